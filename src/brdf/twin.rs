//! Twin of `glsl/include/brdf.glsl`: same names, same order, same f32 arithmetic, to be read line
//! by line against the shader. `brdf_table` is the word buffer of
//! [`MaterialTables`](super::MaterialTables), a binding in the shader.

use std::f32::consts::PI;

use glam::{Vec2, Vec3, vec2, vec3};
use half::f16;

use crate::{
    brdf::{fresnel::*, ggx::*},
    math::colour::luminance,
    shader::{constants::*, structs::Material},
};

/// Word of the BRDF table as a float.
fn table_value(brdf_table: &[u32], index: u32) -> f32 {
    f32::from_bits(brdf_table[index as usize])
}

/// Interpolates linearly between equally spaced nodes over the cosine 0…1, `stride` words apart.
pub fn cosine_table(brdf_table: &[u32], offset: u32, stride: u32, cosine: f32) -> f32 {
    let position = cosine.clamp(0.0, 1.0) * BRDF_COSINE_INTERVALS as f32;
    let node = (position as u32).min(BRDF_COSINE_INTERVALS - 1);
    let index = offset + node * stride;
    mix(
        table_value(brdf_table, index),
        table_value(brdf_table, index + stride),
        position - node as f32,
    )
}

/// GLSL's `mix`: `a` at 0, `b` at 1.
fn mix(a: f32, b: f32, fraction: f32) -> f32 {
    a * (1.0 - fraction) + b * fraction
}

/// GLSL's `mix` of vectors.
fn mix_vec3(a: Vec3, b: Vec3, fraction: f32) -> Vec3 {
    a * (1.0 - fraction) + b * fraction
}

