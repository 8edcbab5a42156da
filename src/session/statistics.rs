//! Figures of a renderer besides its picture; statistics and warnings of a render.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{Renderer, Session, StopReason, traced_window, window_of};
use crate::{
    film::{Statistics, Window},
    pass::Totals,
    scene::Scene,
};

/// Name of the guide's rebuilds in [`Renderer::host_ms`].
const GUIDE_REBUILDS: &str = "guide rebuilds";

/// Figures of a renderer besides its picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Device milliseconds per sample of every pixel, by pass.
    pub gpu_ms_per_sample: BTreeMap<String, f64>,
    /// Rays traced by kind.
    pub rays: BTreeMap<String, u64>,
    /// Share of shadow rays that reached the environment; absent if none was traced.
    pub visible_share: Option<f64>,
    /// Other figures of the sampler, by name.
    pub statistics: BTreeMap<String, f64>,
}

impl Figures {
    /// Collects a renderer's figures since its last restart, over `seconds` of passes.
    pub fn of(renderer: &Renderer, seconds: f64) -> Self {
        let totals = renderer.totals();
        let samples = f64::from(renderer.sample_count().max(1));
        let gpu_ms = totals.gpu_ms.iter();
        let candidates = renderer.report().candidates;
        Self {
            gpu_ms_per_sample: gpu_ms.map(|(pass, ms)| (pass.clone(), ms / samples)).collect(),
            rays: [
                ("camera".to_owned(), totals.camera_rays),
                ("bounce".to_owned(), totals.bounce_rays),
                ("shadow".to_owned(), totals.shadow_rays_traced),
            ]
            .into(),
            visible_share: (totals.shadow_rays_traced > 0)
                .then(|| totals.shadow_rays_visible as f64 / totals.shadow_rays_traced as f64),
            statistics: statistics(totals)
                .chain(guide_rebuild_share(&renderer.host_ms(), seconds))
                .chain(candidates.map(|count| ("candidates".to_owned(), f64::from(count))))
                .collect(),
        }
    }
}

/// Figures that only some samplers or some runs have; dropped samples and overruns only if not 0.
fn statistics(totals: &Totals) -> impl Iterator<Item = (String, f64)> {
    [
        ("dropped_samples", totals.dropped_samples as f64),
        ("traversal_overruns", totals.traversal_overruns as f64),
    ]
    .into_iter()
    .filter(|(_, value)| *value != 0.0)
    .map(|(name, value)| (name.to_owned(), value))
    .chain(totals.sampler_statistics())
}

/// Share of the passes' wall time that the host spent on rebuilding the guide, if there is one.
fn guide_rebuild_share(host_ms: &BTreeMap<String, f64>, seconds: f64) -> Option<(String, f64)> {
    let ms = host_ms.get(GUIDE_REBUILDS)?;
    (seconds > 0.0).then(|| ("guide_rebuild_share".to_owned(), 1e-3 * ms / seconds))
}

impl Session {
    /// Collects the statistics of a run that `reason` has ended, with the warnings of the scene.
    pub fn statistics(&self, scene: &Scene, reason: StopReason) -> Statistics {
        let renderer = &self.renderer;
        let (totals, report) = (renderer.totals(), renderer.report());
        let figures = Figures::of(renderer, self.seconds());
        let mut sampler_figures = report.figures;
        let of_totals = totals.sampler_statistics().into_iter();
        sampler_figures.extend(of_totals.map(|(name, value)| (name, value.into())));
        let metadata = self.metadata();
        let window = window_of(renderer.settings(), scene);
        let portals = renderer.settings().sampler.portal_warning(scene);
        Statistics {
            version: metadata.version,
            scene: metadata.scene,
            scene_hash: metadata.scene_hash,
            triangles: scene.geometry.triangle_count(),
            width: window.width,
            height: window.height,
            device: metadata.device,
            driver: metadata.driver,
            tracer: metadata.tracer,
            sampler: metadata.sampler,
            sampler_parameters: metadata.sampler_parameters,
            candidates: report.candidates,
            shadow_rays_per_vertex: metadata.shadow_rays,
            depth: metadata.depth,
            sample_ranges: metadata.sample_ranges,
            samples_per_pixel: renderer.sample_count(),
            stop_reason: reason.name().to_owned(),
            relative_standard_error: self.relative_error.filter(|error| error.is_finite()),
            seconds: self.seconds(),
            visible_share: figures.visible_share,
            sampler_figures,
            rays: figures.rays,
            found_light: self.found_light,
            warnings: scene.warnings.iter().cloned().chain(portals).collect(),
            dropped_samples: totals.dropped_samples,
            gpu_ms: totals.gpu_ms.clone(),
            host_ms: renderer.host_ms(),
            pipeline_compile_ms: renderer.runner.compile_ms.clone(),
            buffer_bytes: renderer.buffer_bytes(),
        }
    }

    /// Returns what the picture suffers from: darkness, samples left out, rays given up.
    pub fn warnings(&self, scene: &Scene) -> Vec<String> {
        let totals = self.renderer.totals();
        let mut warnings = Vec::new();
        if !self.found_light {
            warnings.push("no sample has found any light: the image is black".to_owned());
        }
        if totals.dropped_samples > 0 {
            warnings.push(format!(
                "{} samples were left out because their radiance was not finite",
                totals.dropped_samples
            ));
        }
        if let Some([left, top, right, bottom]) = totals.overrun_pixels {
            let Window { x, y, .. } = traced_window(self.renderer.settings(), scene);
            warnings.push(format!(
                "{} rays were given up after too many steps of traversal, where many triangles meet in \
                 one place: pixels within --crop {},{},{},{} may be wrong",
                totals.traversal_overruns,
                left + x,
                top + y,
                right + x,
                bottom + y
            ));
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_of_rebuilds_is_of_the_wall_time() {
        let host_ms = BTreeMap::from([(GUIDE_REBUILDS.to_owned(), 500.0), ("bvh".into(), 9.0)]);
        let share = guide_rebuild_share(&host_ms, 20.0);
        assert_eq!(share, Some(("guide_rebuild_share".to_owned(), 0.025)));
        assert_eq!(guide_rebuild_share(&host_ms, 0.0), None);
        assert_eq!(guide_rebuild_share(&BTreeMap::new(), 20.0), None);
    }
}
