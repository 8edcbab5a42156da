//! Triangles and instances → compressed wide BVH → flat arrays for the GPU.
//!
//! The tree is obvhs's CWBVH: eight children per node, their boxes quantised to 8 bits per plane, 80 bytes a
//! node. \[Ylitie et al. 2017\]; binary tree by clustering and reinsertion, \[Meister & Bittner 2018\].
//!
//! A scene without instances is one tree over its triangles. One with instances has a tree over them
//! before the trees of their meshes, each in the space of its mesh ([`instances`]).
//!
//! [`Accel`] holds exactly what the shaders read (`glsl/include/bvh.glsl`); [`traverse`] is the
//! Rust twin of the shader's traversal over the same arrays.

pub mod attributes;
mod binary;
pub mod instances;
pub mod traverse;

use std::ops::RangeInclusive;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3, Vec3A};
use obvhs::{
    aabb::Aabb,
    cwbvh::{CwBvh, bvh2_to_cwbvh::bvh2_to_cwbvh, node::CwBvhNode},
};

use crate::math::octahedron;
use crate::scene::geometry::MAX_COORDINATE;
use crate::{
    error::{Error, Result},
    memory,
    scene::Geometry,
    shader::constants::{BVH_STACK_ENTRIES, FLAT_NORMAL},
    stage,
};
use instances::{Level, Record};

/// Most pages (buffers) for the triangles, bindings `BINDING_TRIANGLES_0` to `_3`.
pub(crate) const MAX_TRIANGLE_PAGES: usize = 4;

/// Bytes that building takes for a triangle at its peak, measured.
const BUILD_BYTES: usize = 250;

/// A node as the shader reads it: five `uvec4`.
pub(crate) type Node = [u32; 20];

/// Three vertices of a triangle, each with its packed shading normal: three `uvec4` in the shader.
///
/// Vertices rather than edges, so that both triangles at a shared edge see the same end points.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct TriangleRecord {
    /// Positions, metres, and normals ([`octahedron::pack`]; [`FLAT_NORMAL`] for a flat triangle).
    pub vertices: [VertexRecord; 3],
}

/// Position and packed shading normal of a vertex: one `uvec4` in the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct VertexRecord {
    /// Position, metres.
    pub position: [f32; 3],
    /// Octahedral shading normal.
    pub normal: u32,
}

/// The scene's triangles in BVH order and the tree over them.
#[derive(Clone, Debug)]
pub struct Accel {
    /// CWBVH nodes, the root first; never empty. With instances, the tree over them comes first, then
    /// that over the placed triangles, then those of the meshes.
    pub nodes: Vec<Node>,
    /// Triangles in BVH order; every page but the last holds `1 << page_shift` triangles. At least
    /// one page, none empty.
    pub triangle_pages: Vec<Vec<TriangleRecord>>,
    /// Base-2 logarithm of the triangles per page.
    pub page_shift: u32,
    /// Material index per triangle in BVH order.
    pub triangle_materials: Vec<u32>,
    /// Index in its mesh per triangle in BVH order.
    pub scene_triangles: Vec<u32>,
    /// First triangle in BVH order of the placed ones and of each mesh that has instances, and their
    /// number at the end.
    pub first_triangles: Vec<u32>,
    /// Instances in the order of the upper level; empty for a tree of one level.
    pub instances: Vec<Record>,
    /// Mesh of each: its place in [`Accel::first_triangles`].
    pub instance_meshes: Vec<u32>,
}

