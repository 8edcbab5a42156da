//! `box`: a cuboid, with rounded edges if it has a bevel.

use std::f64::consts::FRAC_PI_4;

use glam::{DVec2, DVec3};
use serde::Deserialize;

use super::{Builder, Mesh, Shape, Vertex, count, default_count, from_zero_to, positive};

/// `box`: centre at the origin, 12 triangles without a bevel.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RoundedBox {
    /// Full lengths along x, y, z, metres.
    pub size: [f32; 3],
    /// Radius of the rounded edges, metres; 0 is sharp. At most half the shortest length.
    #[serde(default)]
    pub bevel: f32,
    /// Segments of half a rounded edge, that is 45°.
    #[serde(default = "default_count::<3>")]
    pub bevel_segments: usize,
}

impl Shape for RoundedBox {
    fn mesh(&self) -> Result<Mesh, String> {
        let [x, y, z] = self.size;
        let half =
            0.5 * DVec3::new(positive("size", x)?, positive("size", y)?, positive("size", z)?);
        let bevel = from_zero_to("bevel", self.bevel, half.min_element())?;
        let segments = count("bevel_segments", self.bevel_segments, 1..=64)?;
        let inner = half - bevel;
        // Along each axis, the rounded edge up to 45°, the flat part, the other edge: the corner of
        // the inner box and the offset from it, in units of the bevel before normalisation.
        let lines: Vec<(f64, f64)> = if bevel > 0.0 {
            let tangent = |step: usize| (FRAC_PI_4 * step as f64 / segments as f64).tan();
            let low = (0..=segments).rev().map(|step| (-1.0, -tangent(step)));
            let high = (0..=segments).map(|step| (1.0, tangent(step)));
            low.chain(high).collect()
        } else {
            vec![(-1.0, 0.0), (1.0, 0.0)]
        };
        let mut builder = Builder::default();
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                // Columns × rows points outward: (axis + 1) × (axis + 2) = axis.
                let (mut column_axis, mut row_axis) = ((axis + 1) % 3, (axis + 2) % 3);
                if sign < 0.0 {
                    std::mem::swap(&mut column_axis, &mut row_axis);
                }
                let [right, up] = face_axes(axis, sign);
                builder.patch(lines.len(), lines.len(), |row, column| {
                    let (mut corner, mut offset) = (DVec3::ZERO, DVec3::ZERO);
                    (corner[axis], offset[axis]) = (sign, sign);
                    (corner[column_axis], offset[column_axis]) = lines[column];
                    (corner[row_axis], offset[row_axis]) = lines[row];
                    let normal = offset.normalize();
                    let position = corner * inner + bevel * normal;
                    let from_edges = position + half * (right + up);
                    let uv = DVec2::new(from_edges.dot(right), from_edges.dot(up));
                    Vertex { position, normal, uv }
                });
            }
        }
        builder.finish()
    }
}

/// Directions to the right and up on a face, as seen from outside.
fn face_axes(axis: usize, sign: f64) -> [DVec3; 2] {
    match axis {
        0 => [DVec3::NEG_Z * sign, DVec3::Y],
        1 => [DVec3::X, DVec3::NEG_Z * sign],
        _ => [DVec3::X * sign, DVec3::Y],
    }
}
