//! Statistical tests: χ², z and their p-values.

/// Bins that expect fewer counts are pooled with their neighbours.
const MIN_EXPECTED: f64 = 5.0;

/// Returns the probability that counts drawn from `expected` differ from it at least as much as
/// `observed` does, by Pearson's χ² with one degree of freedom less than there are bins.
///
/// `expected` is scaled to the sum of `observed`, so densities or probabilities will do. Bins are
/// visited in order of their expectation and pooled until each pool expects five counts or more. A
/// count in a bin of expectation 0 gives 0.
///
/// # Panics
/// If the lengths differ, a value is negative or not finite, or fewer than two pools remain.
pub fn chi_square_p_value(observed: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(observed.len(), expected.len(), "one expected count per observed count");
    let valid = |values: &[f64]| values.iter().all(|value| value.is_finite() && *value >= 0.0);
    assert!(valid(observed) && valid(expected), "counts are finite and not negative");
    let scale = observed.iter().sum::<f64>() / expected.iter().sum::<f64>();
    let mut bins: Vec<(f64, f64)> = observed
        .iter()
        .zip(expected)
        .map(|(&observed, &expected)| (observed, expected * scale))
        .collect();
    if bins.iter().any(|&(observed, expected)| observed > 0.0 && expected == 0.0) {
        return 0.0;
    }
    bins.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut pools: Vec<(f64, f64)> = Vec::new();
    let mut open = (0.0, 0.0);
    for (observed, expected) in bins {
        open = (open.0 + observed, open.1 + expected);
        if open.1 >= MIN_EXPECTED {
            pools.push(open);
            open = (0.0, 0.0);
        }
    }
    if let Some(last) = pools.last_mut() {
        *last = (last.0 + open.0, last.1 + open.1);
    }
    assert!(pools.len() >= 2, "χ² needs two bins that expect {MIN_EXPECTED} counts or more");
    let statistic: f64 = pools
        .iter()
        .map(|(observed, expected)| (observed - expected) * (observed - expected) / expected)
        .sum();
    upper_incomplete_gamma(0.5 * (pools.len() - 1) as f64, 0.5 * statistic)
}

/// Parts the bins that expect less than one of `samples` counts, of which a quadrature may see nothing:
/// returns the counts and masses of the others, and how many counts the parted ones have and expect.
pub fn part_rare_bins(observed: &[f64], masses: &[f64], samples: u32) -> ([Vec<f64>; 2], [f64; 2]) {
    let samples = f64::from(samples);
    let (mut others, mut rare) = ([vec![], vec![]], [0.0; 2]);
    for (count, mass) in observed.iter().zip(masses) {
        if mass * samples < 1.0 {
            rare = [rare[0] + count, rare[1] + mass * samples];
        } else {
            others[0].push(*count);
            others[1].push(*mass);
        }
    }
    (others, rare)
}

/// Returns the two-sided p-value of a standard normal `z`.
pub fn z_p_value(z: f64) -> f64 {
    upper_incomplete_gamma(0.5, 0.5 * z * z)
}

/// Returns z of the mean of independent `replicates` against `truth`, with the standard error from
/// their spread. Ignores Student's distribution: take 30 replicates or more.
pub fn z_of_mean(replicates: &[f64], truth: f64) -> f64 {
    let estimate = Estimate::of(replicates.iter().copied());
    (estimate.mean - truth) / estimate.error()
}

/// Mean over independent replicates.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: f64,
    /// Square of the mean's standard error, from the spread of the replicates.
    pub squared_error: f64,
}

impl Estimate {
    fn of(replicates: impl Iterator<Item = f64> + Clone) -> Self {
        let count = replicates.clone().count() as f64;
        let mean = replicates.clone().sum::<f64>() / count;
        let squares = replicates.map(|value| (value - mean).powi(2)).sum::<f64>();
        Self { mean, squared_error: squares / (count * (count - 1.0)) }
    }

    /// Returns the standard error of the mean.
    pub fn error(&self) -> f64 {
        self.squared_error.sqrt()
    }

    /// Scales the value by `factor`.
    fn times(self, factor: f64) -> Self {
        Self { mean: factor * self.mean, squared_error: factor * factor * self.squared_error }
    }
}

/// Estimates several values from `rows` of them, one row a replicate.
pub fn estimates(rows: &[Vec<f64>]) -> Vec<Estimate> {
    (0..rows[0].len()).map(|index| Estimate::of(rows.iter().map(|row| row[index]))).collect()
}

