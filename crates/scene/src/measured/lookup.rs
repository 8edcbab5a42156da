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

/// The two bins of an axis between whose centres a position lies, and its share of the way.
struct Between {
    bins: [u32; 2],
    fraction: f32,
}

/// Bins around a position, in bins; the ends are held.
fn held_bins(position: f32, count: u32) -> Between {
    let position = (position - 0.5).clamp(0.0, (count - 1) as f32);
    let lower = position as u32;
    Between { bins: [lower, (lower + 1).min(count - 1)], fraction: position - lower as f32 }
}

/// Bins around a position, in bins, of an axis that closes.
fn closed_bins(position: f32, count: u32) -> Between {
    let mut position = position - 0.5;
    if position < 0.0 {
        position += count as f32;
    }
    let lower = (position as u32).min(count - 1);
    let upper = if lower + 1 == count { 0 } else { lower + 1 };
    Between { bins: [lower, upper], fraction: position - lower as f32 }
}

/// One of the two bins and its weight.
fn side(between: &Between, upper: bool) -> (u32, f32) {
    let fraction = between.fraction;
    (between.bins[usize::from(upper)], if upper { fraction } else { 1.0 - fraction })
}

/// Bins of θ_h in the grid and in its turns.
fn theta_half_bins(theta_half: f32) -> Between {
    held_bins(
        MEASURED_THETA_HALF_BINS as f32 * (theta_half * (2.0 / PI)).sqrt(),
        MEASURED_THETA_HALF_BINS,
    )
}

/// Bins of θ_d and φ_d, as many as a grid has.
fn difference_bins(angles: Vec3, theta_count: u32, phi_count: u32) -> (Between, Between) {
    let theta = held_bins(theta_count as f32 * angles.y * (2.0 / PI), theta_count);
    (theta, closed_bins(phi_count as f32 * angles.z / PI, phi_count))
}

/// Mixes two cells of a row that starts at a word: RGB from three halves.
fn measured_cells(brdf_table: &[u32], row: u32, phi: &Between) -> Vec3 {
    let half = |bits: u32| f16::from_bits(bits as u16).to_f32();
    let [lower, upper] = phi.bins.map(|bin| {
        let index = (row + 2 * bin) as usize;
        let (first, second) = (brdf_table[index], brdf_table[index + 1]);
        vec3(half(first & 0xffff), half(first >> 16), half(second & 0xffff))
    });
    lower * (1.0 - phi.fraction) + upper * phi.fraction
}

/// Measured BRDF, trilinear between the centres of the grid's bins; periodic in φ_d.
pub fn measured_value(brdf_table: &[u32], table_offset: u32, angles: Vec3) -> Vec3 {
    let theta_half = theta_half_bins(angles.x);
    let (theta_difference, phi) =
        difference_bins(angles, MEASURED_THETA_DIFFERENCE_BINS, MEASURED_PHI_DIFFERENCE_BINS);
    let mut value = Vec3::ZERO;
    for corner in 0..4 {
        let (half, half_weight) = side(&theta_half, corner & 1 != 0);
        let (difference, difference_weight) = side(&theta_difference, corner & 2 != 0);
        let row = half * MEASURED_THETA_DIFFERENCE_BINS + difference;
        let row = table_offset + MEASURED_GRID_OFFSET + 2 * row * MEASURED_PHI_DIFFERENCE_BINS;
        value += half_weight * difference_weight * measured_cells(brdf_table, row, &phi);
    }
    value
}

/// Factor of the measured BRDF, which is a mean over all turns about the normal, at the turn of a surface
/// whose unit tangent is `axis`.
pub fn measured_turn(
    brdf_table: &[u32],
    table_offset: u32,
    angles: Vec3,
    half_vector: Vec3,
    axis: Vec2,
) -> Vec3 {
    let y = axis.x * half_vector.y - axis.y * half_vector.x;
    let x = axis.dot(half_vector.truncate());
    let azimuth = if x == 0.0 && y == 0.0 { 0.0 } else { y.atan2(x) };
    let theta_half = theta_half_bins(angles.x);
    let (theta_difference, phi) = difference_bins(
        angles,
        MEASURED_TURN_THETA_DIFFERENCE_BINS,
        MEASURED_TURN_PHI_DIFFERENCE_BINS,
    );
    let turn =
        closed_bins(MEASURED_TURN_BINS as f32 * (azimuth * (0.5 / PI) + 0.5), MEASURED_TURN_BINS);
    let mut factor = Vec3::ZERO;
    for corner in 0..8 {
        let (half, half_weight) = side(&theta_half, corner & 1 != 0);
        let (difference, difference_weight) = side(&theta_difference, corner & 2 != 0);
        let (turn, turn_weight) = side(&turn, corner & 4 != 0);
        let row = (half * MEASURED_TURN_THETA_DIFFERENCE_BINS + difference) * MEASURED_TURN_BINS;
        let row = 2 * (row + turn) * MEASURED_TURN_PHI_DIFFERENCE_BINS;
        factor += half_weight
            * difference_weight
            * turn_weight
            * measured_cells(brdf_table, table_offset + MEASURED_TURN_OFFSET + row, &phi);
    }
    factor
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
