//! `blobs`: balls, ellipsoids and rounded cones melted into one surface.
//!
//! The shapes are signed distances (Quilez, "Distance functions", 2008; ellipsoids by his bound),
//! joined by −b·ln Σ exp(−dᵢ/b), which does not depend on their order. Level 0 becomes a surface net
//! (Gibson, "Constrained elastic surface nets", 1998): a vertex in every grid cell that the surface
//! crosses, moved onto the surface along the gradient, and a quad around every crossed edge.

use glam::{DVec3, USizeVec3, Vec3};
use rayon::prelude::*;
use serde::Deserialize;

use super::{Builder, Mesh, Shape, count, default_count, finite, from_zero_to, positive};
use crate::file::NumberOrVector;

/// `blobs`: placed by its points.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Blobs {
    /// The parts.
    pub balls: Vec<Blob>,
    /// Width of the zone in which parts melt together, metres; 0 leaves creases.
    #[serde(default)]
    pub blend: f32,
    /// Grid cells along the longest side.
    #[serde(default = "default_count::<64>")]
    pub cells: usize,
}

/// Part of [`Blobs`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Blob {
    /// Centre, or the first end of a rounded cone, metres.
    pub at: [f32; 3],
    /// Radius, or the three radii of an ellipsoid, metres.
    pub radius: NumberOrVector,
    /// Second end; makes the part a rounded cone.
    pub to: Option<[f32; 3]>,
    /// Radius at the second end; defaults to that at the first.
    pub to_radius: Option<f32>,
    /// Subtracts the part from the others instead of adding it.
    #[serde(default)]
    pub carve: bool,
}

/// Signed distance to one part.
#[derive(Clone, Copy, Debug)]
enum Part {
    Ellipsoid { center: DVec3, radii: DVec3 },
    Cone { from: DVec3, to: DVec3, from_radius: f64, to_radius: f64 },
}

impl Part {
    /// Distance of a point and its gradient, which costs nothing where it is not used.
    #[inline(always)]
    fn distance(self, point: DVec3) -> (f64, DVec3) {
        match self {
            Self::Ellipsoid { center, radii } => {
                let scaled = (point - center) / radii;
                let twice_scaled = scaled / radii;
                let (length, steep) = (scaled.length(), twice_scaled.length());
                if steep == 0.0 {
                    return (-radii.min_element(), DVec3::ZERO);
                }
                let distance = length * (length - 1.0) / steep;
                let length_gradient = twice_scaled / length;
                let steep_gradient = twice_scaled / (radii * radii * steep);
                let gradient = (2.0 * length - 1.0) * length_gradient - distance * steep_gradient;
                (distance, gradient / steep)
            }
            Self::Cone { from, to, from_radius, to_radius } => {
                let axis = to - from;
                let squared = axis.length_squared();
                let along = if squared > 0.0 { (point - from).dot(axis) / squared } else { 0.0 };
                let offset = point - from - along.clamp(0.0, 1.0) * axis;
                let widening = to_radius - from_radius;
                let radius = from_radius + along.clamp(0.0, 1.0) * widening;
                let is_between = (0.0..=1.0).contains(&along) && squared > 0.0;
                let widening = if is_between { axis * (widening / squared) } else { DVec3::ZERO };
                (offset.length() - radius, offset.normalize_or_zero() - widening)
            }
        }
    }

    /// Corners of the part's bounding box.
    fn bounds(self) -> [DVec3; 2] {
        match self {
            Self::Ellipsoid { center, radii } => [center - radii, center + radii],
            Self::Cone { from, to, from_radius, to_radius } => {
                [(from - from_radius).min(to - to_radius), (from + from_radius).max(to + to_radius)]
            }
        }
    }
}

/// Cells along the side of a block; inside a block, only the parts near it are evaluated.
const BLOCK_CELLS: usize = 4;

/// Largest change of a distance per unit of length: 1 for true distances, more where the bound for
/// ellipsoids is loose.
const STEEPEST: f64 = 1.5;

/// Joined distance, negative inside.
#[derive(Clone, Debug)]
struct Field {
    added: Vec<Part>,
    carved: Vec<Part>,
    blend: f64,
}

impl Field {
    fn distance(&self, point: DVec3) -> f64 {
        self.joined(&distances(&self.added, point), &distances(&self.carved, point))
    }

    fn joined(&self, added: &[f64], carved: &[f64]) -> f64 {
        let added = soft_minimum(added, self.blend);
        if self.carved.is_empty() {
            return added;
        }
        // Subtract the carved parts: the softened maximum of `added` and −`carved`.
        -soft_minimum(&[-added, soft_minimum(carved, self.blend)], self.blend)
    }

