//! The folder beside a scene file, the names in it, and its meshes: binary PLY of one material \[Turk 1994\].

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use glam::Vec3;

use super::parts::{Part, Vertex};
use crate::{error::Result, files, picture::write_colors};

/// Folder of the same name beside the scene file.
pub(super) struct Folder {
    pub(super) path: PathBuf,
    /// Name, as the scene file calls it.
    pub(super) name: String,
}

impl Folder {
    /// Folder beside `scene`; `escaped` makes its name a text of the format.
    pub(super) fn beside(scene: &Path, escaped: fn(&str) -> String) -> Self {
        let path = scene.with_extension("");
        let name = escaped(&path.file_name().unwrap_or_default().to_string_lossy());
        Self { path, name }
    }

    /// Path of a file in the folder, as the scene file calls it.
    pub(super) fn relative(&self, file: &str) -> String {
        Path::new(&self.name).join(file).display().to_string()
    }

    /// Writes a mesh; returns its path as the scene file calls it.
    pub(super) fn write_mesh(
        &self,
        name: &str,
        part: &Part,
        is_flat: bool,
        attributes: Attributes,
    ) -> Result<String> {
        files::write_atomically(&self.path.join(name), |file| {
            write_ply(file, part, is_flat, attributes)
        })?;
        Ok(self.relative(name))
    }

    /// Writes the environment by its radiance in columns and rows; returns its path as the scene file
    /// calls it.
    pub(super) fn write_environment(
        &self,
        size: [usize; 2],
        radiance: impl Fn(usize, usize) -> Vec3 + Sync,
    ) -> Result<String> {
        let color = |column: usize, row: usize| radiance(column, row).to_array();
        write_colors(&self.path.join(ENVIRONMENT), size, color)?;
        Ok(self.relative(ENVIRONMENT))
    }
}

pub(super) const ENVIRONMENT: &str = "environment.exr";

/// Returns an identifier that all formats and file systems take: `m00_name`, other characters as `_`.
pub(super) fn identifier(index: usize, name: &str) -> String {
    format!("m{index:02}_{}", safe_name(name))
}

/// As [`safe_name`], of a file without its extension.
pub(super) fn safe_stem(path: impl AsRef<Path>) -> String {
    safe_name(&path.as_ref().file_stem().unwrap_or_default().to_string_lossy())
}

/// Name of letters and digits, other characters as `_`.
fn safe_name(name: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    name.chars().take(60).map(safe).collect()
}

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
fn write_ply(
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
