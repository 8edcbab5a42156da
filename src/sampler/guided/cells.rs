//! The cells of the scene: which exist, which are refined, their hierarchy and their hash table.

use std::{collections::HashMap, ops::AddAssign};

use rayon::prelude::*;

use crate::sampler::{guided::key::CellKey, regions::FACE_COUNT};
use crate::shader::rooms::guided::{GUIDE_PROBES, GUIDE_REFINED, GUIDE_SHARE_SHIFT};

/// Lets sums over cells add a struct field by field.
macro_rules! adds {
    ($of:ident: $($field:ident)*) => {
        impl std::ops::AddAssign for $of {
            fn add_assign(&mut self, other: Self) {
                $(self.$field += other.$field;)*
            }
        }
    };
}
pub(super) use adds;

/// Upper bound of the number of cells, faces included: their index lies below [`GUIDE_REFINED`].
pub const MAX_CELLS: usize = 1 << 22;

/// Cells in the order in which they were added. The first [`FACE_COUNT`] are the faces, which stand
/// in for places without a cell of their own.
#[derive(Clone, Debug)]
pub struct Cells {
    pub(super) capacity: usize,
    slots: usize,
    /// Keys of all cells; those of the faces are [`CellKey::NONE`].
    pub(super) keys: Vec<CellKey>,
    index_of: HashMap<CellKey, usize>,
    /// Fine cells whose children may be cells.
    pub(super) refined: Vec<usize>,
    /// The same by [`CellKey::child_group`].
    refined_by_children: HashMap<u32, usize>,
}

/// Hierarchy of the cells: faces, coarse cells, fine cells, children of refined cells, and so on.
pub(super) struct Tree {
    /// Parent of every cell; faces are their own.
    pub(super) parents: Vec<usize>,
    pub(super) children: Vec<Vec<usize>>,
    /// The faces, then all other cells with children and all coarse cells, level by level.
    pub(super) generations: Vec<Vec<usize>>,
}

impl Tree {
    /// Computes `value` for the inner cells, generation by generation: parents first, each given what is
    /// found so far. Leaves keep the default.
    pub(super) fn down<T: Clone + Default + Send + Sync>(
        &self,
        value: impl Fn(usize, &[T]) -> T + Sync,
    ) -> Vec<T> {
        self.walk(self.generations.iter(), value)
    }

    /// Sums what `own` tells of every inner cell and its descendants, part by part; empty for the leaves.
    pub(super) fn sums<T: Copy + AddAssign + Send + Sync, Own: Iterator<Item = T>>(
        &self,
        own: impl Fn(usize) -> Own + Sync,
    ) -> Vec<Vec<T>> {
        self.walk(self.generations.iter().rev(), |cell, sums: &[Vec<T>]| {
            let mut sum: Vec<T> = own(cell).collect();
            for &child in &self.children[cell] {
                if sums[child].is_empty() {
                    sum.iter_mut().zip(own(child)).for_each(|(sum, found)| *sum += found);
                } else {
                    sum.iter_mut().zip(&sums[child]).for_each(|(sum, found)| *sum += *found);
                }
            }
            sum
        })
    }

    fn walk<'a, T: Clone + Default + Send + Sync>(
        &self,
        generations: impl Iterator<Item = &'a Vec<usize>>,
        value: impl Fn(usize, &[T]) -> T + Sync,
    ) -> Vec<T> {
        let mut found = vec![T::default(); self.parents.len()];
        for generation in generations {
            let values: Vec<T> = generation.par_iter().map(|&cell| value(cell, &found)).collect();
            for (cell, value) in generation.iter().zip(values) {
                found[*cell] = value;
            }
        }
        found
    }
}

impl Cells {
    /// The faces, with room for `capacity` cells and a hash table of `slots`, a power of two.
    ///
    /// # Panics
    /// If there is no room for the faces or `slots` is not a power of two.
    pub fn new(capacity: usize, slots: usize) -> Self {
        let is_possible = (FACE_COUNT..=MAX_CELLS).contains(&capacity) && slots.is_power_of_two();
        assert!(is_possible, "{capacity} cells, {slots} slots");
        Self {
            capacity,
            slots,
            keys: vec![CellKey::NONE; FACE_COUNT],
            index_of: HashMap::new(),
            refined: Vec::new(),
            refined_by_children: HashMap::new(),
        }
    }

