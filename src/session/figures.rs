//! Figures of a renderer besides its picture.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Renderer;
use crate::pass::Totals;

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
