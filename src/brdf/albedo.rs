//! Tables over the cosine between a direction and the normal: directional albedos of GGX surfaces, and
//! what the sampling of plastics and principled materials derives from them.

use std::{f32::consts::PI, sync::LazyLock};

use glam::{Vec2, Vec3, vec2, vec3};
use rayon::prelude::*;

use crate::{
    brdf::{fresnel::*, ggx::*, sheen::*, value::COAT_REFLECTANCE},
    math::colour::luminance,
    scene::measured::lookup::{mix, sample_cosine_hemisphere},
    shader::constants::*,
};

/// Points per dimension of the quadrature for one material.
const FINE_POINTS: u32 = 64;
/// The same for a sheen, over half of the azimuths, since both halves are alike.
const SHEEN_POINTS: u32 = 96;
/// Points per dimension of the quadrature for the table that materials share.
const COARSE_POINTS: u32 = 32;

/// Direction of the cosine at a node of a table, or between two. Stays just above the horizon, where a rough
/// surface reflects nothing, to give the limit there.
fn direction_at(node: f32) -> Vec3 {
    let cosine = (node / BRDF_COSINE_INTERVALS as f32).max(1e-4);
    vec3((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine)
}

/// Midpoints of a grid of `points`² cells over the unit square.
fn grid(points: u32) -> impl Iterator<Item = Vec2> {
    (0..points * points).map(move |index| {
        vec2((index % points) as f32 + 0.5, (index / points) as f32 + 0.5) / points as f32
    })
}

/// Directional albedo of microfacets of one width in all directions; `fresnel` maps the cosine between
/// direction and half vector to reflectance. Sums visible-normal samples of GGX at the midpoints of a grid:
/// its weights are at most about 1, so 64² points are accurate to 1e-4, those of Beckmann's normals 2.6.
fn ggx_albedo(outgoing: Vec3, width: GgxWidth, points: u32, fresnel: impl Fn(f32) -> Vec3) -> Vec3 {
    let mut sum = glam::DVec3::ZERO;
    for u in grid(points) {
        let incident = ggx_sample(outgoing, width, u);
        if incident.z > 0.0 {
            let half_vector = outgoing + incident;
            let weight = ggx_reflection(half_vector, outgoing, incident, width)
                / ggx_pdf(half_vector, outgoing, width)
                * incident.z;
            sum += (weight * fresnel((0.5 * half_vector.length()).min(1.0))).as_dvec3();
        }
    }
    (sum / f64::from(points * points)).as_vec3()
}

/// Tables of a cover of the share `weight` of a surface: its directional albedo E, and transmission into and
/// out of what it covers, T² = (1 − E)²/(1 − Ē).
fn cover_tables(weight: f32, albedo: impl Fn(Vec3) -> f32 + Sync) -> [Vec<f32>; 2] {
    let coat_albedo = |direction| albedo(direction).min(1.0);
    let mut coat: Vec<f32> = (0..BRDF_COSINE_NODES)
        .into_par_iter()
        .map(|node| coat_albedo(direction_at(node as f32)))
        .collect();
    // Next to the horizon, E falls steeply where the cosine is about α. Give the node there the
    // least value that keeps the line to the next node above E, so that coat and base together
    // never reflect more than they receive.
    let horizon = [0.02, 0.06, 0.12, 0.25, 0.5, 0.75].into_iter().map(|fraction| {
        let e = coat_albedo(direction_at(fraction));
        (e - fraction * coat[1]) / (1.0 - fraction)
    });
    coat[0] = horizon.fold(coat[0], f32::max).min(1.0);
    coat.iter_mut().for_each(|e| *e *= weight);
    // Integrate Ē = 2∫E(μ)μ dμ of the piecewise linear E exactly, so that the interpolated base
    // conserves energy: per interval of width w, ∫ = w·(μ₀(2E₀+E₁)+μ₁(E₀+2E₁))/6.
    let width = 1.0 / f64::from(BRDF_COSINE_INTERVALS);
    let mean: f64 = coat
        .windows(2)
        .zip(0..)
        .map(|(pair, interval)| {
            let (e0, e1) = (f64::from(pair[0]), f64::from(pair[1]));
            let mu0 = f64::from(interval) * width;
            let mu1 = mu0 + width;
            width * (mu0 * (2.0 * e0 + e1) + mu1 * (e0 + 2.0 * e1)) / 3.0
        })
        .sum();
    let normalisation = (1.0 / (1.0 - mean).max(1e-6).sqrt()) as f32;
    let transmission = coat.iter().map(|&e| (1.0 - e) * normalisation).collect();
    [coat, transmission]
}

/// Words of a plastic: directional albedo of the coat, transmission into and out of the base,
/// probability of sampling the coat; see `COAT_TRANSMISSION_OFFSET` and `PLASTIC_SPECULAR_SHARE_OFFSET`.
pub(crate) fn plastic_words(diffuse: Vec3, width: GgxWidth, ior: f32) -> Vec<u32> {
    let fresnel = |cosine| Vec3::splat(fresnel_dielectric(cosine, ior));
    let [coat, transmission] =
        cover_tables(1.0, |direction| ggx_albedo(direction, width, FINE_POINTS, fresnel).x);
    let specular_share = coat.iter().map(|&e| {
        let base = luminance(diffuse) * (1.0 - e);
        if e + base > 0.0 { e / (e + base) } else { 0.5 }
    });
    coat.iter().copied().chain(transmission).chain(specular_share).map(f32::to_bits).collect()
}

/// Words of the coat of a principled material: the first two tables of a plastic.
pub(crate) fn coat_words(weight: f32, alpha: f32) -> Vec<u32> {
    let fresnel = |cosine| Vec3::splat(mix(COAT_REFLECTANCE, 1.0, schlick_rise(cosine)));
    let width = GgxWidth::round(alpha);
    let albedo = |direction| ggx_albedo(direction, width, FINE_POINTS, fresnel).x;
    cover_tables(weight, albedo).concat().into_iter().map(f32::to_bits).collect()
}

/// Words of a sheen whose largest channel is `strength`, likewise; sums over the hemisphere are by midpoints.
pub(crate) fn sheen_words(strength: f32, alpha: f32) -> Vec<u32> {
    let albedo = |outgoing: Vec3| {
        let light = |u: Vec2| {
            let incident = sample_uniform_hemisphere(u * vec2(1.0, 0.5));
            incident.z * sheen_value(outgoing + incident, outgoing.z, incident.z, alpha)
        };
        2.0 * PI * grid(SHEEN_POINTS).map(light).sum::<f32>() / (SHEEN_POINTS * SHEEN_POINTS) as f32
    };
    cover_tables(strength, albedo).concat().into_iter().map(f32::to_bits).collect()
}

/// Words of a conductor with exact Fresnel: directional albedo without the factor of reflected light.
pub(crate) fn conductor_words(width: GgxWidth, eta: Vec3, k: Vec3) -> Vec<u32> {
    let fresnel = |cosine: f32| fresnel_conductor(cosine, eta, k);
    (0..BRDF_COSINE_NODES)
        .into_par_iter()
        .flat_map_iter(|node| {
            let albedo = ggx_albedo(direction_at(node as f32), width, FINE_POINTS, fresnel);
            albedo.clamp(Vec3::ZERO, Vec3::ONE).to_array()
        })
        .map(f32::to_bits)
        .collect()
}

/// Words of the table that all surfaces of one distribution with a Schlick reflectance share.
pub(crate) const GGX_WORDS: usize = (DIFFUSE_RISE_OFFSET + BRDF_COSINE_NODES) as usize;

/// Albedo of GGX, or of Beckmann's normals, by roughness and cosine as factors of the reflectance at normal
/// and at grazing incidence, and the mean rise of Schlick's reflectance over a diffuse base; see
/// `GGX_ROUGHNESS_WORDS` and `DIFFUSE_RISE_OFFSET`. Computed once a process, by one thread: one that
/// waits for others in here could be given work that waits for it.
pub(crate) fn ggx_words(is_beckmann: bool) -> &'static [u32] {
    static WORDS: [LazyLock<Vec<u32>>; 2] =
        [LazyLock::new(|| schlick_words(false)), LazyLock::new(|| schlick_words(true))];
    &WORDS[usize::from(is_beckmann)]
}

