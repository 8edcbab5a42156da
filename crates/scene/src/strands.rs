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

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// Control points on a line: blending of whichever kind keeps it, and radii that grow along it.
    #[test]
    fn a_straight_strand_is_a_cone_of_the_right_width() {
        for (basis, points) in [
            (Basis::Linear, 4),
            (Basis::Bezier(2), 5),
            (Basis::Bezier(3), 7),
            (Basis::Spline(2), 6),
            (Basis::Spline(3), 6),
        ] {
            let along = |x: f64| DVec4::new(1.0, x, -2.0, 0.01 * (1.0 + x));
            let controls: Vec<_> = (0..points).map(|index| along(f64::from(index))).collect();
            let mut mesh = Mesh::default();
            Detail::of(3).add(&mut mesh, basis, &controls);
            let (first, last) = match basis {
                Basis::Spline(2) => (0.5, 4.5),
                Basis::Spline(_) => (1.0, 4.0),
                _ => (0.0, f64::from(points - 1)),
            };
            let ends = [mesh.positions[0][1], mesh.positions[mesh.positions.len() - 1][1]];
            assert!((f64::from(ends[0]) - first).abs() < 1e-5, "{basis:?} {ends:?}");
            assert!((f64::from(ends[1]) - last).abs() < 1e-5, "{basis:?} {ends:?}");
            let along: Vec<f32> = mesh.uvs[0].iter().map(|uv| uv[0]).collect();
            assert_eq!([along[0], along[along.len() - 1]], [0.0, 1.0], "{basis:?}");
            let mut area = 0.0;
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|at| Vec3::from(mesh.positions[at as usize]));
                let normal = (b - a).cross(c - a);
                area += 0.5 * f64::from(normal.length());
                let middle = (a + b + c) / 3.0 - Vec3::new(1.0, 0.0, -2.0);
                assert!(normal.dot(middle.with_y(0.0)) > 0.0, "{basis:?}: inside out");
            }
            // The cone's side, whose projections have its mean width.
            let mean_radius = 0.01 * (1.0 + 0.5 * (first + last));
            let expected = TAU * mean_radius * (last - first);
            assert!((area / expected - 1.0).abs() < 1e-3, "{basis:?} {area} {expected}");
        }
    }

    #[test]
    fn ends_of_bezier_curves_and_splines_are_where_they_should_be() {
        let [a, b, c, d] = [DVec4::X, DVec4::Y, DVec4::Z, DVec4::W];
        let curve = [a, b, c, d];
        assert_eq!(Basis::Bezier(3).point(&curve, 0, 0.0), a);
        assert_eq!(Basis::Bezier(3).point(&curve, 0, 0.5), DVec4::new(0.125, 0.375, 0.375, 0.125));
        let start = Basis::Spline(3).point(&curve, 0, 0.0);
        assert!(start.abs_diff_eq(DVec4::new(1.0, 4.0, 1.0, 0.0) / 6.0, 1e-12), "{start}");
        let middle = Basis::Spline(2).point(&curve, 1, 0.5);
        assert!(middle.abs_diff_eq(DVec4::new(0.0, 1.0, 6.0, 1.0) / 8.0, 1e-12), "{middle}");
        assert_eq!(Basis::Bezier(3).spans(6), None);
        assert_eq!(Basis::Spline(3).spans(3), None);
    }

    #[test]
    fn many_strands_stay_within_the_bound() {
        let controls = [DVec4::new(0.0, 0.0, 0.0, 1.0), DVec4::new(1.0, 0.0, 0.0, 1.0)];
        for count in [1, 100_000, 300_000, 1_000_000] {
            let mut detail = Detail::of(count);
            let mut mesh = Mesh::default();
            (0..count.min(1000)).for_each(|_| detail.add(&mut mesh, Basis::Linear, &controls));
            let share = count.min(1000) as f64 / count as f64;
            let most = share * MAX_TRIANGLES as f64 * 1.01;
            assert!((mesh.triangles.len() as f64) <= most, "{count}: {}", mesh.triangles.len());
            // Those that are kept are thicker by as much as there are fewer of them.
            let width = mesh.positions[0][1].hypot(mesh.positions[0][2]) * detail.sides as f32;
            let kept = mesh.triangles.len() / (2 * detail.sides);
            let whole = kept as f32 * width * (PI as f32 / detail.sides as f32).sin();
            let expected = PI as f32 * count.min(1000) as f32;
            assert!((whole / expected - 1.0).abs() < 0.01, "{count}: {whole} {expected}");
        }
    }
}
