//! Guide → the tables that the next passes read.

use rayon::prelude::*;

use crate::sampler::{
    guided::{
        arriving::Reflected,
        cells::Tree,
        counts::Tally,
        entries::{EntryTables, EntryWriter, ratios},
        estimate::{Estimates, PRIOR_RAYS, RegionTables},
        guide::Guide,
        share::{SHARE_WORDS, ShareEvidence, share_in_256ths},
    },
    regions::{FACE_COUNT, Partition},
};

/// Tables that the next passes read, as they lie on the device.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// Hash table: the key of a cell, [`CellKey::NONE`](super::CellKey::NONE) where empty; its
    /// index, [`GUIDE_REFINED`](crate::shader::rooms::guided::GUIDE_REFINED) where its children may be
    /// cells and, from bit [`GUIDE_SHARE_SHIFT`](crate::shader::rooms::guided::GUIDE_SHARE_SHIFT) on,
    /// its share of the BRDF in 256ths, 0 where the material decides.
    pub table: Vec<[u32; 2]>,
    /// Entries of every cell, region by region, and a 0 after them.
    pub entries: Vec<u32>,
    /// Estimated light from surfaces by cell and direction, relative to the mean over the
    /// directions of the cell; empty where bounces do not teach.
    pub arriving: Vec<f32>,
    /// Light that the cells reflect; empty where bounces do not teach.
    pub reflected: Reflected,
}

impl Guide {
    /// Tables for the next passes.
    pub fn snapshot(&self, partition: &Partition) -> Snapshot {
        let mut snapshot = Snapshot::default();
        self.write_snapshot(partition, &mut snapshot);
        snapshot
    }

    /// Writes the tables for the next passes into the memory of older ones.
    pub fn write_snapshot(&self, partition: &Partition, snapshot: &mut Snapshot) {
        let tree = self.cells.tree();
        let region_tables = RegionTables::new(partition);
        let entry_tables = EntryTables::new(partition);
        let inner = self.estimate_inner_cells(&tree, &region_tables);

        // Estimate the leaves and write the entries of every cell
        let entries = &mut snapshot.entries;
        entries.resize(self.cell_count() * self.region_count, 0);
        let mut reflected = vec![0.0; self.cell_count()];
        entries.par_chunks_mut(self.region_count).zip(&mut reflected).enumerate().for_each_init(
            || EntryWriter::new(&entry_tables),
            |writer, (cell, (entries, reflected))| {
                let leaf;
                let estimates = if inner[cell].is_empty() {
                    let parent = &inner[tree.parents[cell]];
                    let counts = self.counts(cell).iter().map(Tally::from);
                    leaf = Estimates::of_fine(counts, parent, &region_tables);
                    &leaf
                } else {
                    &inner[cell]
                };
                writer.write(estimates, entries);
                if self.arriving.is_some() {
                    *reflected = estimates.reflected(&region_tables);
                }
            },
        );
        entries.push(0);
        if let Some(arriving) = &self.arriving {
            (snapshot.arriving, snapshot.reflected) = arriving.estimate(&tree, &reflected);
        }
        snapshot.table = self.cells.table(&self.brdf_shares(&tree));
    }

    /// Estimates for faces, coarse cells and cells with children, parents first; empty for the leaves.
    fn estimate_inner_cells(&self, tree: &Tree, tables: &RegionTables) -> Vec<Estimates> {
        // Sum the counts of every inner cell and its descendants
        let tallies = tree.sums(|cell| self.counts(cell).iter().map(Tally::from));
        let mut scene = Tally::default();
        for tally in tallies[..FACE_COUNT].iter().flatten() {
            scene += *tally;
        }
        tree.down(|cell, inner: &[Estimates]| {
            let tallies = &tallies[cell];
            let parent = &inner[tree.parents[cell]];
            if cell < FACE_COUNT {
                Estimates::of_face(cell, tallies, scene, tables)
            } else if self.keys()[cell].is_coarse() {
                parent.updated(tallies, PRIOR_RAYS)
            } else {
                Estimates::of_fine(tallies.iter().copied(), parent, tables)
            }
        })
    }

    /// Share of the BRDF of every cell, 256ths, 0 where the material decides. The prior of a cell
    /// is its parent, that of a face the scene.
    fn brdf_shares(&self, tree: &Tree) -> Vec<u32> {
        let own: Vec<ShareEvidence> =
            self.shares.par_chunks(SHARE_WORDS).map(ShareEvidence::from_counts).collect();
        let mut scene = ShareEvidence::default();
        for evidence in &own {
            scene += *evidence;
        }
        let scene = scene.share(None);
        let sums = tree.sums(|cell| std::iter::once(own[cell]));
        let share = |cell: usize, shares: &[Option<f64>]| {
            let prior = if cell < FACE_COUNT { scene } else { shares[tree.parents[cell]] };
            sums[cell].first().unwrap_or(&own[cell]).share(prior)
        };
        let inner = tree.down(share);
        (0..own.len()).map(|cell| share_in_256ths(share(cell, &inner))).collect()
    }

    /// Importance of every region to the scene under `snapshot`: the root of the mean over all fine
    /// cells of its probability divided by its share of the energy.
    pub fn region_importance(&self, partition: &Partition, snapshot: &Snapshot) -> Vec<f64> {
        let mut sums = vec![0.0; self.region_count];
        let mut cells = 0_u32;
        for (key, entries) in
            self.keys().iter().zip(snapshot.entries.chunks(self.region_count)).skip(FACE_COUNT)
        {
            if key.is_coarse() {
                continue;
            }
            cells += 1;
            let shares = partition.regions.iter().map(|region| region.share);
            for (sum, ratio) in sums.iter_mut().zip(ratios(entries, shares)) {
                *sum += ratio;
            }
        }
        if cells == 0 {
            return vec![1.0; self.region_count];
        }
        sums.into_iter().map(|sum| (sum / f64::from(cells)).sqrt()).collect()
    }
}
