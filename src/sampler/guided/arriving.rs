//! Light that arrives at cells by way of surfaces, direction by direction: what bounces are guided by.
//!
//! Every bounce ray tells the cell that it left how much light the cell where it arrived reflects: by what
//! that one has learned of the environment, a mean over its surfaces and over the directions they are seen
//! from, so that there is little noise in it, and a part of what arrives there by way of surfaces. Bounces
//! are resampled by it, so what it gets wrong costs precision only (Vorba et al. 2014 guide paths by
//! learned light, fitted by mixtures of Gaussians).

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::sampler::guided::{key::FACE_COUNT, learned::Tree};
use crate::shader::constants::GUIDE_ARRIVAL_SIDE;

/// Directions that a cell tells apart.
pub const ARRIVAL_DIRECTIONS: usize = (GUIDE_ARRIVAL_SIDE * GUIDE_ARRIVAL_SIDE) as usize;

/// Weight of the prior, in rays.
const PRIOR: f32 = 4.0;
/// Least light that a direction is believed to bring, of the mean of all.
const LEAST_LIGHT: f32 = 0.2;
/// Part of the light that arrives at a cell by way of surfaces that is believed to be reflected.
const REFLECTED_AGAIN: f32 = 0.5;
/// Units of the mean light of all cells in [`Reflected::units`], and the most of one: 2¹⁸ rays of these
/// fit a word.
const MEAN_UNITS: f32 = 64.0;
const MOST_UNITS: f32 = 16383.0;
/// No sum that a file holds is larger.
const LARGEST_SUM: f32 = 1e30;

/// Bounce rays in one direction of one cell as files hold them, and as passes count them: rays, and the bits
/// of the sum of the light where they arrived, or that in whole units.
pub type ArrivalWords = [u32; 2];

/// Index of the direction that a unit vector belongs to, below [`ARRIVAL_DIRECTIONS`]: a grid over the
/// octahedron (Cigolle et al. 2014). Twin of `glsl/include/arriving.glsl`.
pub fn arrival_direction(direction: Vec3) -> usize {
    let place = direction.truncate() / (direction.x.abs() + direction.y.abs() + direction.z.abs());
    let sign = |value: f32| if value < 0.0 { -1.0 } else { 1.0 };
    let folded =
        Vec2::new((1.0 - place.y.abs()) * sign(place.x), (1.0 - place.x.abs()) * sign(place.y));
    let place = if direction.z < 0.0 { folded } else { place };
    let side = GUIDE_ARRIVAL_SIDE as f32;
    let cell = |place: f32| ((0.5 * place + 0.5) * side).clamp(0.0, side - 1.0) as usize;
    cell(place.y) * GUIDE_ARRIVAL_SIDE as usize + cell(place.x)
}

/// Bounce rays in one direction, and the sum of the light where they arrived.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Arrivals {
    rays: f32,
    light: f32,
}

impl Arrivals {
    fn add(&mut self, other: Self) {
        self.rays += other.rays;
        self.light += other.light;
    }

    /// Mean light of a ray, leaning on `prior` as if [`PRIOR`] rays had brought it.
    fn mean(self, prior: f32) -> f32 {
        (self.light + PRIOR * prior) / (self.rays + PRIOR)
    }
}

/// Light that cells reflect, as passes read it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reflected {
    /// Of every cell, in whole units.
    pub units: Vec<u32>,
    /// The unit.
    pub unit: f32,
}

/// What bounces taught.
#[derive(Clone, Debug, Default)]
pub struct ArrivingLight {
    /// [`ARRIVAL_DIRECTIONS`] per cell.
    arrivals: Vec<Arrivals>,
}

impl ArrivingLight {
    /// For `cells` cells, with what an earlier one had learned of the first ones divided by `forget`.
    pub fn new(cells: usize, words: &[ArrivalWords], forget: u32) -> Self {
        let sane = |value: f32| if value >= 0.0 { value.min(LARGEST_SUM) } else { 0.0 };
        let arrivals = |[rays, light]: &ArrivalWords| Arrivals {
            rays: sane(f32::from_bits(*rays)) / forget as f32,
            light: sane(f32::from_bits(*light)) / forget as f32,
        };
        let mut arriving = Self { arrivals: words.iter().map(arrivals).collect() };
        arriving.resize(cells);
        arriving
    }

    /// As [`Self::new`] takes it.
    pub fn words(&self) -> Vec<ArrivalWords> {
        let words = |arrivals: &Arrivals| [arrivals.rays.to_bits(), arrivals.light.to_bits()];
        self.arrivals.iter().map(words).collect()
    }

    /// Makes room for `cells` cells; new ones have learned nothing.
    pub fn resize(&mut self, cells: usize) {
        self.arrivals.resize(cells * ARRIVAL_DIRECTIONS, Arrivals::default());
    }

    /// Adds what one stretch of passes counted by light in units of `unit`; what was found before counts
    /// half from now on, since it was learned from cells that knew less.
    pub fn add(&mut self, found: &[ArrivalWords], unit: f32) {
        self.arrivals.par_iter_mut().zip(found).for_each(|(arrivals, [rays, units])| {
            arrivals.rays = 0.5 * arrivals.rays + *rays as f32;
            arrivals.light = 0.5 * arrivals.light + *units as f32 * unit;
        });
    }

