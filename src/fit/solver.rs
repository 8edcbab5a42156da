//! Projected L-BFGS: minimizes a smooth function within a box. \[Nocedal & Wright 2006\], algorithm
//! 7.4 on the variables that no bound holds, with Armijo's rule along the projected path.

use std::collections::VecDeque;

/// Number of remembered pairs of step and gradient change.
const MEMORY: usize = 8;
/// Sufficient decrease, relative to the slope.
const ARMIJO: f64 = 1e-4;
/// Halvings of a step before the search gives up.
const MAX_HALVINGS: usize = 30;

/// Lower and upper limit of an unknown.
pub(crate) type Bounds = (f64, f64);

fn project(bounds: &[Bounds], unknowns: &mut [f64]) {
    for (value, (lower, upper)) in unknowns.iter_mut().zip(bounds) {
        *value = value.clamp(*lower, *upper);
    }
}

/// True if a bound holds the unknown against the descent.
fn holds((lower, upper): Bounds, value: f64, gradient: f64) -> bool {
    (value <= lower && gradient > 0.0) || (value >= upper && gradient < 0.0)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Lowers `function` (value and gradient) from `unknowns`, in place. Ends when ten steps gain less
/// than `tolerance` relative to the value, when no step along the direction lowers it, or after
/// `steps`. Calls `progress` with the number of each finished step.
pub(crate) fn minimize(
    function: impl Fn(&[f64]) -> (f64, Vec<f64>),
    bounds: &[Bounds],
    unknowns: &mut Vec<f64>,
    steps: usize,
    tolerance: f64,
    progress: &mut dyn FnMut(usize),
) {
    project(bounds, unknowns);
    let (mut value, mut gradient) = function(unknowns);
    let mut memory: VecDeque<(Vec<f64>, Vec<f64>)> = VecDeque::new();
    let mut history = vec![value];
    for step in 0..steps {
        let held: Vec<bool> = (0..unknowns.len())
            .map(|index| holds(bounds[index], unknowns[index], gradient[index]))
            .collect();
        let mask = |vector: &mut [f64]| {
            for (value, _) in vector.iter_mut().zip(&held).filter(|(_, held)| **held) {
                *value = 0.0;
            }
        };
        let mut direction = gradient.clone();
        mask(&mut direction);
        let steepest = direction.clone();
        let mut coefficients = Vec::with_capacity(memory.len());
        for (s, y) in memory.iter().rev() {
            let alpha = dot(s, &direction) / dot(s, y);
            for (value, y) in direction.iter_mut().zip(y) {
                *value -= alpha * y;
            }
            coefficients.push(alpha);
        }
        let scale = memory.back().map_or_else(
            || 0.05 / dot(&steepest, &steepest).sqrt().max(1e-12),
            |(s, y)| dot(s, y) / dot(y, y),
        );
        for value in &mut direction {
            *value *= scale;
        }
        for ((s, y), alpha) in memory.iter().zip(coefficients.iter().rev()) {
            let beta = dot(y, &direction) / dot(s, y);
            for (value, s) in direction.iter_mut().zip(s) {
                *value += (alpha - beta) * s;
            }
        }
        mask(&mut direction);
        if dot(&direction, &gradient) <= 0.0 {
            // Not a descent direction: forget the pairs.
            memory.clear();
            direction = steepest.iter().map(|value| value * scale).collect();
        }
        let mut length = 1.0;
        let mut accepted = None;
        for _ in 0..MAX_HALVINGS {
            let mut trial: Vec<f64> =
                unknowns.iter().zip(&direction).map(|(x, d)| x - length * d).collect();
            project(bounds, &mut trial);
            let decrease: f64 =
                unknowns.iter().zip(&trial).zip(&gradient).map(|((x, t), g)| (x - t) * g).sum();
            let (trial_value, trial_gradient) = function(&trial);
            if trial_value <= value - ARMIJO * decrease && trial_value.is_finite() {
                accepted = Some((trial, trial_value, trial_gradient));
                break;
            }
            length *= 0.5;
        }
        let Some((next, next_value, next_gradient)) = accepted else {
            if memory.is_empty() {
                return;
            }
            memory.clear();
            continue;
        };
        let s: Vec<f64> = next.iter().zip(unknowns.iter()).map(|(a, b)| a - b).collect();
        let y: Vec<f64> = next_gradient.iter().zip(&gradient).map(|(a, b)| a - b).collect();
        if dot(&s, &y) > 1e-10 * dot(&y, &y) {
            memory.push_back((s, y));
            if memory.len() > MEMORY {
                memory.pop_front();
            }
        }
        (*unknowns, value, gradient) = (next, next_value, next_gradient);
        history.push(value);
        progress(step + 1);
        if history.len() > 10 {
            let before = history[history.len() - 11];
            if before - value <= tolerance * before.abs() {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_minimum_of_a_valley_within_a_box() {
        // Rosenbrock's function; its minimum (1, 1) lies outside the second box.
        let function = |x: &[f64]| {
            let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
            (a * a + 100.0 * b * b, vec![-2.0 * a - 400.0 * b * x[0], 200.0 * b])
        };
        let free = [(-5.0, 5.0); 2];
        let mut x = vec![-1.2, 1.0];
        minimize(function, &free, &mut x, 500, 1e-15, &mut |_| ());
        assert!((x[0] - 1.0).abs() < 1e-4 && (x[1] - 1.0).abs() < 1e-4, "{x:?}");
        let tight = [(-5.0, 0.5), (-5.0, 5.0)];
        let mut x = vec![-1.2, 1.0];
        minimize(function, &tight, &mut x, 500, 1e-15, &mut |_| ());
        assert!((x[0] - 0.5).abs() < 1e-6 && (x[1] - 0.25).abs() < 1e-4, "{x:?}");
    }
}
