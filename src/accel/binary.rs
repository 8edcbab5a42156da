//! Boxes → binary BVH, built quickly and with bounded depth for any input.
//!
//! Clustering and reinsertion (obvhs) give the better tree, but chain boxes that share a centre:
//! 40,000 coincident triangles take minutes and give thousands of levels. Such crowds enter the
//! clustering as one box each and get a median-split tree of their own.

use glam::Vec3A;
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, node::Bvh2Node, reinsertion::ReinsertionOptimizer},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision},
};

/// Cells per axis. Centres in one cell count as equal; clustering sorts by the same 20-bit grid.
const CELLS: f32 = 1_048_576.0;

/// Most boxes with centres in one cell that are still clustered individually.
const LARGEST_CROWD: usize = 16;

/// Depth of the binary tree beyond which median splits build all of it.
const DEEPEST: usize = 160;

/// Largest overlap of boxes that are clustered: clustering and reinsertion look through boxes that
/// overlap, and took minutes for a fan of 300,000 slivers, whose overlap is 75,000.
const LARGEST_OVERLAP: f32 = 2000.0;

/// Builds a binary BVH over `boxes`, one box per leaf. Consumes the boxes to free their memory early.
pub(super) fn build(boxes: Vec<Aabb>) -> Bvh2 {
    if overlap(&boxes) > LARGEST_OVERLAP {
        return by_median_splits(&boxes);
    }
    let (mut singles, crowds) = crowds(&boxes);
    if crowds.is_empty() {
        drop(singles);
        let indices = (0..boxes.len() as u32).collect();
        let binary = cluster(&boxes, indices);
        if binary.max_depth <= DEEPEST {
            drop(boxes);
            return reinsert(binary);
        }
        return by_median_splits(&boxes);
    }

    let mut items: Vec<Aabb> = singles.iter().map(|&index| boxes[index as usize]).collect();
    items.extend(crowds.iter().map(|crowd| union(&boxes, crowd)));
    let binary = cluster(&items, (0..items.len() as u32).collect());
    drop(items);
    if binary.max_depth > DEEPEST {
        return by_median_splits(&boxes);
    }
    let mut binary = reinsert(binary);

    // Replace the leaf of each crowd by its tree, and let leaves refer to boxes directly.
    let single_count = singles.len();
    let primitive_of_item = std::mem::take(&mut binary.primitive_indices);
    let mut crowds: Vec<_> = crowds.into_iter().map(Some).collect();
    for node in 0..binary.nodes.len() {
        if !binary.nodes[node].is_leaf() {
            continue;
        }
        let item = primitive_of_item[binary.nodes[node].first_index as usize] as usize;
        if item < single_count {
            binary.nodes[node].first_index = item as u32;
        } else if let Some(mut crowd) = crowds[item - single_count].take() {
            let end = singles.len() as u32;
            singles.extend(&crowd);
            split_median(&mut binary.nodes, node, &boxes, &mut crowd, end);
            singles[end as usize..].copy_from_slice(&crowd);
        }
    }
    binary.primitive_indices = singles;
    binary.parents.clear();
    binary
}

/// Mean number of boxes that a line through all of their bounds meets: the sum of their surfaces over
/// that of the bounds.
fn overlap(boxes: &[Aabb]) -> f32 {
    let bounds = boxes.iter().fold(Aabb::empty(), |bounds, aabb| bounds.union(aabb));
    let surfaces: f32 = boxes.iter().map(Aabb::half_area).sum();
    surfaces / bounds.half_area().max(f32::MIN_POSITIVE)
}

/// Returns the indices of boxes that stand alone, and the groups of boxes that crowd in one cell.
fn crowds(boxes: &[Aabb]) -> (Vec<u32>, Vec<Vec<u32>>) {
    let bounds = boxes.iter().fold(Aabb::empty(), |bounds, aabb| bounds.union(aabb));
    let cells = Vec3A::splat(CELLS) / bounds.diagonal().max(Vec3A::splat(f32::MIN_POSITIVE));
    let mut cells: Vec<(u64, u32)> = boxes
        .iter()
        .zip(0..)
        .map(|(aabb, index)| {
            let cell = ((aabb.center() - bounds.min) * cells).min(Vec3A::splat(CELLS - 1.0));
            let cell = cell.to_array().map(|x| x as u64);
            (cell[0] << 40 | cell[1] << 20 | cell[2], index)
        })
        .collect();
    cells.sort_unstable();
    let mut singles = Vec::new();
    let mut crowds = Vec::new();
    for group in cells.chunk_by(|a, b| a.0 == b.0) {
        let indices = group.iter().map(|(_, index)| *index);
        if group.len() > LARGEST_CROWD {
            crowds.push(indices.collect());
        } else {
            singles.extend(indices);
        }
    }
    (singles, crowds)
}

fn union(boxes: &[Aabb], indices: &[u32]) -> Aabb {
    indices.iter().fold(Aabb::empty(), |bounds, &index| bounds.union(&boxes[index as usize]))
}

fn cluster(boxes: &[Aabb], indices: Vec<u32>) -> Bvh2 {
    PlocBuilder::with_capacity(boxes.len()).build(
        PlocSearchDistance::Medium,
        boxes,
        indices,
        SortPrecision::U64,
        3,
    )
}

