//! What was learned so far, and the snapshot of it that a pass reads.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::sampler::guided::{
    arriving::{ArrivalWords, ArrivingLight, Reflected},
    estimate::{
        Count, CountWords, Estimates, LARGEST_WORD, Lookup, PARTS_PER_RAY, Scratch, Tally,
        decode_entry,
    },
    key::{CellKey, FACE_COUNT},
    partition::Partition,
    share::{SHARE_WORDS, ShareEvidence, share_in_256ths},
    state::GuideState,
};
use crate::shader::constants::{GUIDE_PROBES, GUIDE_REFINED, GUIDE_SHARE_SHIFT};

/// Trials of one region and cell above which what was counted is halved; then the responses fit a word.
const LARGEST_COUNT: u64 = (1 << 16) * PARTS_PER_RAY as u64;

/// Most cells, faces included: their index lies below [`GUIDE_REFINED`].
pub const MOST_CELLS: usize = 1 << 22;

/// Trials in one cell and region that let it be refined, if all regions had as many.
const RAYS_TO_REFINE: u64 = 2;
/// Least share of a cell's rays that went to directions of which it cannot say whether they are blocked.
const LEAST_DOUBT: f64 = 0.01;
/// Parts that a refined cell is expected to have: surfaces cross half of its eight.
const EXPECTED_PARTS: usize = 4;

/// Cells and counts. The first [`FACE_COUNT`] cells are the faces: rays from places that have no
/// cell of their own count there.
#[derive(Clone, Debug)]
pub struct Learned {
    capacity: usize,
    slots: usize,
    keys: Vec<CellKey>,
    index_of: HashMap<CellKey, usize>,
    /// Fine cells whose parts may be cells.
    refined: Vec<usize>,
    /// Those by [`CellKey::parts`].
    refined_by_parts: HashMap<u32, usize>,
    /// Rays that were counted in the cell itself, cell by cell and region by region.
    counts: Vec<Count>,
    region_count: usize,
    /// What visible rays say about the share of the BRDF, [`SHARE_WORDS`] words per cell.
    shares: Vec<u32>,
    /// Light that arrives by way of surfaces, if bounces teach.
    arriving: Option<ArrivingLight>,
    refused: u64,
}

/// What the next pass reads, as it lies on the device.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// Hash table: key of a cell, [`CellKey::NONE`] where empty; its index, [`GUIDE_REFINED`] where its
    /// parts may be cells and, from bit [`GUIDE_SHARE_SHIFT`] on, its share of the BRDF in 256ths, 0
    /// where that goes by the material.
    pub table: Vec<[u32; 2]>,
    /// Entries of every cell, region by region.
    pub entries: Vec<[u32; 2]>,
    /// Of every cell and direction, the light that is believed to arrive by way of surfaces, relative to
    /// the mean over the cell's directions; empty where bounces do not teach.
    pub arriving: Vec<f32>,
    /// Light that the cells reflect; empty where bounces do not teach.
    pub reflected: Reflected,
}

/// Which cells are parts of which.
pub(super) struct Tree {
    /// Of every cell the one that it is a part of; faces are parts of themselves.
    pub(super) parents: Vec<usize>,
    /// The parts of every cell.
    pub(super) parts: Vec<Vec<usize>>,
    /// The faces, those of their parts that have parts or may have, those of these, and so on.
    pub(super) generations: Vec<Vec<usize>>,
}

impl Learned {
    /// Nothing learned, room for `capacity` cells (at least the faces) and a table of `slots`, a
    /// power of two.
    ///
    /// # Panics
    /// If there is no room for the faces or `slots` is not a power of two.
    pub fn new(region_count: usize, capacity: usize, slots: usize) -> Self {
        let is_possible = (FACE_COUNT..=MOST_CELLS).contains(&capacity) && slots.is_power_of_two();
        assert!(is_possible, "{capacity} cells, {slots} slots");
        Self {
            capacity,
            slots,
            keys: vec![CellKey::NONE; FACE_COUNT],
            index_of: HashMap::new(),
            refined: Vec::new(),
            refined_by_parts: HashMap::new(),
            counts: vec![Count::default(); FACE_COUNT * region_count],
            region_count,
            shares: vec![0; FACE_COUNT * SHARE_WORDS],
            arriving: None,
            refused: 0,
        }
    }

