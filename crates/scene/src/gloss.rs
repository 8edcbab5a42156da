//! A diffuse and a specular colour → metallic-roughness, by the formulas that Khronos publishes beside
//! `KHR_materials_pbrSpecularGlossiness`.

use glam::Vec3;

/// Reflectance at normal incidence of the dielectric of refractive index 1.5.
pub(crate) const DIELECTRIC: f32 = 0.04;
/// That index, which materials have that state none.
pub(crate) const DEFAULT_IOR: f32 = 1.5;
const TINY: f32 = 1e-6;

/// Base colour and share of metal that reflect as a diffuse and a specular colour do, of which the diffuse
/// one counts as far as the specular one leaves light.
pub(crate) fn metallic_roughness(diffuse: Vec3, specular: Vec3) -> (Vec3, f32) {
    let share_below = 1.0 - specular.max_element();
    let metallic = metallic(brightness(diffuse), brightness(specular), share_below);
    let of_diffuse = diffuse * (share_below / (1.0 - DIELECTRIC) / (1.0 - metallic).max(TINY));
    let of_specular = (specular - Vec3::splat(DIELECTRIC * (1.0 - metallic))) / metallic.max(TINY);
    let base = of_diffuse.lerp(of_specular, metallic * metallic);
    (base.clamp(Vec3::ZERO, Vec3::ONE), metallic)
}

/// Share of metal at which the one base colour has the brightness of both; the root of a parabola.
fn metallic(diffuse: f32, specular: f32, share_below: f32) -> f32 {
    if specular < DIELECTRIC {
        return 0.0;
    }
    let b = diffuse * share_below / (1.0 - DIELECTRIC) + specular - 2.0 * DIELECTRIC;
    let c = DIELECTRIC - specular;
    let discriminant = (b * b - 4.0 * DIELECTRIC * c).max(0.0);
    ((discriminant.sqrt() - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
}

fn brightness(color: Vec3) -> f32 {
    (color * color).dot(Vec3::new(0.299, 0.587, 0.114)).sqrt()
}
