//! `blobs`: balls, ellipsoids and rounded cones melted into one surface.
//!
//! The shapes are signed distances (Quilez, "Distance functions", 2008; ellipsoids by his bound), joined
//! by −b·ln Σ exp(−dᵢ/b), which does not depend on their order. The level 0 becomes a surface net
//! (Gibson, "Constrained elastic surface nets", 1998): a vertex in every cell of a grid that the surface
//! passes, moved onto the surface along the gradient, and a quad around every edge it crosses.

use glam::{DVec3, USizeVec3};
use rayon::prelude::*;
use serde::Deserialize;

use super::{Builder, Mesh, count, finite, from_zero_to, positive};
use crate::scene::file::NumberOrVector;

/// `blobs`: where its points put it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blobs {
    /// The parts.
    pub balls: Vec<Blob>,
    /// Width of the zone in which parts melt together, metres; 0 leaves creases.
    #[serde(default)]
    pub blend: f32,
    /// Cells of the grid along its longest side.
    #[serde(default = "default_cells")]
    pub cells: usize,
}

/// A part of [`Blobs`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blob {
    /// Centre, or the first end of a rounded cone, metres.
    pub at: [f32; 3],
    /// Radius, or the three of an ellipsoid, metres.
    pub radius: NumberOrVector,
    /// Second end: makes the part a rounded cone.
    pub to: Option<[f32; 3]>,
    /// Radius at the second end; as at the first where left out.
    pub to_radius: Option<f32>,
    /// Taken away from the other parts instead of added.
    #[serde(default)]
    pub carve: bool,
}

fn default_cells() -> usize {
    64
}

/// Signed distance to one part.
#[derive(Clone, Copy, Debug)]
enum Part {
    Ellipsoid { center: DVec3, radii: DVec3 },
    Cone { from: DVec3, to: DVec3, from_radius: f64, to_radius: f64 },
}

impl Part {
    fn distance(self, point: DVec3) -> f64 {
        match self {
            Self::Ellipsoid { center, radii } => {
                let scaled = (point - center) / radii;
                let steep = (scaled / radii).length();
                if steep > 0.0 {
                    scaled.length() * (scaled.length() - 1.0) / steep
                } else {
                    -radii.min_element()
                }
            }
            Self::Cone { from, to, from_radius, to_radius } => {
                let axis = to - from;
                let squared = axis.length_squared();
                let along = if squared > 0.0 { (point - from).dot(axis) / squared } else { 0.0 };
                let along = along.clamp(0.0, 1.0);
                let radius = from_radius + along * (to_radius - from_radius);
                (point - from - along * axis).length() - radius
            }
        }
    }

    /// Corners of the box around the part.
    fn bounds(self) -> [DVec3; 2] {
        match self {
            Self::Ellipsoid { center, radii } => [center - radii, center + radii],
            Self::Cone { from, to, from_radius, to_radius } => {
                [(from - from_radius).min(to - to_radius), (from + from_radius).max(to + to_radius)]
            }
        }
    }
}

/// The joined distance: negative inside.
#[derive(Debug)]
struct Field {
    added: Vec<Part>,
    carved: Vec<Part>,
    blend: f64,
}

impl Field {
    fn distance(&self, point: DVec3) -> f64 {
        let added = self.join(&self.added, point);
        if self.carved.is_empty() {
            return added;
        }
        // What is left of the added parts is what is in them and not in the carved.
        let carved = self.join(&self.carved, point);
        -soft_minimum([-added, carved].into_iter(), self.blend)
    }

    fn join(&self, parts: &[Part], point: DVec3) -> f64 {
        soft_minimum(parts.iter().map(|part| part.distance(point)), self.blend)
    }

    fn gradient(&self, point: DVec3, step: f64) -> DVec3 {
        let slope = |axis: DVec3| {
            (self.distance(point + step * axis) - self.distance(point - step * axis)) / (2.0 * step)
        };
        DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z))
    }
}

/// −blend·ln Σ exp(−distance / blend), the minimum where blend is 0.
fn soft_minimum(distances: impl Iterator<Item = f64> + Clone, blend: f64) -> f64 {
    let least = distances.clone().fold(f64::INFINITY, f64::min);
    if blend == 0.0 {
        return least;
    }
    least - blend * distances.map(|distance| ((least - distance) / blend).exp()).sum::<f64>().ln()
}

impl Blobs {
    /// Closed mesh.
    ///
    /// # Errors
    ///
    /// A message about the parameter at fault.
    pub fn mesh(&self) -> Result<Mesh, String> {
        count("number of balls", self.balls.len(), 1..=512)?;
        let cells = count("cells", self.cells, 4..=256)?;
        let blend = from_zero_to("blend", self.blend, f64::from(f32::MAX))?;
        let mut field = Field { added: Vec::new(), carved: Vec::new(), blend };
        for ball in &self.balls {
            let parts = if ball.carve { &mut field.carved } else { &mut field.added };
            parts.push(ball.part()?);
        }
        if field.added.is_empty() {
            return Err("balls: all of them carve, expected one to carve from".to_owned());
        }
        let [mut low, mut high] = field.added[0].bounds();
        for [part_low, part_high] in field.added.iter().map(|part| part.bounds()) {
            (low, high) = (low.min(part_low), high.max(part_high));
        }
        // Joined parts swell by no more than this; two cells more keep the surface off the border.
        let swell = blend * (field.added.len() as f64).ln();
        let cell = (high - low + 2.0 * swell).max_element() / cells as f64;
        let margin = swell + 2.0 * cell;
        let counts = ((high - low + 2.0 * margin) / cell).ceil().as_usizevec3();
        Ok(surface_net(&field, low - margin, cell, counts))
    }
}

