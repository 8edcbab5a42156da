//! Triangles in world space → compressed wide BVH → flat arrays for the GPU.
//!
//! The tree is obvhs's CWBVH: eight children per node, their boxes quantised to 8 bits per plane,
//! 80 bytes a node. \[Ylitie et al. 2017\]; binary tree by clustering and reinsertion, \[Meister &
//! Bittner 2018\].
//!
//! [`Accel`] holds exactly what the shaders read (`glsl/include/bvh.glsl`); [`traverse`] is the
//! Rust twin of the shader's traversal over the same arrays.

pub mod attributes;
mod binary;
pub mod traverse;

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
    scene::Geometry,
    shader::constants::{BVH_STACK_ENTRIES, FLAT_NORMAL},
};

/// Most pages (buffers) for the triangles, bindings `BINDING_TRIANGLES_0` to `_3`.
pub const MAX_TRIANGLE_PAGES: usize = 4;

/// A node as the shader reads it: five `uvec4`.
pub type Node = [u32; 20];

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
    /// CWBVH nodes, the root first; never empty.
    pub nodes: Vec<Node>,
    /// Triangles in BVH order; every page but the last holds `1 << page_shift` triangles. At least
    /// one page, none empty.
    pub triangle_pages: Vec<Vec<TriangleRecord>>,
    /// Base-2 logarithm of the triangles per page.
    pub page_shift: u32,
    /// Material index per triangle in BVH order.
    pub triangle_materials: Vec<u32>,
    /// Index in the scene per triangle in BVH order.
    pub scene_triangles: Vec<u32>,
    /// Levels of nodes below the root, less than [`BVH_STACK_ENTRIES`].
    pub depth: usize,
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
        let kept = checked_triangles(geometry)?;
        let page_shift = page_shift(kept.len(), page_bytes)?;
        let bvh = build_tree(geometry, &kept)?;
        let depth = depth(&bvh.nodes)?;
        let CwBvh { nodes, primitive_indices, .. } = bvh;
        let mut nodes: Vec<Node> = bytemuck::allocation::cast_vec(nodes);
        if nodes.is_empty() {
            nodes.push([0; 20]);
        }
        nodes.shrink_to_fit();

        let scene_triangles: Vec<u32> =
            primitive_indices.iter().map(|&index| kept[index as usize]).collect();
        drop((primitive_indices, kept));
        let triangle_materials =
            scene_triangles.iter().map(|&triangle| geometry.materials[triangle as usize]).collect();
        let mut triangle_pages: Vec<Vec<TriangleRecord>> = scene_triangles
            .chunks(1 << page_shift)
            .map(|page| page.iter().map(|&triangle| record(geometry, triangle)).collect())
            .collect();
        if triangle_pages.is_empty() {
            triangle_pages.push(vec![TriangleRecord::default()]);
        }
        Ok(Self { nodes, triangle_pages, page_shift, triangle_materials, scene_triangles, depth })
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

/// Stack of the thread that builds the tree. The conversion recurses once per level of the binary
/// tree, which coincident triangles can make very deep.
const BUILD_STACK_BYTES: usize = 1 << 30;

/// Builds the CWBVH over the triangles `kept`.
fn build_tree(geometry: &Geometry, kept: &[u32]) -> Result<CwBvh> {
    std::thread::scope(|scope| {
        let builder = std::thread::Builder::new()
            .name("bvh".into())
            .stack_size(BUILD_STACK_BYTES)
            .spawn_scoped(scope, || build_tree_here(geometry, kept))
            .map_err(|error| geometry_error(format!("cannot start the BVH builder: {error}")))?;
        builder.join().map_err(|_| geometry_error("the BVH builder failed".into()))
    })
}

fn build_tree_here(geometry: &Geometry, kept: &[u32]) -> CwBvh {
    let boxes = padded_boxes(geometry, kept);
    let binary = binary::build(boxes);
    bvh2_to_cwbvh(&binary, 3, true, false)
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

/// Levels of nodes below the root.
fn depth(nodes: &[CwBvhNode]) -> Result<usize> {
    let mut deepest = 0;
    let mut pending: Vec<(u32, usize)> = if nodes.is_empty() { vec![] } else { vec![(0, 0)] };
    while let Some((index, level)) = pending.pop() {
        deepest = deepest.max(level);
        let node = &nodes[index as usize];
        let children = node.imask.count_ones();
        pending.extend((0..children).map(|child| (node.child_base_idx + child, level + 1)));
    }
    if deepest >= BVH_STACK_ENTRIES as usize {
        return Err(geometry_error(format!(
            "the BVH is {deepest} levels deep, traversal can stack {BVH_STACK_ENTRIES}: the scene has \
             many coincident triangles; remove duplicates"
        )));
    }
    Ok(deepest)
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
