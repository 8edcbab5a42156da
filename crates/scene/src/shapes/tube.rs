//! `tube`: a round rod along a path.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3, DVec4};
use serde::Deserialize;

use super::{
    Builder, MAX_POINTS, Mesh, SEGMENT_RANGE, Shape, Vertex, count, curve, default_count, finite,
    positive,
};

/// `tube`: placed by its path.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Tube {
    /// Points of the centre line, metres.
    pub path: Vec<[f32; 3]>,
    /// Radius, metres: one, or one per point of the path.
    pub radius: Radius,
    /// Joins the path's last point to its first: a ring.
    #[serde(default)]
    pub closed: bool,
    /// Ends in hemispheres instead of flat disks.
    #[serde(default)]
    pub round: bool,
    /// Spline segments between two points of the path; 1 is straight. A point given twice is a
    /// corner of the spline.
    #[serde(default = "default_count::<8>")]
    pub smooth: usize,
    /// Segments around the tube.
    #[serde(default = "default_count::<24>")]
    pub segments: usize,
}

/// One radius for the whole path, or one per point.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "expected a number or an array of numbers")]
pub(crate) enum Radius {
    /// Same everywhere.
    Constant(f32),
    PerPoint(Vec<f32>),
}

#[derive(Clone, Copy, Debug)]
struct Ring {
    center: DVec3,
    tangent: DVec3,
    /// Direction to the first point of the circle, at right angles to the tangent.
    start: DVec3,
    radius: f64,
    /// Angle from the plane of the circle to the surface normal, toward the tangent, radians.
    tilt: f64,
}

impl Shape for Tube {
    fn mesh(&self) -> Result<Mesh, String> {
        let needed = if self.closed { 3 } else { 2 };
        count("number of points in path", self.path.len(), needed..=MAX_POINTS)?;
        finite("path", self.path.as_flattened())?;
        let smooth = count("smooth", self.smooth, 1..=256)?;
        let segments = count("segments", self.segments, SEGMENT_RANGE)?;
        let radii = match &self.radius {
            Radius::Constant(radius) => vec![*radius; self.path.len()],
            Radius::PerPoint(radii) => radii.clone(),
        };
        if radii.len() != self.path.len() {
            return Err(format!(
                "radius: expected one number or {}, one per point of path, found {}",
                self.path.len(),
                radii.len()
            ));
        }
        let mut control = Vec::with_capacity(self.path.len());
        for (point, radius) in self.path.iter().zip(&radii) {
            let point = DVec3::from_array(point.map(f64::from));
            control.push(point.extend(positive("radius", *radius)?));
        }
        // A closed path may end where it began; two points in one place would be a corner.
        let is_end =
            |control: &[DVec4]| control[0].truncate() == control[control.len() - 1].truncate();
        while self.closed && control.len() > 1 && is_end(&control) {
            control.pop();
        }
        let mut points = curve::smooth(&control, smooth, self.closed);
        points.dedup_by_key(|point| point.truncate());
        if points.len() < needed {
            return Err("path: expected points that differ, found one".to_owned());
        }
        // A spline between radii may swing below the smallest.
        let smallest = radii.iter().copied().fold(f32::INFINITY, f32::min);
        points.iter_mut().for_each(|point| point.w = point.w.max(f64::from(smallest)));
        sweep(&rings(&points, self.closed), self.closed, self.round, segments)
    }
}