    /// Light by cell and direction, relative to the mean over the directions of the cell, and what the
    /// cells reflect, which of the environment is `of_environment`. A cell leans on what it is a part of,
    /// a face on the scene.
    pub(super) fn estimate(&self, tree: &Tree, of_environment: &[f32]) -> (Vec<f32>, Reflected) {
        let own = |cell: usize| &self.arrivals[cell * ARRIVAL_DIRECTIONS..][..ARRIVAL_DIRECTIONS];
        // Of the cells that others are parts of: what was found in both, and the mean light.
        let mut sums: Vec<Vec<Arrivals>> = vec![Vec::new(); tree.parents.len()];
        for generation in tree.generations.iter().rev() {
            let sum = |&cell: &usize| {
                let mut sum = own(cell).to_vec();
                for &part in &tree.parts[cell] {
                    let of_part = if sums[part].is_empty() { own(part) } else { &sums[part] };
                    sum.iter_mut().zip(of_part).for_each(|(sum, found)| sum.add(*found));
                }
                sum
            };
            let found: Vec<Vec<Arrivals>> = generation.par_iter().map(sum).collect();
            for (cell, found) in generation.iter().zip(found) {
                sums[*cell] = found;
            }
        }
        let mut scene = Arrivals::default();
        for sum in sums[..FACE_COUNT].iter().flatten() {
            scene.add(*sum);
        }
        let scene = [scene.light / scene.rays.max(1.0); ARRIVAL_DIRECTIONS];
        let mut whole: Vec<Vec<f32>> = vec![Vec::new(); tree.parents.len()];
        // What a cell leans on.
        let around = |cell: usize| (cell >= FACE_COUNT).then(|| tree.parents[cell]);
        for generation in &tree.generations {
            let mean = |&cell: &usize| -> Vec<f32> {
                let around = around(cell).map_or(&scene[..], |parent| &whole[parent]);
                sums[cell].iter().zip(around).map(|(sum, prior)| sum.mean(*prior)).collect()
            };
            let means: Vec<Vec<f32>> = generation.par_iter().map(mean).collect();
            for (cell, means) in generation.iter().zip(means) {
                whole[*cell] = means;
            }
        }
        let mut light = vec![0.0; self.arrivals.len()];
        let mut reflected = of_environment.to_vec();
        let by_cell = light.par_chunks_mut(ARRIVAL_DIRECTIONS).zip(&mut reflected).enumerate();
        by_cell.for_each(|(cell, (light, reflected))| {
            let sums = if sums[cell].is_empty() { own(cell) } else { &sums[cell] };
            let around = around(cell).map_or(&scene[..], |parent| &whole[parent]);
            let mut found = Arrivals::default();
            for ((light, sum), prior) in light.iter_mut().zip(sums).zip(around) {
                *light = sum.mean(*prior);
                found.add(Arrivals { rays: sum.rays, light: sum.rays * *light });
            }
            let arriving = if found.rays > 0.0 { found.light / found.rays } else { scene[0] };
            *reflected += REFLECTED_AGAIN * arriving;
            make_relative(light);
        });
        let mean = reflected.iter().sum::<f32>() / reflected.len() as f32;
        let unit = mean / MEAN_UNITS;
        let units = |light: &f32| (light / unit.max(f32::MIN_POSITIVE)).min(MOST_UNITS) as u32;
        (light, Reflected { units: reflected.iter().map(units).collect(), unit })
    }
}

/// Light by direction relative to the mean of all, at least about [`LEAST_LIGHT`].
fn make_relative(light: &mut [f32]) {
    let mean = light.iter().sum::<f32>() / light.len() as f32;
    for light in light {
        let relative = if mean > 0.0 { *light / mean } else { 1.0 };
        *light = LEAST_LIGHT + (1.0 - LEAST_LIGHT) * relative;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_relative_and_never_nothing() {
        let mut light = [0.0, 1.0, 0.0, 3.0];
        make_relative(&mut light);
        assert_eq!(light, [0.2, 0.2 + 0.8, 0.2, 0.2 + 2.4]);
        let mut dark = [0.0; 3];
        make_relative(&mut dark);
        assert_eq!(dark, [1.0; 3], "all alike where nothing arrives");
    }

    #[test]
    fn what_a_file_says_is_made_sane_and_later_light_counts_twice() {
        let words = |rays: f32, light: f32| [rays.to_bits(), light.to_bits()];
        let saved =
            [words(8.0, 2.0), words(f32::NAN, -1.0), words(f32::INFINITY, 4.0), words(1.0, 0.5)];
        let mut arriving = ArrivingLight::new(2, &saved, 4);
        assert_eq!(arriving.words().len(), 2 * ARRIVAL_DIRECTIONS);
        assert_eq!(arriving.words()[0], words(2.0, 0.5));
        assert_eq!(arriving.words()[1], words(0.0, 0.0));
        assert_eq!(arriving.words()[2], words(LARGEST_SUM / 4.0, 1.0));
        arriving.add(&[[3, 10]], 0.5);
        assert_eq!(arriving.words()[0], words(4.0, 5.25));
        assert_eq!(arriving.words()[3], words(0.25, 0.125), "nothing is added there");
    }
}
