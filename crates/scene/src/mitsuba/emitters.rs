//! Lights: lamps, the environment, and the emission of shapes.

use glam::{DVec3, Vec3};

use super::{
    Reader,
    document::Node,
    environment,
    parameters::Parameters,
    spectra::{self, Role},
    textures::Value,
    transforms::turned,
};
use crate::{
    EnvironmentMap, Lamp,
    error::Result,
    features,
    lamp::{LampKind, Spot, SpotFalloff},
    material::Emission,
};

impl Reader {
    /// Reads an emitter that belongs to no shape.
    pub(super) fn emitter(&mut self, node: Node<'_>) -> Result<()> {
        let parameters = Parameters::new(node);
        let map = match node.kind() {
            "constant" => {
                let map = EnvironmentMap::constant(light(&parameters, "radiance")?, 1.0);
                Some(map.map_err(|message| node.error(message))?)
            }
            "envmap" => Some(self.environment_map(&parameters)?),
            "sunsky" | "sky" | "sun" => Some(self.daylight(&parameters)?),
            _ => None,
        };
        let kind = match node.kind() {
            _ if map.is_some() => None,
            "point" => Some(point(&parameters)?),
            "spot" => Some(self.spot(&parameters)?),
            "directional" | "distant" => Some(directional(&parameters)?),
            // Shapes that refer to it read it.
            "area" if node.attribute("id").is_some() => return Ok(()),
            "area" => return Err(node.error("an area light must stand in a shape")),
            found => {
                let name = format!("emitter `{found}`");
                self.ignored.add_named(features::MI_EMITTER, &name, || node.place());
                return Ok(());
            }
        };
        parameters.without_effect("sampling_weight");
        parameters.finish(&mut self.ignored);
        if let Some(kind) = kind {
            let name = node.attribute("id").unwrap_or_default().to_owned();
            self.lamps.push(Lamp { name, kind, light_group: None });
        }
        if map.is_some() && std::mem::replace(&mut self.environment, map).is_some() {
            return Err(node.error("expected at most one envmap or constant, found another"));
        }
        Ok(())
    }

    fn environment_map(&mut self, parameters: &Parameters<'_>) -> Result<EnvironmentMap> {
        let node = parameters.node;
        let name = parameters.required("filename", parameters.string("filename")?)?;
        let path = node.file(name)?;
        let scale = parameters.float_in("scale", (0.0, f32::MAX))?.unwrap_or(1.0);
        let matrix = parameters.transform("to_world")?;
        parameters.without_effect("mis_compensation cache gamma");
        let map = environment::load(&path, scale, matrix, &mut self.warnings)?;
        self.inputs.push(path);
        map.ok_or_else(|| {
            node.error("to_world: expected a rotation, found a matrix without inverse")
        })
    }

    fn spot(&mut self, parameters: &Parameters<'_>) -> Result<LampKind> {
        let node = parameters.node;
        let matrix = parameters.transform("to_world")?;
        let outer = parameters.float_in("cutoff_angle", (0.01, 179.0))?.unwrap_or(20.0);
        let inner = parameters.float_in("beam_width", (0.0, 179.0))?.unwrap_or(0.75 * outer);
        let texture = self.value(parameters, "texture", Role::Reflectance)?;
        if matches!(texture, Some(Value::Texture(_))) {
            self.ignored.add(features::MI_SPOT_TEXTURE, || node.place());
        }
        let factor = texture.map_or(Vec3::ONE, |texture| texture.mean());
        Ok(LampKind::Spot(Spot {
            position: matrix.w_axis.truncate().as_vec3(),
            direction: turned(node, matrix, DVec3::Z)?.as_vec3(),
            intensity: light(parameters, "intensity")? * factor,
            // A sharp edge is a steep one.
            inner_angle_rad: inner.min(0.999 * outer).to_radians(),
            outer_angle_rad: outer.to_radians(),
            falloff: SpotFalloff::LinearAngle,
        }))
    }

    /// Reads the light of a shape; none if it has none.
    pub(super) fn emission(&mut self, node: Node<'_>) -> Result<Emission> {
        if node.kind() != "area" {
            let found = node.kind();
            let message = format!("the emitter `{found}` cannot stand in a shape; expected area");
            return Err(node.error(message));
        }
        let parameters = Parameters::new(node);
        let value = self.value_or(&parameters, "radiance", Role::Light, 1.0)?;
        parameters.without_effect("sampling_weight");
        parameters.finish(&mut self.ignored);
        if value.is_of_vertices() {
            return Err(node.error("radiance: expected a colour or a bitmap, found vertex colours"));
        }
        let (radiance, texture) = value.split();
        Ok(Emission { radiance, texture, two_sided: false })
    }
}

fn light(parameters: &Parameters<'_>, name: &str) -> Result<Vec3> {
    Ok(spectra::parameter(parameters, name, Role::Light)?.unwrap_or(Vec3::ONE))
}

fn point(parameters: &Parameters<'_>) -> Result<LampKind> {
    let position = match parameters.vector("position")? {
        Some(position) => position,
        None => parameters.transform("to_world")?.w_axis.truncate().as_vec3(),
    };
    Ok(LampKind::Point { position, intensity: light(parameters, "intensity")? })
}

fn directional(parameters: &Parameters<'_>) -> Result<LampKind> {
    let node = parameters.node;
    let direction = match parameters.vector("direction")? {
        Some(direction) => direction
            .try_normalize()
            .ok_or_else(|| node.error("direction: expected a vector other than 0, found 0 0 0"))?,
        None => turned(node, parameters.transform("to_world")?, DVec3::Z)?.as_vec3(),
    };
    Ok(LampKind::Directional { direction, irradiance: light(parameters, "irradiance")? })
}
