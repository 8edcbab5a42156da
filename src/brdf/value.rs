//! Value of a material: twin of the values in `glsl/include/brdf.glsl`, in the same order and the same f32
//! arithmetic. `brdf_table` is the word buffer of [`MaterialTables`](super::MaterialTables), a binding in
//! the shader.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use crate::{
    brdf::{fresnel::*, ggx::*, sheen::sheen_value},
    scene::{
        coat::DIELECTRIC,
        measured::lookup::{
            cosine_table, half_difference_angles, measured_turn, measured_value, mix,
        },
    },
    shader::{constants::*, structs::Material},
};

/// GLSL's `mix` of vectors.
fn mix_vec3(a: Vec3, b: Vec3, fraction: f32) -> Vec3 {
    a * (1.0 - fraction) + b * fraction
}

/// Reflectance of a coat at normal incidence, of refractive index 1.5. Twin: `glsl/include/brdf.glsl`.
pub(super) const COAT_REFLECTANCE: f32 = DIELECTRIC;

/// Metal and dielectric in one: `reflection` is that of GGX at unit reflectance. glTF 2.0, appendix B.
fn principled_value(material: &Material, reflection: f32, cosine_difference: f32) -> Vec3 {
    let metallic = material.ior;
    let reflectance = Vec3::from(material.reflectance);
    let metal = fresnel_schlick(cosine_difference, reflectance);
    let rise = schlick_rise(cosine_difference);
    let dielectric = mix_vec3(material.eta.into(), material.k.into(), rise);
    let strongest = dielectric.max_element();
    let base = (1.0 - strongest) / PI * reflectance;
    mix_vec3(base + reflection * dielectric, reflection * metal, metallic)
}

/// Material and outgoing direction at a sheet from whose other side the viewer looks: it shows there what it
/// transmits, over the probability of that side. All others as they are.
pub fn of_side(material: &Material, outgoing_local: Vec3) -> (Material, Vec3) {
    let (mut material, mut outgoing_local) = (*material, outgoing_local);
    if material.kind == MATERIAL_DIFFUSE_TRANSMISSION {
        let side = if outgoing_local.z < 0.0 { material.eta } else { material.k };
        material.reflectance = (Vec3::from(material.reflectance) * Vec3::from(side)).to_array();
        outgoing_local.z = outgoing_local.z.abs();
    }
    (material, outgoing_local)
}

/// Value of a material at one pair of directions, 1/sr, without the cosine.
///
/// # Panics
/// The material is of an unknown kind, for which the shader returns 0.
pub fn brdf_evaluate(
    brdf_table: &[u32],
    material: &Material,
    outgoing_local: Vec3,
    incident_local: Vec3,
) -> Vec3 {
    let (material, outgoing_local) = of_side(material, outgoing_local);
    let material = &material;
    if outgoing_local.z <= 0.0 || incident_local.z <= 0.0 {
        return Vec3::ZERO;
    }
    let reflectance = Vec3::from(material.reflectance);
    if matches!(material.kind, MATERIAL_DIFFUSE | MATERIAL_DIFFUSE_TRANSMISSION) {
        return reflectance / PI;
    }
    if material.kind == MATERIAL_MEASURED {
        let angles = half_difference_angles(outgoing_local, incident_local);
        let mut value = measured_value(brdf_table, material.table_offset, angles);
        let axis = Vec2::from(material.anisotropy);
        if axis != Vec2::ZERO {
            let half_vector = outgoing_local + incident_local;
            value *= measured_turn(brdf_table, material.table_offset, angles, half_vector, axis);
        }
        return value;
    }
    let half_vector = outgoing_local + incident_local;
    let cosine_difference = (0.5 * half_vector.length()).min(1.0);
    let reflection =
        ggx_reflection(half_vector, outgoing_local, incident_local, GgxWidth::of(material));
    // Light that a cover lets in and out.
    let through = |table: u32| {
        let at = |cosine| cosine_table(brdf_table, table + COAT_TRANSMISSION_OFFSET, 1, cosine);
        at(outgoing_local.z) * at(incident_local.z)
    };
    match material.kind {
        MATERIAL_PLASTIC => {
            let base = through(material.table_offset) / PI;
            let coat = reflection * fresnel_dielectric(cosine_difference, material.ior);
            Vec3::splat(coat) + base * reflectance
        }
        MATERIAL_PRINCIPLED => principled_value(material, reflection, cosine_difference),
        MATERIAL_COATED | MATERIAL_SHEEN => {
            let alpha = material.cover_alpha;
            let covering = if material.kind == MATERIAL_SHEEN {
                sheen_value(half_vector, outgoing_local.z, incident_local.z, alpha)
            } else {
                let width = GgxWidth::round(alpha);
                mix(COAT_REFLECTANCE, 1.0, schlick_rise(cosine_difference))
                    * ggx_reflection(half_vector, outgoing_local, incident_local, width)
            };
            let base = principled_value(material, reflection, cosine_difference);
            through(material.cover_table) * base + covering * Vec3::from(material.cover)
        }
        MATERIAL_CONDUCTOR if material.ior > 0.0 => {
            let (eta, k) = (Vec3::from(material.eta), Vec3::from(material.k));
            reflection * reflectance * fresnel_conductor(cosine_difference, eta, k)
        }
        MATERIAL_CONDUCTOR => reflection * fresnel_schlick(cosine_difference, reflectance),
        MATERIAL_MIRROR | MATERIAL_DIELECTRIC | MATERIAL_THIN_DIELECTRIC | MATERIAL_ROUGH_PANE => {
            Vec3::ZERO
        }
        kind => panic!("material of the unknown kind {kind}"),
    }
}
