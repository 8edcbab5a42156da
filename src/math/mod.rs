//! Mathematics that several stages share: that of scenes (frames, random numbers, colour, a square map of the
//! sphere), packed directions, alias tables, the order of refinement and medians.

pub mod alias;
pub mod octahedron;
pub(crate) mod refinement;

pub use fenestra_scene::math::{colour, equal_area, frame, random};

/// Median of ascending values; 0 for none.
pub(crate) fn median(ascending: &[f64]) -> f64 {
    let last = ascending.len().saturating_sub(1);
    let at = |index: usize| ascending.get(index).copied().unwrap_or(0.0);
    0.5 * (at(last / 2) + at(last.div_ceil(2)))
}
