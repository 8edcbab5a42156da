//! `KHR_lights_punctual`: lights of nodes → lamps.
//!
//! Candela and lux count as radiant intensity and irradiance, channel by channel.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::{Mat4, Vec3};
use gltf::Node;

use super::{
    GltfReader, index,
    material::{number, vector},
};
use crate::{
    error::Result,
    features,
    lamp::{Lamp, LampKind, Spot, SpotFalloff},
    mesh::label,
};

/// Smallest angle from the axis of a spot to its edge.
const SMALLEST_CONE_RAD: f32 = 1e-3;

impl GltfReader<'_> {
    /// Adds the light of a node, which shines along −Z.
    pub(super) fn read_lamp(&mut self, node: &Node, world_from_node: Mat4) -> Result<()> {
        let json = self.json;
        let found = &json["nodes"][node.index()]["extensions"]["KHR_lights_punctual"]["light"];
        if found.is_null() {
            return Ok(());
        }
        let place = || label("node", node.index(), node.name());
        let lights = &json["extensions"]["KHR_lights_punctual"]["lights"];
        let light = index(found).and_then(|at| lights.get(at));
        let error = |message: String| self.error(format!("{}: {message}", place()));
        let light = light.ok_or_else(|| error(format!("the file has no light {found}")))?;
        let color = Vec3::from_array(vector(light, "color", [1.0; 3]));
        let intensity = color * number(light, "intensity", 1.0);
        if !intensity.is_finite() || intensity.min_element() < 0.0 {
            let expected = "expected a light of finite colour and intensity from 0";
            return Err(error(format!("{expected}, found {intensity}")));
        }
        let position = world_from_node.w_axis.truncate();
        let direction = world_from_node.transform_vector3(Vec3::NEG_Z).normalize_or(Vec3::NEG_Z);
        let kind = match light["type"].as_str() {
            Some("point") => LampKind::Point { position, intensity },
            Some("spot") => {
                let stated = number(&light["spot"], "outerConeAngle", FRAC_PI_4);
                let outer = stated.clamp(SMALLEST_CONE_RAD, FRAC_PI_2);
                let inner = number(&light["spot"], "innerConeAngle", 0.0);
                if !(0.0..=outer).contains(&inner) || (stated - outer).abs() > 1e-6 {
                    let name = "angles of spots out of order or beyond π/2";
                    self.ignored.add_named(features::GLTF_LIGHT_TYPE, name, place);
                }
                LampKind::Spot(Spot {
                    position,
                    direction,
                    intensity,
                    // Exporters write both alike for a sharp edge, which is a steep one.
                    inner_angle_rad: inner.clamp(0.0, 0.999 * outer),
                    outer_angle_rad: outer,
                    falloff: SpotFalloff::SquaredCosine,
                })
            }
            Some("directional") => LampKind::Directional { direction, irradiance: intensity },
            _ => {
                let name = format!("lights of type {}", light["type"]);
                self.ignored.add_named(features::GLTF_LIGHT_TYPE, &name, place);
                return Ok(());
            }
        };
        if !light["range"].is_null() && !matches!(kind, LampKind::Directional { .. }) {
            self.ignored.add(features::GLTF_LIGHT_RANGE, place);
        }
        let name = light["name"].as_str().or(node.name()).unwrap_or_default().to_owned();
        self.mesh.lamps.push(Lamp { name, kind, light_group: None });
        Ok(())
    }
}
