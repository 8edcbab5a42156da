//! Polylines and splines: control points → points on the curve, and the normals at its corners.

use glam::{DVec2, DVec4};

/// Points of the curve through `points`, with `per_span` pieces between neighbours.
///
/// Centripetal Catmull-Rom splines \[Yuksel et al. 2009\] neither loop nor overshoot within a span.
/// One piece per span gives the polyline itself. A point given twice is a corner, where the curve
/// may turn sharply. The last point of a closed curve leads to the first.
pub(super) fn smooth(points: &[DVec4], per_span: usize, closed: bool) -> Vec<DVec4> {
    let is_corner = |index: usize| index > 0 && points[index] == points[index - 1];
    let corner = (1..points.len()).find(|&index| is_corner(index));
    let mut control: Vec<DVec4> = points.to_vec();
    if per_span <= 1 {
        control.dedup();
        return control;
    }
    if closed {
        match corner {
            // Cut the closed curve open at the corner.
            Some(corner) => {
                control.rotate_left(corner);
                control.push(control[0]);
            }
            None => {
                let count = points.len();
                return pieces(count, per_span, |index| points[(index + count - 1) % count]);
            }
        }
    }
    let mut curve = Vec::new();
    for run in control.chunk_by(|a, b| a != b) {
        // A run may begin at the point where the previous one ended; keep it once.
        let start = usize::from(curve.last() == run.first());
        curve.extend(smooth_run(run, per_span).into_iter().skip(start));
    }
    if closed {
        curve.pop();
    }
    curve
}

/// Open spline, ends included; straight if it has only two points.
fn smooth_run(run: &[DVec4], per_span: usize) -> Vec<DVec4> {
    if run.len() < 3 {
        return run.to_vec();
    }
    let last = run.len() - 1;
    let at = |index: usize| match index.checked_sub(1) {
        None => 2.0 * run[0] - run[1],
        Some(index) if index > last => 2.0 * run[last] - run[last - 1],
        Some(index) => run[index],
    };
    let mut curve = pieces(last, per_span, at);
    curve.push(run[last]);
    curve
}

/// Points of so many spans; `at` gives the control points, from the one before the first span on.
fn pieces(spans: usize, per_span: usize, at: impl Fn(usize) -> DVec4) -> Vec<DVec4> {
    let span = |span| {
        let neighbours = [at(span), at(span + 1), at(span + 2), at(span + 3)];
        (0..per_span).map(move |piece| span_point(neighbours, piece as f64 / per_span as f64))
    };
    (0..spans).flat_map(span).collect()
}

/// Point of the span from the second to the third of four points, by Barry and Goldman's pyramid.
fn span_point(points: [DVec4; 4], parameter: f64) -> DVec4 {
    let [a, b, c, d] = points;
    // Measure distance in the first three components; the fourth carries a radius.
    let step = |from: DVec4, to: DVec4| (to - from).truncate().length().sqrt().max(1e-9);
    let knots = [0.0, step(a, b), step(a, b) + step(b, c), step(a, b) + step(b, c) + step(c, d)];
    let t = knots[1] + parameter * (knots[2] - knots[1]);
    let mix = |from: DVec4, to: DVec4, low: usize, high: usize| {
        from.lerp(to, (t - knots[low]) / (knots[high] - knots[low]))
    };
    let (ab, bc, cd) = (mix(a, b, 0, 1), mix(b, c, 1, 2), mix(c, d, 2, 3));
    mix(mix(ab, bc, 0, 2), mix(bc, cd, 1, 3), 1, 2)
}

/// Stretch of an outline without sharp corners: its point indices, with the unit normal at each and the
/// length of the outline up to there.
pub(super) type Chain = Vec<(usize, DVec2, f64)>;

/// Cuts a polyline at corners sharper than `crease_deg` into chains.
///
/// Normals point to the right of the direction of travel and are averaged at soft corners. `ends`
/// holds the normals beyond the first and the last segment, if any.
pub(super) fn chains(
    points: &[DVec2],
    closed: bool,
    crease_deg: f64,
    ends: [Option<DVec2>; 2],
) -> Vec<Chain> {
    let count = points.len();
    let segment_count = if closed { count } else { count - 1 };
    let normal = |segment: usize| {
        let along = points[(segment + 1) % count] - points[segment % count];
        DVec2::new(along.y, -along.x).normalize_or_zero()
    };
    let soft = |a: DVec2, b: DVec2| a.dot(b) >= crease_deg.to_radians().cos() - 1e-12;
    let mean = |a: DVec2, b: DVec2| (a + b).normalize_or_zero();
    // Begin a closed outline at a sharp corner, so that no chain runs across its end.
    let sharp = |corner: usize| !soft(normal(corner + count - 1), normal(corner));
    let first = if closed { (0..count).find(|&corner| sharp(corner)).unwrap_or(0) } else { 0 };
    let mut chains = Vec::new();
    let mut chain: Chain = Vec::new();
    let mut length = 0.0;
    for step in 0..segment_count {
        let segment = first + step;
        let own = normal(segment);
        let before = match (step, closed) {
            (0, false) => ends[0],
            _ => Some(normal(segment + count - 1)),
        };
        let after = match (step + 1 == segment_count, closed) {
            (true, false) => ends[1],
            _ => Some(normal(segment + 1)),
        };
        if chain.is_empty() {
            let start = before.filter(|&before| soft(before, own)).map_or(own, |b| mean(b, own));
            chain.push((segment % count, start, length));
        }
        length += points[segment % count].distance(points[(segment + 1) % count]);
        let soft_after = after.filter(|&after| soft(own, after));
        let end = soft_after.map_or(own, |after| mean(own, after));
        chain.push(((segment + 1) % count, end, length));
        if soft_after.is_none() {
            chains.push(std::mem::take(&mut chain));
        }
    }
    if !chain.is_empty() {
        chains.push(chain);
    }
    chains
}
