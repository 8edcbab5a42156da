//! Media inside shapes → absorption of dielectrics.

use glam::Vec3;

use super::{
    Reader,
    document::Node,
    parameters::Parameters,
    spectra::{self, Role},
};
use crate::{error::Result, features, material::MaterialKind};

impl Reader {
    /// Lets a dielectric absorb as the medium inside it does; names a medium that scatters, or that
    /// another surface bounds.
    pub(super) fn fill(&mut self, kind: &mut MaterialKind, medium: Node<'_>) -> Result<()> {
        match (kind, self.absorption(medium)?) {
            (MaterialKind::Dielectric { absorption, .. }, Some(found)) => *absorption = found,
            _ => self.ignored.add(features::MI_MEDIUM, || medium.place()),
        }
        Ok(())
    }

    /// Absorption coefficient, per metre, of a medium that scatters no light.
    fn absorption(&mut self, medium: Node<'_>) -> Result<Option<Vec3>> {
        if medium.kind() != "homogeneous" {
            return Ok(None);
        }
        let parameters = Parameters::new(medium);
        let color = |name: &str| spectra::parameter(&parameters, name, Role::Index);
        // Mitsuba 0.6 names absorption and scattering, Mitsuba 3 their sum and the share of scattering.
        let (absorption, scattered) = match color("sigma_a")? {
            Some(absorption) => (absorption, color("sigma_s")?.unwrap_or(Vec3::ZERO)),
            None => {
                let albedo = color("albedo")?.unwrap_or(Vec3::splat(0.75));
                (color("sigma_t")?.unwrap_or(Vec3::ONE), albedo)
            }
        };
        let scale = parameters.float_in("scale", (0.0, 1e6))?.unwrap_or(1.0);
        if scattered != Vec3::ZERO {
            return Ok(None);
        }
        parameters.objects("phase")?;
        parameters.without_effect("sample_emitters");
        parameters.finish(&mut self.ignored);
        Ok(Some((scale * absorption).clamp(Vec3::ZERO, Vec3::splat(1e6))))
    }
}
