//! Error metrics of a picture against a reference, in linear radiance and unclamped.
//!
//! For pixel `p` and colour channel `c` let `d = x − r`, `e(p)` the mean of `d²` over the three
//! channels, `L(p)` the reference's mean over RGB box-filtered over the 5×5 pixels around `p`
//! (those inside the image), and `L̄` the mean of the reference over pixels and channels.
//!
//! | metric | definition |
//! |---|---|
//! | `mse` | mean of `e` over the pixels |
//! | `rmse` | √mse |
//! | `mae` | mean of abs `d` over pixels and channels |
//! | `relmse` | mean over the pixels of `e / (L² + 0.01·L̄²)` |
//! | `relmse_trimmed` | the same without the worst 0.1% of the pixels |
//! | `relmse_p999` | 99.9th percentile of that quotient: the largest that `relmse_trimmed` keeps |
//! | `relmse_max` | the largest of all pixels |
//! | `mean_ratio` | mean of `x` / mean of `r` |
//! | `psnr` | 10·log₁₀(peak² / mse), peak the reference's largest channel value, decibels |
//! | `max_error` | largest abs `d` |
//!
//! With the reference in two independent halves, `(x − r₁)(x − r₂)` replaces `d²`; its expectation
//! is free of the reference's own noise. Elsewhere `r` is the mean of the halves. The estimates of
//! `mse` and `relmse` can then be negative: the reference is too noisy to judge the picture.

pub mod flip;
pub mod parts;

use std::ops::Range;

use crate::{
    error::{Error, Result},
    film::RgbImage,
};

/// Radius of relMSE's box filter, whose side is `2·RADIUS + 1`.
const RADIUS: usize = 2;
/// Share of L̄² that keeps relMSE's denominator from vanishing.
const RELATIVE_FLOOR: f64 = 0.01;
/// Pixels left out of `relmse_trimmed`: one in this many, rounded down.
const TRIMMED_ONE_IN: usize = 1000;

/// Squared errors of a picture against a reference, as the [module](self) defines them.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Errors {
    /// Mean squared error.
    pub mse: f64,
    /// Root of the mean squared error; 0 if a two-halves estimate of it is negative.
    pub rmse: f64,
    /// Mean relative squared error.
    pub relmse: f64,
    /// Mean relative squared error without the worst 0.1% of the pixels.
    pub relmse_trimmed: f64,
    /// 99.9th percentile of the pixels' relative squared errors: the trimmed mean's largest.
    pub relmse_p999: f64,
    /// Largest relative squared error of a pixel.
    pub relmse_max: f64,
}

impl Errors {
    /// Averages the squared errors and the relative ones of the same pixels, of which there are some.
    fn of(squared: impl Iterator<Item = f64>, mut relative: Vec<f64>) -> Self {
        let mean = |sum: f64| sum / relative.len() as f64;
        let (mse, relmse) = (mean(squared.sum()), mean(relative.iter().sum()));
        let kept = relative.len() - relative.len() / TRIMMED_ONE_IN;
        if kept < relative.len() {
            relative.select_nth_unstable_by(kept, f64::total_cmp);
        }
        let largest = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self {
            mse,
            rmse: mse.max(0.0).sqrt(),
            relmse,
            relmse_trimmed: relative[..kept].iter().sum::<f64>() / kept as f64,
            relmse_p999: largest(&relative[..kept]),
            relmse_max: largest(&relative),
        }
    }
}

/// All errors of a picture against a reference, as the [module](self) defines them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Metrics {
    /// Squared errors.
    pub errors: Errors,
    /// Mean absolute error.
    pub mae: f64,
    /// Mean of the picture over that of the reference; 1 if both are black.
    pub mean_ratio: f64,
    /// Peak signal-to-noise ratio, decibels; infinite for equal pictures.
    pub psnr: f64,
    /// Largest absolute error of any channel.
    pub max_error: f64,
}

impl Metrics {
    pub(crate) fn named(&self) -> [(&'static str, f64); 10] {
        let Errors { mse, rmse, relmse, relmse_trimmed, relmse_p999, relmse_max } = self.errors;
        [
            ("mse", mse),
            ("rmse", rmse),
            ("mae", self.mae),
            ("relmse", relmse),
            ("relmse_trimmed", relmse_trimmed),
            ("relmse_p999", relmse_p999),
            ("relmse_max", relmse_max),
            ("mean_ratio", self.mean_ratio),
            ("psnr", self.psnr),
            ("max_error", self.max_error),
        ]
    }

    /// Compares a picture with a reference rendered in two independent halves.
    ///
    /// # Errors
    /// [`Error::Comparison`]: no pixels, different sizes, values that are not finite.
    pub fn of_halves(picture: &RgbImage, first: &RgbImage, second: &RgbImage) -> Result<Self> {
        let squared = squared_errors(picture, first, second)?;
        let reference = mean_picture(first, second);
        let relative = relative_errors(&squared, &reference);
        let pixel_count = squared.len() as f64;
        let errors = Errors::of(squared.into_iter(), relative);
        let (mut absolute_sum, mut max_error) = (0.0_f64, 0.0_f64);
        let (mut picture_sum, mut reference_sum, mut peak) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (x, r) in picture.pixels.iter().zip(&reference.pixels) {
            for channel in 0..3 {
                let (x, r) = (f64::from(x[channel]), r[channel]);
                absolute_sum += (x - r).abs();
                max_error = max_error.max((x - r).abs());
                picture_sum += x;
                reference_sum += r;
                peak = peak.max(r);
            }
        }
        let mean_ratio =
            if picture_sum == reference_sum { 1.0 } else { picture_sum / reference_sum };
        Ok(Self {
            errors,
            mae: absolute_sum / (3.0 * pixel_count),
            mean_ratio,
            psnr: match errors.mse {
                mse if mse > 0.0 => 10.0 * (peak * peak / mse).log10(),
                _ => f64::INFINITY,
            },
            max_error,
        })
    }
}

/// Mean of the reference's halves, exact in 64-bit channels.
struct MeanReference {
    width: usize,
    height: usize,
    pixels: Vec<[f64; 3]>,
}

impl MeanReference {
    fn grey(&self) -> Vec<f64> {
        self.pixels.iter().map(|pixel| pixel.iter().sum::<f64>() / 3.0).collect()
    }