    /// The same, and bounces teach too. What they taught an earlier one, `words` in the order of its cells,
    /// is divided by `forget`.
    #[must_use]
    pub fn with_bounces(mut self, words: &[ArrivalWords], forget: u32) -> Self {
        self.arriving = Some(ArrivingLight::new(self.keys.len(), words, forget));
        self
    }

    /// As [`Self::new`], with the keys, the refined cells, counts (trials and hits in sixteenths of rays)
    /// and shares that an earlier one had; what finds no room is left out. With `forget`, every count is divided by that
    /// number.
    ///
    /// # Panics
    /// As [`Self::new`]; if there are not as many counts as keys and regions, the faces first, or
    /// shares.
    pub fn resume(
        region_count: usize,
        capacity: usize,
        slots: usize,
        state: &GuideState,
        forget: u32,
    ) -> Self {
        let GuideState { keys, refined, counts, shares, .. } = state;
        assert!(keys.len() >= FACE_COUNT && counts.len() == keys.len() * region_count, "lengths");
        assert_eq!(shares.len(), keys.len() * SHARE_WORDS, "lengths");
        let mut learned = Self::new(region_count, capacity, slots);
        for key in keys[FACE_COUNT..].iter().take(capacity - FACE_COUNT).map(|&word| CellKey(word))
        {
            learned.index_of.insert(key, learned.keys.len());
            learned.keys.push(key);
        }
        for &cell in refined {
            learned.let_be_refined(cell as usize);
        }
        let count = learned.keys.len() * region_count;
        learned.counts = counts[..count]
            .iter()
            .map(|counted| counted.map(|count| count.min(LARGEST_WORD) / forget))
            .map(|[trials, hits, response]| Count { hits: hits.min(trials), trials, response })
            .collect();
        let count = learned.keys.len() * SHARE_WORDS;
        learned.shares = shares[..count].iter().map(|count| count / forget).collect();
        learned
    }

    /// Indices of the cells that are refined, as [`Self::resume`] takes them.
    pub fn refined(&self) -> Vec<u32> {
        self.refined.iter().map(|&cell| cell as u32).collect()
    }

    fn let_be_refined(&mut self, cell: usize) {
        if cell >= FACE_COUNT
            && let Some(parts) = self.keys.get(cell).and_then(|key| key.parts())
        {
            self.refined.push(cell);
            self.refined_by_parts.insert(parts, cell);
        }
    }

    /// Lets parts of fine cells be cells where there have been rays enough to tell them apart and these
    /// disagree on what is blocked: those first of which most rays do, as long as there is room.
    pub fn refine(&mut self) {
        let enough = RAYS_TO_REFINE * u64::from(PARTS_PER_RAY) * self.region_count as u64;
        let is_refined = |cell: usize| {
            let parts = self.keys[cell].parts();
            parts.is_none_or(|parts| self.refined_by_parts.contains_key(&parts))
        };
        let doubt = |cell: usize| {
            if is_refined(cell) {
                return None;
            }
            let counts = self.counts(cell);
            let trials: u64 = counts.iter().map(|count| u64::from(count.trials)).sum();
            if trials < enough {
                return None;
            }
            // Variance of as many rays, each of which is blocked or not.
            let doubt = |count: &Count| {
                let (hits, trials) = (count.hits as f32, count.trials as f32);
                f64::from(hits * (trials - hits) / trials.max(1.0))
            };
            let doubt: f64 = counts.iter().map(doubt).sum();
            (doubt >= LEAST_DOUBT * trials as f64).then_some((doubt, cell))
        };
        let mut doubtful: Vec<(f64, usize)> =
            (FACE_COUNT..self.keys.len()).into_par_iter().filter_map(doubt).collect();
        doubtful.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        // An eighth is left for cells that were not seen yet.
        let room = (self.capacity - self.capacity / 8).saturating_sub(self.keys.len());
        for (_, cell) in doubtful.into_iter().take(room / EXPECTED_PARTS) {
            self.let_be_refined(cell);
        }
    }

    /// What all cells counted, as [`Self::resume`] takes it.
    pub fn count_words(&self) -> Vec<CountWords> {
        self.counts.iter().map(|count| [count.trials, count.hits, count.response]).collect()
    }