/// Returns the largest |t| between two lists of estimates of the same values.
pub fn largest_t(a: &[Estimate], b: &[Estimate]) -> f64 {
    assert_eq!(a.len(), b.len(), "estimates of the same values");
    let t = |(a, b): (&Estimate, &Estimate)| {
        (a.mean - b.mean).abs() / (a.squared_error + b.squared_error).sqrt().max(1e-12)
    };
    a.iter().zip(b).map(t).fold(0.0, f64::max)
}

/// Returns the smallest p-value of all t between two lists of estimates, from `replicates` each: under
/// Student's distribution with the degrees of freedom of Welch (1947). They lie between those of one
/// side, where its error is all there is, and those of both.
pub fn smallest_p_value(a: &[Estimate], b: &[Estimate], replicates: u32) -> f64 {
    assert_eq!(a.len(), b.len(), "estimates of the same values");
    let p_value = |(a, b): (&Estimate, &Estimate)| {
        let t = largest_t(&[*a], &[*b]);
        let [a, b] = [a.squared_error, b.squared_error];
        let freedom = f64::from(replicates - 1) * (a + b).powi(2) / (a * a + b * b);
        // Without an error there is no distribution, and values agree or do not.
        let freedom = if freedom.is_finite() { freedom } else { f64::from(replicates - 1) };
        if t > 0.0 { student_p_value(t, freedom) } else { 1.0 }
    };
    a.iter().zip(b).map(p_value).fold(1.0, f64::min)
}

/// Returns the two-sided p-value of `t` > 0 under Student's distribution, by the midpoint rule in t/x.
pub fn student_p_value(t: f64, freedom: f64) -> f64 {
    const STEPS: u32 = 1000;
    let front = (ln_gamma(0.5 * (freedom + 1.0)) - ln_gamma(0.5 * freedom)).exp()
        / (freedom * std::f64::consts::PI).sqrt();
    let density = |x: f64| front * (1.0 + x * x / freedom).powf(-0.5 * (freedom + 1.0));
    let sum: f64 = (0..STEPS)
        .map(|step| {
            let u = (f64::from(step) + 0.5) / f64::from(STEPS);
            density(t / u) * t / (u * u)
        })
        .sum();
    2.0 * sum / f64::from(STEPS)
}

/// Result of comparing estimates with a reference.
#[derive(Clone, Copy, Debug)]
pub struct Comparison {
    /// Largest |t| of all values.
    pub largest_t: f64,
    /// Sum of the means over that of the reference.
    pub ratio: f64,
    /// Largest |t| if the estimates were a tenth too high; small where they are too noisy to judge.
    pub largest_t_with_bias: f64,
}

impl Comparison {
    pub fn new(values: &[Estimate], reference: &[Estimate]) -> Self {
        let total = |values: &[Estimate]| values.iter().map(|value| value.mean).sum::<f64>();
        let biased: Vec<Estimate> = values.iter().map(|value| value.times(1.1)).collect();
        Self {
            largest_t: largest_t(values, reference),
            ratio: total(values) / total(reference),
            largest_t_with_bias: largest_t(&biased, reference),
        }
    }
}

/// Computes the regularised upper incomplete gamma function Q(a, x) by a series below a + 1 and
/// Lentz's continued fraction above. Numerical Recipes, section 6.2.
pub fn upper_incomplete_gamma(a: f64, x: f64) -> f64 {
    assert!(a > 0.0 && x >= 0.0, "Q(a, x) needs a > 0 and x ≥ 0, found a = {a}, x = {x}");
    if x == 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let mut term = 1.0 / a;
        let mut sum = term;
        let mut n = a;
        while term > sum * 1e-16 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return (1.0 - front * sum).max(0.0);
    }
    let tiny = 1e-300;
    let mut b = x + 1.0 - a;
    let mut c = 1.0 / tiny;
    let mut d = 1.0 / b;
    let mut fraction = d;
    for i in 1..100_000 {
        let factor = -f64::from(i) * (f64::from(i) - a);
        b += 2.0;
        d = factor * d + b;
        d = 1.0 / if d.abs() < tiny { tiny } else { d };
        c = b + factor / c;
        c = if c.abs() < tiny { tiny } else { c };
        fraction *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * fraction
}

/// Computes ln Γ(x) for x > 0 by Stirling's series after shifting x above 10, relative error < 1e-13.
fn ln_gamma(x: f64) -> f64 {
    let mut shift = 0.0;
    let mut x = x;
    while x < 10.0 {
        shift += x.ln();
        x += 1.0;
    }
    let inverse = 1.0 / x;
    let square = inverse * inverse;
    let series = inverse
        * (1.0 / 12.0
            - square
                * (1.0 / 360.0
                    - square * (1.0 / 1260.0 - square * (1.0 / 1680.0 - square / 1188.0))));
    (x - 0.5) * x.ln() - x + 0.5 * (2.0 * std::f64::consts::PI).ln() + series - shift
}
