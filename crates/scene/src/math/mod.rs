//! Mathematics of scenes: frames, colour, a square map of the sphere, random numbers, cumulative densities.

pub mod colour;
pub mod equal_area;
pub mod frame;
pub(crate) mod keys;
pub mod random;

/// Writes the cumulative distribution of `weights` in single precision and returns their sum.
/// Entries never decrease, repeat where a weight is 0, and are 1 from the last positive weight on.
pub(crate) fn write_cumulative(
    weights: impl Iterator<Item = f64> + Clone,
    cumulative: &mut [f32],
) -> f64 {
    let sum: f64 = weights.clone().sum();
    let last = weights.clone().enumerate().filter(|(_, weight)| *weight > 0.0).last();
    let last = last.map_or(0, |(index, _)| index);
    let mut running = 0.0;
    for (index, (weight, entry)) in weights.zip(cumulative.iter_mut()).enumerate() {
        running += weight;
        *entry = if index >= last { 1.0 } else { ((running / sum) as f32).min(1.0) };
    }
    sum
}
