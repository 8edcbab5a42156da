//! Densities, samples and albedos of `glsl/include/brdf.glsl`, in the same order and the same f32
//! arithmetic, to be read line by line against the shader. The values are those of the renderer.

use std::f32::consts::PI;

use fenestra::{
    brdf::{MaterialTables, brdf_evaluate, ggx::*, of_side, sheen::sample_uniform_hemisphere},
    math::colour::luminance,
    scene::measured::lookup::{
        cosine_table, half_difference_angles, measured_pdf, measured_sample, mix,
        sample_cosine_hemisphere,
    },
    shader::{constants::*, structs::Material},
};
use glam::{Vec2, Vec3, vec2, vec3};

use super::specular::{fresnel_interface, pane_reflectance, pane_transmittance};

/// Value of a material (1/sr, without the cosine) and density of [`sample`], which integrates to 1 less
/// the share of samples below the surface.
pub fn evaluate_and_pdf(
    tables: &MaterialTables,
    material_index: usize,
    outgoing_local: Vec3,
    incident_local: Vec3,
) -> (Vec3, f32) {
    let material = &tables.materials[material_index];
    brdf_evaluate_and_pdf(&tables.words, material, outgoing_local, incident_local)
}

/// Samples an incident direction with three numbers in [0, 1); z ≤ 0 means no sample.
pub fn sample(
    tables: &MaterialTables,
    material_index: usize,
    outgoing_local: Vec3,
    u: Vec3,
) -> Vec3 {
    brdf_sample(&tables.words, &tables.materials[material_index], outgoing_local, u)
}

/// Share of light from a uniform white hemisphere reflected toward the outgoing direction.
pub fn albedo(tables: &MaterialTables, material_index: usize, outgoing_local: Vec3) -> Vec3 {
    brdf_albedo(&tables.words, &tables.materials[material_index], outgoing_local)
}

/// GLSL's `mix` of vectors.
fn mix_vec3(a: Vec3, b: Vec3, fraction: f32) -> Vec3 {
    a * (1.0 - fraction) + b * fraction
}

/// Directional albedo of a GGX surface with Schlick's reflectance: factors of the reflectance at
/// normal and at grazing incidence. Linear in roughness and cosine between the nodes of the table that
/// all such materials share.
fn ggx_schlick_albedo(brdf_table: &[u32], table_offset: u32, alpha: f32, cosine: f32) -> Vec2 {
    let position = alpha.sqrt().clamp(0.0, 1.0) * GGX_ROUGHNESS_INTERVALS as f32;
    let row = (position as u32).min(GGX_ROUGHNESS_INTERVALS - 1);
    let fraction = position - row as f32;
    let lower = table_offset + row * GGX_ROUGHNESS_WORDS;
    let upper = lower + GGX_ROUGHNESS_WORDS;
    let table = |offset| cosine_table(brdf_table, offset, 2, cosine);
    vec2(
        mix(table(lower), table(upper), fraction),
        mix(table(lower + 1), table(upper + 1), fraction),
    )
}

/// Light of a uniform white hemisphere that each part of a principled material reflects.
struct PrincipledAlbedo {
    specular: Vec3,
    diffuse: Vec3,
}

fn principled_albedo(brdf_table: &[u32], material: &Material, cosine: f32) -> PrincipledAlbedo {
    let metallic = material.ior;
    let (reflectance, k) = (Vec3::from(material.reflectance), Vec3::from(material.k));
    let eta = Vec3::from(material.eta);
    let offset = material.table_offset;
    let specular = ggx_schlick_albedo(brdf_table, offset, material.alpha, cosine);
    let rise = cosine_table(brdf_table, offset + DIFFUSE_RISE_OFFSET, 1, cosine);
    let dielectric = mix_vec3(eta, k, rise);
    let strongest = dielectric.max_element();
    PrincipledAlbedo {
        specular: mix_vec3(eta, reflectance, metallic) * specular.x
            + mix_vec3(k, Vec3::ONE, metallic) * specular.y,
        diffuse: (1.0 - metallic) * (1.0 - strongest) * reflectance,
    }
}

