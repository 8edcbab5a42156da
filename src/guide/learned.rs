//! What was learned so far, and the snapshot of it that a pass reads.

use std::collections::HashMap;

use rayon::prelude::*;

use super::{
    estimate::{Count, CountWords, EstimateOptions, Estimates, PARTS_PER_RAY, decode_entry},
    key::{CellKey, FACE_COUNT, face_normal},
    partition::Partition,
    share::{SHARE_WORDS, ShareEvidence, share_in_256ths},
};
use crate::gpu::constants::{GUIDE_PROBES, GUIDE_SHARE_SHIFT};

/// Trials of one region and cell above which what was counted is halved; then the responses fit a word.
const LARGEST_COUNT: u64 = (1 << 16) * PARTS_PER_RAY;

/// Cells and counts. The first [`FACE_COUNT`] cells are the faces: rays from places that have no
/// cell of their own count there.
#[derive(Clone, Debug)]
pub struct Learned {
    capacity: usize,
    slots: usize,
    keys: Vec<CellKey>,
    index_of: HashMap<CellKey, usize>,
    /// Rays that were counted in the cell itself, cell by cell and region by region.
    counts: Vec<Count>,
    region_count: usize,
    /// What visible rays say about the share of the BRDF, [`SHARE_WORDS`] words per cell.
    shares: Vec<u32>,
    refused: u64,
}

/// What the next pass reads, as it lies on the device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// Hash table: key of a cell, [`CellKey::NONE`] where empty; its index and, from bit
    /// [`GUIDE_SHARE_SHIFT`] on, its share of the BRDF in 256ths, 0 where that goes by the material.
    pub table: Vec<[u32; 2]>,
    /// Entries of every cell, region by region.
    pub entries: Vec<[u32; 2]>,
}

impl Learned {
    /// Nothing learned, room for `capacity` cells (at least the faces) and a table of `slots`, a
    /// power of two.
    ///
    /// # Panics
    /// If there is no room for the faces or `slots` is not a power of two.
    pub fn new(region_count: usize, capacity: usize, slots: usize) -> Self {
        assert!(capacity >= FACE_COUNT && slots.is_power_of_two(), "{capacity} cells, {slots}");
        Self {
            capacity,
            slots,
            keys: vec![CellKey::NONE; FACE_COUNT],
            index_of: HashMap::new(),
            counts: vec![Count::default(); FACE_COUNT * region_count],
            region_count,
            shares: vec![0; FACE_COUNT * SHARE_WORDS],
            refused: 0,
        }
    }

    /// As [`Self::new`], with the keys, counts (trials and hits in sixteenths of rays) and shares that an
    /// earlier one had; what finds no room is left out. With `forget`, every count is divided by that
    /// number.
    ///
    /// # Panics
    /// As [`Self::new`]; if there are not as many counts as keys and regions, the faces first, or
    /// shares.
    pub fn resume(
        region_count: usize,
        capacity: usize,
        slots: usize,
        keys: &[u32],
        counts: &[CountWords],
        shares: &[u32],
        forget: u32,
    ) -> Self {
        assert!(keys.len() >= FACE_COUNT && counts.len() == keys.len() * region_count, "lengths");
        assert_eq!(shares.len(), keys.len() * SHARE_WORDS, "lengths");
        let mut learned = Self::new(region_count, capacity, slots);
        for key in keys[FACE_COUNT..].iter().take(capacity - FACE_COUNT).map(|&word| CellKey(word))
        {
            learned.index_of.insert(key, learned.keys.len());
            learned.keys.push(key);
        }
        let count = learned.keys.len() * region_count;
        learned.counts = counts[..count]
            .iter()
            .map(|[trials, hits, response]| Count {
                hits: u64::from(hits.min(trials) / forget),
                trials: u64::from(trials / forget),
                response: u64::from(response / forget),
            })
            .collect();
        let count = learned.keys.len() * SHARE_WORDS;
        learned.shares = shares[..count].iter().map(|count| count / forget).collect();
        learned
    }

    /// What all cells counted, as [`Self::resume`] takes it.
    pub fn count_words(&self) -> Vec<CountWords> {
        // Counts stay below LARGEST_COUNT and what one stretch of passes adds.
        let word = |count: u64| u32::try_from(count).unwrap_or(u32::MAX);
        self.counts
            .iter()
            .map(|count| [word(count.trials), word(count.hits), word(count.response)])
            .collect()
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
        self.counts.iter().map(|count| count.trials).sum::<u64>() / PARTS_PER_RAY
    }

