//! Parameters of the visibility cache.

use crate::{
    error::{Error, Result},
    sampler::knob::parameters,
};

/// Criterion for a direction close to a lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Threshold {
    /// `1 − ξ·d < τσ` with the deviation σ of the lobe (Wu & Shih 2009, Eq. 9 and 10).
    Sigma,
    /// The same for all lobes: σ of bandwidth 20.
    Fixed,
}

const THRESHOLDS: &[(&str, Threshold)] =
    &[("sigma", Threshold::Sigma), ("fixed", Threshold::Fixed)];

/// Lifetime of a visibility cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CacheScope {
    /// One hit, as in the thesis.
    Hit,
    /// All samples of a pixel.
    Pixel,
}

const SCOPES: &[(&str, CacheScope)] = &[("hit", CacheScope::Hit), ("pixel", CacheScope::Pixel)];

parameters! {
    /// Parameters of `visibility` beside those of `product`.
    pub struct VisibilityParameters {
        /// `k`: exponent of the visibility weight `(1 / (1 + Num))^k`.
        "k" exponent: f32 = 2.0, 0.0..=16.0;
        /// `tau`: closeness in deviations of a lobe.
        "tau" threshold_scale: f32 = 1.0, 0.0..=100.0;
        /// `threshold`: closeness that counts, by the deviation of each lobe or fixed.
        "threshold" threshold: Threshold = Threshold::Sigma, THRESHOLDS;
        /// `cache`: lifetime of a cache, one hit as in the thesis or all samples of a pixel.
        "cache" cache: CacheScope = CacheScope::Hit, SCOPES;
        /// `cache-capacity`: directions in a cache.
        "cache-capacity" cache_capacity: u32 = 16, 1..=64;
    }
}

impl VisibilityParameters {
    /// Returns [`Error::Usage`] for combinations that cannot be rendered.
    pub fn check(&self, depth: u32) -> Result<()> {
        if self.cache == CacheScope::Pixel && depth > 1 {
            return Err(Error::usage(format!(
                "--set cache=pixel with --depth {depth}: a cache of a pixel serves its first hits \
                 alone; use --depth 1 or cache=hit"
            )));
        }
        Ok(())
    }

    /// Returns the places of a cache at `shadow_rays` rays per hit: a cache cleared at every hit
    /// holds no more than the rays before the last.
    pub fn cache_places(&self, shadow_rays: u32) -> u32 {
        match self.cache {
            CacheScope::Hit => self.cache_capacity.min(shadow_rays.saturating_sub(1)).max(1),
            CacheScope::Pixel => self.cache_capacity,
        }
    }
}
