//! `extrude`: an outline swept along z, with rounded rims if it has a bevel.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3, DVec4};
use serde::Deserialize;

use super::{
    Builder, MAX_POINTS, Mesh, Shape, Vertex, count, curve, default_count, default_crease_deg,
    finite, from_zero_to, positive,
};
use crate::triangulate::{is_simple, signed_area, triangulate};

/// `extrude`: outline in the x-y plane, from z = −depth / 2 to depth / 2.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Extrude {
    /// Corners [x, y] of a simple polygon, wound either way, metres; the last leads to the first.
    pub outline: Vec<[f32; 2]>,
    /// Length along z, metres.
    pub depth: f32,
    /// Radius of the rounded rims, metres; 0 is sharp.
    #[serde(default)]
    pub bevel: f32,
    /// Segments of a rounded rim.
    #[serde(default = "default_count::<4>")]
    pub bevel_segments: usize,
    /// Spline segments between two points of the outline; 1 is straight.
    #[serde(default = "default_count::<1>")]
    pub smooth: usize,
    /// Angle above which a corner of the outline is sharp, degrees.
    #[serde(default = "default_crease_deg")]
    pub crease_deg: f32,
}

impl Shape for Extrude {
    fn mesh(&self) -> Result<Mesh, String> {
        count("number of points in outline", self.outline.len(), 3..=MAX_POINTS)?;
        finite("outline", self.outline.as_flattened())?;
        let half_depth = 0.5 * positive("depth", self.depth)?;
        let bevel = from_zero_to("bevel", self.bevel, half_depth)?;
        let bevel_segments = count("bevel_segments", self.bevel_segments, 1..=64)?;
        let smooth = count("smooth", self.smooth, 1..=256)?;
        let crease_deg = from_zero_to("crease_deg", self.crease_deg, 180.0)?;
        let points: Vec<_> =
            self.outline.iter().map(|&[x, y]| DVec4::new(x.into(), y.into(), 0.0, 0.0)).collect();
        let mut outline: Vec<_> =
            curve::smooth(&points, smooth, true).iter().map(|p| p.truncate().truncate()).collect();
        outline.dedup();
        count("number of points in the outline with its splines", outline.len(), 3..=MAX_POINTS)?;
        if !is_simple(&outline) {
            return Err("outline: expected a polygon that does not cross or touch itself".into());
        }
        if signed_area(&outline) < 0.0 {
            outline.reverse();
        }
        let inward = mitres(&outline);
        let inset = |by: f64| -> Vec<DVec2> {
            outline.iter().zip(&inward).map(|(point, inward)| point + by * inward).collect()
        };
        let rim = inset(bevel);
        if bevel > 0.0 && !(is_simple(&rim) && signed_area(&rim) > 0.0) {
            return Err(format!("bevel: {bevel} is too large for the narrow parts of the outline"));
        }
        // Rings from back to front: inset outline, depth, and tilt of the normal.
        let mut rings: Vec<(Vec<DVec2>, f64, f64)> = Vec::new();
        let steps = if bevel > 0.0 { bevel_segments } else { 0 };
        for step in (0..=steps).rev() {
            let angle = FRAC_PI_2 * step as f64 / steps.max(1) as f64;
            let depth = half_depth - bevel + bevel * angle.sin();
            rings.push((inset(bevel * (1.0 - angle.cos())), -depth, -angle));
        }
        for mirror in 0..=steps {
            let (outline, depth, angle) = rings[steps - mirror].clone();
            rings.push((outline, -depth, -angle));
        }
        let mut builder = Builder::default();
        for chain in curve::chains(&outline, true, crease_deg, [None, None]) {
            // Outline counter-clockwise, rings toward +z: columns × rows points outward.
            builder.patch(rings.len(), chain.len(), |row, column| {
                let (ring, depth, angle) = &rings[row];
                let (index, normal, along) = chain[column];
                Vertex {
                    position: ring[index].extend(*depth),
                    normal: (angle.cos() * normal).extend(angle.sin()),
                    uv: DVec2::new(along, half_depth + depth),
                }
            });
        }
        let triangles = triangulate(&rim);
        let cap = |side: f64| -> Vec<(DVec3, DVec2)> {
            let mirror = DVec2::new(side, 1.0);
            rim.iter().map(|point| (point.extend(side * half_depth), mirror * point)).collect()
        };
        builder.face(&cap(1.0), DVec3::Z, &triangles);
        let reversed: Vec<_> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        builder.face(&cap(-1.0), DVec3::NEG_Z, &reversed);
        builder.finish()
    }
}

/// Offset of each corner of a counter-clockwise outline that moves both of its sides inward by 1.
fn mitres(outline: &[DVec2]) -> Vec<DVec2> {
    let count = outline.len();
    let inward = |side: usize| {
        (outline[(side + 1) % count] - outline[side % count]).perp().normalize_or_zero()
    };
    (0..count)
        .map(|corner| {
            let (before, after) = (inward(corner + count - 1), inward(corner));
            // Limit very sharp corners to four times the inset.
            (before + after) / (1.0 + before.dot(after)).max(0.125)
        })
        .collect()
}
