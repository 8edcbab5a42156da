//! Texture coordinates, tangents and colours of triangles in BVH order, as `triangle_attributes` in
//! `glsl/include/texture.glsl` reads them.

use glam::Vec3;
use rayon::prelude::*;

use super::Accel;
use crate::{
    math::octahedron,
    scene::Geometry,
    shader::constants::{
        ATTRIBUTE_COLOR, ATTRIBUTE_FIRST_UVS, ATTRIBUTE_SECOND_UVS, ATTRIBUTE_TANGENT, FLAT_NORMAL,
    },
};

/// Bits `ATTRIBUTE_…` of what the vertices of a geometry have, those of its instances included.
pub fn attributes_of(geometry: &Geometry) -> u32 {
    let prototypes = geometry.prototypes.iter();
    prototypes.fold(own_attributes(geometry), |bits, mesh| bits | own_attributes(mesh))
}

fn own_attributes(geometry: &Geometry) -> u32 {
    let bit = |is_empty: bool, bit: u32| if is_empty { 0 } else { bit };
    bit(geometry.uvs[0].is_empty(), ATTRIBUTE_FIRST_UVS)
        | bit(geometry.uvs[1].is_empty(), ATTRIBUTE_SECOND_UVS)
        | bit(geometry.tangents.is_empty(), ATTRIBUTE_TANGENT)
        | bit(geometry.colors.is_empty(), ATTRIBUTE_COLOR)
}

/// Words of the attributes of all triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleAttributes {
    /// Bits `ATTRIBUTE_…` of the attributes.
    pub bits: u32,
    /// Two words for each attribute of each corner of each triangle.
    pub words: Vec<u32>,
}

impl TriangleAttributes {
    /// Lays out those of the attributes `wanted` that the geometry has.
    pub fn new(geometry: &Geometry, accel: &Accel, wanted: u32) -> Self {
        let bits = wanted & attributes_of(geometry);
        let stride = 6 * bits.count_ones() as usize;
        let mut words = vec![0; accel.triangle_count() * stride];
        if stride > 0 {
            let meshes = std::iter::once(geometry).chain(&geometry.prototypes);
            for (mesh, range) in meshes.zip(accel.first_triangles.windows(2)) {
                let (first, end) = (range[0] as usize, range[1] as usize);
                words[first * stride..end * stride]
                    .par_chunks_exact_mut(stride)
                    .zip(&accel.scene_triangles[first..end])
                    .for_each(|(words, &triangle)| {
                        let corners = mesh.triangles[triangle as usize];
                        let places = words.chunks_exact_mut(stride / 3);
                        for (corner, words) in corners.into_iter().zip(places) {
                            write_corner(words, mesh, bits, corner as usize);
                        }
                    });
            }
        }
        Self { bits, words }
    }
}

fn write_corner(words: &mut [u32], geometry: &Geometry, bits: u32, vertex: usize) {
    let mut pairs = words.chunks_exact_mut(2);
    let mut write = |bit: u32, pair: &dyn Fn() -> [u32; 2]| {
        if bits & bit != 0
            && let Some(words) = pairs.next()
        {
            words.copy_from_slice(&pair());
        }
    };
    // One mesh may lack what another one has.
    let uv =
        |set: usize| geometry.uvs[set].get(vertex).copied().unwrap_or_default().map(f32::to_bits);
    write(ATTRIBUTE_FIRST_UVS, &|| uv(0));
    write(ATTRIBUTE_SECOND_UVS, &|| uv(1));
    write(ATTRIBUTE_TANGENT, &|| {
        let [x, y, z, sign] = geometry.tangents.get(vertex).copied().unwrap_or_default();
        let tangent = Vec3::new(x, y, z);
        let is_there = tangent.length_squared() > 0.25;
        [if is_there { octahedron::pack(tangent) } else { FLAT_NORMAL }, sign.to_bits()]
    });
    write(ATTRIBUTE_COLOR, &|| {
        let quantise = |x: f32| (x.clamp(0.0, 1.0) * 65_535.0).round() as u32;
        let [red, green, blue, alpha] =
            geometry.colors.get(vertex).copied().unwrap_or([1.0; 4]).map(quantise);
        [red | green << 16, blue | alpha << 16]
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Instance, transform::Transform};

    #[test]
    fn meshes_without_colours_are_white_beside_others() {
        let mesh = |colors: Vec<[f32; 4]>| Geometry {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            normals: vec![[0.0, 0.0, 1.0]; 3],
            colors,
            triangles: vec![[0, 1, 2]],
            materials: vec![0],
            ..Geometry::default()
        };
        let stay = Transform::new([1.0; 3], [0.0; 3], [0.0; 3]);
        let geometry = Geometry {
            prototypes: vec![mesh(vec![[0.0, 0.5, 1.0, 0.5]; 3])],
            instances: Instance::new(0, &stay, 0, false).into_iter().collect(),
            ..mesh(Vec::new())
        };
        let accel = Accel::build(&geometry, 1 << 20).unwrap();
        let words = TriangleAttributes::new(&geometry, &accel, ATTRIBUTE_COLOR).words;
        let expected = [[u32::MAX; 2], [0x8000_0000, 0x8000_ffff]].map(|own| [own; 3]);
        assert_eq!(words, expected.as_flattened().as_flattened());
    }
}
