//! The guide: cells of the scene and everything that passes counted in them.

use rayon::prelude::*;

use crate::sampler::{
    guided::{
        arriving::{ArrivalWords, ArrivingLight, Reflected},
        cells::Cells,
        counts::{Count, CountWords, MAX_WORD, PARTS_PER_RAY},
        key::CellKey,
        share::SHARE_WORDS,
        state::GuideState,
    },
    regions::{FACE_COUNT, Partition},
};

/// Trials of one region and cell above which its counts are halved, so that the responses fit a word.
const MAX_TRIALS: u64 = (1 << 16) * PARTS_PER_RAY as u64;

/// Least number of trials per region, on average, for a cell to be refined.
const RAYS_TO_REFINE: u64 = 2;
/// Least variance of the visibility of a ray, averaged over the rays of a cell, for it to be refined.
const MIN_VARIANCE: f64 = 0.01;
/// Children that a refined cell is expected to have: surfaces cross half of its eight.
const EXPECTED_CHILDREN: usize = 4;

/// Cells with their counts. Rays from places without a cell of their own count in the cells of faces.
#[derive(Clone, Debug)]
pub struct Guide {
    pub(super) cells: Cells,
    /// Rays counted in the cell itself, cell by cell and region by region.
    counts: Vec<Count>,
    pub(super) region_count: usize,
    /// Evidence of visible rays on the share of the BRDF, [`SHARE_WORDS`] words per cell.
    pub(super) shares: Vec<u32>,
    /// Light that arrives from surfaces, if bounces teach.
    pub(super) arriving: Option<ArrivingLight>,
}

impl Guide {
    /// Creates a guide that knows nothing, with room for `capacity` cells (at least the faces) and
    /// a hash table of `slots`, a power of two.
    ///
    /// # Panics
    /// If there is no room for the faces or `slots` is not a power of two.
    pub fn new(region_count: usize, capacity: usize, slots: usize) -> Self {
        Self {
            cells: Cells::new(capacity, slots),
            counts: vec![Count::default(); FACE_COUNT * region_count],
            region_count,
            shares: vec![0; FACE_COUNT * SHARE_WORDS],
            arriving: None,
        }
    }

    /// Lets bounces teach too, beginning with `words` of an earlier guide in the order of its
    /// cells, divided by `divisor`.
    #[must_use]
    pub fn with_bounces(mut self, words: &[ArrivalWords], divisor: u32) -> Self {
        self.arriving = Some(ArrivingLight::new(self.cells.len(), words, divisor));
        self
    }

    /// As [`Self::new`], with the keys, refined cells, counts (trials and hits in sixteenths of rays) and
    /// shares of an earlier guide. Drops cells that find no room and divides every count by `divisor`.
    ///
    /// # Panics
    /// As [`Self::new`]; if there are not as many counts as keys and regions, the faces first, or shares.
    pub fn resume(
        region_count: usize,
        capacity: usize,
        slots: usize,
        state: &GuideState,
        divisor: u32,
    ) -> Self {
        let GuideState { keys, refined, counts, shares, .. } = state;
        assert!(keys.len() >= FACE_COUNT && counts.len() == keys.len() * region_count, "lengths");
        assert_eq!(shares.len(), keys.len() * SHARE_WORDS, "lengths");
        let cells = Cells::resume(capacity, slots, keys, refined);
        let counts = counts[..cells.len() * region_count]
            .iter()
            .map(|counted| counted.map(|count| count.min(MAX_WORD) / divisor))
            .map(|[trials, hits, response]| Count { hits: hits.min(trials), trials, response })
            .collect();
        let shares = &shares[..cells.len() * SHARE_WORDS];
        let shares = shares.iter().map(|count| count / divisor).collect();
        Self { cells, counts, region_count, shares, arriving: None }
    }

    /// Refines fine cells that have rays enough to tell their children apart and whose rays disagree on
    /// visibility: those with the greatest total variance first, as long as there is room.
    pub fn refine(&mut self) {
        let enough = RAYS_TO_REFINE * u64::from(PARTS_PER_RAY) * self.region_count as u64;
        let variance = |cell: usize| {
            if !self.cells.is_refinable(cell) {
                return None;
            }
            let counts = self.counts(cell);
            let trials: u64 = counts.iter().map(|count| u64::from(count.trials)).sum();
            if trials < enough {
                return None;
            }
            // Variance of as many Bernoulli trials: each ray is blocked or not.
            let variance = |count: &Count| {
                let (hits, trials) = (count.hits as f32, count.trials as f32);
                f64::from(hits * (trials - hits) / trials.max(1.0))
            };
            let variance: f64 = counts.iter().map(variance).sum();
            (variance >= MIN_VARIANCE * trials as f64).then_some((variance, cell))
        };
        let mut found: Vec<(f64, usize)> =
            (FACE_COUNT..self.cells.len()).into_par_iter().filter_map(variance).collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        // Leave an eighth for cells that were not seen yet.
        let capacity = self.cells.capacity;
        let room = (capacity - capacity / 8).saturating_sub(self.cells.len());
        for (_, cell) in found.into_iter().take(room / EXPECTED_CHILDREN) {
            self.cells.refine(cell);
        }
    }