impl Accel {
    /// Builds the tree over `geometry` with at most `page_bytes` per page of triangles.
    ///
    /// Omits triangles without area, which no ray hits. If no triangle is left, the tree is one
    /// node without children.
    ///
    /// # Errors
    /// More triangles than [`MAX_TRIANGLE_PAGES`] pages hold, a vertex index out of range, a
    /// coordinate that is not finite or beyond [`MAX_COORDINATE`], or a tree too deep for the stack.
    pub fn build(geometry: &Geometry, page_bytes: u64) -> Result<Self> {
        let meshes = geometry.prototypes.iter().chain([geometry]);
        let triangles = meshes.map(|mesh| mesh.triangles.len()).sum();
        let asker = format_args!("the tree over {triangles} triangles");
        memory::check_count(asker, triangles, BUILD_BYTES).map_err(Error::memory)?;
        // Before the tree, which takes minutes over so many triangles.
        let page_shift = page_shift(triangles, page_bytes)?;
        stage::enter(format_args!("building {asker}"));
        let mut trees = Trees::default();
        let around_placed = trees.add(geometry)?;
        let (mut instances, mut instance_meshes) = (Vec::new(), Vec::new());
        if !geometry.instances.is_empty() {
            let mut level = Level::default();
            if let Some(around) = around_placed {
                level.add_placed(around, 0);
            }
            let mut meshes = Vec::with_capacity(geometry.prototypes.len());
            for mesh in &geometry.prototypes {
                let first_node = trees.nodes.len() as u32;
                meshes.push((trees.add(mesh)?, first_node));
            }
            for (label, instance) in geometry.instances.iter().enumerate() {
                let Some((around, first_node)) = meshes.get(instance.prototype as usize) else {
                    return Err(geometry_error(format!(
                        "instance {label} is of mesh {}, but there are {}",
                        instance.prototype,
                        meshes.len()
                    )));
                };
                // Nothing is left of a mesh without area.
                if let Some(around) = around {
                    level.add(label, instance, *around, *first_node)?;
                }
            }
            (instances, instance_meshes) = trees.put_level_first(level)?.into_iter().unzip();
        }
        let Trees { mut nodes, scene_triangles, first_triangles, depth } = trees;
        if depth > BVH_STACK_ENTRIES as usize {
            return Err(geometry_error(format!(
                "the BVH is {depth} levels deep, traversal can stack {BVH_STACK_ENTRIES}: the scene has \
                 many coincident triangles or instances; remove duplicates"
            )));
        }
        if nodes.is_empty() {
            nodes.push([0; 20]);
        }
        nodes.shrink_to_fit();
        let mesh_of = |at: usize| {
            let mesh = first_triangles.partition_point(|&first| first as usize <= at) - 1;
            mesh.checked_sub(1).map_or(geometry, |mesh| &geometry.prototypes[mesh])
        };
        let triangle_materials = scene_triangles
            .iter()
            .enumerate()
            .map(|(at, &triangle)| mesh_of(at).materials[triangle as usize])
            .collect();
        let mut triangle_pages: Vec<Vec<TriangleRecord>> = scene_triangles
            .chunks(1 << page_shift)
            .enumerate()
            .map(|(page, triangles)| {
                let first = page << page_shift;
                let record = |(at, &triangle): (usize, &u32)| record(mesh_of(first + at), triangle);
                triangles.iter().enumerate().map(record).collect()
            })
            .collect();
        if triangle_pages.is_empty() {
            triangle_pages.push(vec![TriangleRecord::default()]);
        }
        Ok(Self {
            nodes,
            triangle_pages,
            page_shift,
            triangle_materials,
            scene_triangles,
            first_triangles,
            instances,
            instance_meshes,
        })
    }

    /// True if the tree has two levels.
    pub fn is_instanced(&self) -> bool {
        !self.instances.is_empty()
    }

    /// Number of triangles that lie in the world; they come first.
    pub(crate) fn placed_count(&self) -> usize {
        self.first_triangles.get(1).map_or(0, |&count| count as usize)
    }

    /// Number of triangles in BVH order.
    pub fn triangle_count(&self) -> usize {
        self.scene_triangles.len()
    }

    /// Triangle `index` in BVH order.
    ///
    /// # Panics
    /// `index` is out of range.
    pub fn triangle(&self, index: u32) -> &TriangleRecord {
        let page = (index >> self.page_shift) as usize;
        &self.triangle_pages[page][index as usize & ((1 << self.page_shift) - 1)]
    }
}

/// Trees one after the other, and their triangles.
#[derive(Debug, Default)]
struct Trees {
    nodes: Vec<Node>,
    scene_triangles: Vec<u32>,
    first_triangles: Vec<u32>,
    /// Stack entries that the deepest tree needs.
    depth: usize,
}

impl Trees {
    /// Adds the tree of the triangles of `mesh`; returns their bounds, none without triangles.
    fn add(&mut self, mesh: &Geometry) -> Result<Option<[Vec3; 2]>> {
        let kept = checked_triangles(mesh)?;
        let total = self.scene_triangles.len() + kept.len();
        if u32::try_from(total).is_err() {
            return Err(too_many(total, u64::from(u32::MAX)));
        }
        let around = instances::bounds_of(mesh, &kept);
        let CwBvh { nodes, primitive_indices, .. } = on_large_stack(kept.len(), || {
            bvh2_to_cwbvh(&binary::build(padded_boxes(mesh, &kept)), 3, true, false)
        })?;
        self.depth = self.depth.max(stack_entries(&nodes));
        if self.first_triangles.is_empty() {
            self.first_triangles.push(0);
        }
        let (first_node, first_triangle) =
            (self.nodes.len() as u32, self.scene_triangles.len() as u32);
        let nodes: Vec<Node> = bytemuck::allocation::cast_vec(nodes);
        self.append(nodes, first_node, first_triangle);
        self.scene_triangles.extend(primitive_indices.iter().map(|&index| kept[index as usize]));
        self.first_triangles.push(self.scene_triangles.len() as u32);
        Ok(around)
    }