/// Probability of sampling the specular part of a principled material.
fn principled_specular_share(brdf_table: &[u32], material: &Material, cosine: f32) -> f32 {
    let albedo = principled_albedo(brdf_table, material, cosine);
    let specular = luminance(albedo.specular);
    let sum = specular + luminance(albedo.diffuse);
    if sum > 0.0 { specular / sum } else { 0.5 }
}

/// Light of a uniform white hemisphere that what covers a principled material reflects.
fn cover_albedo(brdf_table: &[u32], material: &Material, cosine: f32) -> Vec3 {
    let cover = Vec3::from(material.cover);
    cosine_table(brdf_table, material.cover_table, 1, cosine) / cover.max_element() * cover
}

/// Probability of sampling what covers a principled material.
fn cover_share(brdf_table: &[u32], material: &Material, cosine: f32) -> f32 {
    let albedo = principled_albedo(brdf_table, material, cosine);
    let covering = cover_albedo(brdf_table, material, cosine);
    let base = (1.0 - covering.max_element()) * luminance(albedo.specular + albedo.diffuse);
    luminance(covering) / (luminance(covering) + base)
}

/// Value (1/sr, without the cosine) and density of [`brdf_sample`] at one pair of directions.
///
/// # Panics
/// The material is of an unknown kind.
pub fn brdf_evaluate_and_pdf(
    brdf_table: &[u32],
    material: &Material,
    outgoing_local: Vec3,
    incident_local: Vec3,
) -> (Vec3, f32) {
    let value = brdf_evaluate(brdf_table, material, outgoing_local, incident_local);
    let (_, outgoing_local) = of_side(material, outgoing_local);
    if outgoing_local.z <= 0.0 || incident_local.z <= 0.0 {
        return (value, 0.0);
    }
    let offset = material.table_offset;
    let cosine_pdf = incident_local.z / PI;
    let half_vector = outgoing_local + incident_local;
    let specular_pdf = || ggx_pdf(half_vector, outgoing_local, GgxWidth::of(material));
    let pdf = match material.kind {
        MATERIAL_DIFFUSE | MATERIAL_DIFFUSE_TRANSMISSION => cosine_pdf,
        MATERIAL_MEASURED => {
            let theta_half = half_difference_angles(outgoing_local, incident_local).x;
            measured_pdf(brdf_table, offset, outgoing_local, incident_local, theta_half)
        }
        MATERIAL_PLASTIC | MATERIAL_PRINCIPLED | MATERIAL_COATED | MATERIAL_SHEEN => {
            let share = specular_share(brdf_table, material, outgoing_local.z);
            mix(cosine_pdf, specular_pdf(), share)
        }
        MATERIAL_CONDUCTOR => specular_pdf(),
        _ => 0.0,
    };
    let cover_pdf = match material.kind {
        MATERIAL_COATED => {
            ggx_pdf(half_vector, outgoing_local, GgxWidth::round(material.cover_alpha))
        }
        MATERIAL_SHEEN => 0.5 / PI,
        _ => return (value, pdf),
    };
    (value, mix(pdf, cover_pdf, cover_share(brdf_table, material, outgoing_local.z)))
}

/// Probability of sampling the specular part of a material that has another.
fn specular_share(brdf_table: &[u32], material: &Material, cosine: f32) -> f32 {
    if matches!(material.kind, MATERIAL_PRINCIPLED | MATERIAL_COATED | MATERIAL_SHEEN) {
        return principled_specular_share(brdf_table, material, cosine);
    }
    let offset = material.table_offset + PLASTIC_SPECULAR_SHARE_OFFSET;
    cosine_table(brdf_table, offset, 1, cosine)
}