fn reinsert(mut binary: Bvh2) -> Bvh2 {
    ReinsertionOptimizer::default().run(&mut binary, 0.05, None);
    binary
}

/// Builds the whole tree by median splits: 1 + log₂ n levels.
fn by_median_splits(boxes: &[Aabb]) -> Bvh2 {
    let mut indices: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut nodes = vec![Bvh2Node::default()];
    split_median(&mut nodes, 0, boxes, &mut indices, 0);
    Bvh2 { nodes, primitive_indices: indices, ..Bvh2::default() }
}

/// Fills `node` with the tree over the boxes `indices`, sorting them; the first one becomes
/// primitive `first`. Splits at the median centre along the longest axis of the centres.
fn split_median(
    nodes: &mut Vec<Bvh2Node>,
    node: usize,
    boxes: &[Aabb],
    indices: &mut [u32],
    first: u32,
) {
    let bounds = union(boxes, indices);
    if indices.len() == 1 {
        nodes[node] = Bvh2Node::new(bounds, 1, first);
        return;
    }
    let center = |index: u32| boxes[index as usize].center();
    let centers = indices
        .iter()
        .fold(Aabb::empty(), |bounds, &index| bounds.union(&Aabb::from_point(center(index))));
    let axis = centers.largest_axis();
    let middle = indices.len() / 2;
    indices.select_nth_unstable_by(middle, |&a, &b| center(a)[axis].total_cmp(&center(b)[axis]));
    let (lower, upper) = indices.split_at_mut(middle);
    let children = nodes.len();
    nodes.resize(children + 2, Bvh2Node::default());
    nodes[node] = Bvh2Node::new(bounds, 0, children as u32);
    split_median(nodes, children, boxes, lower, first);
    split_median(nodes, children + 1, boxes, upper, first + middle as u32);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes_at(centers: impl IntoIterator<Item = Vec3A>) -> Vec<Aabb> {
        let half = Vec3A::splat(0.01);
        centers.into_iter().map(|center| Aabb::new(center - half, center + half)).collect()
    }

    /// Checks that every box is in one leaf and within all nodes above it. Returns the depth.
    fn check(binary: &Bvh2, boxes: &[Aabb]) -> usize {
        let mut seen = vec![false; boxes.len()];
        let mut deepest = 0;
        let mut pending = vec![(0, 1)];
        while let Some((index, depth)) = pending.pop() {
            let node = &binary.nodes[index];
            deepest = deepest.max(depth);
            let inside = |aabb: &Aabb| {
                assert!(aabb.min.cmpge(node.aabb().min).all());
                assert!(aabb.max.cmple(node.aabb().max).all());
            };
            if node.is_leaf() {
                let primitive = binary.primitive_indices[node.first_index as usize] as usize;
                inside(&boxes[primitive]);
                assert!(!std::mem::replace(&mut seen[primitive], true), "{primitive} twice");
            } else {
                for child in [node.first_index as usize, node.first_index as usize + 1] {
                    inside(binary.nodes[child].aabb());
                    pending.push((child, depth + 1));
                }
            }
        }
        assert!(seen.iter().all(|seen| *seen));
        deepest
    }

    #[test]
    fn crowds_and_singles_share_a_shallow_tree() {
        let line = (0..500).map(|x| Vec3A::new(x as f32, 0.0, 0.0));
        let crowd = (0..40_000).map(|_| Vec3A::new(7.0, 1.0, 2.0));
        let near = (0..100).map(|x| Vec3A::new(3.0 + x as f32 * 1e-6, 5.0, 0.0));
        let boxes = boxes_at(line.chain(crowd).chain(near));
        let depth = check(&build(boxes.clone()), &boxes);
        assert!(depth < 50, "{depth} levels");
    }

    #[test]
    fn nested_boxes_do_not_chain() {
        let boxes: Vec<Aabb> = (1..5_000)
            .map(|size| Aabb::new(Vec3A::splat(-size as f32), Vec3A::splat(size as f32)))
            .collect();
        assert!(check(&build(boxes.clone()), &boxes) < 20);
    }

    #[test]
    fn a_fan_through_one_point_is_built_at_once() {
        let start = std::time::Instant::now();
        let boxes: Vec<Aabb> = (0..100_000)
            .map(|index| {
                let (y, x) = (index as f32 * 6.283e-5).sin_cos();
                let end = Vec3A::new(x, y, 0.0);
                Aabb::new(end.min(Vec3A::ZERO), end.max(Vec3A::ZERO))
            })
            .collect();
        assert!(overlap(&boxes) > LARGEST_OVERLAP, "{}", overlap(&boxes));
        check(&build(boxes.clone()), &boxes);
        assert!(start.elapsed().as_secs() < 10, "{:?}", start.elapsed());
    }

    #[test]
    fn median_splits_are_balanced() {
        let boxes = boxes_at((0..1000).map(|x| Vec3A::new((x * x % 997) as f32, x as f32, 0.0)));
        assert_eq!(check(&by_median_splits(&boxes), &boxes), 11);
    }
}
