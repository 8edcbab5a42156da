//! How many cells and regions the memory of a guide and the rays that were counted allow.

use crate::sampler::guided::FACE_COUNT;

/// Rays per cell and region that twice as many regions would have, for there to be as many.
const RAYS_PER_REGION: u64 = 2;

/// How much can be learned.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    /// Pairs of cell and region that the buffers hold.
    pub counts: usize,
    /// Cells that the film can fill.
    pub useful_cells: usize,
    /// Most regions.
    pub most_regions: usize,
}

impl Room {
    /// Cells of `region_count` regions.
    pub fn cells(&self, region_count: usize) -> usize {
        (self.counts / region_count).min(self.useful_cells).max(FACE_COUNT)
    }

    /// How many regions there should be where there are `now`: twice as many as long as the `rays`
    /// that were counted in `cells` cells tell them apart, and as the cells do not crowd out new ones.
    pub fn regions(&self, now: usize, cells: usize, rays: u64) -> usize {
        let mut count = now;
        loop {
            let next = (2 * count).min(self.most_regions);
            let is_known = rays >= RAYS_PER_REGION * (cells * next) as u64;
            if next <= count || !is_known || cells + cells / 4 > self.cells(next) {
                return count;
            }
            count = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_grow_with_what_was_counted_as_long_as_cells_have_room() {
        let room = Room { counts: 1 << 20, useful_cells: 4096, most_regions: 1024 };
        assert_eq!((room.cells(256), room.cells(1024)), (4096, 1024));
        let rays = |regions: u64, cells: u64| RAYS_PER_REGION * regions * cells;
        assert_eq!(room.regions(256, 800, rays(512, 800) - 1), 256);
        assert_eq!(room.regions(256, 800, rays(512, 800)), 512);
        assert_eq!(room.regions(256, 800, rays(1024, 800)), 1024, "in one step");
        assert_eq!(room.regions(1024, 6, u64::MAX), 1024, "never more than asked for");
        assert_eq!(room.regions(512, 900, u64::MAX), 512, "a fifth of the room is for new cells");
        assert_eq!(Room { most_regions: 300, ..room }.regions(256, 6, u64::MAX), 300);
        let tiny = Room { counts: 6 * 256, ..room };
        assert_eq!((tiny.cells(256), tiny.regions(256, 6, u64::MAX)), (6, 256));
    }
}
