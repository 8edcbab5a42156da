//! Order in which fits and the guide refine their adaptive partitions.

use std::cmp::Ordering;

/// Part that waits to be split: the largest priority is next, the older part on a tie.
pub(crate) struct Queued {
    /// Worth of a split.
    pub priority: f64,
    /// Index of the part.
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
