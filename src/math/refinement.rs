//! Refinement of adaptive partitions, as fits, lamps and the guide make them.

use std::{cmp::Reverse, collections::BinaryHeap};

/// Splits parts as long as there are fewer than `most`: that of the largest priority, which is not negative,
/// and of these the oldest. `split` puts one part in the place of that at an index and others at the end; a
/// part to which it adds none, and one without a priority, stay as they are.
pub(crate) fn refine<T>(
    parts: &mut Vec<T>,
    most: usize,
    priority: impl Fn(&T) -> Option<f64>,
    mut split: impl FnMut(&mut Vec<T>, usize),
) {
    // Floats that are not negative are in the order of their bits.
    let queued = |parts: &[T], index: usize| {
        priority(&parts[index]).map(|priority| (priority.to_bits(), Reverse(index)))
    };
    let mut queue: BinaryHeap<_> =
        (0..parts.len()).filter_map(|index| queued(parts, index)).collect();
    while parts.len() < most {
        let Some((_, Reverse(index))) = queue.pop() else { break };
        let before = parts.len();
        split(parts, index);
        if parts.len() > before {
            let changed = [index].into_iter().chain(before..parts.len());
            queue.extend(changed.filter_map(|index| queued(parts, index)));
        }
    }
}
