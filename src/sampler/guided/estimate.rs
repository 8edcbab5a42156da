//! Counts of one cell → estimated visibility and response of every region.
//!
//! The visibility V̂ of a region is hits / trials. Its response is the mean over the rays that hit
//! of BRDF · cosine, weighted by the colour of the light: the product with the BRDF that Tsai et
//! al. (2008) take at every hit, averaged over the surfaces of a cell and the directions they are
//! seen from. The cell of a flat wall has nearly one of each.
//!
//! A cell with few rays falls back on its surroundings as a prior: a child of a refined cell on that cell, a
//! fine cell on its coarse cell, a coarse cell on all cells of its face, and a face on the visibility of the
//! whole scene and a cosine. A cell tends to differ from its parent cell over whole parts of the sky, so the
//! prior is first scaled by the ratio that the cell found in the parent region.

use glam::Vec3;

use crate::sampler::{
    guided::counts::Tally,
    regions::{FACE_COUNT, PARENT_COUNT, Partition, Region, face_normal},
};

/// Weight of the prior of the visibility, in rays.
pub(super) const PRIOR_RAYS: f32 = 4.0;
/// Weight of the prior of the response, in rays that hit.
const PRIOR_HITS: f32 = 8.0;
/// Largest factor by which a parent region raises the prior.
const MAX_RATIO: f32 = 8.0;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// V̂, the fraction of rays that reach the environment.
    pub visibility: f32,
    /// Mean response of those rays, in units of
    /// 1 / [`GUIDE_RESPONSE_UNITS`](crate::shader::rooms::guided::GUIDE_RESPONSE_UNITS).
    pub response: f32,
}

/// Ratio of a sum found to the sum expected; 1 where little is expected.
#[derive(Clone, Copy, Debug, Default)]
struct Ratio {
    found: f32,
    expected: f32,
}

impl Ratio {
    fn add(&mut self, found: f32, expected: f32) {
        self.found += found;
        self.expected += expected;
    }

    /// The ratio, with a `prior` worth an expectation of `weight`.
    fn value(self, prior: f32, weight: f32) -> f32 {
        (self.found + weight * prior) / (self.expected + weight)
    }
}

/// Properties of the regions that estimates depend on.
pub struct RegionTables {
    shares: Vec<f64>,
    parents: Vec<u8>,
    facing: Vec<Vec<f32>>,
}

impl RegionTables {
    /// Tables of the regions of `partition`.
    pub fn new(partition: &Partition) -> Self {
        let facing_of = |face| {
            let normal = face_normal(face);
            partition.regions.iter().map(|region| facing(normal, region) as f32).collect()
        };
        Self {
            shares: partition.regions.iter().map(|region| region.share).collect(),
            parents: partition.regions.iter().map(|region| region.rectangle.parent as u8).collect(),
            facing: (0..FACE_COUNT).map(facing_of).collect(),
        }
    }
}

/// Estimates for every region in one cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimates {
    pub(super) regions: Vec<Estimate>,
    mean_response: f32,
}

impl Estimates {
    fn new(regions: Vec<Estimate>) -> Self {
        let sum: f32 = regions.iter().map(|estimate| estimate.response).sum();
        Self { mean_response: sum / regions.len().max(1) as f32, regions }
    }

    /// True for the default, which holds no region.
    pub fn is_empty(&self) -> bool {
        self.regions.is_empty()
    }

    /// Estimates for all cells of a face, with the whole `scene` as prior.
    pub fn of_face(face: usize, tallies: &[Tally], scene: Tally, tables: &RegionTables) -> Self {
        let visibility = scene.visibility(0.5, 2.0);
        let response = scene.mean_response(1.0, f32::MIN_POSITIVE);
        let prior = |facing: &f32| Estimate { visibility, response: response * facing };
        Self::new(tables.facing[face].iter().map(prior).collect()).updated(tallies, 2.0)
    }

    /// Updates `self`, worth `weight` rays, by the tallies. Its responses are first scaled by the
    /// ratio found in all regions together.
    pub(super) fn updated(&self, tallies: &[Tally], weight: f32) -> Self {
        let mut ratio = Ratio::default();
        for (tally, prior) in tallies.iter().zip(&self.regions) {
            ratio.add(tally.response, tally.hits * prior.response);
        }
        let scale = ratio.value(1.0, self.mean_response);
        let update = |(tally, prior): (&Tally, &Estimate)| Estimate {
            visibility: tally.visibility(prior.visibility, weight),
            response: tally.mean_response(prior.response * scale, PRIOR_HITS),
        };
        Self::new(tallies.iter().zip(&self.regions).map(update).collect())
    }