/// Rotation-minimising frames along the path, by double reflection (Wang, Jüttler, Zheng and Liu,
/// "Computation of rotation minimizing frames", 2008).
fn rings(points: &[DVec4], closed: bool) -> Vec<Ring> {
    let count = points.len();
    let at = |index: usize| points[index % count];
    let tangents: Vec<DVec3> = (0..count)
        .map(|index| {
            let along = |from: usize, to: usize| (at(to) - at(from)).truncate().normalize_or_zero();
            let before =
                if index > 0 || closed { along(index + count - 1, index) } else { DVec3::ZERO };
            let after =
                if index + 1 < count || closed { along(index, index + 1) } else { DVec3::ZERO };
            // A path that turns straight back has no mean direction.
            (before + after).try_normalize().unwrap_or(before.any_orthonormal_vector())
        })
        .collect();
    let reflect = |vector: DVec3, across: DVec3| {
        let squared = across.length_squared();
        if squared > 0.0 { vector - across * (2.0 * across.dot(vector) / squared) } else { vector }
    };
    let mut start = tangents[0].any_orthonormal_vector();
    let mut rings = Vec::with_capacity(count + 1);
    for step in 0..count + usize::from(closed) {
        let index = step % count;
        if step > 0 {
            let chord = (at(step) - at(step - 1)).truncate();
            let carried = reflect(start, chord);
            let turned = reflect(tangents[(step - 1) % count], chord);
            start = reflect(carried, tangents[index] - turned);
        }
        let (before, after) = if closed {
            (at(index + count - 1), at(index + 1))
        } else {
            (at(index.saturating_sub(1)), at((index + 1).min(count - 1)))
        };
        let along =
            (at(index) - before).truncate().length() + (after - at(index)).truncate().length();
        rings.push(Ring {
            center: at(index).truncate(),
            tangent: tangents[index],
            start,
            radius: at(index).w,
            tilt: -((after.w - before.w) / along).atan(),
        });
    }
    if closed {
        // Undo the frame's total turn about the closed path, spread evenly over the rings.
        let first = rings[0].start;
        let cross = first.cross(rings[0].tangent);
        let turned = f64::atan2(-rings[count].start.dot(cross), rings[count].start.dot(first));
        for (step, ring) in rings.iter_mut().enumerate() {
            let angle = -turned * step as f64 / count as f64;
            let side = ring.tangent.cross(ring.start);
            ring.start = angle.cos() * ring.start + angle.sin() * side;
        }
        rings[count] = rings[0];
    }
    rings
}

fn sweep(rings: &[Ring], closed: bool, round: bool, segments: usize) -> Result<Mesh, String> {
    let mut rows: Vec<Ring> = Vec::new();
    const CAP_STEPS: usize = 6;
    let hemisphere = |end: Ring, side: f64, step: usize| {
        let angle = FRAC_PI_2 * step as f64 / CAP_STEPS as f64;
        let radius = if step == CAP_STEPS { 0.0 } else { end.radius * angle.cos() };
        let center = end.center + side * end.radius * angle.sin() * end.tangent;
        Ring { center, radius, tilt: side * angle, ..end }
    };
    let (first, last) = (rings[0], rings[rings.len() - 1]);
    if round && !closed {
        rows.extend((1..=CAP_STEPS).rev().map(|step| hemisphere(first, -1.0, step)));
    }
    rows.extend(rings);
    if round && !closed {
        rows.extend((1..=CAP_STEPS).map(|step| hemisphere(last, 1.0, step)));
    }
    let spoke = |ring: &Ring, segment: usize| {
        let angle = TAU * (segment % segments) as f64 / segments as f64;
        angle.cos() * ring.start + angle.sin() * ring.tangent.cross(ring.start)
    };
    let mut lengths = vec![0.0];
    for pair in rows.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + pair[0].center.distance(pair[1].center));
    }
    let mut builder = Builder::default();
    builder.patch(rows.len(), segments + 1, |row, column| {
        let ring = &rows[row];
        let spoke = spoke(ring, column);
        let normal = ring.tilt.cos() * spoke + ring.tilt.sin() * ring.tangent;
        let uv = DVec2::new(column as f64 / segments as f64, lengths[row]);
        Vertex { position: ring.center + ring.radius * spoke, normal, uv }
    });
    if !round && !closed {
        for (ring, side) in [(first, -1.0), (last, 1.0)] {
            let corner = |segment: usize| {
                let flat = DVec2::from_angle(TAU * segment as f64 / segments as f64);
                let position = ring.center + ring.radius * spoke(&ring, segment);
                (position, ring.radius * DVec2::new(side, 1.0) * flat)
            };
            let mut corners: Vec<_> = (0..segments).map(corner).collect();
            corners.push((ring.center, DVec2::ZERO));
            let triangles: Vec<_> = (0..segments)
                .map(|segment| {
                    let next = (segment + 1) % segments;
                    if side > 0.0 { [segment, next, segments] } else { [next, segment, segments] }
                })
                .collect();
            builder.face(&corners, side * ring.tangent, &triangles);
        }
    }
    builder.finish()
}
