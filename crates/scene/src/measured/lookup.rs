//! Values, densities and samples of a measured BRDF from its words: twin of the `measured_…` functions of
//! `glsl/include/brdf.glsl`, with the same names in the same order and the same f32 arithmetic.
//! `brdf_table` is a buffer that holds the words of a [`MeasuredTable`](super::MeasuredTable) from
//! `table_offset` on.

use std::f32::consts::PI;

use glam::{Vec2, Vec3, vec2, vec3};
use half::f16;

use super::layout::*;

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
pub fn mix(a: f32, b: f32, fraction: f32) -> f32 {
    a * (1.0 - fraction) + b * fraction
}

/// Samples a direction with density cosθ/π.
pub fn sample_cosine_hemisphere(u: Vec2) -> Vec3 {
    let radius = u.x.sqrt();
    let azimuth = 2.0 * PI * u.y;
    vec3(radius * azimuth.cos(), radius * azimuth.sin(), (1.0 - u.x).max(0.0).sqrt())
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