    /// Estimates for a fine cell, with its parent cell as prior, scaled by parent region.
    pub fn of_fine(
        counted: impl Iterator<Item = Tally> + Clone,
        parent_cell: &Self,
        tables: &RegionTables,
    ) -> Self {
        let mut visible = [Ratio::default(); PARENT_COUNT];
        let mut responses = [Ratio::default(); PARENT_COUNT];
        let counted = counted.zip(&parent_cell.regions).zip(&tables.parents);
        for ((tally, prior), region) in counted.clone() {
            let region = usize::from(*region);
            visible[region].add(tally.hits, tally.trials * prior.visibility);
            responses[region].add(tally.response, tally.hits * prior.response);
        }
        let mut all = Ratio::default();
        for response in &responses {
            all.add(response.found, response.expected);
        }
        let scale = all.value(1.0, parent_cell.mean_response);
        let weight = PRIOR_HITS * parent_cell.mean_response;
        let mut scales = [[0.0; 2]; PARENT_COUNT];
        for ((scales, visible), response) in scales.iter_mut().zip(&visible).zip(&responses) {
            *scales = [visible.value(1.0, 1.0).min(MAX_RATIO), response.value(scale, weight)];
        }
        let estimate = |((tally, prior), region): ((Tally, &Estimate), &u8)| {
            let [visible, response] = scales[usize::from(*region)];
            Estimate {
                visibility: tally.visibility((prior.visibility * visible).min(1.0), PRIOR_RAYS),
                response: tally.mean_response(prior.response * response, PRIOR_HITS),
            }
        };
        Self::new(counted.map(estimate).collect())
    }

    /// Light of the environment that the surfaces of the cell reflect: the sum over regions of
    /// share of energy · V̂ · response.
    pub fn reflected(&self, tables: &RegionTables) -> f32 {
        let reflected = |(estimate, share): (&Estimate, &f64)| {
            *share as f32 * estimate.visibility * estimate.response
        };
        self.regions.iter().zip(&tables.shares).map(reflected).sum()
    }
}

/// Cosine between the normal of a face and the mean direction of a region, raised since surfaces of
/// the face may be tilted.
fn facing(normal: Vec3, region: &Region) -> f64 {
    ((normal.as_dvec3().dot(region.direction) + 0.25) / 1.25).max(0.03)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hit four times as bright as expected tells little of the other regions of its parent, less of those
    /// of other parents, and more of its own.
    #[test]
    fn one_bright_hit_is_worth_one_of_nine() {
        let tables =
            RegionTables { shares: vec![0.25; 4], parents: vec![0, 0, 1, 1], facing: Vec::new() };
        let prior = Estimate { visibility: 0.5, response: 1000.0 };
        let parent = Estimates::new(vec![prior; 4]);
        let mut tallies = [Tally::default(); 4];
        tallies[0] = Tally { hits: 1.0, trials: 1.0, response: 4000.0 };
        let found = Estimates::of_fine(tallies.iter().copied(), &parent, &tables);
        // All together (4 + 1) / (1 + 1); the parent (4 + 8 · 2.5) / (1 + 8), the region itself once more.
        let beside = 1000.0 * 24.0 / 9.0;
        let expected = [(4000.0 + 8.0 * beside) / 9.0, beside, 2500.0, 2500.0];
        for (estimate, expected) in found.regions.iter().zip(expected) {
            assert!((estimate.response / expected - 1.0).abs() < 1e-5, "{found:?}");
        }
        // (1 + 1) / (0.5 + 1) of the visibility in the parent.
        assert!((found.regions[1].visibility - 2.0 / 3.0).abs() < 1e-6, "{found:?}");
        assert!((found.regions[3].visibility - 0.5).abs() < 1e-6, "{found:?}");
        let own = |(visibility, response)| Estimate { visibility, response };
        let two = Estimates::new([(0.5, 8.0), (0.25, 4.0)].map(own).into());
        assert_eq!(two.reflected(&tables), 0.25 * (4.0 + 1.0));
    }
}
