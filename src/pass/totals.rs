//! Totals of a renderer: counts of the device, summed over its waves.

use std::collections::BTreeMap;

use crate::{gpu::PassTimes, shader::structs::Counters};

/// Totals since the start of a renderer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Totals {
    /// Camera rays.
    pub camera_rays: u64,
    /// Bounce rays.
    pub bounce_rays: u64,
    /// Shadow rays traced.
    pub shadow_rays_traced: u64,
    /// Shadow rays that reached the environment.
    pub shadow_rays_visible: u64,
    /// Samples left out because their radiance was not finite.
    pub dropped_samples: u64,
    /// Rays abandoned after too many traversal steps.
    pub traversal_overruns: u64,
    /// Bounds of their pixels in the crop window: left, top, right, bottom, the latter two excluded;
    /// none without such rays.
    pub overrun_pixels: Option<[u32; 4]>,
    /// Hits with product lobes.
    pub product_hits: u64,
    /// Lobes kept at these hits.
    pub lobes_kept: u64,
    /// Share of the product's energy kept, summed over these hits, in 256ths.
    pub energy_kept: u64,
    /// Directions recorded in visibility caches.
    pub cache_entries: u64,
    /// Times that the weights of a hit's lobes were summed again because its cache had grown.
    pub cdf_rebuilds: u64,
    /// Passes of waves: fewer where no path reaches the later vertices.
    pub passes: u64,
    /// Device milliseconds by pass.
    pub gpu_ms: PassTimes,
}

impl Totals {
    /// Adds the counts of the device.
    pub(crate) fn add(&mut self, counters: &Counters) {
        macro_rules! count {
            ($($name:ident),*) => { $(self.$name += u64::from(counters.$name);)* };
        }
        count!(camera_rays, bounce_rays, shadow_rays_traced, shadow_rays_visible, dropped_samples);
        count!(
            traversal_overruns,
            product_hits,
            lobes_kept,
            energy_kept,
            cache_entries,
            cdf_rebuilds
        );
        if counters.traversal_overruns > 0 {
            let [left, top] = [!counters.overrun_left, !counters.overrun_top];
            let new = [left, top, counters.overrun_right, counters.overrun_bottom];
            let [a, b, c, d] = self.overrun_pixels.unwrap_or(new);
            self.overrun_pixels =
                Some([a.min(new[0]), b.min(new[1]), c.max(new[2]), d.max(new[3])]);
        }
    }

    /// Rays of every kind.
    pub(crate) fn rays(&self) -> u64 {
        self.camera_rays + self.bounce_rays + self.shadow_rays_traced
    }

    /// Returns the share of paths that are alive at a vertex after the first, of `depth` vertices; 1 before
    /// any is known.
    pub(crate) fn living_share(&self, depth: u32) -> f64 {
        let all = self.camera_rays as f64 * f64::from(depth.saturating_sub(1));
        if all > 0.0 { self.bounce_rays as f64 / all } else { 1.0 }
    }

    /// Returns sampler statistics as means per hit, by name; empty for samplers without lobes.
    pub fn sampler_statistics(&self) -> BTreeMap<String, f64> {
        if self.product_hits == 0 {
            return BTreeMap::new();
        }
        let per_hit = |count: u64| count as f64 / self.product_hits as f64;
        [
            ("lobes_per_hit", per_hit(self.lobes_kept)),
            ("energy_kept", per_hit(self.energy_kept) / 256.0),
            ("cache_entries_per_hit", per_hit(self.cache_entries)),
            ("cdf_rebuilds_per_hit", per_hit(self.cdf_rebuilds)),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_living_are_counted_at_the_vertices_that_paths_may_reach() {
        // Ten paths of four vertices: six bounce once, three of them again, and none a third time.
        let totals = Totals { camera_rays: 10, bounce_rays: 9, ..Totals::default() };
        assert!((totals.living_share(4) - 0.3).abs() < 1e-12);
        assert_eq!(totals.living_share(1), 1.0);
    }
}