impl Blob {
    fn part(&self) -> Result<Part, String> {
        finite("at", &self.at)?;
        let center = DVec3::from_array(self.at.map(f64::from));
        let [x, y, z] = self.radius.0;
        let radii =
            DVec3::new(positive("radius", x)?, positive("radius", y)?, positive("radius", z)?);
        let Some(to) = self.to else {
            return match self.to_radius {
                Some(_) => Err("to_radius: expected with `to` only".to_owned()),
                None => Ok(Part::Ellipsoid { center, radii }),
            };
        };
        finite("to", &to)?;
        if radii != DVec3::splat(radii.x) {
            return Err("radius: expected one number where there is `to`".to_owned());
        }
        let to_radius =
            self.to_radius.map_or(Ok(radii.x), |radius| positive("to_radius", radius))?;
        let to = DVec3::from_array(to.map(f64::from));
        Ok(Part::Cone { from: center, to, from_radius: radii.x, to_radius })
    }
}

/// Surface of level 0 within `counts` cells of side `cell` from the corner `low`.
fn surface_net(field: &Field, low: DVec3, cell: f64, counts: USizeVec3) -> Mesh {
    let corners = counts + 1;
    let corner_index = |at: USizeVec3| at.x + corners.x * (at.y + corners.y * at.z);
    let at = |index: usize, sides: USizeVec3| {
        USizeVec3::new(index % sides.x, index / sides.x % sides.y, index / (sides.x * sides.y))
    };
    let distances: Vec<f32> = (0..corners.element_product())
        .into_par_iter()
        .map(|index| field.distance(low + cell * at(index, corners).as_dvec3()) as f32)
        .collect();
    let inside = |corner: USizeVec3| distances[corner_index(corner)] < 0.0;
    let axes = [USizeVec3::X, USizeVec3::Y, USizeVec3::Z];
    let mut builder = Builder::default();
    let mut vertices = vec![u32::MAX; counts.element_product()];
    let cell_index = |at: USizeVec3| at.x + counts.x * (at.y + counts.y * at.z);
    for (index, vertex) in vertices.iter_mut().enumerate() {
        let first = at(index, counts);
        let mut sum = DVec3::ZERO;
        let mut crossings = 0;
        for axis in 0..3 {
            let (along, u, v) = (axes[axis], axes[(axis + 1) % 3], axes[(axis + 2) % 3]);
            for from in [first, first + u, first + v, first + u + v] {
                let to = from + along;
                if inside(from) != inside(to) {
                    let (a, b) = (distances[corner_index(from)], distances[corner_index(to)]);
                    let part = f64::from(a / (a - b));
                    sum += from.as_dvec3().lerp(to.as_dvec3(), part);
                    crossings += 1;
                }
            }
        }
        if crossings > 0 {
            let (cell_low, cell_high) = (first.as_dvec3(), (first + 1).as_dvec3());
            let mut position = low + cell * sum / f64::from(crossings);
            // Newton's method, kept to the cell so that the net does not fold.
            for _ in 0..2 {
                let gradient = field.gradient(position, 1e-3 * cell);
                let squared = gradient.length_squared();
                if squared > 0.0 {
                    position -= gradient * (field.distance(position) / squared);
                }
                position = position.clamp(low + cell * cell_low, low + cell * cell_high);
            }
            *vertex = builder.vertex(position, field.gradient(position, 1e-3 * cell));
        }
    }
    for index in 0..corners.element_product() {
        let from = at(index, corners);
        for axis in 0..3 {
            let (along, u, v) = (axes[axis], axes[(axis + 1) % 3], axes[(axis + 2) % 3]);
            let to = from + along;
            // The surface keeps off the border, so the four cells around the edge exist.
            if to[axis] > counts[axis] || inside(from) == inside(to) {
                continue;
            }
            let mut quad =
                [from - u - v, from - v, from, from - u].map(|c| vertices[cell_index(c)]);
            if inside(to) {
                quad.reverse();
            }
            let [a, b, c, d] = quad;
            let length = |from: u32, to: u32| {
                let [from, to] = [from, to].map(|index| builder.mesh.positions[index as usize]);
                glam::Vec3::from_array(from).distance_squared(glam::Vec3::from_array(to))
            };
            // The shorter diagonal.
            if length(a, c) <= length(b, d) {
                builder.triangle([a, b, c]);
                builder.triangle([a, c, d]);
            } else {
                builder.triangle([a, b, d]);
                builder.triangle([b, c, d]);
            }
        }
    }
    builder.finish()
}
