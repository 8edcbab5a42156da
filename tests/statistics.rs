//! The statistical helpers against tabulated values and against themselves.

use std::f64::consts::PI;

use crate::support::{
    hemisphere,
    random::Random,
    statistics::{
        Comparison, chi_square_p_value, estimates, largest_t, smallest_p_value, student_p_value,
        upper_incomplete_gamma, z_of_mean, z_p_value,
    },
};

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 + 1e-10 * b.abs()
}

#[test]
fn the_incomplete_gamma_function_equals_its_closed_forms() {
    // Q(1, x) = e^−x; Q(2, x) = (1 + x) e^−x; Q(3, x) = (1 + x + x²/2) e^−x.
    for x in [1e-6, 0.1, 0.9, 1.0, 2.0, 3.5, 10.0, 50.0_f64] {
        let e = (-x).exp();
        assert!(close(upper_incomplete_gamma(1.0, x), e), "Q(1, {x})");
        assert!(close(upper_incomplete_gamma(2.0, x), (1.0 + x) * e), "Q(2, {x})");
        let third = (1.0 + x + 0.5 * x * x) * e;
        assert!(close(upper_incomplete_gamma(3.0, x), third), "Q(3, {x})");
    }
    // Half the mass of a χ² with many degrees of freedom lies near k − 2/3.
    assert!((upper_incomplete_gamma(500.0, 500.0 - 1.0 / 3.0) - 0.5).abs() < 1e-4);
}

#[test]
fn p_values_equal_tabulated_quantiles() {
    // Two-sided normal quantiles: 1.959964 for 5%, 3.290527 for 0.1%.
    assert!((z_p_value(1.959_964) - 0.05).abs() < 1e-7);
    assert!((z_p_value(-3.290_527) - 0.001).abs() < 1e-8);
    // χ² = 16.918978 with 9 degrees of freedom is the 5% quantile: move counts until it is reached.
    let shift = (16.918_978_f64 * 100.0 / 2.0).sqrt();
    let mut observed = [100.0; 10];
    observed[0] += shift;
    observed[1] -= shift;
    assert!((chi_square_p_value(&observed, &[0.1; 10]) - 0.05).abs() < 1e-7);
}

#[test]
fn impossible_and_rare_bins_are_treated_as_documented() {
    assert_eq!(chi_square_p_value(&[50.0, 50.0, 1.0], &[0.5, 0.5, 0.0]), 0.0);
    // A rare bin is pooled: one count where 0.01 is expected raises no alarm on its own.
    assert!(chi_square_p_value(&[50.0, 49.0, 1.0], &[50.0, 50.0, 0.01]) > 0.5);
}

#[test]
fn z_of_mean_measures_in_standard_errors() {
    // Mean 0, variance 100/99, standard error √(1/99).
    let replicates: Vec<f64> = (0..100).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
    assert!(close(z_of_mean(&replicates, -1.0), 99.0_f64.sqrt()));
}

#[test]
fn estimates_have_the_mean_and_its_error() {
    // The columns hold 1 and 3, and twice 10.
    let values = estimates(&[vec![1.0, 10.0], vec![3.0, 10.0]]);
    assert_eq!(values.len(), 2);
    assert_eq!((values[0].mean, values[0].error()), (2.0, 1.0));
    assert_eq!((values[1].mean, values[1].error()), (10.0, 0.0));
    let others = estimates(&[vec![2.0, 10.0], vec![10.0, 10.0]]);
    // (6 − 2)/√(1 + 16). Values without an error agree or differ by far too much.
    assert!(close(largest_t(&values, &others), 4.0 / 17.0_f64.sqrt()));
    assert_eq!(largest_t(&values[1..], &others[1..]), 0.0);
    assert!(largest_t(&values[1..], &estimates(&[vec![11.0], vec![11.0]])) > 1e6);
}

