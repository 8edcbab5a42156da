//! Spherical radial basis functions against 64-bit quadrature.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::PI;

use fenestra::srbf::{Lobe, expm1, kernel_integral, lobe_value};
use glam::{DVec3, Vec2, Vec3};

use crate::{
    support::{
        lobes::{BANDWIDTHS, random_bandwidth},
        random::Random,
        statistics,
    },
    twin::srbf,
};

/// Integrates by composite Gauss-Legendre quadrature, 5 points on each of `count` intervals.
fn integrate(from: f64, to: f64, count: usize, function: impl Fn(f64) -> f64) -> f64 {
    const NODES: [(f64, f64); 5] = [
        (0.0, 0.568_888_888_888_888_9),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (0.906_179_845_938_664, 0.236_926_885_056_189_1),
        (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    ];
    let half = 0.5 * (to - from) / count as f64;
    let interval = |i: usize| {
        let middle = from + (2 * i + 1) as f64 * half;
        NODES.iter().map(|(x, weight)| weight * function(middle + half * x)).sum::<f64>() * half
    };
    (0..count).map(interval).sum()
}

/// Computes the moment `∫₀² xⁿ e^{−λx} dx` with all points where the integrand matters.
fn moment(bandwidth: f64, power: i32) -> f64 {
    let end = (60.0 / bandwidth).min(2.0);
    integrate(0.0, end, 200, |x| x.powi(power) * (-bandwidth * x).exp())
}

fn assert_close(found: f32, expected: f64, tolerance: f64, what: &str) {
    let error = (f64::from(found) - expected).abs();
    assert!(
        error <= tolerance * expected.abs() || error < 1e-37,
        "{what}: found {found:e}, expected {expected:e}, relative error {:e}",
        error / expected.abs()
    );
}

#[test]
fn elementary_functions_hold_near_zero() {
    for exponent in -80..=6 {
        for sign in [-1.0, 1.0] {
            let x = (sign * 2_f64.powf(f64::from(exponent) * 0.5)) as f32;
            let exact = f64::from(x);
            assert_close(expm1(x), exact.exp_m1(), 3e-7, &format!("expm1({x})"));
            if x > -0.9999 {
                assert_close(srbf::log1p(x), exact.ln_1p(), 4e-7, &format!("log1p({x})"));
            }
            let integral = 2.0 / PI.sqrt() * integrate(0.0, exact, 64, |t| (-t * t).exp());
            assert_close(srbf::erf(x), integral, 1e-6, &format!("erf({x})"));
        }
    }
}

#[test]
fn integral_and_deviation_match_quadrature() {
    for bandwidth in BANDWIDTHS {
        let exact = f64::from(bandwidth);
        let integral = 2.0 * PI * moment(exact, 0);
        assert_close(kernel_integral(bandwidth), integral, 1e-6, &format!("I({bandwidth})"));
        let deviation = (moment(exact, 2) / moment(exact, 0)).sqrt();
        let found = srbf::kernel_deviation(bandwidth);
        assert_close(found, deviation, 2e-6, &format!("sigma({bandwidth})"));
    }
    assert_close(kernel_integral(0.0), 4.0 * PI, 1e-6, "I(0)");
}

#[test]
fn the_share_within_one_deviation_is_the_published_one() {
    // Share of a lobe's mass where 1 − cosine < σ: 75.7% for λ ≥ 5, 67% at λ = 1.
    for (bandwidth, share) in [(1.0_f32, 0.67), (5.0, 0.757), (1e3, 0.757), (1e5, 0.757)] {
        let deviation = f64::from(srbf::kernel_deviation(bandwidth));
        let exact = f64::from(bandwidth);
        let found = (-exact * deviation).exp_m1() / (-2.0 * exact).exp_m1();
        assert!((found - share).abs() < 0.006, "lambda {bandwidth}: {found}");
    }
}

#[test]
fn hemisphere_part_is_within_its_published_error() {
    let mut largest = 0.0_f64;
    for bandwidth in BANDWIDTHS {
        for step in -20..=20 {
            let tilt = PI * f64::from(step) / 40.0; // elevation of the axis
            let (sine, cosine) = (tilt.sin(), tilt.cos());
            // At x = 1 − ω·ξ, weight the kernel by the part of its circle above the horizon.
            let exact = f64::from(bandwidth);
            let above = |x: f64| {
                let height = sine * (1.0 - x);
                let radius = cosine * (x * (2.0 - x)).max(0.0).sqrt();
                let share = if radius <= height.abs() {
                    if height > 0.0 { 1.0 } else { 0.0 }
                } else {
                    1.0 - (height / radius).clamp(-1.0, 1.0).acos() / PI
                };
                share * (-exact * x).exp()
            };
            let end = (60.0 / exact).min(2.0);
            let part = integrate(0.0, end, 2000, above) / moment(exact, 0);
            let found = f64::from(srbf::kernel_hemisphere_part(bandwidth, sine as f32));
            largest = largest.max((found - part).abs());
            assert!((found - part).abs() < 0.0055, "{bandwidth} at {sine}: {found}, not {part}");
        }
    }
    assert!(largest > 1e-4, "the reference does not follow the formula by accident");
    assert_close(srbf::kernel_hemisphere_part(0.0, 0.3), 0.5, 1e-6, "constant kernel");
}

/// Computes `λ₃`, `ln(a₃)` and `ξ₃` of a product of unit lobes in 64 bits.
fn exact_product(a: &Lobe, b: &Lobe) -> (f64, f64, DVec3) {
    let (axis_a, axis_b) = (a.axis.as_dvec3().normalize(), b.axis.as_dvec3().normalize());
    let (lambda_a, lambda_b) = (f64::from(a.bandwidth), f64::from(b.bandwidth));
    let sum = lambda_a * axis_a + lambda_b * axis_b;
    (sum.length(), sum.length() - lambda_a - lambda_b, sum.normalize_or_zero())
}

#[test]
fn products_are_pointwise_products_and_convolutions_their_integrals() {
    let mut random = Random(1);
    for _ in 0..20_000 {
        let axis = random.direction();
        let a = Lobe { axis, bandwidth: random_bandwidth(&mut random), amplitude: 2.0 };
        // Place half of the partners near by, where the product is not negligible.
        let near = srbf::kernel_sample(
            axis,
            a.bandwidth,
            Vec2::new(random.uniform() as f32, random.uniform() as f32),
        );
        let other = if random.uniform() < 0.5 { near.normalize() } else { random.direction() };
        let b = Lobe { axis: other, bandwidth: random_bandwidth(&mut random), amplitude: 3.0 };
        let (bandwidth, log_amplitude, exact_axis) = exact_product(&a, &b);
        let product = srbf::lobe_product(&a, &b);
        let what = format!("{a:?} × {b:?}");
        let larger = f64::from(a.bandwidth.max(b.bandwidth));
        assert!((f64::from(product.bandwidth) - bandwidth).abs() < 3e-7 * larger, "{what}");
        if bandwidth > 1e-3 * larger {
            assert!(product.axis.as_dvec3().distance(exact_axis) < 1e-3, "{what}");
        }
        // Rounding axes to 6e-8 adds an error of about 1e-7·√(λe) to an exponent e.
        let tolerance = 2e-5 + 4e-7 * (-log_amplitude * larger).sqrt() + 3e-7 * -log_amplitude;
        if log_amplitude > -80.0 {
            assert_close(product.amplitude, 6.0 * log_amplitude.exp(), tolerance, &what);
            let integral =
                6.0 * log_amplitude.exp() * 2.0 * PI * -(-2.0 * bandwidth).exp_m1() / bandwidth;
            assert_close(srbf::lobe_convolution(&a, &b), integral, tolerance + 1e-3, &what);
        }
        let direction = near.normalize();
        let pointwise = lobe_value(&a, direction) * lobe_value(&b, direction);
        if pointwise > 1e-6 {
            let relative = lobe_value(&product, direction) / pointwise - 1.0;
            assert!(relative.abs() < 0.02, "{what} at {direction}: {relative}");
        }
    }
}

#[test]
fn products_of_aligned_narrow_lobes_keep_their_amplitude() {
    // The textbook exponent λ₃ − λ₁ − λ₂ is off by 5e-2 here.
    let axis = Vec3::new(0.6, 0.0, 0.8);
    let nearby = Vec3::new(0.603, 0.001, 0.798).normalize();
    let a = Lobe { axis, bandwidth: 1e5, amplitude: 1.0 };
    let b = Lobe { axis: nearby, bandwidth: 0.7e5, amplitude: 1.0 };
    let (_, log_amplitude, _) = exact_product(&a, &b);
    assert!(log_amplitude < -0.1);
    let found = srbf::lobe_product(&a, &b).amplitude;
    assert_close(found, log_amplitude.exp(), 2e-4, "amplitude");
}

#[test]
fn opposite_lobes_do_not_divide_by_zero() {
    for bandwidth in BANDWIDTHS {
        let a = Lobe { axis: Vec3::Z, bandwidth, amplitude: 1.0 };
        let b = Lobe { axis: -Vec3::Z, bandwidth, amplitude: 1.0 };
        let product = srbf::lobe_product(&a, &b);
        assert!(product.axis.is_normalized() && product.bandwidth == 0.0);
        let expected = 4.0 * PI * (-2.0 * f64::from(bandwidth)).exp();
        assert_close(srbf::lobe_convolution(&a, &b), expected, 1e-5, &format!("{bandwidth}"));
    }
    let constant = Lobe { axis: Vec3::Z, bandwidth: 0.0, amplitude: 1.0 };
    assert_close(srbf::lobe_convolution(&constant, &constant), 4.0 * PI, 1e-6, "constant");
}

#[test]
fn convolution_matches_quadrature_over_the_sphere() {
    for (lambda_a, lambda_b, angle) in
        [(0.5_f32, 4.0_f32, 0.9_f64), (20.0, 35.0, 0.3), (2.0, 60.0, 2.5), (0.01, 0.02, 1.5)]
    {
        let a = Lobe { axis: Vec3::Z, bandwidth: lambda_a, amplitude: 1.5 };
        let axis = DVec3::new(angle.sin(), 0.0, angle.cos());
        let b = Lobe { axis: axis.as_vec3(), bandwidth: lambda_b, amplitude: 0.5 };
        let integral = integrate(-1.0, 1.0, 100, |z| {
            integrate(0.0, 2.0 * PI, 60, |azimuth| {
                let radius = (1.0 - z * z).sqrt();
                let direction = DVec3::new(radius * azimuth.cos(), radius * azimuth.sin(), z);
                (f64::from(lambda_a) * (z - 1.0)).exp()
                    * (f64::from(lambda_b) * (direction.dot(axis) - 1.0)).exp()
            })
        });
        assert_close(srbf::lobe_convolution(&a, &b), 0.75 * integral, 1e-5, "convolution");
    }
}

#[test]
fn samples_invert_and_their_distances_are_exact() {
    let mut random = Random(2);
    for bandwidth in BANDWIDTHS {
        for _ in 0..500 {
            let axis = random.direction();
            let u = Vec2::new(random.uniform() as f32, random.uniform() as f32);
            let exact = f64::from(bandwidth);
            let x = -(f64::from(u.x) * (-2.0 * exact).exp_m1()).ln_1p() / exact;
            let found = srbf::kernel_sample_distance(bandwidth, u.x);
            assert_close(found, x, 2e-6, &format!("x of {bandwidth} at {u}"));
            let direction = srbf::kernel_sample(axis, bandwidth, u);
            assert!((direction.length() - 1.0).abs() < 1e-6);
            let inverse = srbf::kernel_inverse(axis, bandwidth, direction);
            // Directions are rounded to 6e-8, which at λ = 1e5 is a few 1e-5 of the lobe's width.
            assert!((inverse.x - u.x).abs() < 3e-4, "{bandwidth}: {u} → {inverse}");
            let turn = (inverse.y - u.y).abs();
            let sine = (found * (2.0 - found)).sqrt();
            assert!(turn.min(1.0 - turn) * sine < 3e-7, "{bandwidth}: {u} → {inverse}");
        }
        for edge in [0.0, 1.0] {
            let direction = srbf::kernel_sample(Vec3::Y, bandwidth, Vec2::new(edge, 0.5));
            assert!(direction.is_finite() && (direction.length() - 1.0).abs() < 1e-6);
        }
    }
    let direction = srbf::kernel_sample(Vec3::Y, 0.0, Vec2::new(0.25, 0.5));
    assert!((direction.y - 0.5).abs() < 1e-6, "a bandwidth of 0 is uniform");
}

#[test]
fn densities_integrate_to_one() {
    let axis = Vec3::new(0.36, 0.48, 0.8);
    let (tangent, _) = srbf::lobe_frame(axis);
    for bandwidth in BANDWIDTHS {
        // The density depends on the distance alone, and its circles measure 2π dx.
        let end = (60.0 / f64::from(bandwidth)).min(2.0);
        let integral = 2.0
            * PI
            * integrate(0.0, end, 200, |x| {
                let sine = (x * (2.0 - x)).sqrt();
                let direction = (1.0 - x) * axis.as_dvec3() + sine * tangent.as_dvec3();
                f64::from(srbf::kernel_pdf(axis, bandwidth, direction.as_vec3()))
            });
        assert!((integral - 1.0).abs() < 1e-4, "{bandwidth}: {integral}");
    }
}

#[test]
fn mixtures_sample_their_density() {
    let lobes = vec![
        Lobe { axis: Vec3::Z, bandwidth: 2.0, amplitude: 1.0 },
        Lobe { axis: Vec3::X, bandwidth: 25.0, amplitude: 4.0 },
        Lobe { axis: -Vec3::X, bandwidth: 5.0, amplitude: 0.0 },
        Lobe { axis: Vec3::new(0.0, -0.6, 0.8), bandwidth: 300.0, amplitude: 20.0 },
    ];
    let mixture = srbf::Mixture { lobes };
    let direction = Vec3::new(0.6, 0.0, 0.8);
    let ratio = mixture.value(direction) / mixture.integral();
    assert_close(mixture.pdf(direction), f64::from(ratio), 1e-5, "pdf");

    // Count in bins of z × azimuth, and integrate the density over each.
    let (rows, columns, count) = (15_usize, 11_usize, 100_000_usize);
    let mut random = Random(3);
    let mut observed = vec![0.0_f64; rows * columns];
    for _ in 0..count {
        let u = Vec2::new(random.uniform() as f32, random.uniform() as f32);
        let sampled = mixture.sample(u).unwrap();
        let row = ((f64::from(sampled.z) + 1.0) / 2.0 * rows as f64) as usize;
        let turn = f64::from(sampled.y).atan2(f64::from(sampled.x)) / (2.0 * PI) + 0.5;
        let column = (turn * columns as f64) as usize;
        observed[row.min(rows - 1) * columns + column.min(columns - 1)] += 1.0;
    }
    let expected: Vec<f64> = (0..observed.len())
        .map(|index| {
            let z0 = -1.0 + 2.0 * (index / columns) as f64 / rows as f64;
            let azimuth0 = (2.0 * (index % columns) as f64 / columns as f64 - 1.0) * PI;
            integrate(z0, z0 + 2.0 / rows as f64, 12, |z| {
                integrate(azimuth0, azimuth0 + 2.0 * PI / columns as f64, 12, |azimuth| {
                    let radius = (1.0 - z * z).sqrt();
                    let at = DVec3::new(radius * azimuth.cos(), radius * azimuth.sin(), z);
                    f64::from(mixture.pdf(at.as_vec3()))
                })
            })
        })
        .collect();
    let whole: f64 = expected.iter().sum();
    assert!((whole - 1.0).abs() < 1e-3, "the density integrates to {whole}");
    let p = statistics::chi_square_p_value(&observed, &expected);
    assert!(p > 3e-6, "p = {p:e}");
    assert_eq!(srbf::Mixture::default().sample(Vec2::splat(0.5)), None);
    assert_eq!(srbf::Mixture::default().pdf(Vec3::Z), 0.0);
}

#[test]
fn mixture_products_are_pointwise_products() {
    let mut random = Random(4);
    let mut mixture = || srbf::Mixture {
        lobes: (0..5)
            .map(|_| Lobe {
                axis: random.direction(),
                bandwidth: random_bandwidth(&mut random).min(40.0),
                amplitude: random.uniform() as f32,
            })
            .collect(),
    };
    let (a, b) = (mixture(), mixture());
    let product = a.product(&b);
    assert_eq!(product.lobes.len(), 25);
    for _ in 0..200 {
        let direction = random.direction();
        let expected = f64::from(a.value(direction)) * f64::from(b.value(direction));
        assert_close(product.value(direction), expected, 1e-4, "product");
    }
}
