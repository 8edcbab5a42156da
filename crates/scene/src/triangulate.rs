//! Simple polygon → triangles, by ear clipping.
//!
//! Meisters, "Polygons have ears", 1975: every simple polygon with more than three corners has two
//! ears, triangles of three consecutive corners that contain no other corner. Clipping them one by
//! one leaves n − 2 triangles. Choosing the best each time costs O(n³), so long outlines take the first
//! ear and polygons beyond [`MAX_CLIPPED_CORNERS`] become fans: no input takes longer than a second.

use glam::{DVec2, DVec3};

/// Most corners of a polygon that is clipped; a longer one becomes a fan, correct where convex.
pub(crate) const MAX_CLIPPED_CORNERS: usize = 1024;

/// Most remaining corners among which the best ear is searched for.
const MAX_BEST_CORNERS: usize = 64;

/// Triangulates a polygon in space in the plane of its Newell normal; indices into `positions`.
pub(crate) fn triangulate_in_space(positions: &[[f32; 3]]) -> Vec<[usize; 3]> {
    let positions: Vec<_> =
        positions.iter().map(|position| DVec3::from_array(position.map(f64::from))).collect();
    let origin = positions.first().copied().unwrap_or_default();
    let next = positions.iter().cycle().skip(1);
    let normal: DVec3 =
        positions.iter().zip(next).map(|(from, to)| (from - origin).cross(to - origin)).sum();
    // A polygon without area gets an arbitrary plane; whoever uses its triangles drops them.
    let (x_axis, y_axis) = normal.try_normalize().unwrap_or(DVec3::Z).any_orthonormal_pair();
    let outline: Vec<_> = positions
        .iter()
        .map(|position| {
            DVec2::new((position - origin).dot(x_axis), (position - origin).dot(y_axis))
        })
        .collect();
    triangulate(&outline)
}

/// Triangulates a simple polygon; indices into `outline`, wound as the outline is.
///
/// An outline that crosses or touches itself may run out of ears. A fan then closes the rest, so
/// that there are always n − 2 triangles.
pub(crate) fn triangulate(outline: &[DVec2]) -> Vec<[usize; 3]> {
    let turn = signed_area(outline).signum();
    let mut remaining: Vec<usize> = (0..outline.len()).collect();
    let mut triangles = Vec::with_capacity(outline.len().saturating_sub(2));
    while remaining.len() > 3 && outline.len() <= MAX_CLIPPED_CORNERS {
        let Some(ear) = best_ear(outline, &remaining, turn) else { break };
        let (previous, next) = neighbours(&remaining, ear);
        triangles.push([previous, remaining[ear], next]);
        remaining.remove(ear);
    }
    for corner in 1..remaining.len().saturating_sub(1) {
        triangles.push([remaining[0], remaining[corner], remaining[corner + 1]]);
    }
    triangles
}

/// Area of a polygon, positive if counter-clockwise.
pub(crate) fn signed_area(outline: &[DVec2]) -> f64 {
    let next = outline.iter().cycle().skip(1);
    0.5 * outline.iter().zip(next).map(|(from, to)| from.perp_dot(*to)).sum::<f64>()
}

/// Tests that no two sides of the closed outline cross and no corner lies on another side.
pub(crate) fn is_simple(outline: &[DVec2]) -> bool {
    let count = outline.len();
    let side = |index: usize| (outline[index], outline[(index + 1) % count]);
    (0..count).all(|first| {
        (first + 1..count).all(|second| {
            let adjacent = second == first + 1 || (first == 0 && second == count - 1);
            let ((a, b), (c, d)) = (side(first), side(second));
            if adjacent {
                // Neighbouring sides share a corner; they must not fold back onto each other.
                let (corner, before, after) =
                    if second == first + 1 { (b, a, d) } else { (a, c, b) };
                let (back, on) = (before - corner, after - corner);
                back.perp_dot(on) != 0.0 || back.dot(on) < 0.0
            } else {
                !segments_touch(a, b, c, d)
            }
        })
    })
}

fn segments_touch(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> bool {
    let side = |from: DVec2, to: DVec2, point: DVec2| (to - from).perp_dot(point - from);
    let within = |from: DVec2, to: DVec2, point: DVec2| {
        point.cmpge(from.min(to)).all() && point.cmple(from.max(to)).all()
    };
    let (c_side, d_side) = (side(a, b, c), side(a, b, d));
    let (a_side, b_side) = (side(c, d, a), side(c, d, b));
    (c_side * d_side < 0.0 && a_side * b_side < 0.0)
        || (c_side == 0.0 && within(a, b, c))
        || (d_side == 0.0 && within(a, b, d))
        || (a_side == 0.0 && within(c, d, a))
        || (b_side == 0.0 && within(c, d, b))
}

fn neighbours(remaining: &[usize], index: usize) -> (usize, usize) {
    let count = remaining.len();
    (remaining[(index + count - 1) % count], remaining[(index + 1) % count])
}

/// Finds the ear with the most area for its longest side, so that slivers come last; the first ear
/// where many corners remain.
fn best_ear(outline: &[DVec2], remaining: &[usize], turn: f64) -> Option<usize> {
    let mut best = None;
    let mut best_quality = 0.0;
    for index in 0..remaining.len() {
        let (previous, next) = neighbours(remaining, index);
        let corners = [outline[previous], outline[remaining[index]], outline[next]];
        let [a, b, c] = corners;
        let area = turn * (b - a).perp_dot(c - a);
        let longest = (b - a).length_squared().max((c - b).length_squared());
        let quality = area / longest.max((a - c).length_squared());
        // NaN compares false, so it is never an ear.
        if quality > best_quality
            && !remaining.iter().any(|&other| {
                let point = outline[other];
                !corners.contains(&point)
                    && turn * (b - a).perp_dot(point - a) >= 0.0
                    && turn * (c - b).perp_dot(point - b) >= 0.0
                    && turn * (a - c).perp_dot(point - c) >= 0.0
            })
        {
            best = Some(index);
            best_quality = quality;
            if remaining.len() > MAX_BEST_CORNERS {
                break;
            }
        }
    }
    best
}
