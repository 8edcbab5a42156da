//! Light that arrives at cells from other surfaces, by direction: bounce rays → weights of bounces.
//!
//! Every bounce ray tells the cell it left how much light the cell it reached reflects. That light
//! is the environment's by the estimates of that cell, a mean over its surfaces and the directions
//! they are seen from and so nearly free of noise, plus a part of the light that arrives there from
//! other surfaces. Bounces are resampled by the result, so its errors cost precision only (Vorba et
//! al. 2014 guide paths by learned light, fitted with mixtures of Gaussians).

use rayon::prelude::*;

use crate::sampler::{
    guided::cells::{Tree, adds},
    regions::FACE_COUNT,
};
use crate::shader::rooms::guided::GUIDE_ARRIVAL_SIDE;

/// Number of directions that a cell distinguishes.
pub const ARRIVAL_DIRECTIONS: usize = (GUIDE_ARRIVAL_SIDE * GUIDE_ARRIVAL_SIDE) as usize;

/// Weight of the prior, in rays.
const PRIOR_RAYS: f32 = 4.0;
/// Share of the estimate that is the same for every direction, which bounds the weight of a bounce toward
/// light that is not expected.
const UNIFORM_SHARE: f32 = 0.5;
/// Reflectance of surfaces for the light that arrives from other surfaces.
const ASSUMED_REFLECTANCE: f32 = 0.5;
/// Units of the mean light of all cells in [`Reflected::units`].
const MEAN_UNITS: f32 = 64.0;
/// Largest number of units: the sum over 2¹⁸ rays fits a word.
const MAX_UNITS: f32 = 16383.0;
/// Upper bound of every sum read from a file.
const MAX_SUM: f32 = 1e30;

/// Bounce rays in one direction of one cell. Files hold the bits of two floats, the number of rays
/// and the sum of the light where they arrived; passes count rays and whole units of light.
pub type ArrivalWords = [u32; 2];

/// Number of bounce rays in one direction and sum of the light where they arrived.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Arrivals {
    rays: f32,
    light: f32,
}

adds!(Arrivals: rays light);

impl Arrivals {
    /// Mean light of a ray, with a prior worth [`PRIOR_RAYS`].
    fn mean(self, prior: f32) -> f32 {
        (self.light + PRIOR_RAYS * prior) / (self.rays + PRIOR_RAYS)
    }
}

/// Light that cells reflect, as passes read it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reflected {
    /// Light of every cell, in whole units.
    pub units: Vec<u32>,
    /// Light per unit.
    pub unit: f32,
}

/// Light found by bounce rays, by cell and direction.
#[derive(Clone, Debug, Default)]
pub struct ArrivingLight {
    /// [`ARRIVAL_DIRECTIONS`] per cell.
    arrivals: Vec<Arrivals>,
}

impl ArrivingLight {
    /// Makes room for `cells` cells; the first begin with `words` of an earlier guide, divided by `divisor`.
    pub fn new(cells: usize, words: &[ArrivalWords], divisor: u32) -> Self {
        let sane = |value: f32| if value >= 0.0 { value.min(MAX_SUM) } else { 0.0 };
        let arrivals = |[rays, light]: &ArrivalWords| Arrivals {
            rays: sane(f32::from_bits(*rays)) / divisor as f32,
            light: sane(f32::from_bits(*light)) / divisor as f32,
        };
        let mut arriving = Self { arrivals: words.iter().map(arrivals).collect() };
        arriving.resize(cells);
        arriving
    }

    /// Returns the sums as [`Self::new`] takes them.
    pub fn words(&self) -> Vec<ArrivalWords> {
        let words = |arrivals: &Arrivals| [arrivals.rays.to_bits(), arrivals.light.to_bits()];
        self.arrivals.iter().map(words).collect()
    }

    /// Makes room for `cells` cells; new ones know nothing.
    pub fn resize(&mut self, cells: usize) {
        self.arrivals.resize(cells * ARRIVAL_DIRECTIONS, Arrivals::default());
    }

    /// Adds counts of one stretch of passes, with light in multiples of `unit`, and halves the
    /// older sums, which rest on cells that knew less.
    pub fn add(&mut self, found: &[ArrivalWords], unit: f32) {
        self.arrivals.par_iter_mut().zip(found).for_each(|(arrivals, [rays, units])| {
            arrivals.rays = 0.5 * arrivals.rays + *rays as f32;
            arrivals.light = 0.5 * arrivals.light + *units as f32 * unit;
        });
    }