    /// Returns cells and counts, as [`Self::resume`] and [`Self::with_bounces`] take them.
    pub fn state(&self) -> GuideState {
        let words = |count: &Count| [count.trials, count.hits, count.response];
        GuideState {
            keys: self.keys().iter().map(|key| key.0).collect(),
            refined: self.cells.refined.iter().map(|&cell| cell as u32).collect(),
            counts: self.counts.iter().map(words).collect(),
            shares: self.shares.clone(),
            arrivals: self.arriving.as_ref().map(ArrivingLight::words).unwrap_or_default(),
            ..GuideState::default()
        }
    }

    /// Number of cells, faces included.
    pub fn cell_count(&self) -> usize {
        self.cells.len()
    }

    /// Keys of all cells; those of the faces are [`CellKey::NONE`].
    pub fn keys(&self) -> &[CellKey] {
        &self.cells.keys
    }

    /// Counts of one cell, region by region.
    pub fn counts(&self, cell: usize) -> &[Count] {
        &self.counts[cell * self.region_count..][..self.region_count]
    }

    /// Number of rays counted in all cells together.
    pub fn rays(&self) -> u64 {
        let trials = |count: &Count| u64::from(count.trials);
        self.counts.par_iter().map(trials).sum::<u64>() / u64::from(PARTS_PER_RAY)
    }

    /// Adds counts of one stretch of passes per cell and region, in the order of the cells as they
    /// were, trials and hits in rays; `counted` starts with pair `first` of cell and region.
    ///
    /// # Panics
    /// If there are more counts than cells.
    pub fn add(&mut self, first: usize, counted: &[CountWords]) {
        let counts = &mut self.counts[first..][..counted.len()];
        let parts = u64::from(PARTS_PER_RAY);
        let add = |(count, [trials, hits, response]): (&mut Count, &CountWords)| {
            let all = u64::from(count.trials) + parts * u64::from(*trials);
            let halvings = (all / (MAX_TRIALS + 1)).checked_ilog2().map_or(0, |log| log + 1);
            let halved = |count: u32, more: u64| {
                u32::try_from((u64::from(count) + more) >> halvings).unwrap_or(u32::MAX)
            };
            count.hits = halved(count.hits, parts * u64::from(*hits.min(trials)));
            count.response = halved(count.response, u64::from(*response));
            count.trials = halved(count.trials, parts * u64::from(*trials));
        };
        let longest = 16 * self.region_count;
        let pieces = counts.par_chunks_mut(longest).zip(counted.par_chunks(longest));
        pieces.for_each(|(counts, counted)| counts.iter_mut().zip(counted).for_each(add));
    }

    /// Adds evidence of one stretch of passes on the share of the BRDF, [`SHARE_WORDS`] words per
    /// cell, and halves the older evidence.
    ///
    /// # Panics
    /// If there are more words than cells have.
    pub fn add_shares(&mut self, found: &[u32]) {
        assert!(found.len() <= self.shares.len(), "shares of cells that are there");
        for (share, found) in self.shares.iter_mut().zip(found) {
            *share = (*share / 2).saturating_add(*found);
        }
    }

    /// Adds light found by the bounce rays of one stretch of passes, cell by cell and direction by
    /// direction, in the units of the `reflected` light that these passes read.
    pub fn add_arrivals(&mut self, found: &[ArrivalWords], reflected: &Reflected) {
        if let Some(arriving) = &mut self.arriving {
            arriving.add(found, reflected.unit);
        }
    }

    /// Adds the fine cells among the `missing` keys, in any order and with repetitions, as long as
    /// there is room; first the coarse cells of those that are not children of refined cells.
    pub fn add_cells(&mut self, missing: &[u32]) {
        self.cells.add(missing);
        let count = self.cells.len();
        self.counts.resize(count * self.region_count, Count::default());
        self.shares.resize(count * SHARE_WORDS, 0);
        if let Some(arriving) = &mut self.arriving {
            arriving.resize(count);
        }
    }

    /// Replaces the counts for the regions of `from` by counts for those of `to`: each region inherits, in
    /// proportion to energy, the counts of the regions it overlaps. Makes room for `capacity` cells.
    ///
    /// # Panics
    /// If there are more cells than that.
    pub fn carry_over(&mut self, from: &Partition, to: &Partition, capacity: usize) {
        assert!(self.cells.len() <= capacity, "{} cells, room for {capacity}", self.cells.len());
        self.cells.capacity = capacity;
        let shares = from.shares_in(to);
        let count = to.regions.len();
        let mut counts = vec![Count::default(); self.cells.len() * count];
        counts.par_chunks_mut(count).zip(self.counts.par_chunks(self.region_count)).for_each(
            |(new, old)| {
                let counted = old.iter().zip(&shares).filter(|(old, _)| old.trials > 0);
                for (old, shares) in counted {
                    for (region, share) in shares {
                        new[*region].add_share(*old, *share);
                    }
                }
            },
        );
        self.counts = counts;
        self.region_count = count;
    }
}
