//! Statistics and warnings of a render.

use super::{Figures, Session, StopReason, traced_window, window_of};
use crate::{
    film::{Statistics, Window},
    scene::Scene,
};

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
            pipeline_compile_ms: renderer.compile_ms().clone(),
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
