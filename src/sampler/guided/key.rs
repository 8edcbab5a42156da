//! Keys of cells of the scene: place, size and orientation in 32 bits.
//!
//! A cell is a cube of an infinite grid, with an edge that follows from the distance to the camera,
//! together with the face of the cube that is nearest to the normal of the surface. Keys hold the
//! grid coordinates modulo 256: two places share a key only if they are at least 256 edges apart at
//! the same edge, which costs precision but no correctness. The grids are nested: a cell consists
//! of eight of half its edge. Twin of `guide_key` in `glsl/guided/guide.glsl`.

use crate::sampler::regions::FACE_COUNT;

/// Key of a cell: x, y, z in 8 bits each, the level of size in 4, the face in 3. The highest bit
/// marks coarse cells, four times as long, which hold 64 fine ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CellKey(pub u32);

impl CellKey {
    /// Key of no cell.
    pub const NONE: Self = Self(u32::MAX);

    const COARSE: u32 = 1 << 31;

    /// Key of the fine cell at grid coordinates `position`, taken modulo 256.
    ///
    /// # Panics
    /// If the level is above 15 or the face above 5: a mistake of the caller.
    pub fn fine(position: [i32; 3], level: u32, face: usize) -> Self {
        assert!(level < 16 && face < FACE_COUNT, "level {level}, face {face}");
        let [x, y, z] = position.map(|coordinate| (coordinate & 255) as u32);
        Self(x | y << 8 | z << 16 | level << 24 | (face as u32) << 28)
    }

    /// Key of the coarse cell that holds a fine one; a coarse cell is its own.
    pub fn coarse(self) -> Self {
        if self.is_coarse() {
            return self;
        }
        Self((self.0 >> 2 & 0x003f_3f3f) | (self.0 & 0x7f00_0000) | Self::COARSE)
    }

    /// [`Self::sibling_group`] of the children of a fine cell, which have half its edge; `None`
    /// where there are none. Cells that are 128 edges apart have children of the same keys.
    pub fn child_group(self) -> Option<u32> {
        let level = self.0 >> 24 & 15;
        (!self.is_coarse() && level > 0).then(|| (self.0 & 0x707f_7f7f) | (level - 1) << 24)
    }

    /// Number that the eight children of a cell have in common, from the key of any of them.
    pub fn sibling_group(self) -> u32 {
        (self.0 >> 1 & 0x007f_7f7f) | (self.0 & 0x7f00_0000)
    }

    /// True if this is a coarse cell.
    pub fn is_coarse(self) -> bool {
        self.0 & Self::COARSE != 0
    }

    /// Face that surfaces in the cell point at.
    pub fn face(self) -> usize {
        (self.0 >> 28 & 7) as usize
    }

    /// True if a word read back from the device is the key of a fine cell.
    pub fn is_valid_fine(self) -> bool {
        !self.is_coarse() && self.face() < FACE_COUNT
    }

    /// First slot in a table of `mask + 1` slots. Finalizer of MurmurHash3 (Appleby 2011).
    pub fn slot(self, mask: u32) -> u32 {
        let mut hash = self.0;
        hash ^= hash >> 16;
        hash = hash.wrapping_mul(0x85eb_ca6b);
        hash ^= hash >> 13;
        hash = hash.wrapping_mul(0xc2b2_ae35);
        (hash ^ hash >> 16) & mask
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_cells_hold_four_fine_ones_along_each_axis() {
        let key = CellKey::fine([7, -1, 300], 9, 5);
        assert_eq!(key.0, 7 | 255 << 8 | 44 << 16 | 9 << 24 | 5 << 28);
        assert_eq!(key.coarse(), CellKey::fine([4, 252, 47], 9, 5).coarse());
        assert_ne!(key.coarse(), CellKey::fine([8, -1, 300], 9, 5).coarse());
        assert_ne!(key.coarse(), CellKey::fine([7, -1, 300], 8, 5).coarse());
        assert!(key.coarse().is_coarse() && key.coarse().coarse() == key.coarse());
        assert_eq!((key.face(), key.coarse().face()), (5, 5));
        assert!(key.is_valid_fine() && !CellKey::NONE.is_valid_fine());
    }

    #[test]
    fn children_have_half_the_edge() {
        let parent = CellKey::fine([7, -1, 300], 9, 5);
        for child in 0..8 {
            let offset = |position: i32, axis: i32| 2 * position + (child >> axis & 1);
            let child = CellKey::fine([offset(7, 0), offset(-1, 1), offset(300, 2)], 8, 5);
            assert_eq!(Some(child.sibling_group()), parent.child_group());
        }
        for other in [([8, -1, 300], 9, 5), ([7, -1, 300], 8, 5), ([7, -1, 300], 9, 4)] {
            assert_ne!(
                CellKey::fine(other.0, other.1, other.2).child_group(),
                parent.child_group()
            );
        }
        assert_eq!(CellKey::fine([7, 1, 3], 0, 2).child_group(), None);
        assert_eq!(parent.coarse().child_group(), None);
    }
}