    /// Cells that found no room, counted again at every rebuild.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Adds what one stretch of passes counted per cell and region, in the order of the cells as they
    /// were, trials and hits in rays.
    ///
    /// # Panics
    /// If there are more counts than cells.
    pub fn add(&mut self, counted: &[CountWords]) {
        assert!(counted.len() <= self.counts.len(), "counts of cells that are there");
        for (count, [trials, hits, response]) in self.counts.iter_mut().zip(counted) {
            count.trials += PARTS_PER_RAY * u64::from(*trials);
            count.hits += PARTS_PER_RAY * u64::from(*hits.min(trials));
            count.response += u64::from(*response);
            while count.trials > LARGEST_COUNT {
                count.trials /= 2;
                count.hits /= 2;
                count.response /= 2;
            }
        }
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

    /// Makes room for the fine cells `wanted`, in any order and repeated at will: first for their
    /// coarse cells, then for themselves, as long as there is room.
    pub fn want(&mut self, wanted: &[u32]) {
        let mut keys: Vec<CellKey> =
            wanted.iter().map(|&word| CellKey(word)).filter(|key| key.is_valid_fine()).collect();
        keys.sort_unstable();
        keys.dedup();
        // Neighbours in the order of a hash are nowhere near each other: what finds no room is
        // scattered over the scene.
        keys.sort_by_key(|key| (key.slot(u32::MAX), key.0));
        let coarse: Vec<CellKey> = keys.iter().map(|key| key.coarse()).collect();
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
                for (old, shares) in old.iter().zip(&shares) {
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
    pub fn snapshot(&self, partition: &Partition, options: &EstimateOptions) -> Snapshot {
        let regions = self.region_count;
        // Every count also belongs to the coarse cell and the face above it.
        let mut sums = self.counts.clone();
        let mut scene = Count::default();
        let mut faces = vec![Count::default(); FACE_COUNT * regions];
        let add = |sums: &mut [Count], to: usize, counts: &[Count]| {
            for (sum, count) in sums[to * regions..][..regions].iter_mut().zip(counts) {
                sum.add(*count);
            }
        };
        for (index, key) in self.keys.iter().enumerate() {
            let counts = self.counts(index);
            for count in counts {
                scene.add(*count);
            }
            if index < FACE_COUNT {
                add(&mut faces, index, counts);
                continue;
            }
            add(&mut faces, key.face(), counts);
            if let Some(coarse) = self.coarse_of(*key) {
                add(&mut sums, coarse, counts);
            }
        }
        let face = |face: usize, counts: &[Count]| {
            Estimates::of_face(counts, scene, face_normal(face), partition)
        };
        let faces: Vec<Estimates> = (0..FACE_COUNT)
            .map(|index| face(index, &faces[index * regions..][..regions]))
            .collect();
        let nothing = vec![Count::default(); regions];
        let flat: Vec<Estimates> = (0..FACE_COUNT).map(|index| face(index, &nothing)).collect();
        let priors = if options.hierarchy { &faces } else { &flat };
        // Of coarse cells, where they are not those of their face.
        let coarse: Vec<Option<Estimates>> = self
            .keys
            .par_iter()
            .zip(sums.par_chunks(regions))
            .enumerate()
            .map(|(index, (key, sums))| {
                (index >= FACE_COUNT && key.is_coarse() && options.hierarchy)
                    .then(|| Estimates::of_coarse(sums, &priors[key.face()]))
            })
            .collect();
        let coarse_or_face = |index: Option<usize>, face: usize| {
            index.and_then(|index| coarse[index].as_ref()).unwrap_or(&priors[face])
        };
        let mut entries = vec![[0; 2]; self.keys.len() * regions];
        entries.par_chunks_mut(regions).enumerate().for_each(|(index, entries)| {
            let key = self.keys[index];
            let face = if index < FACE_COUNT { index } else { key.face() };
            let normal = face_normal(face);
            let of = |estimates: &Estimates| estimates.entries(normal, partition, options);
            entries.copy_from_slice(&if index < FACE_COUNT {
                of(&faces[face])
            } else if key.is_coarse() {
                of(coarse_or_face(Some(index), face))
            } else {
                let coarse = coarse_or_face(self.coarse_of(key), face);
                of(&Estimates::of_fine(self.counts(index), coarse, partition))
            });
        });
        let shares = if options.learned_share {
            self.shares_in_256ths(options.hierarchy)
        } else {
            vec![0; self.keys.len()]
        };
        Snapshot { table: self.table(&shares), entries }
    }

    /// The coarse cell above a fine one.
    fn coarse_of(&self, key: CellKey) -> Option<usize> {
        if key.is_coarse() { None } else { self.index_of.get(&key.coarse()).copied() }
    }

    /// Share of the BRDF of every cell, 256ths, 0 where it is left to the material. A cell leans on
    /// its coarse cell, that on its face, that on the scene.
    fn shares_in_256ths(&self, hierarchy: bool) -> Vec<u32> {
        let own: Vec<ShareEvidence> =
            self.shares.par_chunks(SHARE_WORDS).map(ShareEvidence::of).collect();
        let mut sums = own.clone();
        let mut scene = ShareEvidence::default();
        let mut faces = [ShareEvidence::default(); FACE_COUNT];
        for (index, (key, evidence)) in self.keys.iter().zip(&own).enumerate() {
            scene.add(*evidence);
            faces[if index < FACE_COUNT { index } else { key.face() }].add(*evidence);
            if index >= FACE_COUNT
                && let Some(coarse) = self.coarse_of(*key)
            {
                sums[coarse].add(*evidence);
            }
        }
        let scene = scene.share(None);
        let share = |(index, key): (usize, &CellKey)| {
            let face = if index < FACE_COUNT { index } else { key.face() };
            let mut around = faces[face].share(scene);
            if !hierarchy {
                around = scene;
            } else if index >= FACE_COUNT
                && let Some(coarse) = self.coarse_of(*key)
            {
                around = sums[coarse].share(around);
            }
            share_in_256ths(sums[index].share(around))
        };
        self.keys.iter().enumerate().map(share).collect()
    }

    /// The hash table, with `shares` of the BRDF by cell; what finds no slot within [`GUIDE_PROBES`] is left out, and its place falls
    /// back to the coarse cell or the face.
    fn table(&self, shares: &[u32]) -> Vec<[u32; 2]> {
        let mut table = vec![[CellKey::NONE.0, 0]; self.slots];
        let mask = (self.slots - 1) as u32;
        for (index, key) in self.keys.iter().enumerate().skip(FACE_COUNT) {
            let first = key.slot(mask);
            let slots = (0..GUIDE_PROBES).map(|probe| ((first + probe) & mask) as usize);
            if let Some(slot) = slots.into_iter().find(|&slot| table[slot][0] == CellKey::NONE.0) {
                table[slot] = [key.0, index as u32 | shares[index] << GUIDE_SHARE_SHIFT];
            }
        }
        table
    }
}
