//! Files of other formats as scenes, with the options of the command line.

use glam::Vec3;

use super::{Loader, default_material, whole};
use crate::{
    EnvironmentMap, Scene, beside::Folder, error::Result, files, import::Imported, mitsuba, pbrt,
};

impl Loader<'_> {
    /// Reads the file at the loader's path by its extension; none for a format that is no whole scene.
    pub(super) fn import(&self) -> Result<Option<Imported>> {
        let camera = self.options.camera.as_deref();
        let folder = || Folder::of(self.path).allowing(self.options.allow_root.as_deref());
        let mut imported = if files::extension(self.path) == "xml" {
            mitsuba::read(self.path, camera, folder())?
        } else if pbrt::is_pbrt(self.path) {
            if let Some(name) = camera {
                let message = "a pbrt file has one camera; the option is for glTF files";
                return Err(self.error(format!("--camera {name}: {message}")));
            }
            pbrt::read(self.path, folder())?
        } else if whole::is_whole(self.path) {
            self.whole()?
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
    pub(super) fn imported(&self, imported: Imported) -> Result<Scene> {
        let Imported { asked, lamps, materials, geometry, variants, inputs, mut warnings, .. } =
            imported;
        let camera = match imported.camera {
            Some(camera) => camera,
            None => self.frame(&geometry, &mut warnings)?,
        };
        let empty = self.scene(&camera, imported.film)?;
        let mut scene =
            Scene { asked, lamps, materials, geometry, variants, inputs, warnings, ..empty };
        scene.environment = match (&self.options.environment, imported.environment) {
            (Some(map), _) => {
                scene.inputs.push(map.clone());
                EnvironmentMap::load(map, 1.0, &mut scene.warnings)?
            }
            (None, Some(environment)) => environment,
            (None, None) => {
                scene.warnings.push(format!(
                    "{}: no --environment; lit by white light of radiance 1 from everywhere",
                    self.path.display()
                ));
                self.uniform_light(Vec3::ONE)?
            }
        };
        if let Some(rotation_deg) = self.options.rotation_deg {
            scene.environment = scene.environment.turned(rotation_deg);
        }
        Ok(self.finished(scene))
    }
}
