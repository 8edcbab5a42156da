//! A scene description of pbrt-v4 as a whole scene.

use super::{LoadOptions, Loader, MIN_ALPHA, default_material, light::Light};
use crate::{EnvironmentMap, Scene, error::Result, material::MaterialKind, pbrt};

impl Loader<'_> {
    /// Builds a scene from the description at the loader's path.
    pub(super) fn pbrt(&self, options: &LoadOptions) -> Result<Scene> {
        if let Some(name) = &options.camera {
            let message = "a pbrt file has one camera; the option is for glTF files";
            return Err(self.error(format!("--camera {name}: {message}")));
        }
        let mut contents = pbrt::read(self.path)?;
        let camera = self.camera(&contents.camera)?;
        self.check_film(&contents.film)?;
        self.check_extent("the scene", contents.geometry.extent())?;
        let mut warnings = contents.warnings;
        let mut environment = contents.environment;
        if let Some(map) = &options.environment {
            environment = EnvironmentMap::load(map, 1.0, 0.0, &mut warnings)?;
            contents.inputs.push(map.clone());
        }
        if let Some(rotation_deg) = options.rotation_deg {
            environment.rotation_rad = rotation_deg.rem_euclid(360.0).to_radians();
        }
        for material in &mut contents.materials {
            if let MaterialKind::Plastic { alpha, .. } | MaterialKind::Conductor { alpha, .. } =
                &mut material.kind
            {
                *alpha = alpha.clamp(MIN_ALPHA, 1.0);
            }
        }
        if contents.materials.is_empty() {
            contents.materials.push(default_material());
        }
        let is_dark = environment.is_black()
            && contents.lamps.is_empty()
            && contents.materials.iter().all(|material| material.surface.emission.is_none());
        if is_dark {
            warnings.push(format!("{}: no light: nothing is lit", self.path.display()));
        }
        let light = Light { environment, lamps: contents.lamps, portals: Vec::new() };
        let (film, geometry) = (contents.film, contents.geometry);
        let mut scene = self.scene(camera, film, light, contents.materials, geometry, warnings);
        scene.inputs = contents.inputs;
        Ok(scene)
    }
}
