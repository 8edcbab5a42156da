//! Binary PLY meshes of one material \[Turk 1994\].

use std::{
    collections::HashMap,
    io::{self, Write},
};

use crate::scene::Geometry;

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

    /// Writes the part as little-endian PLY, with its normals if `with_normals`.
    pub(super) fn write(
        &self,
        file: &mut impl Write,
        geometry: &Geometry,
        with_normals: bool,
    ) -> io::Result<()> {
        let normals = if with_normals {
            "property float nx\nproperty float ny\nproperty float nz\n"
        } else {
            ""
        };
        write!(
            file,
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n\
             property float y\nproperty float z\n{normals}element face {}\n\
             property list uchar uint vertex_indices\nend_header\n",
            self.vertices.len(),
            self.triangles.len()
        )?;
        for &vertex in &self.vertices {
            write_triple(file, geometry.positions[vertex as usize])?;
            if with_normals {
                write_triple(file, geometry.normals[vertex as usize])?;
            }
        }
        for triangle in &self.triangles {
            file.write_all(&[3])?;
            triangle.iter().try_for_each(|index| file.write_all(&index.to_le_bytes()))?;
        }
        Ok(())
    }
}

fn write_triple(file: &mut impl Write, triple: [f32; 3]) -> io::Result<()> {
    triple.iter().try_for_each(|value| file.write_all(&value.to_le_bytes()))
}
