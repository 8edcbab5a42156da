//! Curves of hair, fur and grass → open tubes of a few sides.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, DVec4};

use super::mesh::Mesh;

/// Triangles that all strands of a file together have at most, about.
const MAX_TRIANGLES: usize = 1 << 21;
/// Most pieces of a span.
const PIECES: usize = 8;

/// Polynomials that blend the control points of a span; a number is their degree, 2 or 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Basis {
    /// Straight lines from point to point.
    Linear,
    /// Bézier curves, each beginning where the last one ends.
    Bezier(usize),
    /// Uniform B-splines.
    Spline(usize),
}

impl Basis {
    /// Spans between so many control points; none for a number that makes no curve.
    pub(crate) fn spans(self, points: usize) -> Option<usize> {
        let spans = match self {
            Self::Linear => points.checked_sub(1)?,
            Self::Bezier(degree) if points % degree == 1 => points / degree,
            Self::Bezier(_) => 0,
            Self::Spline(degree) => points.checked_sub(degree)?,
        };
        (spans > 0).then_some(spans)
    }

    /// Weights of the control points of a span at the parameter t, 0…1.
    fn weights(self, t: f64) -> [f64; 4] {
        let s = 1.0 - t;
        match self {
            Self::Linear => [s, t, 0.0, 0.0],
            Self::Bezier(2) => [s * s, 2.0 * s * t, t * t, 0.0],
            Self::Bezier(_) => [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t],
            Self::Spline(2) => [0.5 * s * s, 0.5 + s * t, 0.5 * t * t, 0.0],
            Self::Spline(_) => {
                let inner = |x: f64| (4.0 - 3.0 * x * x * (2.0 - x)) / 6.0;
                [s * s * s / 6.0, inner(t), inner(s), t * t * t / 6.0]
            }
        }
    }

    fn point(self, controls: &[DVec4], span: usize, t: f64) -> DVec4 {
        let first = if let Self::Bezier(degree) = self { span * degree } else { span };
        let weighted = controls.iter().skip(first).zip(self.weights(t));
        weighted.map(|(control, weight)| *control * weight).sum()
    }
}

/// Fineness of the tubes, by which all strands of a file share [`MAX_TRIANGLES`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Detail {
    sides: usize,
    pieces: usize,
    /// One of so many strands is kept, and is as much thicker.
    pub(crate) step: usize,
    seen: usize,
}

impl Detail {
    /// Fineness for a file with so many spans.
    pub(crate) fn of(spans: usize) -> Self {
        let each = MAX_TRIANGLES / spans.max(1);
        let sides = match each {
            48.. => 6,
            16.. => 4,
            _ => 3,
        };
        let pieces = (each / (2 * sides)).clamp(1, PIECES);
        Self { sides, pieces, step: spans.div_ceil(MAX_TRIANGLES / 6).max(1), seen: 0 }
    }

    /// Adds the next strand, whose control points have their radius as fourth component; u runs along it.
    pub(crate) fn add(&mut self, mesh: &mut Mesh, basis: Basis, controls: &[DVec4]) {
        self.seen += 1;
        let Some(spans) = basis.spans(controls.len()) else { return };
        if !(self.seen - 1).is_multiple_of(self.step) {
            return;
        }
        let pieces = if basis == Basis::Linear { 1 } else { self.pieces };
        let points: Vec<DVec4> = (0..=spans * pieces)
            .map(|index| {
                let span = (index / pieces).min(spans - 1);
                basis.point(controls, span, (index - span * pieces) as f64 / pieces as f64)
            })
            .collect();
        // Seen from all sides, a polygon is as wide on the mean as its perimeter over π.
        let side = PI / self.sides as f64;
        let thicker = self.step as f64 * side / side.sin();
        let thickest = points.iter().map(|point| point.w).fold(0.0, f64::max);
        let mut tangent = DVec3::Z;
        let mut start = DVec3::X;
        for (row, point) in points.iter().enumerate() {
            let (before, after) =
                (points[row.saturating_sub(1)], points.get(row + 1).unwrap_or(point));
            tangent = (after - before).truncate().try_normalize().unwrap_or(tangent);
            // Carry the start along without a twist.
            let carried = (start - tangent * tangent.dot(start)).try_normalize();
            start = carried.unwrap_or_else(|| tangent.any_orthonormal_vector());
            let across = tangent.cross(start);
            // A tip of no width has triangles without area.
            let radius = thicker * point.w.max(1e-3 * thickest);
            let first = mesh.positions.len() as u32;
            let sides = self.sides as u32;
            for side in 0..sides {
                let (sine, cosine) = (TAU * f64::from(side) / f64::from(sides)).sin_cos();
                let normal = cosine * start + sine * across;
                mesh.positions.push((point.truncate() + radius * normal).as_vec3().to_array());
                mesh.normals.push(normal.as_vec3().to_array());
                mesh.uvs[0].push([row as f32 / (points.len() - 1) as f32, 0.5]);
                if row > 0 {
                    let [a, b] = [side, (side + 1) % sides].map(|side| first + side - sides);
                    mesh.triangles.extend([[a, b, a + sides], [b, b + sides, a + sides]]);
                }
            }
        }
    }
}