    /// Returns the distance of `point`, and the field of the parts that matter within `reach` of it unless
    /// the surface lies farther away. Each of the other parts adds less than exp(−18) to the sum.
    fn near(&self, point: DVec3, reach: f64) -> (f64, Option<Self>) {
        let [added, carved] = [&self.added, &self.carved].map(|parts| distances(parts, point));
        let distance = self.joined(&added, &carved);
        if distance.abs() > STEEPEST * reach {
            return (distance, None);
        }
        let keep = |parts: &[Part], distances: &[f64]| -> Vec<Part> {
            let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
            let limit = least + 2.0 * STEEPEST * reach + 18.0 * self.blend;
            let near = parts.iter().zip(distances).filter(|(_, distance)| **distance <= limit);
            near.map(|(part, _)| *part).collect()
        };
        let (added, carved) = (keep(&self.added, &added), keep(&self.carved, &carved));
        (distance, Some(Self { added, carved, blend: self.blend }))
    }

    fn distance_and_gradient(&self, point: DVec3) -> (f64, DVec3) {
        let join = |parts: &[Part]| {
            let parts: Vec<_> = parts.iter().map(|part| part.distance(point)).collect();
            soft_minimum_and_gradient(&parts, self.blend)
        };
        let (added, added_gradient) = join(&self.added);
        if self.carved.is_empty() {
            return (added, added_gradient);
        }
        let (distance, gradient) =
            soft_minimum_and_gradient(&[(-added, -added_gradient), join(&self.carved)], self.blend);
        (-distance, -gradient)
    }
}

fn distances(parts: &[Part], point: DVec3) -> Vec<f64> {
    parts.iter().map(|part| part.distance(point).0).collect()
}

/// −blend·ln Σ exp(−distance / blend); the minimum if blend is 0.
fn soft_minimum(distances: &[f64], blend: f64) -> f64 {
    let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
    if blend == 0.0 {
        return least;
    }
    let weights = distances.iter().map(|distance| ((least - distance) / blend).exp());
    least - blend * weights.sum::<f64>().ln()
}

/// [`soft_minimum`] of distances, with its gradient.
fn soft_minimum_and_gradient(parts: &[(f64, DVec3)], blend: f64) -> (f64, DVec3) {
    let (least, gradient) = parts
        .iter()
        .copied()
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap_or((f64::INFINITY, DVec3::ZERO));
    if blend == 0.0 {
        return (least, gradient);
    }
    let (mut sum, mut gradients) = (0.0, DVec3::ZERO);
    for (distance, gradient) in parts {
        let weight = ((least - distance) / blend).exp();
        sum += weight;
        gradients += weight * gradient;
    }
    (least - blend * sum.ln(), gradients / sum)
}

impl Shape for Blobs {
    fn mesh(&self) -> Result<Mesh, String> {
        count("number of balls", self.balls.len(), 1..=512)?;
        let cells = count("cells", self.cells, 4..=256)?;
        let blend = from_zero_to("blend", self.blend, f64::from(f32::MAX))?;
        let mut field = Field { added: Vec::new(), carved: Vec::new(), blend };
        for ball in &self.balls {
            let parts = if ball.carve { &mut field.carved } else { &mut field.added };
            parts.push(ball.part()?);
        }
        let bounds = field.added.iter().map(|part| part.bounds());
        let Some([low, high]) = bounds.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]) else {
            return Err("balls: all of them carve, expected one to carve from".to_owned());
        };
        // Joined parts swell by no more than this; two more cells keep the surface off the border.
        let swell = blend * (field.added.len() as f64).ln();
        let cell = (high - low + 2.0 * swell).max_element() / cells as f64;
        let margin = swell + 2.0 * cell;
        let counts = ((high - low + 2.0 * margin) / cell).ceil().as_usizevec3();
        surface_net(&field, low - margin, cell, counts)
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

/// Grid of distances, with the field that suffices in each of its blocks.
struct Lattice {
    low: DVec3,
    cell: f64,
    /// Cells along each axis; there is one corner more.
    counts: USizeVec3,
    distances: Vec<f32>,
    block_counts: USizeVec3,
    /// None far from the surface.
    blocks: Vec<Option<Field>>,
}

impl Lattice {
    fn new(field: &Field, low: DVec3, cell: f64, counts: USizeVec3) -> Self {
        let corners = counts + 1;
        let block_counts = (corners + BLOCK_CELLS - 1) / BLOCK_CELLS;
        // Distance from a block's centre to its farthest vertex, up to a cell beyond its corners.
        let reach = 0.5 * 3.0_f64.sqrt() * (BLOCK_CELLS + 1) as f64 * cell;
        let sampled: Vec<(f64, Option<Field>, Vec<f32>)> = (0..block_counts.element_product())
            .into_par_iter()
            .map(|block| {
                let first = grid_position(block, block_counts) * BLOCK_CELLS;
                let center = low + cell * (first.as_dvec3() + 0.5 * BLOCK_CELLS as f64);
                let (distance, near) = field.near(center, reach);
                let Some(near) = near else {
                    return (distance, None, Vec::new());
                };
                let side = USizeVec3::splat(BLOCK_CELLS);
                let distances = (0..BLOCK_CELLS.pow(3))
                    .map(|index| {
                        let corner = first + grid_position(index, side);
                        near.distance(low + cell * corner.as_dvec3()) as f32
                    })
                    .collect();
                (distance, Some(near), distances)
            })
            .collect();
        let distances = (0..corners.element_product())
            .map(|index| {
                let corner = grid_position(index, corners);
                let (distance, _, distances) =
                    &sampled[grid_index(corner / BLOCK_CELLS, block_counts)];
                let within = grid_index(corner % BLOCK_CELLS, USizeVec3::splat(BLOCK_CELLS));
                distances.get(within).copied().unwrap_or(*distance as f32)
            })
            .collect();
        let blocks = sampled.into_iter().map(|(_, field, _)| field).collect();
        Self { low, cell, counts, distances, block_counts, blocks }
    }

