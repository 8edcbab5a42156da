//! Surfaces of revolution about +Y: `sphere`, `cylinder`, `cone`, `torus`, `lathe`.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3, DVec4};
use serde::Deserialize;

use super::{
    Builder, DEFAULT_CREASE_DEG, MAX_POINTS, Mesh, SEGMENT_RANGE, Shape, Vertex, count, curve,
    default_count, default_crease_deg, finite, from_zero_to, positive,
};

/// `sphere`: centre at the origin.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Sphere {
    /// Radius, metres.
    pub radius: f32,
    /// Segments around the equator; half as many from pole to pole.
    #[serde(default = "default_count::<64>")]
    pub segments: usize,
}

/// `cylinder`: base on y = 0.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Cylinder {
    /// Radius, metres.
    pub radius: f32,
    /// Height, metres.
    pub height: f32,
    /// Radius of the rounded rims, metres; 0 is sharp.
    #[serde(default)]
    pub bevel: f32,
    /// Segments around the axis.
    #[serde(default = "default_count::<64>")]
    pub segments: usize,
}

/// `cone`, or a truncated one: base on y = 0.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Cone {
    /// Radius of the base, metres.
    pub radius: f32,
    /// Radius of the top, metres; 0 is a point.
    #[serde(default)]
    pub top_radius: f32,
    /// Height, metres.
    pub height: f32,
    /// Segments around the axis.
    #[serde(default = "default_count::<64>")]
    pub segments: usize,
}

/// `torus`: centre at the origin, axis +Y.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Torus {
    /// Distance from the centre to the middle of the tube, metres.
    pub radius: f32,
    /// Radius of the tube, metres; less than `radius`.
    pub tube_radius: f32,
    /// Segments around the axis.
    #[serde(default = "default_count::<64>")]
    pub segments: usize,
    /// Segments around the tube.
    #[serde(default = "default_count::<32>")]
    pub tube_segments: usize,
}

/// `lathe`: a profile revolved about +Y.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Lathe {
    /// Points [radius, y], metres. Flat disks close the ends of an open profile.
    pub profile: Vec<[f32; 2]>,
    /// Joins the profile's last point to its first: a ring.
    #[serde(default)]
    pub closed: bool,
    /// Spline segments between two points of the profile; 1 is straight.
    #[serde(default = "default_count::<1>")]
    pub smooth: usize,
    /// Angle above which a corner is sharp, degrees.
    #[serde(default = "default_crease_deg")]
    pub crease_deg: f32,
    /// Segments around the axis.
    #[serde(default = "default_count::<64>")]
    pub segments: usize,
}

impl Shape for Sphere {
    fn mesh(&self) -> Result<Mesh, String> {
        let radius = positive("radius", self.radius)?;
        let segments = count("segments", self.segments, SEGMENT_RANGE)?;
        let rings = (segments / 2).max(2);
        let profile: Vec<_> = (0..=rings)
            .map(|ring| match ring {
                0 => DVec2::new(0.0, -radius),
                ring if ring == rings => DVec2::new(0.0, radius),
                ring => radius * DVec2::from_angle(PI * ring as f64 / rings as f64 - FRAC_PI_2),
            })
            .collect();
        revolve(&profile, false, 180.0, segments)
    }
}

impl Shape for Cylinder {
    fn mesh(&self) -> Result<Mesh, String> {
        let radius = positive("radius", self.radius)?;
        let height = positive("height", self.height)?;
        let bevel = from_zero_to("bevel", self.bevel, radius.min(0.5 * height))?;
        let segments = count("segments", self.segments, SEGMENT_RANGE)?;
        let mut profile = vec![DVec2::ZERO];
        if bevel > 0.0 {
            let arc = |center_y: f64, from: f64| {
                (0..=6).map(move |step| {
                    let angle = from + FRAC_PI_2 * f64::from(step) / 6.0;
                    DVec2::new(radius - bevel, center_y) + bevel * DVec2::from_angle(angle)
                })
            };
            profile.extend(arc(bevel, -FRAC_PI_2));
            profile.extend(arc(height - bevel, 0.0));
        } else {
            profile.extend([DVec2::new(radius, 0.0), DVec2::new(radius, height)]);
        }
        profile.push(DVec2::new(0.0, height));
        // Arcs meet up to rounding where the bevel takes all of the radius or height.
        profile.dedup_by(|next, kept| next.distance(*kept) < 1e-9 * radius);
        let last = profile.len() - 1;
        profile[last].x = 0.0;
        revolve(&profile, false, DEFAULT_CREASE_DEG, segments)
    }
}

