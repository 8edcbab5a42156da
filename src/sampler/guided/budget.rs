//! Divides the memory of the guide: memory, counted rays → number of cells and regions.

use crate::sampler::regions::FACE_COUNT;

/// Rays per cell and region required after the number of regions doubles.
const RAYS_PER_REGION: u64 = 2;

#[derive(Clone, Copy, Debug)]
pub(super) struct GuideBudget {
    /// Number of cell-region pairs that the buffers hold.
    pub counts: usize,
    /// Number of cells that the film can fill.
    pub useful_cells: usize,
    pub max_regions: usize,
}

impl GuideBudget {
    /// Number of cells that fit with `region_count` regions each.
    pub fn cells(&self, region_count: usize) -> usize {
        (self.counts / region_count).min(self.useful_cells).max(FACE_COUNT)
    }

    /// Doubles the number of regions as long as the `rays` counted in `cells` cells suffice to tell
    /// them apart and a fifth of the room for cells remains free.
    pub fn regions(&self, now: usize, cells: usize, rays: u64) -> usize {
        let mut count = now;
        loop {
            let next = (2 * count).min(self.max_regions);
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
    fn regions_double_while_rays_suffice_and_cells_have_room() {
        let budget = GuideBudget { counts: 1 << 20, useful_cells: 4096, max_regions: 1024 };
        assert_eq!((budget.cells(256), budget.cells(1024)), (4096, 1024));
        let rays = |regions: u64, cells: u64| RAYS_PER_REGION * regions * cells;
        assert_eq!(budget.regions(256, 800, rays(512, 800) - 1), 256);
        assert_eq!(budget.regions(256, 800, rays(512, 800)), 512);
        assert_eq!(budget.regions(256, 800, rays(1024, 800)), 1024, "in one step");
        assert_eq!(budget.regions(1024, 6, u64::MAX), 1024, "never more than asked for");
        assert_eq!(budget.regions(512, 900, u64::MAX), 512, "a fifth of the room is for new cells");
        assert_eq!(GuideBudget { max_regions: 300, ..budget }.regions(256, 6, u64::MAX), 300);
        let tiny = GuideBudget { counts: 6 * 256, ..budget };
        assert_eq!((tiny.cells(256), tiny.regions(256, 6, u64::MAX)), (6, 256));
    }
}
