//! Statistical tests: χ², z and their p-values.

#![allow(dead_code, reason = "every test binary uses its own part")]

/// Bins with a smaller expected count are pooled with their neighbours.
const MIN_EXPECTED: f64 = 5.0;

/// Probability that counts drawn from `expected` differ from it at least as much as `observed` does:
/// Pearson's χ², one degree of freedom less than there are bins.
///
/// `expected` is scaled to the sum of `observed`, so that densities or probabilities will do. Bins
/// are visited in order of their expectation and pooled until each pool expects five counts or more.
/// A count in a bin of expectation 0 gives 0.
///
/// # Panics
/// Where the lengths differ, a value is negative or not finite, or fewer than two pools remain.
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

/// Two-sided p-value of a standard normal `z`.
pub fn z_p_value(z: f64) -> f64 {
    upper_incomplete_gamma(0.5, 0.5 * z * z)
}

/// z of the mean of independent `replicates` against `truth`, with the standard error estimated from
/// their spread. Uses Student's distribution nowhere: take 30 replicates or more.
pub fn z_of_mean(replicates: &[f64], truth: f64) -> f64 {
    let count = replicates.len() as f64;
    let mean = replicates.iter().sum::<f64>() / count;
    let variance =
        replicates.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean - truth) / (variance / count).sqrt()
}

/// Regularised upper incomplete gamma function Q(a, x): series below a + 1, Lentz's continued
/// fraction above. Numerical Recipes, section 6.2.
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

/// Logarithm of Γ(x) for x > 0: Stirling's series after shifting x above 10, relative error < 1e-13.
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
