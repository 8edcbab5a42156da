//! `[[lamp]]` and `[[portal]]`.

use serde::Deserialize;
use toml::Spanned;

use super::Entry;
use crate::lamp::SpotFalloff;

pub(crate) type LampEntry = Entry<LampKeys, LampKindEntry>;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LampKeys {
    /// Name, for messages.
    pub name: Option<String>,
    /// Kind.
    pub r#type: Spanned<String>,
    /// Group of its light, for `--aov LightGroups`. Default: lamps.
    pub light_group: Option<String>,
}

/// Keys of a `[[lamp]]` that depend on its `type`.
#[derive(Clone, Debug)]
pub(crate) enum LampKindEntry {
    Point(PointEntry),
    Spot(SpotEntry),
    /// `directional`.
    Directional(DirectionalEntry),
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PointEntry {
    /// Place, metres.
    pub position: [f32; 3],
    /// Radiant intensity per steradian.
    pub intensity: [f32; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SpotEntry {
    /// Place, metres.
    pub position: [f32; 3],
    /// Axis of the cone, away from the lamp, of any length.
    pub direction: [f32; 3],
    /// Radiant intensity along the axis, per steradian.
    pub intensity: [f32; 3],
    /// Angle to the axis where the light begins to fall off, degrees.
    #[serde(default)]
    pub inner_angle_deg: f32,
    /// Angle to the axis from which there is no light, degrees, above the inner one, at most 180.
    #[serde(default = "default_outer_angle_deg")]
    pub outer_angle_deg: f32,
    /// Course of the light between these angles.
    #[serde(default)]
    pub falloff: SpotFalloff,
}

fn default_outer_angle_deg() -> f32 {
    45.0
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DirectionalEntry {
    /// Direction in which the light travels, of any length.
    pub direction: [f32; 3],
    /// Irradiance on a surface that faces the light.
    pub irradiance: [f32; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PortalKeys {
    /// Name, for messages.
    pub name: Option<String>,
    /// One corner of the rectangle, metres.
    pub corner: [f32; 3],
    /// Edge from that corner, metres.
    pub first_edge: [f32; 3],
    /// Other edge from that corner, metres, perpendicular to the first.
    pub second_edge: [f32; 3],
}
