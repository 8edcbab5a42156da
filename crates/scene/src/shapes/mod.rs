//! Procedural shapes: parameters of a scene file → a closed mesh with outward winding and normals.
//!
//! Every shape is in metres in its own space, +Y up:
//!
//! | shape | position |
//! |---|---|
//! | `box`, `sphere`, `torus` | centre at the origin |
//! | `cylinder`, `cone` | base on y = 0, axis +Y |
//! | `lathe` | revolved about +Y, placed by its profile |
//! | `extrude` | outline in the x-y plane, from z = −depth / 2 to depth / 2 |
//! | `tube`, `blobs` | placed by their points |
//! | `grid` | centred on the origin in x and z, heights along +Y |
//!
//! All but `blobs` have texture coordinates, with u to the right and v up as seen from outside:
//!
//! | shape | u | v |
//! |---|---|---|
//! | `box` | metres from the left edge of each face | metres from its lower edge |
//! | `sphere`, `cylinder`, `cone`, `torus`, `lathe` | turns about the axis | metres along the profile |
//! | `extrude`, sides | metres along the outline | metres from the back |
//! | `extrude`, front and back | x, −x | y |
//! | `tube` | turns about the centre line | metres along it |
//! | `tube`, flat ends | metres from the centre | likewise |
//! | `grid`, above and below | metres from the −x and +x edges | metres from the +z edge |
//!
//! The faces ±X and ±Z of a box have +Y up, the face +Y has −Z up and the face −Y has +Z up.
//!
//! Counts and list lengths are bounded, so that no scene text asks for more memory than a machine has.

mod blobs;
mod curve;
mod extrude;
mod grid;
mod revolve;
mod rounded_box;
mod tube;

use std::{fmt::Debug, ops::RangeInclusive};

pub(crate) use blobs::Blobs;
pub(crate) use extrude::Extrude;
use glam::{DVec2, DVec3};
pub(crate) use grid::Grid;
pub(crate) use revolve::{Cone, Cylinder, Lathe, Sphere, Torus};
pub(crate) use rounded_box::RoundedBox;
pub(crate) use tube::Tube;

use super::mesh::Mesh;
use crate::memory::{self, Shortage};

/// Allowed numbers of segments.
const SEGMENT_RANGE: RangeInclusive<usize> = 3..=4096;

/// Most points of a profile, outline or path.
const MAX_POINTS: usize = 1024;

/// Most triangles of all shapes of a scene together, each object counted.
pub(crate) const MAX_TRIANGLES: usize = 1 << 25;

/// Bytes of a triangle and half a vertex.
const BYTES_PER_TRIANGLE: usize = 28;

/// Angle above which a corner is a crease, degrees, for shapes that do not set it.
const DEFAULT_CREASE_DEG: f64 = 40.0;

fn default_crease_deg() -> f32 {
    DEFAULT_CREASE_DEG as f32
}

/// Default of a key that counts segments or cells.
fn default_count<const COUNT: usize>() -> usize {
    COUNT
}

/// Parameters of a procedural shape.
pub(crate) trait Shape: Debug {
    /// Builds the closed mesh. Fails with a message that names the parameter, what is expected and what was
    /// found.
    fn mesh(&self) -> Result<Mesh, String>;
}

/// Checks that a length is finite and above 0.
fn positive(key: &str, length: f32) -> Result<f64, String> {
    if length > 0.0 && length.is_finite() {
        Ok(f64::from(length))
    } else {
        Err(format!("{key}: expected a finite number above 0, found {length}"))
    }
}

/// Checks that a length lies from 0 to `limit`.
fn from_zero_to(key: &str, length: f32, limit: f64) -> Result<f64, String> {
    let length = f64::from(length);
    if (0.0..=limit).contains(&length) {
        Ok(length)
    } else {
        Err(format!("{key}: expected a number from 0 to {limit}, found {length}"))
    }
}

fn finite(key: &str, numbers: &[f32]) -> Result<(), String> {
    match numbers.iter().find(|number| !number.is_finite()) {
        None => Ok(()),
        Some(found) => Err(format!("{key}: expected finite numbers, found {found}")),
    }
}

fn count(key: &str, count: usize, range: RangeInclusive<usize>) -> Result<usize, String> {
    if range.contains(&count) {
        Ok(count)
    } else {
        Err(format!("{key}: expected {} to {}, found {count}", range.start(), range.end()))
    }
}

