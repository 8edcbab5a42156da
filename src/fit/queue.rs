//! The order in which adaptive partitions are refined.

use std::cmp::Ordering;

/// A part that waits to be split: the largest priority is next, the older one where two are equal.
pub(super) struct Queued {
    pub(super) priority: f64,
    pub(super) index: usize,
}

impl PartialEq for Queued {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Queued {}

impl PartialOrd for Queued {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Queued {
    fn cmp(&self, other: &Self) -> Ordering {
        self.priority.total_cmp(&other.priority).then(other.index.cmp(&self.index))
    }
}
