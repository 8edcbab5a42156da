//! Lights without a surface.

use glam::Vec3;
use serde::Deserialize;

/// Light without a surface, which no ray can meet. Lamps with a surface are materials with an
/// [`Emission`](crate::material::Emission).
#[derive(Clone, Debug, PartialEq)]
pub struct Lamp {
    /// Name in the file; may be empty.
    pub name: String,
    /// Kind and its numbers.
    pub kind: LampKind,
    /// Group of its light, as in [`LightGroups`](crate::light_group::LightGroups); none for `lamps`.
    pub light_group: Option<String>,
}

/// Kind of a [`Lamp`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LampKind {
    /// Shines from a point into all directions.
    Point {
        /// Place, metres.
        position: Vec3,
        /// Radiant intensity per steradian, linear Rec.709.
        intensity: Vec3,
    },
    /// Shines from a point into a cone.
    Spot(Spot),
    /// Shines from infinitely far away along one direction.
    Directional {
        /// Unit direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a surface that faces the light, linear Rec.709.
        irradiance: Vec3,
    },
}

/// Light from a point into a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Place, metres.
    pub position: Vec3,
    /// Unit axis of the cone, away from the lamp.
    pub direction: Vec3,
    /// Radiant intensity along the axis, per steradian, linear Rec.709.
    pub intensity: Vec3,
    /// Angle to the axis where the light begins to fall off, radians.
    pub inner_angle_rad: f32,
    /// Angle to the axis from which there is no light, radians, above the inner one.
    pub outer_angle_rad: f32,
    /// Course of the light between these angles.
    pub falloff: SpotFalloff,
}

/// Course of a spot's light between its two angles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpotFalloff {
    /// t², t linear in the cosine: `KHR_lights_punctual`.
    #[default]
    SquaredCosine,
    /// 3t² − 2t³, t linear in the cosine: pbrt-v4.
    SmoothCosine,
    /// t, linear in the angle: Mitsuba 3.
    LinearAngle,
}
