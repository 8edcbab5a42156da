//! Binary PLY meshes of one material \[Turk 1994\].

use std::io::{self, Write};

use glam::Vec3;

use super::parts::{Part, Vertex};

/// Properties of vertices that the material needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attributes {
    /// Set of texture coordinates, and those that are written in its place: the rows of a matrix for
    /// (u, v, 1).
    pub(super) uvs: Option<(usize, [[f32; 3]; 2])>,
    /// Factor of the colours, if they are written.
    pub(super) color_factor: Option<Vec3>,
}

/// Rows of the matrix that leaves texture coordinates as they are.
pub(super) const SAME_UV: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// Writes a part as little-endian PLY, without normals if it is flat.
pub(super) fn write(
    file: &mut impl Write,
    part: &Part,
    is_flat: bool,
    attributes: Attributes,
) -> io::Result<()> {
    let Attributes { uvs: written, color_factor } = attributes;
    let groups = [
        ("x y z", true),
        ("nx ny nz", !is_flat),
        ("u v", written.is_some()),
        ("r g b", color_factor.is_some()),
    ];
    let names = groups.into_iter().filter(|group| group.1).flat_map(|group| group.0.split(' '));
    let properties: String = names.map(|name| format!("property float {name}\n")).collect();
    write!(
        file,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}element face \
         {}\nproperty list uchar uint vertex_indices\nend_header\n",
        part.vertices.len(),
        part.triangles.len()
    )?;
    for &Vertex { position, normal, uvs, color, .. } in &part.vertices {
        write_numbers(file, position.to_array())?;
        if !is_flat {
            write_numbers(file, normal.to_array())?;
        }
        if let Some((set, rows)) = written {
            let uv = uvs[set & 1].extend(1.0);
            write_numbers(file, rows.map(|row| Vec3::from(row).dot(uv)))?;
        }
        if let Some(factor) = color_factor {
            write_numbers(file, (factor * color.truncate()).to_array())?;
        }
    }
    for triangle in &part.triangles {
        file.write_all(&[3])?;
        triangle.iter().try_for_each(|index| file.write_all(&index.to_le_bytes()))?;
    }
    Ok(())
}

fn write_numbers<const N: usize>(file: &mut impl Write, numbers: [f32; N]) -> io::Result<()> {
    numbers.iter().try_for_each(|value| file.write_all(&value.to_le_bytes()))
}
