//! Intervals, standard errors and slopes over the runs of a study.

use serde::Serialize;

use crate::{film::reconstruction::variance_share, math::median, scene::Filter};

/// A value with its 95% confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The estimate.
    pub middle: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Applies an increasing function to the estimate and both ends.
    #[must_use]
    pub(crate) fn map(&self, function: impl Fn(f64) -> f64) -> Self {
        let [middle, low, high] = [self.middle, self.low, self.high].map(function);
        Self { middle, low, high }
    }
}

/// 97.5% quantiles of Student's t distribution for 1, 2, … degrees of freedom.
const T_QUANTILES: [f64; 30] = [
    12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622, 2.2281, 2.2010,
    2.1788, 2.1604, 2.1448, 2.1314, 2.1199, 2.1098, 2.1009, 2.0930, 2.0860, 2.0796, 2.0739, 2.0687,
    2.0639, 2.0595, 2.0555, 2.0518, 2.0484, 2.0452, 2.0423,
];

/// 97.5% quantile of Student's t distribution; above 30 degrees of freedom by the first two
/// terms of its expansion around the normal quantile z \[Abramowitz & Stegun 1964\] 26.7.5.
fn t_quantile(degrees_of_freedom: usize) -> f64 {
    T_QUANTILES.get(degrees_of_freedom - 1).copied().unwrap_or_else(|| {
        let (z, nu) = (1.959_964_f64, degrees_of_freedom as f64);
        let second = 5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z;
        z + (z.powi(3) + z) / (4.0 * nu) + second / (96.0 * nu * nu)
    })
}

/// Mean of normally distributed values; a single value is its own interval. `None` for no values.
pub(crate) fn mean_interval(values: &[f64]) -> Option<Interval> {
    let count = values.len();
    let mean = values.iter().sum::<f64>() / count as f64;
    match count {
        0 => None,
        1 => Some(Interval { middle: mean, low: mean, high: mean }),
        _ => {
            let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
            let error = (squares / ((count - 1) as f64 * count as f64)).sqrt();
            let half = t_quantile(count - 1) * error;
            Some(Interval { middle: mean, low: mean - half, high: mean + half })
        }
    }
}

/// Geometric mean of log-normally distributed values. `None` for no values or one not positive.
pub fn geometric_interval(values: &[f64]) -> Option<Interval> {
    if values.iter().any(|value| value.is_nan() || *value <= 0.0) {
        return None;
    }
    let logarithms: Vec<f64> = values.iter().map(|value| value.ln()).collect();
    mean_interval(&logarithms).map(|interval| interval.map(f64::exp))
}

/// Median with the narrowest pair of order statistics that holds the true median with at least 95%
/// confidence, whatever the distribution; below six values, where no pair does, the whole range.
/// Zeros for no values.
pub(crate) fn median_interval(mut values: Vec<f64>) -> Interval {
    values.sort_by(f64::total_cmp);
    let count = values.len();
    let at = |index: usize| values.get(index).copied().unwrap_or(0.0);
    // The interval from the k-th smallest to the k-th largest misses the median with probability
    // 2·P(at most k − 1 of the values are below it), a binomial distribution with p = ½.
    let mut term = 0.5_f64.powi(i32::try_from(count).unwrap_or(i32::MAX));
    let mut below = term;
    let mut cut = 0;
    while 2.0 * below <= 0.05 && 2 * (cut + 1) < count {
        cut += 1;
        term *= (count - cut + 1) as f64 / cut as f64;
        below += term;
    }
    let index = cut.saturating_sub(1);
    let last = count.saturating_sub(1);
    Interval { middle: median(&values), low: at(index), high: at(last - index.min(last)) }
}

/// The value that `percent` of the values do not exceed, by the nearest rank. `None` for no values.
pub fn percentile(mut values: Vec<f64>, percent: usize) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get((values.len() * percent).div_ceil(100).max(1) - 1).copied()
}