    fn distance(&self, corner: USizeVec3) -> f32 {
        self.distances[grid_index(corner, self.counts + 1)]
    }

    fn is_inside(&self, corner: USizeVec3) -> bool {
        self.distance(corner) < 0.0
    }

    /// Vertex of a cell and its normal, if the surface crosses the cell.
    fn vertex(&self, field: &Field, first: USizeVec3) -> Option<(DVec3, DVec3)> {
        let mut sum = DVec3::ZERO;
        let mut crossings = 0;
        for axis in 0..3 {
            let [along, u, v] = axes_from(axis);
            for from in [first, first + u, first + v, first + u + v] {
                let to = from + along;
                if self.is_inside(from) != self.is_inside(to) {
                    let (a, b) = (self.distance(from), self.distance(to));
                    sum += from.as_dvec3().lerp(to.as_dvec3(), f64::from(a / (a - b)));
                    crossings += 1;
                }
            }
        }
        if crossings == 0 {
            return None;
        }
        let block = grid_index(first / BLOCK_CELLS, self.block_counts);
        let field = self.blocks[block].as_ref().unwrap_or(field);
        let (cell_low, cell_high) = (first.as_dvec3(), (first + 1).as_dvec3());
        let mut position = self.low + self.cell * sum / f64::from(crossings);
        // Take Newton steps, clamped to the cell so that the net does not fold.
        for _ in 0..2 {
            let (distance, gradient) = field.distance_and_gradient(position);
            let squared = gradient.length_squared();
            if squared > 0.0 {
                position -= gradient * (distance / squared);
            }
            let [low, high] = [cell_low, cell_high].map(|corner| self.low + self.cell * corner);
            position = position.clamp(low, high);
        }
        Some((position, field.distance_and_gradient(position).1))
    }
}

/// Index of a position in a grid of `counts`, x first.
fn grid_index(at: USizeVec3, counts: USizeVec3) -> usize {
    at.x + counts.x * (at.y + counts.y * at.z)
}

/// Inverse of [`grid_index`].
fn grid_position(index: usize, counts: USizeVec3) -> USizeVec3 {
    USizeVec3::new(index % counts.x, index / counts.x % counts.y, index / (counts.x * counts.y))
}

/// Unit steps along an axis and the two after it.
fn axes_from(axis: usize) -> [USizeVec3; 3] {
    let axes = [USizeVec3::X, USizeVec3::Y, USizeVec3::Z];
    [axes[axis], axes[(axis + 1) % 3], axes[(axis + 2) % 3]]
}

/// Extracts the surface of level 0 within `counts` cells of side `cell` from the corner `low`.
fn surface_net(field: &Field, low: DVec3, cell: f64, counts: USizeVec3) -> Result<Mesh, String> {
    let lattice = Lattice::new(field, low, cell, counts);
    let found: Vec<_> = (0..counts.element_product())
        .into_par_iter()
        .filter_map(|index| {
            lattice.vertex(field, grid_position(index, counts)).map(|vertex| (index, vertex))
        })
        .collect();
    let mut builder = Builder::default();
    let mut vertices = vec![u32::MAX; counts.element_product()];
    for (index, (position, normal)) in found {
        vertices[index] = builder.vertex(position, normal);
    }
    let corners = counts + 1;
    for index in 0..corners.element_product() {
        let from = grid_position(index, corners);
        for axis in 0..3 {
            let [along, u, v] = axes_from(axis);
            let to = from + along;
            // The surface stays off the border, so the four cells around the edge exist.
            if to[axis] > counts[axis] || lattice.is_inside(from) == lattice.is_inside(to) {
                continue;
            }
            let mut quad = [from - u - v, from - v, from, from - u]
                .map(|cell| vertices[grid_index(cell, counts)]);
            if lattice.is_inside(to) {
                quad.reverse();
            }
            let [a, b, c, d] = quad;
            let length = |from: u32, to: u32| {
                let [from, to] = [from, to]
                    .map(|index| Vec3::from_array(builder.mesh.positions[index as usize]));
                from.distance_squared(to)
            };
            // Split the quad along its shorter diagonal.
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
