//! Files of other formats as scenes, with the options of the command line.

use glam::Vec3;

use super::{LoadOptions, Loader, default_material, light::Light, viewed, whole};
use crate::{
    EnvironmentMap, Scene, beside::Folder, error::Result, files, import::Imported, mitsuba, pbrt,
};

impl Loader<'_> {
    /// Reads the file at the loader's path by its extension, with the camera that is named; `None` for a
    /// format that cannot be a whole scene.
    pub(super) fn import(&self, camera: Option<&str>) -> Result<Option<Imported>> {
        let mut imported = if files::extension(self.path) == "xml" {
            mitsuba::read(self.path, camera, Folder::of(self.path).allowing(self.allowed))?
        } else if pbrt::is_pbrt(self.path) {
            if let Some(name) = camera {
                let message = "a pbrt file has one camera; the option is for glTF files";
                return Err(self.error(format!("--camera {name}: {message}")));
            }
            pbrt::read(self.path, Folder::of(self.path).allowing(self.allowed))?
        } else if whole::is_whole(self.path) {
            self.whole(camera)?
        } else {
            return Ok(None);
        };
        self.check_extent("the scene", imported.geometry.extent())?;
        if imported.materials.is_empty() {
            imported.materials.push(default_material());
        }
        Ok(Some(imported))
    }

    /// Makes a scene of an imported file. The map of `--environment` replaces its own; a format without
    /// one is lit by white.
    pub(super) fn imported(&self, imported: Imported, options: &LoadOptions) -> Result<Scene> {
        let Imported { film, asked, lamps, materials, geometry, variants, .. } = imported;
        let (mut inputs, mut warnings) = (imported.inputs, imported.warnings);
        let camera = self.camera(&viewed(&imported.camera, options))?;
        self.check_film(&film)?;
        let mut environment = match (&options.environment, imported.environment) {
            (Some(map), _) => {
                inputs.push(map.clone());
                EnvironmentMap::load(map, 1.0, 0.0, &mut warnings)?
            }
            (None, Some(environment)) => environment,
            (None, None) => {
                warnings.push(format!(
                    "{}: no --environment; lit by white light of radiance 1 from everywhere",
                    self.path.display()
                ));
                EnvironmentMap::constant(Vec3::ONE, 1.0).map_err(|message| self.error(message))?
            }
        };
        if let Some(rotation_deg) = options.rotation_deg {
            environment.rotation_rad = rotation_deg.rem_euclid(360.0).to_radians();
        }
        let light = Light { environment, lamps, portals: Vec::new() };
        let mut scene = self.scene(camera, film, light, materials, geometry, warnings);
        scene.inputs = inputs;
        scene.asked = asked;
        scene.variants = variants;
        Ok(scene)
    }
}
