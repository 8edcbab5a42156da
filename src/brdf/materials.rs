//! Materials of the scene → the material and BRDF table buffers of the device.

use std::{collections::HashMap, sync::Arc};

use glam::{Vec3, vec2, vec3};
use rayon::prelude::*;

use crate::math::colour::luminance;
use crate::{
    brdf::{
        material::{ConductorFresnel, Material, MaterialKind},
        twin,
    },
    error::{Error, Result},
    shader::{constants::*, structs},
};

/// Smallest GGX width: single-precision directions cannot resolve a narrower lobe.
pub const SMALLEST_ALPHA: f32 = 1e-3;

/// Largest size of the BRDF table buffer: Vulkan guarantees it for one storage buffer.
pub const LARGEST_TABLE_BYTES: usize = 128 << 20;

/// Contents of the material and BRDF table buffers.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialTables {
    /// Materials in the order of the scene.
    pub materials: Vec<structs::Material>,
    /// Words of the tables, at the offsets that the materials hold; never empty.
    pub words: Vec<u32>,
}

impl MaterialTables {
    /// Lays out the tables. Materials with the same measured table share its words.
    ///
    /// Fails if the tables together exceed [`LARGEST_TABLE_BYTES`]; names materials and sizes.
    pub fn new(materials: &[Material]) -> Result<Self> {
        check_size(materials)?;
        let mut tables = Self { materials: Vec::with_capacity(materials.len()), words: vec![0] };
        let mut measured_offsets = HashMap::new();
        for material in materials {
            let mut converted = structs::Material::default();
            let mut words = Vec::new();
            match &material.kind {
                MaterialKind::Diffuse { reflectance } => {
                    converted.kind = MATERIAL_DIFFUSE;
                    converted.reflectance = reflectance.to_array();
                }
                MaterialKind::Plastic { diffuse, alpha, ior } => {
                    converted.kind = MATERIAL_PLASTIC;
                    converted.reflectance = diffuse.to_array();
                    converted.alpha = alpha.max(SMALLEST_ALPHA);
                    converted.ior = *ior;
                    words = plastic_words(*diffuse, converted.alpha, *ior);
                }
                MaterialKind::Conductor { alpha, fresnel } => {
                    converted.kind = MATERIAL_CONDUCTOR;
                    converted.alpha = alpha.max(SMALLEST_ALPHA);
                    match fresnel {
                        ConductorFresnel::Schlick { reflectance } => {
                            converted.reflectance = reflectance.to_array();
                        }
                        ConductorFresnel::Exact { eta, k } => {
                            converted.ior = 1.0;
                            converted.eta = eta.to_array();
                            converted.k = k.to_array();
                        }
                    }
                    words = conductor_words(&converted);
                }
                MaterialKind::Principled {
                    base_color,
                    metallic,
                    roughness,
                    ior,
                    specular,
                    specular_color,
                } => {
                    let ratio = (ior - 1.0) / (ior + 1.0);
                    converted.kind = MATERIAL_PRINCIPLED;
                    converted.reflectance = base_color.to_array();
                    converted.alpha = (roughness * roughness).max(SMALLEST_ALPHA);
                    converted.ior = *metallic;
                    converted.eta = (*specular_color * ratio * ratio)
                        .min(Vec3::ONE)
                        .map(|reflectance| reflectance * specular)
                        .to_array();
                    converted.k = [*specular; 3];
                }
                MaterialKind::Mirror { reflectance } => {
                    converted.kind = MATERIAL_MIRROR;
                    converted.reflectance = reflectance.to_array();
                }
                MaterialKind::Dielectric { ior, alpha, reflectance, transmittance } => {
                    converted.kind = MATERIAL_DIELECTRIC;
                    converted.alpha = *alpha;
                    converted.ior = *ior;
                    converted.reflectance = reflectance.to_array();
                    converted.eta = transmittance.to_array();
                }
                MaterialKind::ThinDielectric { ior, reflectance, transmittance } => {
                    converted.kind = MATERIAL_THIN_DIELECTRIC;
                    converted.ior = *ior;
                    converted.reflectance = reflectance.to_array();
                    converted.eta = transmittance.to_array();
                }
                MaterialKind::Measured { table, .. } => {
                    converted.kind = MATERIAL_MEASURED;
                    converted.table_offset =
                        *measured_offsets.entry(Arc::as_ptr(table)).or_insert_with(|| {
                            // Align to pairs of words, the unit in which cells are read.
                            if (tables.words.len() + MEASURED_GRID_OFFSET as usize) % 2 == 1 {
                                tables.words.push(0);
                            }
                            let first = tables.words.len() as u32;
                            tables.words.extend_from_slice(table.words());
                            first
                        });
                }
            }
            if !words.is_empty() {
                converted.table_offset = tables.words.len() as u32;
                tables.words.append(&mut words);
            }
            tables.materials.push(converted);
        }
        Ok(tables)
    }
}

