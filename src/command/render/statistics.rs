//! Statistics of a render, for `--stats`.

use super::{RenderJob, StopReason};
use crate::{
    film::{Metadata, Statistics},
    session::Renderer,
    study::record::Figures,
};

impl RenderJob<'_> {
    /// Collects the statistics of the render so far.
    pub(super) fn statistics(
        &self,
        renderer: &Renderer,
        metadata: &Metadata,
        reason: StopReason,
        load_ms: f64,
    ) -> Statistics {
        let totals = renderer.totals();
        let mut host_ms = renderer.host_ms();
        host_ms.insert("load".into(), load_ms);
        let figures = Figures::of(renderer, self.seconds());
        let figure = |name: &str| figures.statistics.get(name).copied();
        Statistics {
            version: metadata.version.clone(),
            scene: metadata.scene.clone(),
            scene_hash: metadata.scene_hash.clone(),
            triangles: self.scene.geometry.triangle_count(),
            width: self.window.width,
            height: self.window.height,
            device: metadata.device.clone(),
            driver: metadata.driver.clone(),
            sampler: metadata.sampler.clone(),
            sampler_parameters: metadata.sampler_parameters.clone(),
            candidates: renderer.report().candidates,
            candidate_costs: renderer.report().candidate_costs,
            shadow_rays_per_vertex: metadata.shadow_rays,
            share_tiles: renderer.report().share_tiles,
            sharing_gain: renderer.report().sharing_gain,
            depth: metadata.depth,
            sample_ranges: metadata.sample_ranges.clone(),
            samples_per_pixel: renderer.sample_count(),
            stop_reason: reason.name().to_owned(),
            relative_standard_error: self.relative_error.filter(|error| error.is_finite()),
            seconds: self.seconds(),
            visible_share: figures.visible_share,
            cache_entries_per_hit: figure("cache_entries_per_hit"),
            lobes_per_hit: figure("lobes_per_hit"),
            energy_kept: figure("energy_kept"),
            cdf_rebuilds_per_hit: figure("cdf_rebuilds_per_hit"),
            rays: figures.rays,
            found_light: self.found_light,
            warnings: self.scene.warnings.iter().chain(&self.warnings).cloned().collect(),
            dropped_samples: totals.dropped_samples,
            gpu_ms: totals.gpu_ms.clone(),
            host_ms,
            pipeline_compile_ms: renderer.compile_ms().clone(),
            buffer_bytes: renderer.buffer_bytes(),
        }
    }
}
