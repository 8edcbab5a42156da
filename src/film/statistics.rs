//! Statistics of a render as JSON, which `render --stats` writes.

use std::{collections::BTreeMap, fmt};

use serde::{Deserialize, Serialize};

use super::metadata::SampleRange;

/// Figures of one render. Times cover this run only, even if it continued a checkpoint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Statistics {
    /// Fenestra's version.
    pub version: String,
    /// Scene name.
    pub scene: String,
    /// `Scene::hash`.
    pub scene_hash: String,
    /// Triangles in the scene.
    pub triangles: u64,
    /// Width of the rendered window in pixels.
    pub width: u32,
    /// Height of the rendered window in pixels.
    pub height: u32,
    /// Vulkan device.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// Sampler's name.
    pub sampler: String,
    /// Sampler's parameters as text, by name.
    pub sampler_parameters: BTreeMap<String, String>,
    /// Number of candidates from which `guided` chose each shadow ray, asked for or measured;
    /// absent for other samplers and in open scenes.
    pub candidates: Option<u32>,
    /// Costs measured in this run to choose that number; empty if none were.
    pub candidate_costs: Vec<CandidateCost>,
    /// Directions traced at every vertex.
    pub shadow_rays_per_vertex: u32,
    /// Edge of the cohorts that share paths as `guided` chose it, 1 for none; absent where it was given,
    /// in open scenes and in direct light.
    pub share_paths: Option<u32>,
    /// Gain measured in this run for that choice; absent if none was.
    pub sharing_gain: Option<SharingGain>,
    /// Path vertices at which environment light is gathered.
    pub depth: u32,
    /// Samples of every pixel that the image holds.
    pub sample_ranges: Vec<SampleRange>,
    /// Camera paths per pixel, over all ranges.
    pub samples_per_pixel: u32,
    /// Rule that ended the run: `spp`, `time`, `error`, `interrupt`.
    pub stop_reason: String,
    /// Mean relative standard error of the pixels (`Sums::relative_standard_error`); absent below
    /// two samples and in a black image.
    pub relative_standard_error: Option<f64>,
    /// Wall time of the passes, seconds.
    pub seconds: f64,
    /// Rays traced by kind: `camera`, `shadow`, `bounce`.
    pub rays: BTreeMap<String, u64>,
    /// Share of shadow rays that reached the environment; absent if none was traced.
    pub visible_share: Option<f64>,
    /// Mean entries in the visibility cache per hit, for samplers that have one.
    pub cache_entries_per_hit: Option<f64>,
    /// Mean product lobes kept per hit, for samplers with a product.
    pub lobes_per_hit: Option<f64>,
    /// Mean share of the product's energy in the kept lobes, for samplers with a product.
    pub energy_kept: Option<f64>,
    /// Mean rebuilds of the lobe probabilities per hit, for samplers that have them.
    pub cdf_rebuilds_per_hit: Option<f64>,
    /// Samples dropped because their radiance was not finite.
    pub dropped_samples: u64,
    /// True if any sample found light; otherwise the image is black.
    pub found_light: bool,
    /// Warnings of loading and rendering, parts of files that were left out among them.
    pub warnings: Vec<String>,
    /// Device time by pass, milliseconds.
    pub gpu_ms: BTreeMap<String, f64>,
    /// Host time by stage (`load`, `fit`, `bvh`, `upload`, …), milliseconds.
    pub host_ms: BTreeMap<String, f64>,
    /// Pipeline compile time by pass, milliseconds.
    pub pipeline_compile_ms: BTreeMap<String, f64>,
    /// Device memory by buffer, bytes.
    pub buffer_bytes: BTreeMap<String, u64>,
}

/// Measured gain of paths that the pixels of a cohort share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SharingGain {
    /// Relative variance without sharing over that with it, as in [`CandidateCost`].
    pub variance_ratio: f64,
    /// Standard error over the blocks of its logarithm; 1000 if there is only one block.
    pub log_error: f64,
}

impl fmt::Display for SharingGain {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:.2} (±{:.0}%)", self.variance_ratio, 100.0 * self.log_error)
    }
}

/// Measured cost of a number of candidates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CandidateCost {
    /// Candidates per shadow ray.
    pub candidates: u32,
    /// Device milliseconds of all passes for one sample of every pixel.
    pub ms_per_sample: f64,
    /// Variance of a pixel's samples relative to the squared mean of its block, geometric mean over
    /// the blocks.
    pub relative_variance: f64,
    /// Standard error over the blocks of the logarithm of the variance relative to that of the
    /// fewest candidates measured; 0 for these, 1000 if there is only one block.
    pub log_variance_error: f64,
}

impl fmt::Display for CandidateCost {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { candidates, ms_per_sample, relative_variance, log_variance_error } = self;
        let percent = 100.0 * log_variance_error;
        write!(
            formatter,
            "{candidates}: {ms_per_sample:.2} ms a sample, relative variance {relative_variance:.3} \
             (±{percent:.0}%)"
        )
    }
}