/// Slope of the least-squares line through points. `None` below two different abscissae.
pub fn slope(points: &[[f64; 2]]) -> Option<f64> {
    let count = points.len() as f64;
    let mean = |axis: usize| points.iter().map(|point| point[axis]).sum::<f64>() / count;
    let [mean_x, mean_y] = [mean(0), mean(1)];
    let square: f64 = points.iter().map(|point| (point[0] - mean_x).powi(2)).sum();
    let product: f64 = points.iter().map(|point| (point[0] - mean_x) * (point[1] - mean_y)).sum();
    (square > 0.0).then(|| product / square)
}

/// Standard error of the mean over pixels and channels, from the pixels' standard errors; takes
/// channels as fully correlated, and samples as independent, which `filter` spreads over pixels.
pub(crate) fn mean_standard_error(errors: impl Iterator<Item = [f64; 3]>, filter: Filter) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for error in errors {
        let mean = (error[0] + error[1] + error[2]) / 3.0;
        sum += mean * mean;
        count += 1.0;
    }
    (sum / variance_share(filter)).sqrt() / count.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_have_students_interval() {
        assert_eq!(mean_interval(&[]), None);
        assert_eq!(mean_interval(&[2.0]), Some(Interval { middle: 2.0, low: 2.0, high: 2.0 }));
        let interval = mean_interval(&[1.0, 2.0, 3.0]).unwrap();
        assert_eq!(interval.middle, 2.0);
        // s/√n = 1/√3.
        assert!((interval.high - 2.0 - 4.3027 / 3.0_f64.sqrt()).abs() < 1e-9);
        assert!((interval.high + interval.low - 4.0).abs() < 1e-12);
    }

    #[test]
    fn the_quantile_is_continued_without_a_step() {
        assert!((t_quantile(31) - 2.0395).abs() < 2e-4, "{}", t_quantile(31));
        assert!((t_quantile(1_000_000) - 1.96).abs() < 1e-3);
    }

    #[test]
    fn geometric_means_are_symmetric_in_ratios() {
        let interval = geometric_interval(&[0.5, 2.0]).unwrap();
        assert!((interval.middle - 1.0).abs() < 1e-12);
        assert!((interval.low * interval.high - 1.0).abs() < 1e-9);
        assert_eq!(geometric_interval(&[1.0, 0.0]), None);
        assert_eq!(geometric_interval(&[1.0, f64::NAN]), None);
    }

    #[test]
    fn medians_have_the_tabulated_order_statistics() {
        // Tables of the sign test: n = 8 → 1st to 8th (99.2%, the next pair 93.0%), n = 9 → 2nd to 8th
        // (96.1%), n = 15 → 4th to 12th (96.5%).
        let table = [(5, 1, 5), (6, 1, 6), (8, 1, 8), (9, 2, 8), (15, 4, 12), (20, 6, 15)];
        for (count, low, high) in table {
            let interval = median_interval((1..=count).map(f64::from).collect());
            let expected = (f64::from(low), f64::from(high));
            assert_eq!((interval.low, interval.high), expected, "{count}");
            assert!((interval.middle - f64::from(count + 1) / 2.0).abs() < 1e-12);
        }
        assert_eq!(median_interval(vec![3.0]), Interval { middle: 3.0, low: 3.0, high: 3.0 });
        assert_eq!(median_interval(Vec::new()), Interval { middle: 0.0, low: 0.0, high: 0.0 });
    }

    #[test]
    fn slopes_are_exact_on_lines() {
        let points: Vec<[f64; 2]> =
            (0..5).map(|i| [f64::from(i), 3.0 - 0.5 * f64::from(i)]).collect();
        assert!((slope(&points).unwrap() + 0.5).abs() < 1e-12);
        assert_eq!(slope(&[[1.0, 2.0]]), None);
        assert_eq!(slope(&[[1.0, 2.0], [1.0, 3.0]]), None);
    }

    #[test]
    fn the_means_error_shrinks_with_the_pixels() {
        let four = mean_standard_error([[2.0, 2.0, 2.0]; 4].into_iter(), Filter::Box);
        assert!((four - 1.0).abs() < 1e-12);
        // A Gaussian of ½ spreads independent noise over 4π σ² = π pixels.
        let shared = mean_standard_error([[2.0, 2.0, 2.0]; 4].into_iter(), Filter::Gaussian);
        assert!((shared / std::f64::consts::PI.sqrt() - 1.0).abs() < 0.02, "{shared}");
    }
}
