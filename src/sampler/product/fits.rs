//! Fits of environment and materials on the device, for `product` and `visibility`.

use std::{collections::BTreeMap, sync::Arc, time::Instant};

use super::parameters::{Elevation, LobeOrder, ProductParameters};
use crate::{
    brdf::MaterialTables,
    error::{Error, Result},
    fit::{
        self, BrdfFit, BrdfOptions, EnvironmentLobe, EnvironmentOptions, Method, brdf_lobes,
        environment_lobes,
    },
    gpu::{Buffer, Device},
    scene::{Scene, material::Material},
    shader::{bindings::Binding, rooms::product},
};

/// Sizes of the fits on the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSizes {
    /// Lobes of the environment; 0 if nothing could be fitted.
    pub environment_lobes: u32,
    /// Logarithm of the largest integral of an environment lobe over 2π, in the form of
    /// `multiply_lobes.comp`, or of the largest amplitude if lobes are ordered by coefficient.
    pub strongest_environment_lobe: f32,
    /// Largest number of lobes of a material in one view.
    pub brdf_lobes: u32,
    /// Number of view elevations.
    pub views: u32,
}

/// SRBF tables of a scene.
pub struct Fits {
    /// The tables at their bindings.
    pub bound: [(Binding, Buffer); 3],
    /// Numbers of lobes and views.
    pub sizes: FitSizes,
    /// Hash of each fit, by the name of its input.
    pub(super) hashes: BTreeMap<String, String>,
    /// Milliseconds spent on all fits, or on finding them in the cache.
    pub(super) fit_ms: f64,
}

impl Fits {
    /// Fits the environment and every material, or takes the fits from the user's cache, and
    /// uploads them. A black map or material, which cannot be fitted, gets no lobes and a warning;
    /// specular materials get none.
    /// Fails if numbers of lobes or views are out of range, or if the device fails.
    pub fn new(
        device: &Arc<Device>,
        scene: &Scene,
        parameters: &ProductParameters,
    ) -> Result<Self> {
        if parameters.elevation == Elevation::Metropolis {
            log::warn!("--set elevation=metropolis: a short random walk, so the image is biased");
        }
        let start = Instant::now();
        let cache = fit::Cache::user();
        let mut hashes = BTreeMap::new();

        log::info!("fitting the environment of {}", scene.name);
        let options = EnvironmentOptions {
            lobes: parameters.environment_lobes as usize,
            method: Method::default(),
        };
        let fitted = environment_lobes(&scene.environment, options, cache.as_ref(), &mut |_| ());
        let environment: Vec<EnvironmentLobe> = or_warn(fitted)?
            .map(|fit| fit.world_lobes(scene.environment.rotation_rad))
            .unwrap_or_default();
        hashes.insert(
            "environment".to_owned(),
            fit::cache::key(&[bytemuck::cast_slice(&environment)]),
        );

        // Lobes serve a whole material, so that textures enter by their means.
        let means: Vec<_> = scene
            .materials
            .iter()
            .map(|material| {
                let mut mean = Material::new(&material.name, material.mean_kind());
                mean.surface.distribution = material.surface.distribution;
                mean
            })
            .collect();
        let tables = MaterialTables::new(&means)?;
        let options = BrdfOptions {
            lobes: parameters.brdf_lobes as usize,
            views: parameters.views as usize,
            method: Method::default(),
        };
        let mut lobes: Vec<[f32; 4]> = Vec::new();
        let mut materials: Vec<[u32; 2]> = Vec::new();
        for (index, material) in scene.materials.iter().enumerate() {
            let first = lobes.len();
            if material.kind.is_specular() {
                materials.push([first as u32, 0]);
                continue;
            }
            log::info!("fitting the material {}", material.name);
            let fitted =
                brdf_lobes(&tables, index, &material.name, options, cache.as_ref(), &mut |_| ());
            let per_view = or_warn(fitted)?.map_or(0, |fit| append(&mut lobes, &fit));
            materials.push([first as u32, per_view]);
            hashes.insert(
                format!("material {}", material.name),
                fit::cache::key(&[bytemuck::cast_slice(&lobes[first..])]),
            );
        }
        let strength = |lobe: &EnvironmentLobe| match parameters.order {
            LobeOrder::Integral => lobe.amplitude.ln() - lobe.bandwidth.hypot(0.5).ln(),
            LobeOrder::Coefficient => lobe.amplitude.ln(),
        };
        let sizes = FitSizes {
            strongest_environment_lobe: environment.iter().map(strength).fold(f32::MIN, f32::max),
            environment_lobes: environment.len() as u32,
            brdf_lobes: materials.iter().map(|material| material[1]).max().unwrap_or(0),
            views: parameters.views,
        };
        let fit_ms = start.elapsed().as_secs_f64() * 1e3;

        let environment: Vec<[f32; 4]> = environment
            .iter()
            .map(|lobe| exponents(lobe.axis, lobe.bandwidth, lobe.amplitude))
            .collect();
        let texels = |name, words| Buffer::texels_from_slice(device, name, words);
        let bound = [
            (product::ENVIRONMENT_LOBES, texels("environment lobes", &environment)?),
            (product::BRDF_LOBES, texels("BRDF lobes", &lobes)?),
            (
                product::MATERIAL_LOBES,
                Buffer::texels_from_slice(device, "material lobes", &materials)?,
            ),
        ];
        Ok(Self { bound, sizes, hashes, fit_ms })
    }
}

fn or_warn<T>(fitted: Result<T>) -> Result<Option<T>> {
    match fitted {
        Ok(fit) => Ok(Some(fit)),
        Err(error @ Error::Fit { .. }) => {
            log::warn!("{error}; sampling does without its lobes");
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

/// Returns the texel of a lobe: exponents that add up in products, see `ENVIRONMENT_LOBES`.
fn exponents(axis: [f32; 3], bandwidth: f32, amplitude: f32) -> [f32; 4] {
    let [x, y, z] = axis.map(|component| bandwidth * component);
    // A lobe without amplitude is weaker than all others.
    let logarithm = if amplitude > 0.0 { amplitude.ln() } else { -1e30 };
    [x, y, z, logarithm - bandwidth]
}

/// Appends the lobes of all views; returns the number per view.
fn append(lobes: &mut Vec<[f32; 4]>, fit: &BrdfFit) -> u32 {
    lobes.extend(
        fit.views
            .iter()
            .flat_map(|view| &view.lobes)
            .map(|lobe| exponents(lobe.axis.to_array(), lobe.bandwidth, lobe.amplitude)),
    );
    fit.views.first().map_or(0, |view| view.lobes.len() as u32)
}
