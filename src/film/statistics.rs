//! Statistics of a render as JSON, which `render --stats` writes.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

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
    /// Its tracer.
    pub tracer: String,
    /// Sampler's name.
    pub sampler: String,
    /// Sampler's parameters as text, by name.
    pub sampler_parameters: BTreeMap<String, String>,
    /// Number of candidates from which `guided` chose each shadow ray, asked for or measured;
    /// absent for other samplers and in open scenes.
    pub candidates: Option<u32>,
    /// Directions traced at every vertex.
    pub shadow_rays_per_vertex: u32,
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
    /// Further figures of the sampler, by name.
    #[serde(flatten)]
    pub sampler_figures: BTreeMap<String, Value>,
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