    fn append(&mut self, mut nodes: Vec<Node>, first_node: u32, first_triangle: u32) {
        if self.nodes.is_empty() {
            self.nodes = nodes;
            return;
        }
        nodes.iter_mut().for_each(|node| shift(node, first_node, first_triangle));
        self.nodes.append(&mut nodes);
    }

    /// Puts the tree over the instances before all others; returns their records and meshes in its order.
    fn put_level_first(&mut self, level: Level) -> Result<Vec<(Record, u32)>> {
        let Level { mut records, boxes } = level;
        let (upper, order): (Vec<Node>, Vec<u32>) = if boxes.is_empty() {
            (vec![[0; 20]], Vec::new())
        } else {
            // One instance a leaf: entering one in vain costs more than a box.
            let tree = on_large_stack(boxes.len(), || {
                bvh2_to_cwbvh(&binary::build(boxes), 1, true, false)
            })?;
            // An instance is entered with the rest of its group and the nodes beside it stacked.
            self.depth += stack_entries(&tree.nodes) + 2;
            (bytemuck::allocation::cast_vec(tree.nodes), tree.primitive_indices)
        };
        let first_node = upper.len() as u32;
        let mut lower = std::mem::replace(&mut self.nodes, upper);
        lower.iter_mut().for_each(|node| shift(node, first_node, 0));
        self.nodes.append(&mut lower);
        records.iter_mut().for_each(|(record, _)| record.first_node += first_node);
        Ok(order.iter().map(|&index| records[index as usize]).collect())
    }
}

/// Moves the children and triangles that a node refers to.
fn shift(node: &mut Node, nodes: u32, triangles: u32) {
    node[4] = node[4].wrapping_add(nodes);
    node[5] = node[5].wrapping_add(triangles);
}

/// Corner positions of a triangle of the scene.
fn corners(geometry: &Geometry, triangle: u32) -> [Vec3; 3] {
    geometry.triangles[triangle as usize]
        .map(|vertex| Vec3::from_array(geometry.positions[vertex as usize]))
}

/// Checks the input and returns the indices of the triangles with an area.
fn checked_triangles(geometry: &Geometry) -> Result<Vec<u32>> {
    let usable = |value: f32| value.abs() <= MAX_COORDINATE;
    if let Some((index, position)) = geometry
        .positions
        .iter()
        .enumerate()
        .find(|(_, position)| !position.iter().all(|&x| usable(x)))
    {
        return Err(geometry_error(format!(
            "vertex {index} lies at {position:?}; expected finite coordinates of at most \
             {MAX_COORDINATE:e} m: scale the object or remove the vertex"
        )));
    }
    assert_eq!(geometry.positions.len(), geometry.normals.len(), "one normal per vertex");
    assert_eq!(geometry.triangles.len(), geometry.materials.len(), "one material per triangle");
    let count = u32::try_from(geometry.triangles.len())
        .map_err(|_| too_many(geometry.triangles.len(), u64::from(u32::MAX)))?;
    let mut kept = Vec::with_capacity(geometry.triangles.len());
    for triangle in 0..count {
        let indices = geometry.triangles[triangle as usize];
        if let Some(index) =
            indices.iter().find(|&&index| index as usize >= geometry.positions.len())
        {
            return Err(geometry_error(format!(
                "triangle {triangle} refers to vertex {index}, but there are {} vertices",
                geometry.positions.len()
            )));
        }
        let [a, b, c] = corners(geometry, triangle).map(Vec3::as_dvec3);
        if (b - a).cross(c - a) != DVec3::ZERO {
            kept.push(triangle);
        }
    }
    Ok(kept)
}

fn geometry_error(message: String) -> Error {
    Error::Usage { message: format!("geometry: {message}") }
}

fn too_many(count: usize, limit: u64) -> Error {
    geometry_error(format!(
        "{count} triangles, but this device's buffers hold {limit}: use simpler meshes or another \
         device (--device)"
    ))
}