    /// What visible rays say about the share of the BRDF, as [`Self::resume`] takes it.
    pub fn shares(&self) -> &[u32] {
        &self.shares
    }

    /// Number of cells, faces included.
    pub fn cell_count(&self) -> usize {
        self.keys.len()
    }

    /// Keys of all cells; those of the faces mean nothing.
    pub fn keys(&self) -> &[CellKey] {
        &self.keys
    }

    /// Hits and trials of one cell, region by region.
    pub fn counts(&self, cell: usize) -> &[Count] {
        &self.counts[cell * self.region_count..][..self.region_count]
    }

    /// Rays that were counted in all cells together.
    pub fn rays(&self) -> u64 {
        let trials = |count: &Count| u64::from(count.trials);
        self.counts.par_iter().map(trials).sum::<u64>() / u64::from(PARTS_PER_RAY)
    }

    /// Cells that found no room, counted again at every rebuild.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Adds what one stretch of passes counted per cell and region, in the order of the cells as they
    /// were, trials and hits in rays; `counted` starts with pair `first` of cell and region.
    ///
    /// # Panics
    /// If there are more counts than cells.
    pub fn add(&mut self, first: usize, counted: &[CountWords]) {
        let counts = &mut self.counts[first..][..counted.len()];
        let parts = u64::from(PARTS_PER_RAY);
        let add = |(count, [trials, hits, response]): (&mut Count, &CountWords)| {
            let all = u64::from(count.trials) + parts * u64::from(*trials);
            let halvings = (all / (LARGEST_COUNT + 1)).checked_ilog2().map_or(0, |log| log + 1);
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

    /// Adds what one stretch of passes found about the share of the BRDF, [`SHARE_WORDS`] words per
    /// cell; what was found before counts half from now on.
    ///
    /// # Panics
    /// If there are more words than cells have.
    pub fn add_shares(&mut self, found: &[u32]) {
        assert!(found.len() <= self.shares.len(), "shares of cells that are there");
        for (share, found) in self.shares.iter_mut().zip(found) {
            *share = (*share / 2).saturating_add(*found);
        }
    }

    /// Adds what bounce rays of one stretch of passes found, cell by cell and direction by direction; light
    /// in the units of `reflected`, which they read.
    pub fn add_arrivals(&mut self, found: &[ArrivalWords], reflected: &Reflected) {
        if let Some(arriving) = &mut self.arriving {
            arriving.add(found, reflected.unit);
        }
    }

    /// What bounces taught, as [`Self::with_bounces`] takes it.
    pub fn arrivals(&self) -> Vec<ArrivalWords> {
        self.arriving.as_ref().map(ArrivingLight::words).unwrap_or_default()
    }

    /// Makes room for the fine cells `wanted`, in any order and repeated at will: first for the coarse
    /// cells of those that are no parts of others, then for themselves, as long as there is room.
    pub fn want(&mut self, wanted: &[u32]) {
        let mut keys: Vec<CellKey> =
            wanted.iter().map(|&word| CellKey(word)).filter(|key| key.is_valid_fine()).collect();
        keys.sort_unstable();
        keys.dedup();
        // Neighbours in the order of a hash are nowhere near each other: what finds no room is
        // scattered over the scene.
        keys.sort_by_key(|key| (key.slot(u32::MAX), key.0));
        let is_part = |key: &&CellKey| self.refined_by_parts.contains_key(&key.siblings());
        let coarse: Vec<CellKey> =
            keys.iter().filter(|key| !is_part(key)).map(|key| key.coarse()).collect();
        for key in coarse.into_iter().chain(keys) {
            if self.index_of.contains_key(&key) {
                continue;
            }
            if self.keys.len() == self.capacity {
                self.refused += 1;
                continue;
            }
            self.index_of.insert(key, self.keys.len());
            self.keys.push(key);
            self.counts.resize(self.counts.len() + self.region_count, Count::default());
            self.shares.resize(self.shares.len() + SHARE_WORDS, 0);
        }
        if let Some(arriving) = &mut self.arriving {
            arriving.resize(self.keys.len());
        }
    }

    /// What every region is worth to the scene by `snapshot`: the root of the mean over all fine cells
    /// of its probability divided by its share of the energy.
    pub fn interest(&self, snapshot: &Snapshot) -> Vec<f64> {
        let mut sums = vec![0.0; self.region_count];
        let mut cells = 0_u32;
        for (key, entries) in
            self.keys.iter().zip(snapshot.entries.chunks(self.region_count)).skip(FACE_COUNT)
        {
            if key.is_coarse() {
                continue;
            }
            cells += 1;
            for (sum, entry) in sums.iter_mut().zip(entries) {
                *sum += f64::from(decode_entry(*entry).0);
            }
        }
        if cells == 0 {
            return vec![1.0; self.region_count];
        }
        sums.into_iter().map(|sum| (sum / f64::from(cells)).sqrt()).collect()
    }

    /// Counts for the regions of `to` in the place of those of `from`: each inherits its share, by
    /// energy, of what was counted where it lies. From here on there is room for `capacity` cells.
    ///
    /// # Panics
    /// If there are more cells than that.
    pub fn carry_over(&mut self, from: &Partition, to: &Partition, capacity: usize) {
        assert!(self.keys.len() <= capacity, "{} cells, room for {capacity}", self.keys.len());
        self.capacity = capacity;
        let shares = from.shares_in(to);
        let count = to.regions.len();
        let mut counts = vec![Count::default(); self.keys.len() * count];
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

    /// The tables for the next pass.
    pub fn snapshot(&self, partition: &Partition) -> Snapshot {
        let mut snapshot = Snapshot::default();
        self.write_snapshot(partition, &mut snapshot);
        snapshot
    }

    /// The tables for the next pass, in the memory of older ones.
    pub fn write_snapshot(&self, partition: &Partition, snapshot: &mut Snapshot) {
        let regions = self.region_count;
        let lookup = Lookup::new(partition);
        let tree = self.tree();
        let tallies = self.tallies(&tree);
        let mut scene = Tally::default();
        for tally in tallies[..FACE_COUNT].iter().flatten() {
            scene.add(*tally);
        }
        // Estimate the cells that others are parts of, from the faces down. The others stay empty.
        let mut whole = vec![Estimates::default(); self.keys.len()];
        for generation in &tree.generations {
            let estimate = |&cell: &usize| {
                let tallies = &tallies[cell];
                if cell < FACE_COUNT {
                    return Estimates::of_face(cell, tallies, scene, &lookup);
                }
                let parent = &whole[tree.parents[cell]];
                if self.keys[cell].is_coarse() {
                    Estimates::of_coarse(tallies, parent)
                } else {
                    Estimates::of_part(tallies, parent, &lookup)
                }
            };
            let estimates: Vec<Estimates> = generation.par_iter().map(estimate).collect();
            for (cell, estimates) in generation.iter().zip(estimates) {
                whole[*cell] = estimates;
            }
        }
        let entries = &mut snapshot.entries;
        entries.resize(self.keys.len() * regions, [0; 2]);
        let mut reflected = vec![0.0; self.keys.len()];
        entries.par_chunks_mut(regions).zip(&mut reflected).enumerate().for_each_init(
            Scratch::default,
            |scratch, (cell, (entries, reflected))| {
                let of_part;
                let estimates = if whole[cell].is_empty() {
                    let parent = &whole[tree.parents[cell]];
                    of_part = Estimates::of_part(self.counts(cell), parent, &lookup);
                    &of_part
                } else {
                    &whole[cell]
                };
                estimates.write_entries(&lookup, scratch, entries);
                if self.arriving.is_some() {
                    *reflected = estimates.reflected(&lookup);
                }
            },
        );
        if let Some(arriving) = &self.arriving {
            (snapshot.arriving, snapshot.reflected) = arriving.estimate(&tree, &reflected);
        }
        snapshot.table = self.table(&self.shares_in_256ths(&tree));
    }

    /// The cell that another is a part of: a refined one, else its coarse cell, of that its face.
    fn parent(&self, cell: usize) -> usize {
        let key = self.keys[cell];
        if key.is_coarse() {
            return key.face();
        }
        let refined = self.refined_by_parts.get(&key.siblings());
        refined.or_else(|| self.index_of.get(&key.coarse())).copied().unwrap_or(key.face())
    }

    fn tree(&self) -> Tree {
        let parents: Vec<usize> = (0..FACE_COUNT)
            .chain((FACE_COUNT..self.keys.len()).map(|cell| self.parent(cell)))
            .collect();
        let mut parts = vec![Vec::new(); parents.len()];
        for (cell, parent) in parents.iter().enumerate().skip(FACE_COUNT) {
            parts[*parent].push(cell);
        }
        let mut generations = vec![(0..FACE_COUNT).collect::<Vec<usize>>()];
        while let Some(last) = generations.last().filter(|last| !last.is_empty()) {
            let next = last.iter().flat_map(|&cell| parts[cell].iter().copied());
            let is_whole = |cell: &usize| !parts[*cell].is_empty() || self.keys[*cell].is_coarse();
            generations.push(next.filter(is_whole).collect());
        }
        Tree { parents, parts, generations }
    }

    /// What was counted in every cell that has parts and in these; nothing for the others.
    fn tallies(&self, tree: &Tree) -> Vec<Vec<Tally>> {
        let mut tallies = vec![Vec::new(); self.keys.len()];
        for generation in tree.generations.iter().rev() {
            let sum = |&cell: &usize| -> Vec<Tally> {
                let mut sum: Vec<Tally> = self.counts(cell).iter().map(Tally::from).collect();
                for &part in &tree.parts[cell] {
                    if tallies[part].is_empty() {
                        let counts = self.counts(part);
                        sum.iter_mut().zip(counts).for_each(|(sum, count)| sum.add(count.into()));
                    } else {
                        let tallies = &tallies[part];
                        sum.iter_mut().zip(tallies).for_each(|(sum, tally)| sum.add(*tally));
                    }
                }
                sum
            };
            let sums: Vec<Vec<Tally>> = generation.par_iter().map(sum).collect();
            for (cell, sum) in generation.iter().zip(sums) {
                tallies[*cell] = sum;
            }
        }
        tallies
    }

    /// Share of the BRDF of every cell, 256ths, 0 where it is left to the material. A cell leans on
    /// what it is a part of, a face on the scene.
    fn shares_in_256ths(&self, tree: &Tree) -> Vec<u32> {
        let mut sums: Vec<ShareEvidence> =
            self.shares.par_chunks(SHARE_WORDS).map(ShareEvidence::of).collect();
        let mut scene = ShareEvidence::default();
        for evidence in &sums {
            scene.add(*evidence);
        }
        for generation in tree.generations.iter().rev() {
            for &cell in generation {
                for &part in &tree.parts[cell] {
                    let evidence = sums[part];
                    sums[cell].add(evidence);
                }
            }
        }
        let scene = scene.share(None);
        let mut shares: Vec<Option<f64>> =
            sums[..FACE_COUNT].iter().map(|sum| sum.share(scene)).collect();
        shares.resize(self.keys.len(), None);
        for generation in &tree.generations {
            for &cell in generation {
                for &part in &tree.parts[cell] {
                    shares[part] = sums[part].share(shares[cell]);
                }
            }
        }
        shares.into_iter().map(share_in_256ths).collect()
    }

    /// The hash table, with `shares` of the BRDF by cell; what finds no slot within [`GUIDE_PROBES`] is left out, and its place falls
    /// back to the coarse cell or the face.
    fn table(&self, shares: &[u32]) -> Vec<[u32; 2]> {
        let mut table = vec![[CellKey::NONE.0, 0]; self.slots];
        let mask = (self.slots - 1) as u32;
        let mut values: Vec<u32> = shares.iter().map(|share| share << GUIDE_SHARE_SHIFT).collect();
        for &cell in &self.refined {
            values[cell] |= GUIDE_REFINED;
        }
        for (index, key) in self.keys.iter().enumerate().skip(FACE_COUNT) {
            let first = key.slot(mask);
            let slots = (0..GUIDE_PROBES).map(|probe| ((first + probe) & mask) as usize);
            if let Some(slot) = slots.into_iter().find(|&slot| table[slot][0] == CellKey::NONE.0) {
                table[slot] = [key.0, index as u32 | values[index]];
            }
        }
        table
    }
}