fn schlick_words(is_beckmann: bool) -> Vec<u32> {
    let nodes = (GGX_ROUGHNESS_INTERVALS + 1) * BRDF_COSINE_NODES;
    let ggx: Vec<[f32; 2]> = (0..nodes)
        .map(|index| {
            let (row, node) = (index / BRDF_COSINE_NODES, index % BRDF_COSINE_NODES);
            let roughness = row as f32 / GGX_ROUGHNESS_INTERVALS as f32;
            let alpha = (roughness * roughness).max(SMALLEST_ALPHA);
            let direction = direction_at(node as f32);
            let fresnel = |cosine: f32| {
                let rise = schlick_rise(cosine);
                vec3(1.0 - rise, rise, 0.0)
            };
            let width = GgxWidth { is_beckmann, ..GgxWidth::round(alpha) };
            let factors = ggx_albedo(direction, width, COARSE_POINTS, fresnel);
            [factors.x, factors.y]
        })
        .collect();
    let rise = (0..BRDF_COSINE_NODES).map(|node| diffuse_rise(direction_at(node as f32)));
    ggx.into_iter().flatten().chain(rise).map(f32::to_bits).collect()
}

/// Mean of Schlick's rise over incident directions in proportion to their cosine.
fn diffuse_rise(outgoing: Vec3) -> f32 {
    let sum: f64 = grid(COARSE_POINTS)
        .map(|u| {
            let half_vector = outgoing + sample_cosine_hemisphere(u);
            f64::from(schlick_rise((0.5 * half_vector.length()).min(1.0)))
        })
        .sum();
    (sum / f64::from(COARSE_POINTS * COARSE_POINTS)) as f32
}
