//! Parameters of the samplers `product` and `visibility`.

use std::{collections::BTreeMap, fmt::Display, ops::RangeInclusive, str::FromStr};

use crate::error::{Error, Result};

/// By what the lobes of a product are ordered before the weakest are dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LobeOrder {
    /// Their integral over the sphere.
    Integral,
    /// Their coefficient, as in the thesis.
    Coefficient,
}

/// When a direction counts as close to a lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Threshold {
    /// `1 − ξ·d < τσ` with the deviation σ of the lobe (Wu & Shih 2009, Eq. 9 and 10).
    Sigma,
    /// The same for all lobes: σ of the bandwidth 20.
    Fixed,
}

/// How long a visibility cache lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CacheScope {
    /// One hit, as in the thesis.
    Hit,
    /// All samples of a pixel.
    Pixel,
}

/// How the elevation of a direction within its lobe is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elevation {
    /// By inversion of the closed form.
    Inverse,
    /// By a short Metropolis walk, as in the thesis: biased.
    Metropolis,
}

impl Elevation {
    fn describe(self) -> &'static str {
        match self {
            Self::Inverse => "inverse",
            Self::Metropolis => "metropolis (biased)",
        }
    }
}

/// Parameters of `product` and `visibility`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeParameters {
    /// `environment_lobes`: lobes fitted to the environment.
    pub environment_lobes: u32,
    /// `brdf_lobes`: lobes fitted to each view of a material.
    pub brdf_lobes: u32,
    /// `views`: view elevations at which a material is fitted; a hit takes the nearest.
    pub views: u32,
    /// `lobes`: lobes of the product that are kept at a hit.
    pub kept_lobes: u32,
    /// `order`: `integral` or `coefficient`.
    pub order: LobeOrder,
    /// `brdf_share`: share of directions from the BRDF's own sampling, more than 0.
    pub brdf_share: f32,
    /// `environment_share`: share of directions from the environment map.
    pub environment_share: f32,
    /// `k`: exponent of the visibility weight `(1 / (1 + Num))^k`.
    pub exponent: f32,
    /// `tau`: closeness in deviations of a lobe.
    pub threshold_scale: f32,
    /// `threshold`: `sigma` or `fixed`.
    pub threshold: Threshold,
    /// `cache`: `hit` or `pixel`.
    pub cache: CacheScope,
    /// `cache_capacity`: directions that a cache holds.
    pub cache_capacity: u32,
    /// `count_visible`: whether visible directions are recorded too and raise a lobe's weight.
    pub count_visible: bool,
    /// `elevation`: `inverse` or `metropolis`.
    pub elevation: Elevation,
}

impl Default for LobeParameters {
    fn default() -> Self {
        Self {
            environment_lobes: 100,
            brdf_lobes: 20,
            views: 32,
            kept_lobes: 64,
            order: LobeOrder::Integral,
            brdf_share: 0.25,
            environment_share: 0.25,
            exponent: 2.0,
            threshold_scale: 1.0,
            threshold: Threshold::Sigma,
            cache: CacheScope::Hit,
            cache_capacity: 16,
            count_visible: false,
            elevation: Elevation::Inverse,
        }
    }
}

/// Most products at a hit. Mesa 22.3 ends the loops of an invocation after 65,535 rounds in all; the
/// product pass makes up to 17 for every environment lobe and 20 BRDF lobes.
const MOST_PAIRS: u32 = 25_000;

impl LobeParameters {
    /// Keys of `--set`.
    pub const KEYS: [&'static str; 15] = [
        "preset",
        "environment_lobes",
        "brdf_lobes",
        "views",
        "lobes",
        "order",
        "brdf_share",
        "environment_share",
        "k",
        "tau",
        "threshold",
        "cache",
        "cache_capacity",
        "count_visible",
        "elevation",
    ];

