//! A Mitsuba file as a scene, with the options of the command line.

use std::path::Path;

use super::{LoadOptions, Loader, light::Light};
use crate::{EnvironmentMap, Scene, error::Result, files, mitsuba};

impl Loader<'_> {
    /// Builds a scene from the Mitsuba file at the loader's path.
    pub(super) fn mitsuba(&self, options: &LoadOptions) -> Result<Scene> {
        let mitsuba::Parts {
            camera,
            film,
            mut environment,
            lamps,
            materials,
            geometry,
            inputs,
            mut warnings,
        } = mitsuba::read(self.path, options.camera.as_deref())?;
        if let Some(map) = &options.environment {
            let rotation_deg = options.rotation_deg.unwrap_or(0.0);
            environment = EnvironmentMap::load(map, 1.0, rotation_deg, &mut warnings)?;
        } else if let Some(rotation_deg) = options.rotation_deg {
            environment.rotation_rad = rotation_deg.rem_euclid(360.0).to_radians();
        }
        let light = Light { environment, lamps, portals: Vec::new() };
        let mut scene = self.scene(camera, film, light, materials, geometry, warnings);
        scene.inputs = inputs;
        scene.inputs.extend(options.environment.clone());
        Ok(scene)
    }
}

/// Checks that a file is one that [`Loader::mitsuba`] reads.
pub(super) fn is_mitsuba(path: &Path) -> bool {
    files::extension(path) == "xml"
}