/// Samples a direction with density cosθ/π.
pub fn sample_cosine_hemisphere(u: Vec2) -> Vec3 {
    let radius = u.x.sqrt();
    let azimuth = 2.0 * PI * u.y;
    vec3(radius * azimuth.cos(), radius * azimuth.sin(), (1.0 - u.x).max(0.0).sqrt())
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

/// (θ_h, θ_d, φ_d) of two directions, φ_d in 0…π: the half/difference angles of \[Rusinkiewicz
/// 1998\], symmetric in the two directions to the last bit.
pub fn half_difference_angles(outgoing_local: Vec3, incident_local: Vec3) -> Vec3 {
    let half_vector = outgoing_local + incident_local;
    let difference = incident_local - outgoing_local;
    let tangential = half_vector.truncate().dot(half_vector.truncate());
    let mut y =
        half_vector.length() * (difference.y * half_vector.x - difference.x * half_vector.y);
    let mut x = half_vector.z * difference.truncate().dot(half_vector.truncate())
        - difference.z * tangential;
    if y < 0.0 || (y == 0.0 && x < 0.0) {
        y = -y;
        x = -x;
    }
    // The angle is undefined at the poles, and the grid is constant over it.
    let phi_difference = if x == 0.0 && y == 0.0 { 0.0 } else { y.atan2(x) };
    vec3(
        tangential.sqrt().atan2(half_vector.z),
        difference.length().atan2(half_vector.length()),
        phi_difference,
    )
}

/// Cell of the measured grid: RGB per steradian from three halves.
fn measured_cell(brdf_table: &[u32], grid: u32, row: u32, phi_index: u32) -> Vec3 {
    let index = (grid + 2 * (row * MEASURED_PHI_DIFFERENCE_BINS + phi_index)) as usize;
    let half = |bits: u32| f16::from_bits(bits as u16).to_f32();
    let (first, second) = (brdf_table[index], brdf_table[index + 1]);
    vec3(half(first & 0xffff), half(first >> 16), half(second & 0xffff))
}

/// Measured BRDF, trilinear between the centres of the grid's bins; periodic in φ_d.
pub fn measured_value(brdf_table: &[u32], table_offset: u32, angles: Vec3) -> Vec3 {
    let theta_half = (MEASURED_THETA_HALF_BINS as f32 * (angles.x * (2.0 / PI)).sqrt() - 0.5)
        .clamp(0.0, (MEASURED_THETA_HALF_BINS - 1) as f32);
    let theta_difference = (MEASURED_THETA_DIFFERENCE_BINS as f32 * angles.y * (2.0 / PI) - 0.5)
        .clamp(0.0, (MEASURED_THETA_DIFFERENCE_BINS - 1) as f32);
    let mut phi = MEASURED_PHI_DIFFERENCE_BINS as f32 * angles.z / PI - 0.5;
    if phi < 0.0 {
        phi += MEASURED_PHI_DIFFERENCE_BINS as f32;
    }
    let half_0 = theta_half as u32;
    let half_1 = (half_0 + 1).min(MEASURED_THETA_HALF_BINS - 1);
    let difference_0 = theta_difference as u32;
    let difference_1 = (difference_0 + 1).min(MEASURED_THETA_DIFFERENCE_BINS - 1);
    let phi_0 = (phi as u32).min(MEASURED_PHI_DIFFERENCE_BINS - 1);
    let phi_1 = if phi_0 + 1 == MEASURED_PHI_DIFFERENCE_BINS { 0 } else { phi_0 + 1 };
    let phi_fraction = phi - phi_0 as f32;

    let grid = table_offset + MEASURED_GRID_OFFSET;
    let mut value = Vec3::ZERO;
    for corner in 0..4 {
        let upper_half = corner & 1 != 0;
        let upper_difference = corner & 2 != 0;
        let row = (if upper_half { half_1 } else { half_0 }) * MEASURED_THETA_DIFFERENCE_BINS
            + (if upper_difference { difference_1 } else { difference_0 });
        let half_fraction = theta_half - half_0 as f32;
        let difference_fraction = theta_difference - difference_0 as f32;
        let weight = (if upper_half { half_fraction } else { 1.0 - half_fraction })
            * (if upper_difference { difference_fraction } else { 1.0 - difference_fraction });
        let cells = measured_cell(brdf_table, grid, row, phi_0) * (1.0 - phi_fraction)
            + measured_cell(brdf_table, grid, row, phi_1) * phi_fraction;
        value += weight * cells;
    }
    value
}

/// Bin of the outgoing polar angle in the sampling table.
fn measured_elevation_bin(outgoing_local: Vec3) -> u32 {
    let theta = outgoing_local.truncate().length().atan2(outgoing_local.z);
    ((theta * (2.0 / PI) * MEASURED_ELEVATION_BINS as f32) as u32).min(MEASURED_ELEVATION_BINS - 1)
}

/// Unit azimuthal direction that is φ_h = 0 in the sampling table.
fn measured_azimuth_axis(outgoing_local: Vec3) -> Vec2 {
    let sine = outgoing_local.truncate().length();
    if sine > 0.0 { outgoing_local.truncate() / sine } else { vec2(1.0, 0.0) }
}

/// Density of [`measured_sample`]: cosine lobe and tabulated half vectors.
pub fn measured_pdf(
    brdf_table: &[u32],
    table_offset: u32,
    outgoing_local: Vec3,
    incident_local: Vec3,
    theta_half: f32,
) -> f32 {
    let half_vector = outgoing_local + incident_local;
    let elevation = measured_elevation_bin(outgoing_local);
    let cosine_share =
        table_value(brdf_table, table_offset + MEASURED_COSINE_SHARE_OFFSET + elevation);
    let polar = ((MEASURED_POLAR_BINS as f32 * (theta_half * (2.0 / PI)).sqrt()) as u32)
        .min(MEASURED_POLAR_BINS - 1);
    let axis = measured_azimuth_axis(outgoing_local);
    let y = (axis.x * half_vector.y - axis.y * half_vector.x).abs();
    let x = axis.dot(half_vector.truncate());
    let phi = if x == 0.0 && y == 0.0 { 0.0 } else { y.atan2(x) };
    let azimuth = ((MEASURED_AZIMUTH_BINS as f32 * phi / PI) as u32).min(MEASURED_AZIMUTH_BINS - 1);
    let density = table_value(
        brdf_table,
        table_offset
            + MEASURED_DENSITY_OFFSET
            + elevation * MEASURED_SAMPLING_CELLS
            + polar * MEASURED_AZIMUTH_BINS
            + azimuth,
    );
    // dω_h/dω_i = 1/(4 ω_o·h), and ω_o·h is half the length of the half vector.
    cosine_share * incident_local.z / PI
        + (1.0 - cosine_share) * density / (2.0 * half_vector.length())
}

/// Samples an incident direction from the cosine lobe or the tabulated half vectors; z ≤ 0 means no
/// sample.
pub fn measured_sample(
    brdf_table: &[u32],
    table_offset: u32,
    outgoing_local: Vec3,
    u: Vec3,
) -> Vec3 {
    let elevation = measured_elevation_bin(outgoing_local);
    let cosine_share =
        table_value(brdf_table, table_offset + MEASURED_COSINE_SHARE_OFFSET + elevation);
    if u.x < cosine_share {
        return sample_cosine_hemisphere(vec2(u.y, u.z));
    }
    // Find the first cell whose cumulative probability exceeds u.y.
    let cumulative =
        table_offset + MEASURED_CUMULATIVE_OFFSET + elevation * MEASURED_SAMPLING_CELLS;
    let mut cell = 0;
    let mut span = MEASURED_SAMPLING_CELLS / 2;
    while span > 0 {
        if table_value(brdf_table, cumulative + cell + span - 1) <= u.y {
            cell += span;
        }
        span /= 2;
    }
    let lower = if cell > 0 { table_value(brdf_table, cumulative + cell - 1) } else { 0.0 };
    let fraction = (u.y - lower) / (table_value(brdf_table, cumulative + cell) - lower);
    let polar = cell / MEASURED_AZIMUTH_BINS;
    // 1 − cosθ_h is uniform within the cell; compute its edges as 2 sin²(θ/2).
    let edge_0 = polar as f32 / MEASURED_POLAR_BINS as f32;
    let edge_1 = (polar + 1) as f32 / MEASURED_POLAR_BINS as f32;
    let sine_0 = (0.25 * PI * edge_0 * edge_0).sin();
    let sine_1 = (0.25 * PI * edge_1 * edge_1).sin();
    let below_pole = 2.0 * mix(sine_0 * sine_0, sine_1 * sine_1, u.z);
    let sine = (below_pole * (2.0 - below_pole)).max(0.0).sqrt();
    let mut phi =
        PI * ((cell % MEASURED_AZIMUTH_BINS) as f32 + fraction) / MEASURED_AZIMUTH_BINS as f32;
    // The table holds |φ_h|; both signs are equally likely.
    if u.x - cosine_share < 0.5 * (1.0 - cosine_share) {
        phi = -phi;
    }
    let axis = measured_azimuth_axis(outgoing_local);
    let tangential = phi.cos() * axis + phi.sin() * vec2(-axis.y, axis.x);
    let half_vector = (sine * tangential).extend(1.0 - below_pole);
    2.0 * outgoing_local.dot(half_vector) * half_vector - outgoing_local
}

/// Fails on a kind that this file does not know, where the shader returns 0.
fn unknown_kind(kind: u32) -> ! {
    panic!("material of the unknown kind {kind}")
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
    if outgoing_local.z <= 0.0 || incident_local.z <= 0.0 {
        return (Vec3::ZERO, 0.0);
    }
    let reflectance = Vec3::from(material.reflectance);
    let cosine_pdf = incident_local.z / PI;
    if material.kind == MATERIAL_DIFFUSE {
        return (reflectance / PI, cosine_pdf);
    }
    if material.kind == MATERIAL_MEASURED {
        let angles = half_difference_angles(outgoing_local, incident_local);
        let offset = material.table_offset;
        return (
            measured_value(brdf_table, offset, angles),
            measured_pdf(brdf_table, offset, outgoing_local, incident_local, angles.x),
        );
    }
    let half_vector = outgoing_local + incident_local;
    let cosine_difference = (0.5 * half_vector.length()).min(1.0);
    let reflection = ggx_reflection(half_vector, outgoing_local, incident_local, material.alpha);
    let pdf = ggx_pdf(half_vector, outgoing_local, material.alpha);
    match material.kind {
        MATERIAL_PLASTIC => {
            let transmission = material.table_offset + PLASTIC_TRANSMISSION_OFFSET;
            let specular_share = cosine_table(
                brdf_table,
                material.table_offset + PLASTIC_SPECULAR_SHARE_OFFSET,
                1,
                outgoing_local.z,
            );
            let base = cosine_table(brdf_table, transmission, 1, outgoing_local.z)
                * cosine_table(brdf_table, transmission, 1, incident_local.z)
                / PI;
            let coat = reflection * fresnel_dielectric(cosine_difference, material.ior);
            (Vec3::splat(coat) + base * reflectance, mix(cosine_pdf, pdf, specular_share))
        }
        MATERIAL_PRINCIPLED => {
            let share = principled_specular_share(brdf_table, material, outgoing_local.z);
            let value = principled_value(material, reflection, cosine_difference);
            (value, mix(cosine_pdf, pdf, share))
        }
        MATERIAL_CONDUCTOR if material.ior > 0.0 => {
            let (eta, k) = (Vec3::from(material.eta), Vec3::from(material.k));
            (reflection * fresnel_conductor(cosine_difference, eta, k), pdf)
        }
        MATERIAL_CONDUCTOR => (reflection * fresnel_schlick(cosine_difference, reflectance), pdf),
        MATERIAL_MIRROR | MATERIAL_DIELECTRIC | MATERIAL_THIN_DIELECTRIC => (Vec3::ZERO, 0.0),
        kind => unknown_kind(kind),
    }
}

/// Samples an incident direction with three numbers in [0, 1); z ≤ 0 means no sample, which counts
/// as one with contribution 0.
///
/// # Panics
/// The material is of an unknown kind.
pub fn brdf_sample(brdf_table: &[u32], material: &Material, outgoing_local: Vec3, u: Vec3) -> Vec3 {
    if outgoing_local.z <= 0.0 {
        return vec3(0.0, 0.0, -1.0);
    }
    let specular_share = match material.kind {
        MATERIAL_MEASURED => {
            return measured_sample(brdf_table, material.table_offset, outgoing_local, u);
        }
        MATERIAL_MIRROR | MATERIAL_DIELECTRIC | MATERIAL_THIN_DIELECTRIC => {
            return vec3(0.0, 0.0, -1.0);
        }
        MATERIAL_DIFFUSE => 0.0,
        MATERIAL_CONDUCTOR => 1.0,
        MATERIAL_PLASTIC => cosine_table(
            brdf_table,
            material.table_offset + PLASTIC_SPECULAR_SHARE_OFFSET,
            1,
            outgoing_local.z,
        ),
        MATERIAL_PRINCIPLED => principled_specular_share(brdf_table, material, outgoing_local.z),
        kind => unknown_kind(kind),
    };
    if u.x < specular_share {
        return ggx_sample(outgoing_local, material.alpha, vec2(u.y, u.z));
    }
    sample_cosine_hemisphere(vec2(u.y, u.z))
}

/// Share of light from a uniform white hemisphere reflected toward the outgoing direction, 0…1, for
/// the albedo image. Dielectrics and panes count transmitted light too, seen from outside and as if
/// smooth.
///
/// # Panics
/// The material is of an unknown kind.
pub fn brdf_albedo(brdf_table: &[u32], material: &Material, outgoing_local: Vec3) -> Vec3 {
    let reflectance = Vec3::from(material.reflectance);
    let cosine = outgoing_local.z;
    let offset = material.table_offset;
    match material.kind {
        MATERIAL_DIFFUSE | MATERIAL_MIRROR => reflectance,
        MATERIAL_PLASTIC => {
            let coat = cosine_table(brdf_table, offset, 1, cosine);
            Vec3::splat(coat) + (1.0 - coat) * reflectance
        }
        MATERIAL_PRINCIPLED => {
            let albedo = principled_albedo(brdf_table, material, cosine);
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
        MATERIAL_THIN_DIELECTRIC => {
            pane_reflectance(material, cosine) + pane_transmittance(material, cosine)
        }
        MATERIAL_CONDUCTOR | MATERIAL_MEASURED => vec3(
            cosine_table(brdf_table, offset, 3, cosine),
            cosine_table(brdf_table, offset + 1, 3, cosine),
            cosine_table(brdf_table, offset + 2, 3, cosine),
        ),
        kind => unknown_kind(kind),
    }
}