    /// Sets one parameter; false where the key is none of [`LobeParameters::KEYS`].
    ///
    /// # Errors
    /// [`Error::Usage`] for a value out of range.
    pub fn set(&mut self, key: &str, value: &str) -> Result<bool> {
        match key {
            "preset" => match choice(key, value, &[("default", false), ("strict", true)])? {
                false => *self = Self::default(),
                true => *self = Self::strict(),
            },
            "environment_lobes" => self.environment_lobes = number(key, value, 1..=1000)?,
            "brdf_lobes" => self.brdf_lobes = number(key, value, 1..=64)?,
            "views" => self.views = number(key, value, 1..=256)?,
            "lobes" => self.kept_lobes = number(key, value, 1..=512)?,
            "order" => {
                let names =
                    [("integral", LobeOrder::Integral), ("coefficient", LobeOrder::Coefficient)];
                self.order = choice(key, value, &names)?;
            }
            "brdf_share" => self.brdf_share = number(key, value, 0.001..=1.0)?,
            "environment_share" => self.environment_share = number(key, value, 0.0..=0.999)?,
            "k" => self.exponent = number(key, value, 0.0..=16.0)?,
            "tau" => self.threshold_scale = number(key, value, 0.0..=100.0)?,
            "threshold" => {
                let names = [("sigma", Threshold::Sigma), ("fixed", Threshold::Fixed)];
                self.threshold = choice(key, value, &names)?;
            }
            "cache" => {
                let names = [("hit", CacheScope::Hit), ("pixel", CacheScope::Pixel)];
                self.cache = choice(key, value, &names)?;
            }
            "cache_capacity" => self.cache_capacity = number(key, value, 1..=64)?,
            "count_visible" => {
                self.count_visible = choice(key, value, &[("no", false), ("yes", true)])?;
            }
            "elevation" => {
                let names =
                    [("inverse", Elevation::Inverse), ("metropolis", Elevation::Metropolis)];
                self.elevation = choice(key, value, &names)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// The thesis to the letter where the letter is sound: lobes by coefficient, and of the shares
    /// that it does not have only as much as keeps the sampler unbiased.
    pub fn strict() -> Self {
        Self {
            order: LobeOrder::Coefficient,
            brdf_share: 0.05,
            environment_share: 0.0,
            ..Self::default()
        }
    }

    /// Refuses combinations that cannot be rendered.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check(&self, depth: u32) -> Result<()> {
        if self.brdf_share + self.environment_share > 1.0 {
            return Err(Error::usage(format!(
                "--set brdf_share={} and environment_share={}: expected a sum of at most 1",
                self.brdf_share, self.environment_share
            )));
        }
        if self.environment_lobes * self.brdf_lobes > MOST_PAIRS {
            return Err(Error::usage(format!(
                "--set environment_lobes={} and brdf_lobes={}: {} products, expected at most \
                 {MOST_PAIRS}",
                self.environment_lobes,
                self.brdf_lobes,
                self.environment_lobes * self.brdf_lobes
            )));
        }
        if self.cache == CacheScope::Pixel && depth > 1 {
            return Err(Error::usage(format!(
                "--set cache=pixel with --depth {depth}: a cache of a pixel serves its first hits \
                 alone; use --depth 1 or cache=hit"
            )));
        }
        Ok(())
    }

    /// Places of a visibility cache at `shadow_rays` rays per hit: a cache that is cleared at every hit
    /// holds no more than the rays before the last.
    pub fn cache_places(&self, shadow_rays: u32) -> u32 {
        match self.cache {
            CacheScope::Hit => self.cache_capacity.min(shadow_rays.saturating_sub(1)).max(1),
            CacheScope::Pixel => self.cache_capacity,
        }
    }

    /// The parameters by name; those of the visibility cache where `with_cache`.
    pub fn describe(&self, with_cache: bool) -> BTreeMap<String, String> {
        let mut named: BTreeMap<String, String> = [
            ("environment_lobes", self.environment_lobes.to_string()),
            ("brdf_lobes", self.brdf_lobes.to_string()),
            ("views", self.views.to_string()),
            ("lobes", self.kept_lobes.to_string()),
            ("order", format!("{:?}", self.order).to_lowercase()),
            ("brdf_share", self.brdf_share.to_string()),
            ("environment_share", self.environment_share.to_string()),
            ("elevation", self.elevation.describe().to_owned()),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into();
        if with_cache {
            named.extend(
                [
                    ("k", self.exponent.to_string()),
                    ("tau", self.threshold_scale.to_string()),
                    ("threshold", format!("{:?}", self.threshold).to_lowercase()),
                    ("cache", format!("{:?}", self.cache).to_lowercase()),
                    ("cache_capacity", self.cache_capacity.to_string()),
                    ("count_visible", if self.count_visible { "yes" } else { "no" }.to_owned()),
                ]
                .map(|(key, value)| (key.to_owned(), value)),
            );
        }
        named
    }
}

fn number<T: FromStr + PartialOrd + Display>(
    key: &str,
    value: &str,
    range: RangeInclusive<T>,
) -> Result<T> {
    value.parse().ok().filter(|number| range.contains(number)).ok_or_else(|| {
        let (least, most) = (range.start(), range.end());
        Error::usage(format!("--set {key}={value}: expected {least} to {most}"))
    })
}

fn choice<T: Copy>(key: &str, value: &str, names: &[(&str, T)]) -> Result<T> {
    names.iter().find(|(name, _)| *name == value).map(|(_, choice)| *choice).ok_or_else(|| {
        let known: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
        Error::usage(format!("--set {key}={value}: expected {}", known.join(" or ")))
    })
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    #[test]
    fn values_out_of_range_are_refused() {
        let mut parameters = LobeParameters::default();
        for (key, value) in [
            ("lobes", "0"),
            ("lobes", "513"),
            ("k", "NaN"),
            ("brdf_share", "0"),
            ("cache", "scene"),
            ("preset", "loose"),
        ] {
            let error = parameters.set(key, value).unwrap_err().to_string();
            assert!(error.contains(&format!("--set {key}={value}: expected")), "{error}");
        }
        assert!(!parameters.set("colour", "red").unwrap());
        assert_eq!(parameters, LobeParameters::default());
    }

    #[test]
    fn every_key_is_known_and_a_preset_replaces_all() {
        let mut parameters = LobeParameters::default();
        for (key, value) in [("order", "coefficient"), ("k", "1"), ("cache", "pixel")] {
            assert!(LobeParameters::KEYS.contains(&key));
            assert!(parameters.set(key, value).unwrap());
        }
        assert!(parameters.check(2).unwrap_err().to_string().contains("--depth 2"));
        parameters.set("preset", "strict").unwrap();
        assert_eq!(parameters, LobeParameters::strict());
        parameters.check(2).unwrap();
    }

    #[test]
    fn impossible_combinations_are_refused() {
        let shares =
            LobeParameters { brdf_share: 0.6, environment_share: 0.6, ..Default::default() };
        assert!(shares.check(1).is_err());
        let pairs =
            LobeParameters { environment_lobes: 1000, brdf_lobes: 64, ..Default::default() };
        assert!(pairs.check(1).unwrap_err().to_string().contains("64000 products"));
    }
}
