//! Reconstruction filter of the film: weights of a sample in the pixels around its own. Twin of
//! `glsl/include/reconstruction.glsl`. Lengths are in pixels.
//!
//! The Gaussian has a standard deviation of half a pixel and reaches one and a half. All pixels share
//! the offset of a sample from their centres, and the weights of the samples that a pixel sees are
//! divided by their sum, which depends on that offset alone. So every sample of the filtered picture is
//! unbiased, and each of the film counts in nine pixels: independent noise has 0.31 of the variance that
//! it has in a film whose samples each belong to one pixel.

use std::array;

use crate::{
    math::random::random_2d,
    scene::Filter,
    shader::constants::{DIMENSION_FILTER, EVERY_PIXEL},
};

/// Standard deviation of the Gaussian.
const SIGMA: f64 = 0.5;
/// Offsets at which [`variance_share`] averages.
const OFFSETS: u32 = 256;

/// Returns the offset from the centre that all pixels share, where the filter wants one.
pub(crate) fn shared_offset(filter: Filter, sample_index: u32, seed: u32) -> Option<[f32; 2]> {
    let at = || random_2d(EVERY_PIXEL, sample_index, DIMENSION_FILTER, seed).map(|u| u - 0.5);
    (filter == Filter::Gaussian).then(at)
}

/// The filter for samples at `offset` in the pixel before, in the pixel and in the one after, along one axis.
pub(crate) fn falloff(offset: f32) -> [f64; 3] {
    array::from_fn(|at| {
        let distance = (at as f64 - 1.0 + f64::from(offset)) / SIGMA;
        (-0.5 * distance * distance).exp()
    })
}

/// Weights of these samples: where a pixel does not exist, those of the others still add up to one.
pub(crate) fn weights(falloff: [f64; 3], exists: [bool; 3]) -> [f64; 3] {
    let weights: [f64; 3] = array::from_fn(|at| if exists[at] { falloff[at] } else { 0.0 });
    weights.map(|weight| weight / weights.iter().sum::<f64>())
}

/// Filters a sample of `width` columns of pixels, row by row, which share its `offset`.
pub(crate) fn filtered(samples: &[[f32; 3]], width: usize, offset: [f32; 2]) -> Vec<[f32; 3]> {
    let height = samples.len() / width.max(1);
    let falloffs = offset.map(falloff);
    let along =
        |at: usize, end: usize, axis: usize| weights(falloffs[axis], [at > 0, true, at + 1 < end]);
    let pixel = |index: usize| {
        let (row, column) = (index / width, index % width);
        let (rows, columns) = (along(row, height, 1), along(column, width, 0));
        let mut value = [0.0; 3];
        for (beside, weight) in
            rows.iter().flat_map(|row| columns.map(|column| row * column)).enumerate()
        {
            if weight > 0.0 {
                let sample = samples[index + beside / 3 * width + beside % 3 - width - 1];
                for channel in 0..3 {
                    value[channel] += weight as f32 * sample[channel];
                }
            }
        }
        value
    };
    (0..samples.len()).map(pixel).collect()
}

/// Variance of a pixel over that of its own samples, if those of its neighbours are as noisy and independent.
/// The variance of a film's mean is too low by this factor if its pixels count as independent.
pub(crate) fn variance_share(filter: Filter) -> f64 {
    if filter == Filter::Box {
        return 1.0;
    }
    let squares = |offset: u32| {
        let offset = (f64::from(offset) + 0.5) / f64::from(OFFSETS) - 0.5;
        weights(falloff(offset as f32), [true; 3]).map(|weight| weight * weight).iter().sum::<f64>()
    };
    ((0..OFFSETS).map(squares).sum::<f64>() / f64::from(OFFSETS)).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash_4d, unit_float};

    #[test]
    fn filtered_noise_has_the_share_of_its_variance() {
        const EDGE: usize = 64;
        let mut squares = [0.0_f64; 2];
        for sample in 0..16 {
            let noise = |pixel| [unit_float(hash_4d([pixel, sample, 0, 0])[0]) - 0.5; 3];
            let noise: Vec<[f32; 3]> = (0..(EDGE * EDGE) as u32).map(noise).collect();
            let offset = shared_offset(Filter::Gaussian, sample, 3).unwrap_or_default();
            for (sum, film) in squares.iter_mut().zip([&noise, &filtered(&noise, EDGE, offset)]) {
                *sum += film.iter().map(|[value, ..]| f64::from(value * value)).sum::<f64>();
            }
        }
        // At the edges of this film fewer pixels share.
        let ratio = squares[1] / squares[0] / variance_share(Filter::Gaussian);
        assert!((1.0..1.08).contains(&ratio), "{ratio}");
    }

    /// One sample is bright, in the second row of the left column.
    #[test]
    fn samples_are_spread_along_both_axes_by_their_own_offsets() {
        let offset = [0.4, -0.25];
        let mut samples = vec![[0.0; 3]; 12];
        samples[3] = [1.0; 3];
        let found = filtered(&samples, 3, offset);
        let share = |place: usize, of: usize, end: usize, axis: usize| {
            let weights = weights(falloff(offset[axis]), [place > 0, true, place + 1 < end]);
            (of + 1).checked_sub(place).and_then(|at| weights.get(at)).copied().unwrap_or(0.0)
        };
        for (index, value) in found.iter().enumerate() {
            let expected = share(index % 3, 0, 3, 0) * share(index / 3, 1, 4, 1);
            assert!((f64::from(value[1]) - expected).abs() < 1e-6, "{index}: {value:?}");
        }
    }
}