/// Logarithm of the triangles per page of `page_bytes`. Fails if `count` triangles do not fit.
fn page_shift(count: usize, page_bytes: u64) -> Result<u32> {
    let per_page = page_bytes / size_of::<TriangleRecord>() as u64;
    let shift = per_page.checked_ilog2().ok_or_else(|| {
        geometry_error(format!("a page of {page_bytes} bytes cannot hold a triangle of 48 bytes"))
    })?;
    let shift = shift.min(30);
    let limit = (MAX_TRIANGLE_PAGES as u64) << shift;
    if count as u64 > limit { Err(too_many(count, limit)) } else { Ok(shift) }
}

/// Stack of the thread that builds the tree, at least and at most, and for each box. The conversion
/// recurses once per level of the binary tree, which coincident triangles can make very deep.
const BUILD_STACK_BYTES: RangeInclusive<usize> = 1 << 20..=1 << 30;
const STACK_BYTES_PER_BOX: usize = 4096;

fn on_large_stack(boxes: usize, build: impl FnOnce() -> CwBvh + Send) -> Result<CwBvh> {
    let (least, most) = BUILD_STACK_BYTES.into_inner();
    let stack_bytes = boxes.saturating_mul(STACK_BYTES_PER_BOX).clamp(least, most);
    std::thread::scope(|scope| {
        let builder = std::thread::Builder::new()
            .name("bvh".into())
            .stack_size(stack_bytes)
            .spawn_scoped(scope, build)
            .map_err(|error| Error::Memory {
                message: format!(
                    "the builder of the tree over {boxes} boxes, with a stack of {}, cannot start: \
                     {error}",
                    memory::size(stack_bytes as u64)
                ),
                help: None,
            })?;
        builder.join().map_err(|_| geometry_error("the BVH builder failed".into()))
    })
}

/// Boxes of the triangles, padded by a few units in the last place of the largest coordinate: the
/// slab test of `bvh.glsl` rounds, but must not lose a ray through the edge of a flat box.
///
/// The slab test computes (q·2^e)/d + (p − o)/d. Its error, as a distance along the axis, is at
/// most 3 units of roundoff (2⁻²⁴) of |p − o| + 255·2^e, hence below 2⁻²⁰ of the scene's size for
/// rays that start within twice that size.
fn padded_boxes(geometry: &Geometry, kept: &[u32]) -> Vec<Aabb> {
    let mut bounds = Aabb::empty();
    let mut boxes: Vec<Aabb> = kept
        .iter()
        .map(|&triangle| {
            let aabb = Aabb::from_points(&corners(geometry, triangle).map(Vec3A::from));
            bounds = bounds.union(&aabb);
            aabb
        })
        .collect();
    let size =
        bounds.diagonal().max_element().max(bounds.min.abs().max(bounds.max.abs()).max_element());
    let pad = Vec3A::splat(size * (-20.0_f32).exp2());
    for aabb in &mut boxes {
        aabb.min -= pad;
        aabb.max += pad;
    }
    boxes
}

/// Stack entries that traversal of a tree may need: levels of nodes, the root among them.
fn stack_entries(nodes: &[CwBvhNode]) -> usize {
    let mut deepest = 0;
    let mut pending: Vec<(u32, usize)> = if nodes.is_empty() { vec![] } else { vec![(0, 0)] };
    while let Some((index, level)) = pending.pop() {
        deepest = deepest.max(level);
        let node = &nodes[index as usize];
        let children = node.imask.count_ones();
        pending.extend((0..children).map(|child| (node.child_base_idx + child, level + 1)));
    }
    deepest + usize::from(!nodes.is_empty())
}

/// Positions and packed normals of a triangle; flat if one of its vertices has no normal.
fn record(geometry: &Geometry, triangle: u32) -> TriangleRecord {
    let indices = geometry.triangles[triangle as usize];
    let normals = indices.map(|vertex| Vec3::from_array(geometry.normals[vertex as usize]));
    let flat = !normals.iter().all(|normal| normal.length_squared() > 0.25);
    let vertices = [0, 1, 2].map(|corner| VertexRecord {
        position: geometry.positions[indices[corner] as usize],
        normal: if flat { FLAT_NORMAL } else { octahedron::pack(normals[corner]) },
    });
    TriangleRecord { vertices }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_padded_by_the_distance_from_the_origin() {
        let corner = |y: f32, z: f32| [1e6, y, z];
        let geometry = Geometry {
            positions: vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)],
            triangles: vec![[0, 1, 2]],
            ..Geometry::default()
        };
        // 2⁻²⁰ of a million metres.
        let boxes = padded_boxes(&geometry, &[0]);
        assert!((boxes[0].max.x - 1e6 - 0.954).abs() < 0.1, "{boxes:?}");
        assert!((boxes[0].min.y + 0.954).abs() < 0.1, "{boxes:?}");
    }
}
