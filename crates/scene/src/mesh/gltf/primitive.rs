//! Primitives of a glTF mesh → triangles in world space, vertices of skins where their joints carry them.

use glam::{Mat3, Mat4, Vec3};
use gltf::{
    Accessor, Node, Primitive,
    accessor::{DataType, Dimensions},
    mesh::{Mode, Semantic},
};
use serde_json::Value;

use super::GltfReader;
use crate::{
    error::Result,
    features,
    geometry::extend,
    mesh::{Mesh, RepeatedMesh, label, strip_triangles},
};

impl GltfReader<'_> {
    /// Place in `mesh.repeated` of a primitive whose copies are too many; none if it is to be copied.
    pub(super) fn repeated_primitive(
        &mut self,
        key: [usize; 2],
        primitive: &Primitive,
        weights: &[f32],
    ) -> Result<Option<usize>> {
        if let Some(found) = self.repeated.get(&key) {
            return Ok(*found);
        }
        let corners = primitive.indices().or_else(|| primitive.get(&Semantic::Positions));
        let triangles = corners.map_or(0, |corners| corners.count() / 3);
        let copies = self.copies.get(&key[0]).copied().unwrap_or(0);
        let is_repeated = copies > 1
            && matches!(primitive.mode(), Mode::Triangles)
            && self.budget.as_mut().is_some_and(|budget| budget.takes_instances(copies, triangles));
        let place = if is_repeated {
            // Read it into a mesh of its own, with the materials of the whole.
            let materials = std::mem::take(&mut self.mesh.materials);
            let own = Mesh { materials, ..Mesh::default() };
            let whole = std::mem::replace(&mut self.mesh, own);
            let read = self.read_primitive(primitive, weights, Place::Node(Mat4::IDENTITY));
            let mut own = std::mem::replace(&mut self.mesh, whole);
            self.mesh.materials = std::mem::take(&mut own.materials);
            read?;
            // An instance has one material.
            (own.runs.len() <= 1).then(|| {
                let material = own.runs.first().and_then(|run| run.material);
                let (mesh, places) = (Box::new(own), Vec::new());
                let repeated = RepeatedMesh { name: String::new(), mesh, material, places };
                self.mesh.repeated.push(repeated);
                self.mesh.repeated.len() - 1
            })
        } else {
            None
        };
        self.repeated.insert(key, place);
        Ok(place)
    }

    /// Adds a primitive of triangles with its morph targets; others add nothing.
    pub(super) fn read_primitive(
        &mut self,
        primitive: &Primitive,
        weights: &[f32],
        place: Place<'_>,
    ) -> Result<()> {
        if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(());
        }
        let Some(position_accessor) = primitive.get(&Semantic::Positions) else {
            return Err(self.error(format!("primitive {} has no positions", primitive.index())));
        };
        let mut positions = self.vectors::<3>(&position_accessor)?;
        let count = positions.len();
        let first_vertex = self.mesh.positions.len();
        if u32::try_from(first_vertex + count).is_err() {
            return Err(self.error("more than 4,294,967,295 vertices"));
        }
        let mut normals = self.attribute::<3>(primitive, &Semantic::Normals, count)?;
        let mut tangents = self.attribute::<4>(primitive, &Semantic::Tangents, count)?;
        for (target, &weight) in primitive.morph_targets().zip(weights) {
            if weight == 0.0 {
                continue;
            }
            self.morph(&mut positions, target.positions(), weight)?;
            self.morph(&mut normals, target.normals(), weight)?;
            self.morph(&mut tangents, target.tangents(), weight)?;
        }
        let material = primitive.material().index().map(|index| self.material_index(index));
        let material = material.transpose()?;
        let (world_from_node, mirrors) = match place {
            Place::Node(matrix) => (matrix, Mat3::from_mat4(matrix).determinant() < 0.0),
            Place::Joints(joints) => {
                let (normals, tangents) = (&mut normals, &mut tangents);
                let mirrors = self.pose(primitive, joints, &mut positions, normals, tangents)?;
                (Mat4::IDENTITY, mirrors)
            }
        };
        let linear = Mat3::from_mat4(world_from_node);
        let to_world = |position: &[f32; 3]| {
            world_from_node.transform_point3(Vec3::from_array(*position)).to_array()
        };
        self.mesh.positions.extend(positions.iter().map(to_world));
        let end = self.mesh.positions.len();
        // A node scaled to nothing has no inverse; its normals become zero.
        let turn = linear.inverse().transpose();
        let to_world =
            |normal: &[f32; 3]| (turn * Vec3::from_array(*normal)).normalize_or_zero().to_array();
        extend(&mut self.mesh.normals, &normals, first_vertex, end, [0.0; 3], to_world);
        let to_world = |&[x, y, z, sign]: &[f32; 4]| {
            let tangent = (linear * Vec3::new(x, y, z)).normalize_or_zero();
            tangent.extend(if mirrors { -sign } else { sign }).to_array()
        };
        extend(&mut self.mesh.tangents, &tangents, first_vertex, end, [0.0; 4], to_world);
        for set in 0..2 {
            let uvs = self.attribute::<2>(primitive, &Semantic::TexCoords(set), count)?;
            extend(&mut self.mesh.uvs[set as usize], &uvs, first_vertex, end, [0.0; 2], |uv| *uv);
        }
        let colors = self.colors(primitive, material, count)?;
        extend(&mut self.mesh.colors, &colors, first_vertex, end, [1.0; 4], |color| *color);
        let indices = match primitive.indices() {
            Some(accessor) => self.indices(&accessor, count)?,
            None => (0..count as u32).collect(),
        };
        let first_vertex = first_vertex as u32;
        let mut triangles = Vec::with_capacity(indices.len() / 3);
        let mut push = |[a, b, c]: [u32; 3]| {
            let triangle = if mirrors { [a, c, b] } else { [a, b, c] };
            triangles.push(triangle.map(|index| first_vertex + index));
        };
        match primitive.mode() {
            Mode::TriangleStrip => strip_triangles(&indices).for_each(push),
            Mode::TriangleFan => {
                for corners in indices.get(1..).unwrap_or_default().windows(2) {
                    push([indices[0], corners[0], corners[1]]);
                }
            }
            _ => indices
                .chunks_exact(3)
                .for_each(|corners| push([corners[0], corners[1], corners[2]])),
        }
        self.mesh.start_run(material);
        let Some(pane) = material.and_then(|material| self.panes.get(&material)) else {
            self.mesh.triangles.append(&mut triangles);
            return Ok(());
        };
        let uvs = &self.mesh.uvs[pane.uv_set()];
        let uv = |vertex: u32| uvs.get(vertex as usize).copied().unwrap_or_default().into();
        let (glass, opaque): (Vec<_>, Vec<_>) =
            triangles.into_iter().partition(|triangle| pane.covers(triangle.map(uv)));
        self.mesh.triangles.extend(opaque);
        if !glass.is_empty() {
            self.mesh.start_run(Some(pane.material));
            self.mesh.triangles.extend(glass);
        }
        Ok(())
    }

    /// Reads an attribute, one vector for each of `count` positions; empty if the primitive has none.
    pub(super) fn attribute<const N: usize>(
        &self,
        primitive: &Primitive,
        semantic: &Semantic,
        count: usize,
    ) -> Result<Vec<[f32; N]>> {
        let Some(accessor) = primitive.get(semantic) else { return Ok(Vec::new()) };
        let vectors = self.vectors::<N>(&accessor)?;
        if vectors.len() == count {
            return Ok(vectors);
        }
        Err(self.error(format!(
            "primitive {} has {count} positions and {} elements of {}",
            primitive.index(),
            vectors.len(),
            semantic.to_string()
        )))
    }

    /// Adds the differences of a morph target to vectors, if there are any.
    fn morph<const N: usize>(
        &self,
        vectors: &mut [[f32; N]],
        target: Option<Accessor>,
        weight: f32,
    ) -> Result<()> {
        let Some(accessor) = target.filter(|_| !vectors.is_empty()) else { return Ok(()) };
        let differences = self.vectors::<3>(&accessor)?;
        if differences.len() != vectors.len() {
            return Err(self.error(format!(
                "accessor {} of a morph target has {} elements for {} vertices",
                accessor.index(),
                differences.len(),
                vectors.len()
            )));
        }
        for (vector, difference) in vectors.iter_mut().zip(differences) {
            for (component, difference) in vector.iter_mut().zip(difference) {
                *component += weight * difference;
            }
        }
        Ok(())
    }

    /// Reads the vertex colours of a primitive, and lets its material use them.
    fn colors(
        &mut self,
        primitive: &Primitive,
        material: Option<usize>,
        count: usize,
    ) -> Result<Vec<[f32; 4]>> {
        let semantic = Semantic::Colors(0);
        let accessor = primitive.get(&semantic);
        let mut colors = if accessor.is_some_and(|own| own.dimensions() == Dimensions::Vec3) {
            let opaque = |[r, g, b]: [f32; 3]| [r, g, b, 1.0];
            self.attribute::<3>(primitive, &semantic, count)?.into_iter().map(opaque).collect()
        } else {
            self.attribute::<4>(primitive, &semantic, count)?
        };
        let index = primitive.material().index();
        let json = index.map_or(&Value::Null, |index| &self.json["materials"][index]);
        if !matches!(json["alphaMode"].as_str(), Some("MASK" | "BLEND")) {
            colors.iter_mut().for_each(|color| color[3] = 1.0);
        }
        let Some(material) = material.filter(|_| !colors.is_empty()) else { return Ok(colors) };
        if !json["extensions"]["KHR_materials_unlit"].is_null() {
            let place = || label("material", index.unwrap_or_default(), json["name"].as_str());
            self.ignored.add(features::GLTF_UNLIT_COLOR, place);
        }
        self.mesh.materials[material].material.surface.vertex_color = true;
        Ok(colors)
    }

    /// Adds the mesh of a node with a skin; `worlds` places the nodes of the scene. The node itself does not
    /// place the mesh.
    pub(super) fn read_skinned(&mut self, node: &Node, worlds: &[Option<Mat4>]) -> Result<()> {
        let (Some(mesh), Some(skin)) = (node.mesh(), node.skin()) else { return Ok(()) };
        let place = || label("skin", skin.index(), skin.name());
        let binds = skin.inverse_bind_matrices().map(|accessor| {
            let (data_type, dimensions) = (accessor.data_type(), accessor.dimensions());
            if (data_type, dimensions) != (DataType::F32, Dimensions::Mat4) {
                return Err(self.error(format!(
                    "accessor {}: expected matrices of 4×4 floats, found {dimensions:?} of \
                     {data_type:?}",
                    accessor.index()
                )));
            }
            self.elements(&accessor, |bytes| {
                let numbers = bytes[..MATRIX_BYTES].as_chunks::<4>().0;
                let number = |index: usize| f32::from_le_bytes(numbers[index]);
                Mat4::from_cols_array(&std::array::from_fn(number))
            })
        });
        let binds = binds.transpose()?;
        let mut joints = Vec::new();
        for (index, joint) in skin.joints().enumerate() {
            let world = worlds[joint.index()].ok_or_else(|| {
                self.error(format!("{}: joint {index} is no node of the scene", place()))
            })?;
            let bind = match &binds {
                Some(binds) => *binds.get(index).ok_or_else(|| {
                    let found = binds.len();
                    self.error(format!("{}: {found} matrices for joint {index}", place()))
                })?,
                None => Mat4::IDENTITY,
            };
            joints.push(world * bind);
        }
        self.mesh.start_object(node.name().or(mesh.name()).unwrap_or("skin"));
        let weights = node.weights().or(mesh.weights()).unwrap_or_default();
        for primitive in mesh.primitives() {
            self.read_primitive(&primitive, weights, Place::Joints(&joints))?;
        }
        Ok(())
    }

    /// Moves vertices into world space, each by the mean of its joints' matrices; returns true if these
    /// mirror. A vertex without a joint stays.
    pub(super) fn pose(
        &self,
        primitive: &Primitive,
        joints: &[Mat4],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
        tangents: &mut [[f32; 4]],
    ) -> Result<bool> {
        let count = positions.len();
        let mut matrices = vec![(Mat4::ZERO, 0.0); count];
        for set in 0.. {
            let names = self.attribute::<4>(primitive, &Semantic::Joints(set), count)?;
            let weights = self.attribute::<4>(primitive, &Semantic::Weights(set), count)?;
            if names.is_empty() || weights.is_empty() {
                break;
            }
            for (vertex, (sum, total)) in matrices.iter_mut().enumerate() {
                for (&joint, &weight) in names[vertex].iter().zip(&weights[vertex]) {
                    if weight == 0.0 {
                        continue;
                    }
                    let matrix = joints.get(joint as usize).ok_or_else(|| {
                        let most = joints.len();
                        self.error(format!(
                            "primitive {}, vertex {vertex}: joint {joint} is out of range, the skin \
                             has {most}",
                            primitive.index()
                        ))
                    })?;
                    *sum += *matrix * weight;
                    *total += weight;
                }
            }
        }
        let of = |(sum, total): (Mat4, f32)| {
            if total == 0.0 { Mat4::IDENTITY } else { sum * total.recip() }
        };
        let matrices: Vec<Mat4> = matrices.into_iter().map(of).collect();
        for (position, matrix) in positions.iter_mut().zip(&matrices) {
            *position = matrix.transform_point3((*position).into()).into();
        }
        for (normal, matrix) in normals.iter_mut().zip(&matrices) {
            let turn = Mat3::from_mat4(*matrix).inverse().transpose();
            *normal = (turn * Vec3::from(*normal)).into();
        }
        for (tangent, matrix) in tangents.iter_mut().zip(&matrices) {
            let [x, y, z, sign] = *tangent;
            *tangent = matrix.transform_vector3(Vec3::new(x, y, z)).extend(sign).into();
        }
        Ok(matrices.first().is_some_and(|matrix| matrix.determinant() < 0.0))
    }
}

/// Bytes of a matrix of singles.
const MATRIX_BYTES: usize = 64;

pub(super) enum Place<'j> {
    Node(Mat4),
    Joints(&'j [Mat4]),
}