impl Shape for Cone {
    fn mesh(&self) -> Result<Mesh, String> {
        let radius = positive("radius", self.radius)?;
        let top_radius = from_zero_to("top_radius", self.top_radius, f64::from(f32::MAX))?;
        let height = positive("height", self.height)?;
        let segments = count("segments", self.segments, SEGMENT_RANGE)?;
        let mut profile = vec![
            DVec2::ZERO,
            DVec2::new(radius, 0.0),
            DVec2::new(top_radius, height),
            DVec2::new(0.0, height),
        ];
        profile.dedup();
        revolve(&profile, false, DEFAULT_CREASE_DEG, segments)
    }
}

impl Shape for Torus {
    fn mesh(&self) -> Result<Mesh, String> {
        let radius = positive("radius", self.radius)?;
        let tube_radius = positive("tube_radius", self.tube_radius)?;
        if tube_radius >= radius {
            return Err(format!(
                "tube_radius: expected less than radius ({radius}), found {tube_radius}"
            ));
        }
        let segments = count("segments", self.segments, SEGMENT_RANGE)?;
        let tube_segments = count("tube_segments", self.tube_segments, SEGMENT_RANGE)?;
        let profile: Vec<_> = (0..tube_segments)
            .map(|step| {
                let angle = TAU * step as f64 / tube_segments as f64;
                DVec2::new(radius, 0.0) + tube_radius * DVec2::from_angle(angle)
            })
            .collect();
        revolve(&profile, true, 180.0, segments)
    }
}

impl Shape for Lathe {
    fn mesh(&self) -> Result<Mesh, String> {
        let needed = if self.closed { 3 } else { 2 };
        count("number of points in profile", self.profile.len(), needed..=MAX_POINTS)?;
        for point in &self.profile {
            finite("profile", point)?;
            if point[0] < 0.0 {
                return Err(format!("profile: expected radii of 0 or more, found {}", point[0]));
            }
        }
        let smooth = count("smooth", self.smooth, 1..=256)?;
        let segments = count("segments", self.segments, SEGMENT_RANGE)?;
        let crease_deg = from_zero_to("crease_deg", self.crease_deg, 180.0)?;
        let points: Vec<_> = self
            .profile
            .iter()
            .map(|&[radius, y]| DVec4::new(radius.into(), y.into(), 0.0, 0.0))
            .collect();
        let mut profile: Vec<_> = curve::smooth(&points, smooth, self.closed)
            .iter()
            .map(|point| DVec2::new(point.x.max(0.0), point.y))
            .collect();
        profile.dedup();
        if !self.closed {
            let (first, last) = (profile[0], profile[profile.len() - 1]);
            if first.x > 0.0 {
                profile.insert(0, DVec2::new(0.0, first.y));
            }
            if last.x > 0.0 {
                profile.push(DVec2::new(0.0, last.y));
            }
        }
        if profile.iter().all(|point| point.x == 0.0) || profile.len() < 3 {
            return Err("profile: expected points off the axis, found none".to_owned());
        }
        revolve(&profile, self.closed, crease_deg, segments)
    }
}

/// Revolves a profile of (radius, y), from bottom to top with the outside to the right, about +Y.
fn revolve(
    profile: &[DVec2],
    closed: bool,
    crease_deg: f64,
    segments: usize,
) -> Result<Mesh, String> {
    let mirrored = |from: DVec2, to: DVec2| {
        let along = to - from;
        // Across the axis, the profile continues as its mirror image.
        let normal = DVec2::new(along.y, -along.x).normalize_or_zero();
        Some(DVec2::new(-normal.x, normal.y))
    };
    let count = profile.len();
    let ends = [mirrored(profile[0], profile[1]), mirrored(profile[count - 2], profile[count - 1])];
    let turns: Vec<_> = (0..=segments)
        .map(|segment| {
            // Repeat the first column bit for bit in the last.
            let angle = TAU * (segment % segments) as f64 / segments as f64;
            DVec3::new(angle.cos(), 0.0, -angle.sin())
        })
        .collect();
    let mut builder = Builder::default();
    for chain in curve::chains(profile, closed, crease_deg, ends) {
        builder.patch(chain.len(), turns.len(), |row, column| {
            let (index, normal, along) = chain[row];
            let turn = |vector: DVec2| vector.x * turns[column] + vector.y * DVec3::Y;
            let uv = DVec2::new(column as f64 / segments as f64, along);
            Vertex { position: turn(profile[index]), normal: turn(normal), uv }
        });
    }
    builder.finish()
}
