//! Binary PLY meshes of one material \[Turk 1994\].

use std::{
    collections::HashMap,
    io::{self, Write},
};

use glam::Vec3;

use crate::scene::Geometry;

/// Properties of vertices beside their positions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attributes {
    /// Writes normals.
    pub(super) normals: bool,
    /// Set of texture coordinates to write; 0, 0 where the geometry has none.
    pub(super) uv_set: Option<usize>,
    /// Factor of the colours, if they are written.
    pub(super) color_factor: Option<Vec3>,
    /// Turns the triangles and moves them so far behind their front, metres.
    pub(super) back_distance: Option<f32>,
}

/// Triangles of one material that are all smooth or all flat, with the vertices they use.
#[derive(Debug, Default)]
pub(super) struct Part {
    /// Indices into the geometry's vertices, without repetition.
    vertices: Vec<u32>,
    /// Three indices into `vertices` per triangle.
    triangles: Vec<[u32; 3]>,
    /// New index of each vertex of the geometry that is used.
    places: HashMap<u32, u32>,
}

impl Part {
    /// True if the part has no triangle.
    pub(super) fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Adds a triangle of the geometry.
    pub(super) fn push(&mut self, triangle: [u32; 3]) {
        let Self { vertices, places, .. } = self;
        let triangle = triangle.map(|vertex| {
            *places.entry(vertex).or_insert_with(|| {
                vertices.push(vertex);
                vertices.len() as u32 - 1
            })
        });
        self.triangles.push(triangle);
    }

    /// Writes the part as little-endian PLY.
    pub(super) fn write(
        &self,
        file: &mut impl Write,
        geometry: &Geometry,
        attributes: Attributes,
    ) -> io::Result<()> {
        let Attributes { normals, uv_set, color_factor, back_distance } = attributes;
        let mut properties = String::new();
        for (is_there, names) in [
            (true, &["x", "y", "z"][..]),
            (normals, &["nx", "ny", "nz"]),
            (uv_set.is_some(), &["u", "v"]),
            (color_factor.is_some(), &["r", "g", "b"]),
        ] {
            for name in names.iter().filter(|_| is_there) {
                properties += &format!("property float {name}\n");
            }
        }
        write!(
            file,
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}element face \
             {}\nproperty list uchar uint vertex_indices\nend_header\n",
            self.vertices.len(),
            self.triangles.len()
        )?;
        let inwards = back_distance.map(|distance| self.inwards(geometry, distance));
        for (index, &vertex) in self.vertices.iter().enumerate() {
            let vertex = vertex as usize;
            let inwards = inwards.as_ref().map_or(Vec3::ZERO, |inwards| inwards[index]);
            write_numbers(file, (Vec3::from(geometry.positions[vertex]) + inwards).to_array())?;
            if normals {
                let normal = geometry.normals[vertex];
                write_numbers(
                    file,
                    if back_distance.is_some() { normal.map(|n| -n) } else { normal },
                )?;
            }
            if let Some(set) = uv_set {
                let uvs = geometry.uvs.get(set).and_then(|uvs| uvs.get(vertex));
                write_numbers(file, uvs.copied().unwrap_or_default())?;
            }
            if let Some(factor) = color_factor {
                let [r, g, b, _] = geometry.colors.get(vertex).copied().unwrap_or([1.0; 4]);
                write_numbers(file, (factor * Vec3::new(r, g, b)).to_array())?;
            }
        }
        for &[a, b, c] in &self.triangles {
            file.write_all(&[3])?;
            let triangle = if back_distance.is_some() { [a, c, b] } else { [a, b, c] };
            triangle.iter().try_for_each(|index| file.write_all(&index.to_le_bytes()))?;
        }
        Ok(())
    }

    /// Steps of the vertices against the normals of their triangles.
    fn inwards(&self, geometry: &Geometry, distance: f32) -> Vec<Vec3> {
        let mut sums = vec![Vec3::ZERO; self.vertices.len()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle
                .map(|at| Vec3::from(geometry.positions[self.vertices[at as usize] as usize]));
            let normal = (b - a).cross(c - a).normalize_or_zero();
            triangle.iter().for_each(|&at| sums[at as usize] += normal);
        }
        sums.iter().map(|sum| -distance * sum.normalize_or_zero()).collect()
    }
}

fn write_numbers<const N: usize>(file: &mut impl Write, numbers: [f32; N]) -> io::Result<()> {
    numbers.iter().try_for_each(|value| file.write_all(&value.to_le_bytes()))
}
