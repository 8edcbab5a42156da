//! Reflection models: materials of the scene → [`MaterialTables`] for the device, and their values. The
//! sampling of `glsl/include/brdf.glsl` and `specular.glsl` has its twin in `tests/twin`.
//!
//! Directions are unit vectors in the shading frame (z is the normal) and point away from the
//! surface. Values are per steradian without the cosine, and 0 unless both directions are above the
//! surface. Mirrors, dielectrics and thin panes send light where no other sampling finds it: paths follow
//! them by `specular.glsl`, and their value here is 0.
//!
//! | kind | value | samples |
//! |---|---|---|
//! | diffuse | reflectance / π | cosine |
//! | sheet | reflectance / π, or from the other side transmittance / π, over the probability of the side | cosine |
//! | plastic | GGX coat, exact dielectric Fresnel, over ρ/π·T(θ_o)·T(θ_i), T² = (1−E)²/(1−Ē) | visible normals or cosine, by albedo |
//! | conductor | GGX, exact conductor Fresnel or Schlick's | visible normals |
//! | principled | GGX with Schlick's reflectance, over (1−metallic)·(1−F)·ρ/π | visible normals or cosine, by albedo |
//! | coated | GGX coat with Schlick's reflectance, over principled·T(θ_o)·T(θ_i) | visible normals of either or cosine, by albedo |
//! | sheen | Charlie's sheen, over principled·T(θ_o)·T(θ_i) | uniform, visible normals or cosine, by albedo |
//! | measured | trilinear on the half/difference grid, by the factor of a turn | tabulated half vectors or cosine |
//!
//! E(θ) is the directional albedo of the coat and Ē its cosine-weighted mean. Coat and base
//! together reflect exactly E + ρ(1 − E): reciprocal, and lossless for a white base (\[Kelemen &
//! Szirmay-Kalos 2001\]).
//!
//! References: \[Walter et al. 2007\], \[Heitz 2014\], \[Dupuy & Benyoub 2023\], \[Eto & Tokuyoshi
//! 2023\], \[Rusinkiewicz 1998\], \[Schlick 1994\], glTF 2.0 appendix B.

mod albedo;
pub mod fresnel;
pub mod ggx;
pub mod materials;
pub mod sanity;
pub mod sheen;
mod value;

use glam::Vec3;

pub use materials::MaterialTables;
pub use value::{brdf_evaluate, of_side};

/// Value of a material, 1/sr, without the cosine.
pub fn evaluate(
    tables: &MaterialTables,
    material_index: usize,
    outgoing_local: Vec3,
    incident_local: Vec3,
) -> Vec3 {
    brdf_evaluate(&tables.words, &tables.materials[material_index], outgoing_local, incident_local)
}