#[test]
fn p_values_are_those_of_student_and_welch() {
    // Tables of Student's distribution; with one degree of freedom it is Cauchy's.
    assert!((student_p_value(3.499, 7.0) - 0.01).abs() < 1e-5);
    assert!((student_p_value(1.0, 1.0) - 0.5).abs() < 1e-5);
    let rows = |mean: f64, error: f64| estimates(&[vec![mean + error], vec![mean - error]]);
    // Equal errors have the freedom of both sides, one error that of one side.
    let p_value = |a: Vec<_>, b: Vec<_>| smallest_p_value(&a, &b, 8);
    let t = 5.0 / 2.0_f64.sqrt();
    assert!(close(p_value(rows(1.5, 0.1), rows(1.0, 0.1)), student_p_value(t, 14.0)));
    assert!(close(p_value(rows(1.5, 0.1), rows(1.0, 0.0)), student_p_value(5.0, 7.0)));
    assert_eq!(p_value(rows(1.0, 0.0), rows(1.0, 0.0)), 1.0);
    assert!(p_value(rows(1.1, 0.0), rows(1.0, 0.0)) < 1e-12);
}

#[test]
fn a_comparison_finds_a_bias_unless_noise_hides_it() {
    let mut random = Random(1);
    let mut replicates = |noise: f64| -> Vec<Vec<f64>> {
        let mut value = || 1.0 + noise * (random.uniform() - 0.5);
        (0..8).map(|_| (0..36).map(|_| value()).collect()).collect()
    };
    for (noise, is_found) in [(0.05, true), (2.0, false)] {
        let [values, reference] = [replicates(noise), replicates(noise)].map(|r| estimates(&r));
        let comparison = Comparison::new(&values, &reference);
        assert!(comparison.largest_t < 7.5, "{comparison:?}");
        assert!((comparison.ratio - 1.0).abs() < 0.1, "{comparison:?}");
        assert_eq!(comparison.largest_t_with_bias > 7.5, is_found, "{comparison:?}");
    }
}

#[test]
fn random_numbers_are_those_of_splitmix64() {
    // First outputs for the seed 1234567, from the generator's reference implementation.
    let (mut random, mut single) = (Random(1_234_567), Random(1_234_567));
    for bits in [6_457_827_717_110_365_317_u64, 3_203_168_211_198_807_973] {
        assert_eq!(random.uniform(), (bits >> 11) as f64 / 2_f64.powi(53));
        assert_eq!(single.uniform_f32(), (bits >> 40) as f32 / 2_f32.powi(24));
    }
    let mut decades = vec![0.0; 8];
    for _ in 0..10_000 {
        decades[(f64::from(random.power_of_ten(-3.0, 5.0)).log10() + 3.0) as usize] += 1.0;
    }
    let p = chi_square_p_value(&decades, &[1.0; 8]);
    assert!(p > 1e-6, "p = {p:e}");
}

#[test]
fn random_directions_are_uniform() {
    for kind in [Random::direction, Random::direction_from_point] {
        let mut random = Random(2);
        let mut counts = vec![0.0; 10 * 20];
        for _ in 0..100_000 {
            let direction = kind(&mut random);
            assert!(direction.is_normalized(), "{direction}");
            let turn = f64::from(direction.y).atan2(f64::from(direction.x)) / (2.0 * PI) + 0.5;
            let row = ((f64::from(direction.z) + 1.0) * 5.0) as usize;
            counts[row.min(9) * 20 + ((turn * 20.0) as usize).min(19)] += 1.0;
        }
        let p = chi_square_p_value(&counts, &[1.0; 10 * 20]);
        assert!(p > 1e-6, "p = {p:e}");
    }
}

#[test]
fn bins_of_the_hemisphere_hold_their_solid_angle() {
    let rows = 384;
    let mut shares = vec![0.0; hemisphere::BINS];
    for local in hemisphere::quadrature(rows) {
        assert!((local.length() - 1.0).abs() < 1e-12, "{local}");
        shares[hemisphere::bin(local)] += 1.0 / (2 * rows * rows) as f64;
    }
    let below = shares.pop().unwrap_or_default();
    assert!((below - 0.5).abs() < 1e-3, "{below}");
    let bin_rows = shares.len() / hemisphere::BIN_COLUMNS;
    for (bin, share) in shares.iter().enumerate() {
        let edge = |row: usize| (0.5 * PI * row as f64 / bin_rows as f64).cos();
        let row = bin / hemisphere::BIN_COLUMNS;
        let expected = 0.5 * (edge(row) - edge(row + 1)) / hemisphere::BIN_COLUMNS as f64;
        assert!(
            (share - expected).abs() < 0.03 * expected + 3e-5,
            "bin {bin}: {share}, not {expected}"
        );
    }
}