    /// Estimates the light by cell and direction, relative to the mean over the directions of the
    /// cell, and the light that every cell reflects, of which `of_environment` comes from the
    /// environment. The prior of a cell is its parent, that of a face the mean of the scene.
    pub(super) fn estimate(&self, tree: &Tree, of_environment: &[f32]) -> (Vec<f32>, Reflected) {
        let own = |cell: usize| &self.arrivals[cell * ARRIVAL_DIRECTIONS..][..ARRIVAL_DIRECTIONS];
        // Sum over every inner cell and its descendants
        let sums = tree.sums(|cell| own(cell).iter().copied());
        let mut scene = Arrivals::default();
        for sum in sums[..FACE_COUNT].iter().flatten() {
            scene += *sum;
        }
        let scene = [scene.light / scene.rays.max(1.0); ARRIVAL_DIRECTIONS];
        // Estimate the mean light of inner cells, parents first
        let prior_of = |cell: usize| (cell >= FACE_COUNT).then(|| tree.parents[cell]);
        let inner = tree.down(|cell, inner: &[Vec<f32>]| {
            let prior = prior_of(cell).map_or(&scene[..], |parent| &inner[parent]);
            sums[cell].iter().zip(prior).map(|(sum, prior)| sum.mean(*prior)).collect()
        });
        // Estimate the light of all cells by direction, and what they reflect of it
        let mut light = vec![0.0; self.arrivals.len()];
        let mut reflected = of_environment.to_vec();
        let by_cell = light.par_chunks_mut(ARRIVAL_DIRECTIONS).zip(&mut reflected).enumerate();
        by_cell.for_each(|(cell, (light, reflected))| {
            let sums = if sums[cell].is_empty() { own(cell) } else { &sums[cell] };
            let prior = prior_of(cell).map_or(&scene[..], |parent| &inner[parent]);
            let mut found = Arrivals::default();
            for ((light, sum), prior) in light.iter_mut().zip(sums).zip(prior) {
                *light = sum.mean(*prior);
                found += Arrivals { rays: sum.rays, light: sum.rays * *light };
            }
            let arriving = if found.rays > 0.0 { found.light / found.rays } else { scene[0] };
            *reflected += ASSUMED_REFLECTANCE * arriving;
            make_relative(light);
        });
        let mean = reflected.iter().sum::<f32>() / reflected.len() as f32;
        let unit = mean / MEAN_UNITS;
        let units = |light: &f32| (light / unit.max(f32::MIN_POSITIVE)).min(MAX_UNITS) as u32;
        (light, Reflected { units: reflected.iter().map(units).collect(), unit })
    }
}

/// Divides the light of every direction by the mean of all and mixes in [`UNIFORM_SHARE`].
fn make_relative(light: &mut [f32]) {
    let mean = light.iter().sum::<f32>() / light.len() as f32;
    for light in light {
        let relative = if mean > 0.0 { *light / mean } else { 1.0 };
        *light = UNIFORM_SHARE + (1.0 - UNIFORM_SHARE) * relative;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_relative_and_never_zero() {
        let mut light = [0.0, 1.0, 0.0, 3.0];
        make_relative(&mut light);
        assert_eq!(light, [0.5, 1.0, 0.5, 2.0]);
        let mut dark = [0.0; 3];
        make_relative(&mut dark);
        assert_eq!(dark, [1.0; 3], "all alike where nothing arrives");
    }

    #[test]
    fn sums_from_files_are_made_sane_and_halved_by_later_ones() {
        let words = |rays: f32, light: f32| [rays.to_bits(), light.to_bits()];
        let saved =
            [words(8.0, 2.0), words(f32::NAN, -1.0), words(f32::INFINITY, 4.0), words(1.0, 0.5)];
        let mut arriving = ArrivingLight::new(2, &saved, 4);
        assert_eq!(arriving.words().len(), 2 * ARRIVAL_DIRECTIONS);
        assert_eq!(arriving.words()[0], words(2.0, 0.5));
        assert_eq!(arriving.words()[1], words(0.0, 0.0));
        assert_eq!(arriving.words()[2], words(MAX_SUM / 4.0, 1.0));
        arriving.add(&[[3, 10]], 0.5);
        assert_eq!(arriving.words()[0], words(4.0, 5.25));
        assert_eq!(arriving.words()[3], words(0.25, 0.125), "nothing is added there");
    }
}
