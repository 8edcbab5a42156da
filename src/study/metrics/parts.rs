//! Errors over a part of the picture: lit surfaces, or where the camera sees the environment.
//!
//! A sun in the frame outshines everything, so that figures of the whole picture measure how its disc is
//! smoothed. Over a part P of the pixels, with `e` the squared error and `g` the reference's mean over RGB:
//!
//! `relmse` = mean over P of `e / (L² + 0.01·M²)`, where `L` is the mean of `g` over those of the
//! 5×5 pixels around that belong to P, and `M` the mean over P of `min(g, q)` with `q` the 99th
//! percentile of `g` over P. A small bright spot thus changes neither the denominator of its
//! neighbours across the edge of P nor, through the mean, that of all others.

use serde::{Deserialize, Serialize};

use super::{Errors, MeanReference, RELATIVE_FLOOR, mean_picture, squared_errors};
use crate::{error::Result, film::RgbImage};

/// Share of a part's pixels that are not brighter than the limit of its mean.
const CLAMP_SHARE: f64 = 0.99;

/// Errors over a part of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PartErrors {
    /// Mean squared error.
    pub mse: f64,
    /// Mean relative squared error, by the denominator of the [module](self).
    pub relmse: f64,
    /// The same without the worst 0.1% of the part's pixels.
    pub relmse_trimmed: f64,
}

impl PartErrors {
    /// Compares a picture with a reference in two halves over the pixels that `is_inside` names;
    /// `None` if there are none. Fails as [`squared_errors`].
    pub(crate) fn of_halves(
        picture: &RgbImage,
        [first, second]: [&RgbImage; 2],
        is_inside: &[bool],
    ) -> Result<Option<Self>> {
        let squared = squared_errors(picture, first, second)?;
        let inside = |value: &(usize, f64)| is_inside.get(value.0).is_some_and(|inside| *inside);
        let errors: Vec<(usize, f64)> = squared.into_iter().enumerate().filter(inside).collect();
        if errors.is_empty() {
            return Ok(None);
        }
        let denominators = denominators(&mean_picture(first, second), is_inside);
        let relative = |(index, error): &(usize, f64)| {
            if *error == 0.0 { 0.0 } else { error / denominators[*index] }
        };
        let relative = errors.iter().map(relative).collect();
        let Errors { mse, relmse, relmse_trimmed, .. } =
            Errors::of(errors.iter().map(|(_, error)| *error), relative);
        Ok(Some(Self { mse, relmse, relmse_trimmed }))
    }

    /// Computes each figure, given the function that takes it from errors.
    pub(crate) fn each(figure: impl Fn(fn(&Self) -> f64) -> f64) -> Self {
        Self {
            mse: figure(|part| part.mse),
            relmse: figure(|part| part.relmse),
            relmse_trimmed: figure(|part| part.relmse_trimmed),
        }
    }
}

/// `L² + 0.01·M²` of every pixel of a part; 0.01·M² elsewhere.
fn denominators(reference: &MeanReference, is_inside: &[bool]) -> Vec<f64> {
    let (width, grey) = (reference.width, reference.grey());
    let mut own: Vec<f64> =
        grey.iter().zip(is_inside).filter(|(_, inside)| **inside).map(|(g, _)| *g).collect();
    own.sort_unstable_by(f64::total_cmp);
    let index = ((own.len() as f64 * CLAMP_SHARE).ceil() as usize).max(1) - 1;
    let limit = own.get(index).copied().unwrap_or(0.0);
    let mean = own.iter().map(|g| g.min(limit)).sum::<f64>() / own.len().max(1) as f64;
    let local = |index: usize| {
        let (mut sum, mut count) = (0.0, 0.0_f64);
        let [columns, rows] = reference.around(index);
        for y in rows {
            for x in columns.clone().filter(|x| is_inside[y * width + x]) {
                sum += grey[y * width + x];
                count += 1.0;
            }
        }
        sum / count.max(1.0)
    };
    let floor = RELATIVE_FLOOR * mean * mean;
    (0..grey.len()).map(|index| local(index).powi(2) + floor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::metrics::Metrics;

    fn grey(values: impl Iterator<Item = f32>, width: u32) -> RgbImage {
        let pixels: Vec<[f32; 3]> = values.map(|value| [value; 3]).collect();
        RgbImage { width, height: pixels.len() as u32 / width, pixels }
    }

    /// A room of radiance 1 with a sun of 100,000 in one pixel.
    fn sunny(error: f32) -> RgbImage {
        grey((0..400).map(|index| if index == 30 { 1e5 } else { 1.0 + error }), 20)
    }

    #[test]
    fn a_visible_sun_leaves_the_surfaces_figure_alone() {
        let is_surface: Vec<bool> = (0..400).map(|index| index != 30).collect();
        let (picture, reference) = (sunny(0.1), sunny(0.0));
        let halves = [&reference, &reference];
        let part = PartErrors::of_halves(&picture, halves, &is_surface).unwrap().unwrap();
        assert!((part.relmse - 0.01 / 1.01).abs() < 1e-6, "{part:?}");
        assert!((part.mse - 0.01).abs() < 1e-6, "{part:?}");
        let whole = Metrics::of_halves(&picture, &reference, &reference).unwrap();
        assert!(
            whole.errors.relmse < 1e-2 * part.relmse,
            "the sun hides it in {}",
            whole.errors.relmse
        );
    }

    #[test]
    fn a_sunlit_spot_does_not_lift_the_floor() {
        let reference = sunny(0.0);
        let all = vec![true; 400];
        let halves = [&reference, &reference];
        let part = PartErrors::of_halves(&sunny(0.1), halves, &all).unwrap().unwrap();
        // The 24 neighbours of the spot have its light in L; all others weigh as without it.
        let expected = f64::from(400 - 1 - 19) / 400.0 * 0.01 / 1.01;
        assert!((part.relmse / expected - 1.0).abs() < 0.02, "{part:?}, {expected}");
    }

    #[test]
    fn without_bright_spots_the_whole_picture_has_the_old_figure() {
        let reference = grey((0..400).map(|_| 1.0), 20);
        let picture = grey((0..400).map(|index| 1.0 + 0.01 * (index % 7) as f32), 20);
        let halves = [&reference, &reference];
        let part = PartErrors::of_halves(&picture, halves, &[true; 400]).unwrap().unwrap();
        let whole = Metrics::of_halves(&picture, &reference, &reference).unwrap();
        assert!((part.relmse - whole.errors.relmse).abs() < 1e-12);
        assert!((part.relmse_trimmed - whole.errors.relmse_trimmed).abs() < 1e-12);
        assert_eq!(PartErrors::of_halves(&picture, halves, &[false; 400]).unwrap(), None);
    }
}
