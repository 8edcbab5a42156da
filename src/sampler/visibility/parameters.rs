//! Parameters of the visibility cache.

use crate::{
    error::{Error, Result},
    sampler::knob::{self, Knob},
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

/// Parameters of `visibility` beside those of `product`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisibilityParameters {
    /// `k`: exponent of the visibility weight `(1 / (1 + Num))^k`.
    pub exponent: f32,
    /// `tau`: closeness in deviations of a lobe.
    pub threshold_scale: f32,
    /// `threshold`: `sigma` or `fixed`.
    pub threshold: Threshold,
    /// `cache`: `hit` or `pixel`.
    pub cache: CacheScope,
    /// `cache-capacity`: directions in a cache.
    pub cache_capacity: u32,
}

impl Default for VisibilityParameters {
    fn default() -> Self {
        Self {
            exponent: 2.0,
            threshold_scale: 1.0,
            threshold: Threshold::Sigma,
            cache: CacheScope::Hit,
            cache_capacity: 16,
        }
    }
}

impl VisibilityParameters {
    pub(in crate::sampler) const KNOBS: &'static [Knob<Self>] = &[
        Knob {
            key: "k",
            set: |own, value| knob::number(&mut own.exponent, value, 0.0..=16.0),
            get: |own| own.exponent.to_string(),
        },
        Knob {
            key: "tau",
            set: |own, value| knob::number(&mut own.threshold_scale, value, 0.0..=100.0),
            get: |own| own.threshold_scale.to_string(),
        },
        Knob {
            key: "threshold",
            set: |own, value| knob::choice(&mut own.threshold, value, THRESHOLDS),
            get: |own| knob::name_of(&own.threshold, THRESHOLDS),
        },
        Knob {
            key: "cache",
            set: |own, value| knob::choice(&mut own.cache, value, SCOPES),
            get: |own| knob::name_of(&own.cache, SCOPES),
        },
        Knob {
            key: "cache-capacity",
            set: |own, value| knob::number(&mut own.cache_capacity, value, 1..=64),
            get: |own| own.cache_capacity.to_string(),
        },
    ];

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn caches_of_pixels_need_direct_light() {
        let pixel =
            VisibilityParameters { cache: CacheScope::Pixel, ..VisibilityParameters::default() };
        let message = pixel.check(2).map_or_else(|error| error.to_string(), |()| String::new());
        assert!(message.contains("--depth 2"), "{message}");
        assert!(pixel.check(1).is_ok() && VisibilityParameters::default().check(2).is_ok());
    }
}