    /// As [`Self::new`], with the `keys`, faces first, and `refined` cells of an earlier guide.
    /// Drops the keys that find no room.
    ///
    /// # Panics
    /// As [`Self::new`]; if there are fewer keys than faces.
    pub fn resume(capacity: usize, slots: usize, keys: &[u32], refined: &[u32]) -> Self {
        let mut cells = Self::new(capacity, slots);
        for &key in keys[FACE_COUNT..].iter().take(capacity - FACE_COUNT) {
            cells.push(CellKey(key));
        }
        for &cell in refined {
            if (FACE_COUNT..cells.len()).contains(&(cell as usize)) {
                cells.refine(cell as usize);
            }
        }
        cells
    }

    fn push(&mut self, key: CellKey) {
        self.index_of.insert(key, self.keys.len());
        self.keys.push(key);
    }

    /// Adds the fine cells among `missing`, in any order and with repetitions, as long as there is
    /// room. Coarse cells come first; children of refined cells need none.
    pub fn add(&mut self, missing: &[u32]) {
        let mut keys: Vec<CellKey> =
            missing.iter().map(|&word| CellKey(word)).filter(|key| key.is_valid_fine()).collect();
        keys.sort_unstable();
        keys.dedup();
        // Neighbours in the order of a hash are nowhere near each other: the cells that find no
        // room are scattered over the scene.
        keys.sort_by_key(|key| (key.slot(u32::MAX), key.0));
        let has_refined_parent =
            |key: &&CellKey| self.refined_by_children.contains_key(&key.sibling_group());
        let coarse: Vec<CellKey> =
            keys.iter().filter(|key| !has_refined_parent(key)).map(|key| key.coarse()).collect();
        for key in coarse.into_iter().chain(keys) {
            if !self.index_of.contains_key(&key) && self.keys.len() < self.capacity {
                self.push(key);
            }
        }
    }

    /// Lets the children of a cell be cells, where it can have any.
    pub fn refine(&mut self, cell: usize) {
        if let Some(children) = self.keys[cell].child_group() {
            self.refined.push(cell);
            self.refined_by_children.insert(children, cell);
        }
    }

    /// True if a cell can be refined and is not yet.
    pub fn is_refinable(&self, cell: usize) -> bool {
        let children = self.keys[cell].child_group();
        children.is_some_and(|children| !self.refined_by_children.contains_key(&children))
    }

    /// Number of cells, faces included.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Parent of a cell: a refined cell, else its coarse cell; of a coarse cell its face.
    fn parent(&self, cell: usize) -> usize {
        let key = self.keys[cell];
        if key.is_coarse() {
            return key.face();
        }
        let refined = self.refined_by_children.get(&key.sibling_group());
        refined.or_else(|| self.index_of.get(&key.coarse())).copied().unwrap_or(key.face())
    }

    /// Links every cell to its parent and its children.
    pub(super) fn tree(&self) -> Tree {
        let parents: Vec<usize> = (0..FACE_COUNT)
            .chain((FACE_COUNT..self.keys.len()).map(|cell| self.parent(cell)))
            .collect();
        let mut children = vec![Vec::new(); parents.len()];
        for (cell, parent) in parents.iter().enumerate().skip(FACE_COUNT) {
            children[*parent].push(cell);
        }
        let mut generations = vec![(0..FACE_COUNT).collect::<Vec<usize>>()];
        while let Some(last) = generations.last().filter(|last| !last.is_empty()) {
            let next = last.iter().flat_map(|&cell| children[cell].iter().copied());
            let is_inner =
                |cell: &usize| !children[*cell].is_empty() || self.keys[*cell].is_coarse();
            generations.push(next.filter(is_inner).collect());
        }
        Tree { parents, children, generations }
    }

    /// Hash table of the cells with their `shares` of the BRDF, 256ths. A cell that finds no slot
    /// within [`GUIDE_PROBES`] is left out; lookups fall back on its coarse cell or its face.
    pub fn table(&self, shares: &[u32]) -> Vec<[u32; 2]> {
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
