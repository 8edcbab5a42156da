//! The order in which adaptive partitions are refined, those of fits and that of the guide.

use std::cmp::Ordering;

/// A part that waits to be split: the largest priority is next, the older one where two are equal.
pub struct Queued {
    /// How much a split is worth.
    pub priority: f64,
    /// Which part.
    pub index: usize,
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
