//! The `principled` model → glTF's metallic-roughness material, or a rough dielectric.

use glam::Vec3;

use super::{Reader, bsdfs::colored, parameters::Parameters, spectra::Role};
use crate::{
    MIN_ALPHA,
    coat::{COAT_IOR, normal_reflectance, principled_base_factor},
    error::Result,
    features,
    import::{Value, Width},
    material::{Material, MaterialKind, Principled},
    math::colour::luminance,
};

/// Largest value of `anisotropic`, which Mitsuba does not limit: of widths as 1 to 1,000.
const MOST_ANISOTROPIC: f32 = 1.11;
/// Parameters without a counterpart, which change nothing at 0.
const WITHOUT_COUNTERPART: [&str; 3] = ["spec_tint", "sheen", "flatness"];

impl Reader {
    /// Names parameters that are left out, where they are not 0.
    pub(super) fn without_counterpart(
        &mut self,
        parameters: &Parameters<'_>,
        names: &[&str],
    ) -> Result<()> {
        for name in names {
            let value = self.value_or(parameters, name, Role::Index, 0.0)?;
            if !matches!(value, Value::Constant(Vec3::ZERO)) {
                let place = || parameters.node.place();
                self.ignored.add_named(features::MI_PRINCIPLED_REST, &format!("`{name}`"), place);
            }
        }
        Ok(())
    }

    pub(super) fn principled(&mut self, parameters: &Parameters<'_>) -> Result<Material> {
        let node = parameters.node;
        let mut number =
            |name: &str, default: f32| self.value_or(parameters, name, Role::Index, default);
        let (roughness, metallic) = (number("roughness", 0.5)?, number("metallic", 0.0)?);
        let (spec_trans, coat) = (number("spec_trans", 0.0)?, number("clearcoat", 0.0)?);
        // Mitsuba's coat has a quarter of the strength that it states, and an α of 0.1 to 0.001.
        let coat_weight = 0.25 * luminance(coat.mean()).clamp(0.0, 1.0);
        let gloss = luminance(number("clearcoat_gloss", 0.0)?.mean()).clamp(0.0, 1.0);
        let coat_roughness = (0.1 - gloss * (0.1 - MIN_ALPHA)).sqrt();
        let anisotropic = luminance(number("anisotropic", 0.0)?.mean());
        let anisotropic = anisotropic.clamp(0.0, MOST_ANISOTROPIC);
        self.without_counterpart(parameters, &WITHOUT_COUNTERPART)?;
        parameters.without_effect(
            "sheen_tint diffuse_reflectance_sampling_rate main_specular_sampling_rate \
             clearcoat_sampling_rate",
        );
        let base = self.value_or(parameters, "base_color", Role::Reflectance, 0.5)?;
        let ior = match (parameters.float_in("eta", (1.0, 4.0))?, parameters.float("specular")?) {
            (Some(eta), _) => eta,
            // Index whose reflectance at normal incidence is 0.08 times `specular`.
            (None, specular) => {
                let root = (0.08 * specular.unwrap_or(0.5).clamp(0.0, 1.0)).sqrt();
                (1.0 + root) / (1.0 - root)
            }
        };
        let is_metal = matches!(&metallic, Value::Constant(share) if share.x >= 0.5);
        let share = match &spec_trans {
            Value::Constant(share) => share.x,
            Value::Image(_) | Value::Vertices(_) => 0.5,
        };
        let is_whole = matches!(&metallic, Value::Constant(Vec3::ZERO)) && share == 1.0;
        if share > 0.0 && !is_whole {
            self.ignored.add(features::MI_SPEC_TRANS, || node.place());
        }
        if share >= 0.5 && !is_metal {
            // The model's transmission is the root of the colour, since light goes in and out.
            let color = self.without_texture(Some(base), node, features::MI_SPECULAR_TEXTURE);
            let transmittance = color.map_or(Vec3::ONE, |color| color.map(f32::sqrt));
            let (roughness, texture) = roughness.split();
            let alpha = (roughness.x * roughness.x).clamp(MIN_ALPHA, 1.0);
            let reflectance = Vec3::ONE;
            let absorption = Vec3::ZERO;
            let kind =
                MaterialKind::Dielectric { ior, alpha, reflectance, transmittance, absorption };
            let mut model = Material::new("", kind);
            model.surface.roughness = texture;
            return Ok(model);
        }
        // The base of metal reflects alike in both.
        let diffuse_share = 1.0 - luminance(metallic.mean()).clamp(0.0, 1.0);
        let factor = principled_base_factor(luminance(roughness.mean()), normal_reflectance(ior));
        let factor = 1.0 + diffuse_share * (factor - 1.0);
        let base = base.mapped(|albedo| (factor * albedo).clamp(0.0, 1.0));
        let (metallic, metallic_texture) = metallic.split();
        let mean_roughness = luminance(roughness.mean());
        let Width { alpha, anisotropy, .. } = Width::stretched(mean_roughness, anisotropic);
        let (mut roughness, roughness_texture) = roughness.split();
        if anisotropy.strength > 0.0 && mean_roughness > 0.0 {
            roughness.x *= alpha.sqrt() / mean_roughness;
        }
        // An index of 1 has no reflection at all, which the factor says better.
        let (ior, specular) = if ior < COAT_IOR.0 { (1.5, 0.0) } else { (ior, 1.0) };
        let mut model = colored(base, |base_color| {
            MaterialKind::Principled(Principled {
                base_color,
                metallic: metallic.x.clamp(0.0, 1.0),
                roughness: roughness.x.clamp(0.0, 1.0),
                ior,
                specular,
                coat_weight,
                coat_roughness,
                ..Principled::default()
            })
        });
        model.surface.metallic = metallic_texture;
        model.surface.roughness = roughness_texture;
        model.surface.anisotropy = anisotropy;
        Ok(model)
    }
}