#[derive(Clone, Copy, Debug)]
struct Vertex {
    position: DVec3,
    /// Outward, of any length.
    normal: DVec3,
    uv: DVec2,
}

/// Assembles a surface from patches.
#[derive(Debug, Default)]
struct Builder {
    mesh: Mesh,
    /// Triangles of all patches asked for, of which those beyond [`MAX_TRIANGLES`] are not built.
    asked_triangles: usize,
    /// Why patches were left out.
    shortage: Option<Shortage>,
}

impl Builder {
    /// Adds a vertex without texture coordinates; a shape has them at all of its vertices or none.
    fn vertex(&mut self, position: DVec3, normal: DVec3) -> u32 {
        self.mesh.positions.push(position.as_vec3().to_array());
        self.mesh.normals.push(normal.normalize_or_zero().as_vec3().to_array());
        (self.mesh.positions.len() - 1) as u32
    }

    fn mapped_vertex(&mut self, Vertex { position, normal, uv }: Vertex) {
        self.vertex(position, normal);
        self.mesh.uvs[0].push(uv.as_vec2().to_array());
    }

    /// Adds a triangle, unless two of its corners coincide, as at a pole.
    fn triangle(&mut self, corners: [u32; 3]) {
        let [a, b, c] = corners.map(|corner| self.mesh.positions[corner as usize]);
        if a != b && b != c && c != a {
            self.mesh.triangles.push(corners);
        }
    }

    /// Adds a patch of `rows` × `columns` vertices; columns × rows (cross product) points outward.
    fn patch(&mut self, rows: usize, columns: usize, vertex: impl Fn(usize, usize) -> Vertex) {
        self.asked_triangles += 2 * rows.saturating_sub(1) * columns.saturating_sub(1);
        let room = memory::check_count("a shape", self.asked_triangles, BYTES_PER_TRIANGLE);
        if let Err(shortage) = room {
            self.shortage = Some(shortage);
        }
        if self.asked_triangles > MAX_TRIANGLES || self.shortage.is_some() {
            return;
        }
        let first = self.mesh.positions.len() as u32;
        for row in 0..rows {
            for column in 0..columns {
                self.mapped_vertex(vertex(row, column));
            }
        }
        let at = |row: usize, column: usize| first + (row * columns + column) as u32;
        for row in 1..rows {
            for column in 1..columns {
                let (a, b) = (at(row - 1, column - 1), at(row - 1, column));
                let (c, d) = (at(row, column), at(row, column - 1));
                self.triangle([a, b, c]);
                self.triangle([a, c, d]);
            }
        }
    }

    /// Adds a flat face of positions and texture coordinates, with its triangles, given as indices
    /// of these.
    fn face(&mut self, corners: &[(DVec3, DVec2)], normal: DVec3, triangles: &[[usize; 3]]) {
        let first = self.mesh.positions.len() as u32;
        for &(position, uv) in corners {
            self.mapped_vertex(Vertex { position, normal, uv });
        }
        for triangle in triangles {
            self.triangle(triangle.map(|index| first + index as u32));
        }
    }

    /// Returns the mesh, turned inside out if wound inward (a profile given from top to bottom).
    fn finish(self) -> Result<Mesh, String> {
        check_triangles(self.asked_triangles)?;
        if let Some(shortage) = self.shortage {
            return Err(shortage.to_string());
        }
        let mut mesh = self.mesh;
        if volume(&mesh) < 0.0 {
            mesh.reverse();
            // Images were mirrored seen from the new outside; now v grows against the profile.
            mesh.uvs[0].iter_mut().for_each(|uv| uv[1] = -uv[1]);
        }
        Ok(mesh)
    }
}

/// Checks the number of triangles of a scene's shapes.
pub(crate) fn check_triangles(found: usize) -> Result<(), String> {
    if found > MAX_TRIANGLES {
        return Err(format!(
            "the shapes of a scene may have {MAX_TRIANGLES} triangles together, found {found}: \
             lower the numbers of segments or objects"
        ));
    }
    Ok(())
}

/// Volume inside a closed mesh, by the divergence theorem; negative if it is wound inward.
fn volume(mesh: &Mesh) -> f64 {
    mesh.triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle
                .map(|index| DVec3::from_array(mesh.positions[index as usize].map(f64::from)));
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}
