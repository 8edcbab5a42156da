//! Materials of the scene → the material and BRDF table buffers of the device.

use std::{collections::HashMap, sync::Arc};

use glam::{Vec2, Vec3};

use crate::{
    brdf::{
        albedo::{GGX_WORDS, coat_words, conductor_words, ggx_words, plastic_words, sheen_words},
        ggx::{GgxWidth, SMALLEST_ALPHA},
        sheen::SMALLEST_SHEEN_ALPHA,
    },
    error::{Error, Result},
    math::colour::luminance,
    scene::material::{ConductorFresnel, Distribution, Material, MaterialKind},
    shader::{constants::*, structs},
};

/// Largest size of the BRDF table buffer: Vulkan guarantees it for one storage buffer.
pub(crate) const LARGEST_TABLE_BYTES: usize = 128 << 20;

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
        let mut ggx_offsets = [None; 2];
        // All surfaces of one distribution with a Schlick reflectance share one table.
        let mut ggx_table = |tables: &mut Self, is_beckmann: bool| {
            *ggx_offsets[usize::from(is_beckmann)]
                .get_or_insert_with(|| tables.append(ggx_words(is_beckmann)))
        };
        for material in materials {
            let mut converted = structs::Material::default();
            let anisotropy = &material.surface.anisotropy;
            let is_beckmann = material.surface.distribution == Distribution::Beckmann;
            let round = |alpha| GgxWidth { is_beckmann, ..GgxWidth::round(alpha) };
            let widths = |converted: &mut structs::Material, alpha: f32| {
                let [along, across] = anisotropy.widths(alpha.max(SMALLEST_ALPHA));
                converted.alpha = anisotropy.mean_width(across);
                let stretch = (along - across) / (along + across);
                let twice = Vec2::from_angle(2.0 * anisotropy.rotation);
                converted.anisotropy = (stretch * twice).to_array();
            };
            match &material.kind {
                MaterialKind::Diffuse { reflectance } => {
                    converted.kind = MATERIAL_DIFFUSE;
                    converted.reflectance = reflectance.to_array();
                }
                MaterialKind::DiffuseTransmission { reflectance, transmittance } => {
                    let [kept, passed] = [*reflectance, *transmittance].map(luminance);
                    let probability = if passed > 0.0 { kept / (kept + passed) } else { 1.0 };
                    let whole = reflectance.max(*transmittance);
                    let part = |side: &Vec3, probability: f32| {
                        let scale = (whole * probability).max(Vec3::splat(f32::MIN_POSITIVE));
                        (side / scale).to_array()
                    };
                    converted.kind = MATERIAL_DIFFUSE_TRANSMISSION;
                    converted.reflectance = whole.to_array();
                    converted.ior = probability;
                    converted.k = part(reflectance, probability);
                    converted.eta = part(transmittance, 1.0 - probability);
                }
                MaterialKind::Plastic { diffuse, alpha, ior } => {
                    converted.kind = MATERIAL_PLASTIC;
                    converted.reflectance = diffuse.to_array();
                    converted.alpha = alpha.max(SMALLEST_ALPHA);
                    converted.ior = *ior;
                    converted.cover_alpha = f32::from(is_beckmann);
                    let words = plastic_words(*diffuse, round(converted.alpha), *ior);
                    converted.table_offset = tables.append(&words);
                }
                MaterialKind::Conductor { alpha, fresnel } => {
                    converted.kind = MATERIAL_CONDUCTOR;
                    widths(&mut converted, *alpha);
                    converted.cover_alpha = f32::from(is_beckmann);
                    match fresnel {
                        ConductorFresnel::Schlick { reflectance } => {
                            converted.reflectance = reflectance.to_array();
                            converted.table_offset = ggx_table(&mut tables, is_beckmann);
                        }
                        ConductorFresnel::Exact { reflectance, eta, k } => {
                            converted.ior = 1.0;
                            converted.reflectance = reflectance.to_array();
                            converted.eta = eta.to_array();
                            converted.k = k.to_array();
                            let words = conductor_words(round(converted.alpha), *eta, *k);
                            converted.table_offset = tables.append(&words);
                        }
                    }
                }
                MaterialKind::Principled(own) => {
                    let ratio = (own.ior - 1.0) / (own.ior + 1.0);
                    converted.kind = MATERIAL_PRINCIPLED;
                    converted.reflectance = own.base_color.to_array();
                    widths(&mut converted, own.roughness * own.roughness);
                    converted.ior = own.metallic;
                    converted.eta = (own.specular_color * ratio * ratio)
                        .min(Vec3::ONE)
                        .map(|reflectance| reflectance * own.specular)
                        .to_array();
                    converted.k = [own.specular; 3];
                    converted.table_offset = ggx_table(&mut tables, false);
                    if own.coat_weight > 0.0 {
                        converted.kind = MATERIAL_COATED;
                        converted.cover = [own.coat_weight; 3];
                        converted.cover_alpha =
                            (own.coat_roughness * own.coat_roughness).max(SMALLEST_ALPHA);
                        let words = coat_words(own.coat_weight, converted.cover_alpha);
                        converted.cover_table = tables.append(&words);
                    } else if own.sheen_color != Vec3::ZERO {
                        converted.kind = MATERIAL_SHEEN;
                        converted.cover = own.sheen_color.to_array();
                        let alpha = own.sheen_roughness * own.sheen_roughness;
                        converted.cover_alpha = alpha.max(SMALLEST_SHEEN_ALPHA);
                        let strength = own.sheen_color.max_element();
                        let words = sheen_words(strength, converted.cover_alpha);
                        converted.cover_table = tables.append(&words);
                    }
                }
                MaterialKind::Mirror { reflectance } => {
                    converted.kind = MATERIAL_MIRROR;
                    converted.reflectance = reflectance.to_array();
                    converted.ior = f32::from(material.surface.two_sided);
                }
                MaterialKind::Dielectric { ior, alpha, reflectance, transmittance, absorption } => {
                    converted.kind = MATERIAL_DIELECTRIC;
                    converted.cover_alpha = f32::from(is_beckmann);
                    converted.alpha = if *alpha > 0.0 { alpha.max(SMALLEST_ALPHA) } else { 0.0 };
                    converted.ior = *ior;
                    converted.reflectance = reflectance.to_array();
                    converted.eta = transmittance.to_array();
                    converted.k = absorption.to_array();
                }
                MaterialKind::ThinDielectric { ior, alpha, reflectance, transmittance } => {
                    let is_rough = *alpha > 0.0;
                    converted.kind =
                        if is_rough { MATERIAL_ROUGH_PANE } else { MATERIAL_THIN_DIELECTRIC };
                    converted.alpha = if is_rough { alpha.max(SMALLEST_ALPHA) } else { 0.0 };
                    converted.ior = *ior;
                    converted.reflectance = reflectance.to_array();
                    converted.eta = transmittance.to_array();
                }
                MaterialKind::Measured { table, .. } => {
                    converted.kind = MATERIAL_MEASURED;
                    if anisotropy.strength > 0.0 {
                        converted.anisotropy = Vec2::from_angle(anisotropy.rotation).to_array();
                    }
                    converted.table_offset =
                        *measured_offsets.entry(Arc::as_ptr(table)).or_insert_with(|| {
                            // Align to pairs of words, the unit in which cells are read.
                            if (tables.words.len() + MEASURED_GRID_OFFSET as usize) % 2 == 1 {
                                tables.words.push(0);
                            }
                            tables.append(table.words())
                        });
                }
            }
            tables.materials.push(converted);
        }
        Ok(tables)
    }

    fn append(&mut self, words: &[u32]) -> u32 {
        let first = self.words.len() as u32;
        self.words.extend_from_slice(words);
        first
    }
}

/// Fails if the measured tables do not fit into one buffer.
fn check_size(materials: &[Material]) -> Result<()> {
    // Count the tables that surfaces of one distribution share, and the word that is always there.
    let mut bytes = (2 * GGX_WORDS + 1) * 4;
    let mut seen = Vec::new();
    let mut names = Vec::new();
    for material in materials {
        let MaterialKind::Measured { table, .. } = &material.kind else {
            // Count at most three tables over the cosine.
            bytes += 3 * BRDF_COSINE_NODES as usize * 4;
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
