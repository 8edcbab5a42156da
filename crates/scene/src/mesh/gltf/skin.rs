//! Skins: vertices where the joints of a node's skin carry them.

use glam::{Mat3, Mat4, Vec3};
use gltf::{
    Node, Primitive,
    accessor::{DataType, Dimensions},
    mesh::Semantic,
};

use super::GltfReader;
use crate::{error::Result, mesh::label};

/// Bytes of a matrix of singles.
const MATRIX_BYTES: usize = 64;

pub(super) enum Place<'j> {
    Node(Mat4),
    Joints(&'j [Mat4]),
}

impl GltfReader<'_> {
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
