//! Media inside shapes → absorption of dielectrics.

use glam::Vec3;

use super::{materials::Materials, parameters::Entity, spectra, tokens::Place};
use crate::{error::Result, features, material::MaterialKind};

impl Materials<'_> {
    /// Lets a dielectric absorb as the medium inside it does; names a medium that does more, or that
    /// another surface bounds.
    pub(super) fn fill(
        &mut self,
        kind: Option<&mut MaterialKind>,
        medium: &str,
        place: &Place,
    ) -> Result<()> {
        let Some(entity) = self.description.media.get(medium) else {
            let message = format!("MediumInterface \"{medium}\": there is no such medium");
            return Err(place.error(message));
        };
        match (kind, self.absorption(entity)?) {
            (Some(MaterialKind::Dielectric { absorption, .. }), Some(found)) => {
                *absorption = found;
                self.textures.log.unused(entity);
            }
            _ => self.textures.log.ignore(features::PBRT_MEDIUM, &entity.place),
        }
        Ok(())
    }

    /// Absorption coefficient, per metre, of a medium that neither scatters nor emits light.
    fn absorption(&self, medium: &Entity) -> Result<Option<Vec3>> {
        let color = |name: &str| match medium.find_of(name, &spectra::KINDS)? {
            Some(parameter) => spectra::index(parameter, self.textures.folder),
            None => Ok(Vec3::ONE),
        };
        let is_clear = medium.string("type")? == Some("homogeneous")
            && color("sigma_s")? == Vec3::ZERO
            && ["preset", "Le"].iter().all(|name| medium.find(name).is_none());
        let scale = medium.number("scale", 1.0)? as f32;
        let absorption = (scale * color("sigma_a")?).clamp(Vec3::ZERO, Vec3::splat(1e6));
        medium.find("g");
        Ok(is_clear.then_some(absorption))
    }
}
