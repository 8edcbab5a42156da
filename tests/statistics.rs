//! The statistical helpers against tabulated values and against themselves.

#[path = "support/statistics.rs"]
mod statistics;

use statistics::{chi_square_p_value, upper_incomplete_gamma, z_of_mean, z_p_value};

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
    // A rare bin is pooled: one count where 0.01 is expected is no scandal on its own.
    assert!(chi_square_p_value(&[50.0, 49.0, 1.0], &[50.0, 50.0, 0.01]) > 0.5);
}

#[test]
fn z_of_mean_measures_in_standard_errors() {
    // Mean 0, variance 100/99, standard error √(1/99).
    let replicates: Vec<f64> = (0..100).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
    assert!(close(z_of_mean(&replicates, -1.0), 99.0_f64.sqrt()));
}
