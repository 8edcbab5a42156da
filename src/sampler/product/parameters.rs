//! Parameters of product sampling.

use crate::{
    error::{Error, Result},
    sampler::knob::{Values, parameters},
};

/// Order of the lobes of a product for dropping the weakest, and what the others are chosen by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LobeOrder {
    /// By integral over the sphere; chosen by its part above the horizon.
    Integral,
    /// By coefficient; chosen by integral over the sphere, as in the thesis.
    Coefficient,
}

const ORDERS: &[(&str, LobeOrder)] =
    &[("integral", LobeOrder::Integral), ("coefficient", LobeOrder::Coefficient)];

/// Method of sampling the elevation of a direction within its lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elevation {
    /// By inversion of the closed form.
    Inverse,
    /// By a short Metropolis walk, as in the thesis: biased.
    Metropolis,
}

const ELEVATIONS: &[(&str, Elevation)] =
    &[("inverse", Elevation::Inverse), ("metropolis", Elevation::Metropolis)];

/// Elevations by name; the text of a biased one says so.
struct Elevations;

impl Values<Elevation> for Elevations {
    fn parse(&self, text: &str) -> Result<Elevation, String> {
        ELEVATIONS.parse(text)
    }

    fn text(&self, value: &Elevation) -> String {
        let is_biased = *value == Elevation::Metropolis;
        ELEVATIONS.text(value) + if is_biased { " (biased)" } else { "" }
    }
}

parameters! {
    /// Parameters of `product`, also within `visibility`.
    pub struct ProductParameters {
        /// `environment-lobes`: lobes fitted to the environment.
        "environment-lobes" environment_lobes: u32 = 100, 1..=1000;
        /// `brdf-lobes`: lobes fitted to each view of a material.
        "brdf-lobes" brdf_lobes: u32 = 20, 1..=64;
        /// `views`: view elevations at which a material is fitted; a hit takes the nearest.
        "views" views: u32 = 32, 1..=256;
        /// `lobes`: product lobes kept at a hit.
        "lobes" kept_lobes: u32 = 64, 1..=512;
        /// `order`: order in which the weakest lobes are dropped.
        "order" order: LobeOrder = LobeOrder::Integral, ORDERS;
        /// `brdf-share`: share of directions from the BRDF's own sampling, more than 0.
        "brdf-share" brdf_share: f32 = 0.25, 0.001..=1.0;
        /// `environment-share`: share of directions from the environment map.
        "environment-share" environment_share: f32 = 0.25, 0.0..=0.999;
        /// `elevation`: how the elevation within a lobe is drawn; metropolis is biased.
        "elevation" elevation: Elevation = Elevation::Inverse, Elevations;
    }
}

/// Largest number of products at a hit. Mesa 22.3 ends the loops of an invocation after 65,535
/// rounds in all; `multiply_lobes` makes up to 17 for every environment lobe and 20 BRDF lobes.
const MOST_PAIRS: u32 = 25_000;

impl ProductParameters {
    /// Follows the thesis to the letter where it is sound: lobes by coefficient, and of the shares
    /// that it lacks only as much as keeps the sampler unbiased.
    pub fn strict() -> Self {
        Self {
            order: LobeOrder::Coefficient,
            brdf_share: 0.05,
            environment_share: 0.0,
            ..Self::default()
        }
    }

    /// Returns [`Error::Usage`] for combinations that cannot be rendered.
    pub fn check(&self) -> Result<()> {
        if self.brdf_share + self.environment_share > 1.0 {
            return Err(Error::usage(format!(
                "--set brdf-share={} and environment-share={}: expected a sum of at most 1",
                self.brdf_share, self.environment_share
            )));
        }
        let pairs = self.environment_lobes * self.brdf_lobes;
        if pairs > MOST_PAIRS {
            return Err(Error::usage(format!(
                "--set environment-lobes={} and brdf-lobes={}: {pairs} products, expected at most \
                 {MOST_PAIRS}",
                self.environment_lobes, self.brdf_lobes,
            )));
        }
        Ok(())
    }
}