/// Fails if the measured tables do not fit into one buffer.
fn check_size(materials: &[Material]) -> Result<()> {
    let mut bytes = 0;
    let mut seen = Vec::new();
    let mut names = Vec::new();
    for material in materials {
        let MaterialKind::Measured { table, .. } = &material.kind else {
            // Count at most five tables over the cosine, and the word that is always there.
            bytes += (5 * BRDF_COSINE_NODES as usize + 1) * 4;
            continue;
        };
        if !seen.contains(&Arc::as_ptr(table)) {
            seen.push(Arc::as_ptr(table));
            let size = table.words().len() * 4;
            bytes += size;
            names.push(format!("{} ({:.1} MiB)", material.name, size as f64 / 1048576.0));
        }
    }
    if bytes <= LARGEST_TABLE_BYTES {
        return Ok(());
    }
    Err(Error::Device {
        reason: format!(
            "the tables of the measured materials need {:.1} MiB, a storage buffer holds {} MiB: {}",
            bytes as f64 / 1048576.0,
            LARGEST_TABLE_BYTES >> 20,
            names.join(", ")
        ),
        help: "name the same file in several materials, or use fewer measured files".to_string(),
    })
}

/// Direction of a given cosine. Stays just above the horizon, where a rough surface reflects nothing,
/// to give the limit there.
fn direction_of_cosine(cosine: f32) -> Vec3 {
    let cosine = cosine.max(1e-4);
    vec3((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine)
}

/// Directional albedo of a GGX surface; `fresnel` maps the cosine between direction and half vector
/// to reflectance. Sums visible-normal samples at the midpoints of a grid: each weight is at most
/// about 1, so 64 × 64 points are accurate to 1e-4.
fn ggx_albedo(outgoing: Vec3, alpha: f32, fresnel: impl Fn(f32) -> Vec3) -> Vec3 {
    const POINTS: u32 = 64;
    let mut sum = glam::DVec3::ZERO;
    for index in 0..POINTS * POINTS {
        let u = vec2((index % POINTS) as f32 + 0.5, (index / POINTS) as f32 + 0.5) / POINTS as f32;
        let incident = twin::ggx_sample(outgoing, alpha, u);
        if incident.z > 0.0 {
            let half_vector = outgoing + incident;
            let weight = twin::ggx_reflection(half_vector, outgoing, incident, alpha)
                / twin::ggx_pdf(half_vector, outgoing, alpha)
                * incident.z;
            sum += (weight * fresnel((0.5 * half_vector.length()).min(1.0))).as_dvec3();
        }
    }
    (sum / f64::from(POINTS * POINTS)).as_vec3()
}

/// Words of a plastic: directional albedo, transmission into and out of the base, probability of
/// sampling the coat; see `PLASTIC_…_OFFSET`.
fn plastic_words(diffuse: Vec3, alpha: f32, ior: f32) -> Vec<u32> {
    let fresnel = |cosine| Vec3::splat(twin::fresnel_dielectric(cosine, ior));
    let coat_albedo = |direction| ggx_albedo(direction, alpha, fresnel).x.min(1.0);
    let mut coat: Vec<f32> = (0..BRDF_COSINE_NODES)
        .into_par_iter()
        .map(|node| coat_albedo(direction_of_cosine(node as f32 / BRDF_COSINE_INTERVALS as f32)))
        .collect();
    // Next to the horizon, E falls steeply where the cosine is about α. Give the node there the
    // least value that keeps the line to the next node above E, so that coat and base together
    // never reflect more than they receive.
    let horizon = [0.02, 0.06, 0.12, 0.25, 0.5, 0.75].into_iter().map(|fraction| {
        let e = coat_albedo(direction_of_cosine(fraction / BRDF_COSINE_INTERVALS as f32));
        (e - fraction * coat[1]) / (1.0 - fraction)
    });
    coat[0] = horizon.fold(coat[0], f32::max).min(1.0);
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
    let albedo = coat.iter().map(|&e| Vec3::splat(e) + diffuse * (1.0 - e));
    let specular_share = coat.iter().map(|&e| {
        let base = luminance(diffuse) * (1.0 - e);
        if e + base > 0.0 { e / (e + base) } else { 0.5 }
    });
    albedo
        .flat_map(|value| value.to_array())
        .chain(coat.iter().map(|&e| (1.0 - e) * normalisation))
        .chain(specular_share)
        .map(f32::to_bits)
        .collect()
}

/// Words of a conductor: directional albedo.
fn conductor_words(material: &structs::Material) -> Vec<u32> {
    let fresnel = |cosine: f32| {
        if material.ior > 0.0 {
            twin::fresnel_conductor(cosine, material.eta.into(), material.k.into())
        } else {
            twin::fresnel_schlick(cosine, material.reflectance.into())
        }
    };
    (0..BRDF_COSINE_NODES)
        .into_par_iter()
        .flat_map_iter(|node| {
            ggx_albedo(
                direction_of_cosine(node as f32 / BRDF_COSINE_INTERVALS as f32),
                material.alpha,
                fresnel,
            )
            .clamp(Vec3::ZERO, Vec3::ONE)
            .to_array()
        })
        .map(f32::to_bits)
        .collect()
}