    /// Returns the columns and rows of the box around a pixel that are inside the image.
    fn around(&self, index: usize) -> [Range<usize>; 2] {
        [(index % self.width, self.width), (index / self.width, self.height)]
            .map(|(centre, end)| centre.saturating_sub(RADIUS)..(centre + RADIUS + 1).min(end))
    }
}

fn mean_picture(first: &RgbImage, second: &RgbImage) -> MeanReference {
    let mean = |(a, b): (&[f32; 3], &[f32; 3])| {
        std::array::from_fn(|channel| 0.5 * (f64::from(a[channel]) + f64::from(b[channel])))
    };
    MeanReference {
        width: first.width as usize,
        height: first.height as usize,
        pixels: first.pixels.iter().zip(&second.pixels).map(mean).collect(),
    }
}

/// Computes `e(p)` of every pixel: the mean over RGB of `(x − r₁)(x − r₂)`. Pass one reference
/// twice for the plain squared error. Fails for no pixels, different sizes and values that are not finite.
pub(crate) fn squared_errors(
    picture: &RgbImage,
    first: &RgbImage,
    second: &RgbImage,
) -> Result<Vec<f64>> {
    check(picture, first, second)?;
    let error = |((x, r1), r2): ((&[f32; 3], &[f32; 3]), &[f32; 3])| {
        let product = |channel: usize| {
            let x = f64::from(x[channel]);
            (x - f64::from(r1[channel])) * (x - f64::from(r2[channel]))
        };
        (product(0) + product(1) + product(2)) / 3.0
    };
    Ok(picture.pixels.iter().zip(&first.pixels).zip(&second.pixels).map(error).collect())
}

/// Computes `e / (L² + 0.01·L̄²)` of every pixel.
///
/// # Errors
/// As [`squared_errors`].
pub fn relative_squared_errors(
    picture: &RgbImage,
    first: &RgbImage,
    second: &RgbImage,
) -> Result<Vec<f64>> {
    let squared = squared_errors(picture, first, second)?;
    Ok(relative_errors(&squared, &mean_picture(first, second)))
}

/// Divides errors by `L² + 0.01·L̄²`. If a black reference makes that 0, an error of 0 stays 0 and
/// any other becomes infinite.
fn relative_errors(squared: &[f64], reference: &MeanReference) -> Vec<f64> {
    let grey = reference.grey();
    let image_mean = grey.iter().sum::<f64>() / grey.len() as f64;
    let floor = RELATIVE_FLOOR * image_mean * image_mean;
    let relative = |(index, &error): (usize, &f64)| {
        let [columns, rows] = reference.around(index);
        let count = (rows.len() * columns.len()) as f64;
        let row = |y: usize| grey[y * reference.width..][columns.clone()].iter().sum::<f64>();
        let local = rows.map(row).sum::<f64>() / count;
        if error == 0.0 { 0.0 } else { error / (local * local + floor) }
    };
    squared.iter().enumerate().map(relative).collect()
}

fn check(picture: &RgbImage, first: &RgbImage, second: &RgbImage) -> Result<()> {
    let comparison = |message: String| Err(Error::comparison(message));
    let size = |image: &RgbImage| format!("{}x{}", image.width, image.height);
    if picture.pixels.is_empty() {
        return comparison("the picture has no pixels".to_owned());
    }
    for reference in [first, second] {
        if (picture.width, picture.height) != (reference.width, reference.height) {
            return comparison(format!(
                "the picture has {} pixels, the reference {}; render both at one size and crop",
                size(picture),
                size(reference)
            ));
        }
    }
    for (name, image) in [("picture", picture), ("reference", first), ("reference", second)] {
        if let Some((count, first)) = not_finite(image) {
            return comparison(format!("{count} pixels of the {name} are not finite, {first}"));
        }
    }
    Ok(())
}

/// Counts the pixels that are not finite, if there are any, and says where the first lies.
pub(super) fn not_finite(picture: &RgbImage) -> Option<(usize, String)> {
    let is_bad = |(_, pixel): &(usize, &[f32; 3])| pixel.iter().any(|value| !value.is_finite());
    let bad = || picture.pixels.iter().enumerate().filter(is_bad);
    let (index, pixel) = bad().next()?;
    let [x, y] = [index % picture.width as usize, index / picture.width as usize];
    Some((bad().count(), format!("the first at {x},{y}: {pixel:?}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_find_their_values() {
        let metrics = Metrics { mae: 1.0, max_error: 2.0, psnr: 3.0, ..Metrics::default() };
        let named = std::collections::BTreeMap::from(metrics.named());
        assert_eq!((named["mae"], named["max_error"], named["psnr"]), (1.0, 2.0, 3.0));
    }
}