/// Samples an incident direction with three numbers in [0, 1); z ≤ 0 means no sample, which counts
/// as one with contribution 0.
///
/// # Panics
/// The material is of an unknown kind.
pub fn brdf_sample(brdf_table: &[u32], material: &Material, outgoing_local: Vec3, u: Vec3) -> Vec3 {
    let (_, outgoing_local) = of_side(material, outgoing_local);
    if outgoing_local.z <= 0.0 {
        return vec3(0.0, 0.0, -1.0);
    }
    let mut specular_share = match material.kind {
        MATERIAL_MEASURED => {
            return measured_sample(brdf_table, material.table_offset, outgoing_local, u);
        }
        MATERIAL_MIRROR | MATERIAL_DIELECTRIC | MATERIAL_THIN_DIELECTRIC | MATERIAL_ROUGH_PANE => {
            return vec3(0.0, 0.0, -1.0);
        }
        MATERIAL_DIFFUSE | MATERIAL_DIFFUSE_TRANSMISSION => 0.0,
        MATERIAL_CONDUCTOR => 1.0,
        MATERIAL_PLASTIC | MATERIAL_PRINCIPLED | MATERIAL_COATED | MATERIAL_SHEEN => {
            specular_share(brdf_table, material, outgoing_local.z)
        }
        kind => panic!("material of the unknown kind {kind}"),
    };
    if matches!(material.kind, MATERIAL_COATED | MATERIAL_SHEEN) {
        let cover_share = cover_share(brdf_table, material, outgoing_local.z);
        if u.x < cover_share && material.kind == MATERIAL_SHEEN {
            return sample_uniform_hemisphere(vec2(u.y, u.z));
        }
        if u.x < cover_share {
            let width = GgxWidth::round(material.cover_alpha);
            return ggx_sample(outgoing_local, width, vec2(u.y, u.z));
        }
        specular_share = mix(specular_share, 1.0, cover_share);
    }
    if u.x < specular_share {
        return ggx_sample(outgoing_local, GgxWidth::of(material), vec2(u.y, u.z));
    }
    sample_cosine_hemisphere(vec2(u.y, u.z))
}

/// Share of light from a uniform white hemisphere reflected toward the outgoing direction, 0…1, for
/// the albedo image. Dielectrics, panes and sheets count transmitted light too, the first seen from outside
/// and as if smooth.
///
/// # Panics
/// The material is of an unknown kind.
pub fn brdf_albedo(brdf_table: &[u32], material: &Material, outgoing_local: Vec3) -> Vec3 {
    let reflectance = Vec3::from(material.reflectance);
    let cosine = outgoing_local.z;
    let offset = material.table_offset;
    match material.kind {
        MATERIAL_DIFFUSE | MATERIAL_MIRROR => reflectance,
        MATERIAL_DIFFUSE_TRANSMISSION => {
            reflectance * mix_vec3(material.eta.into(), material.k.into(), material.ior)
        }
        MATERIAL_PLASTIC => {
            let coat = cosine_table(brdf_table, offset, 1, cosine);
            Vec3::splat(coat) + (1.0 - coat) * reflectance
        }
        MATERIAL_PRINCIPLED | MATERIAL_COATED | MATERIAL_SHEEN => {
            let mut albedo = principled_albedo(brdf_table, material, cosine);
            if material.kind != MATERIAL_PRINCIPLED {
                let covering = cover_albedo(brdf_table, material, cosine);
                let rest = 1.0 - covering.max_element();
                let table = material.cover_table + COAT_TRANSMISSION_OFFSET;
                let transmission = cosine_table(brdf_table, table, 1, cosine);
                let spread = material.alpha / (material.alpha + 0.05);
                albedo.specular *= mix(transmission * transmission, rest, spread);
                albedo.specular += covering;
                albedo.diffuse *= rest;
            }
            (albedo.specular + albedo.diffuse).min(Vec3::ONE)
        }
        MATERIAL_CONDUCTOR if material.ior == 0.0 => {
            let shares = ggx_schlick_albedo(brdf_table, offset, material.alpha, cosine);
            reflectance * shares.x + Vec3::splat(shares.y)
        }
        MATERIAL_DIELECTRIC => {
            let fresnel = fresnel_interface(cosine.abs(), material.ior);
            mix_vec3(material.eta.into(), reflectance, fresnel)
        }
        MATERIAL_THIN_DIELECTRIC | MATERIAL_ROUGH_PANE => {
            pane_reflectance(material, cosine) + pane_transmittance(material, cosine)
        }
        MATERIAL_CONDUCTOR | MATERIAL_MEASURED => {
            let factor = if material.kind == MATERIAL_CONDUCTOR { reflectance } else { Vec3::ONE };
            factor
                * vec3(
                    cosine_table(brdf_table, offset, 3, cosine),
                    cosine_table(brdf_table, offset + 1, 3, cosine),
                    cosine_table(brdf_table, offset + 2, 3, cosine),
                )
        }
        kind => panic!("material of the unknown kind {kind}"),
    }
}
