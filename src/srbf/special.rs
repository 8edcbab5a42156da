//! Elementary functions accurate near zero, in arithmetic shared with the shaders: GLSL lacks
//! `expm1`, `log1p` and `erf`, and its `log` loses relative accuracy near 1.

use std::f32::consts::FRAC_2_SQRT_PI;

/// `exp(x) − 1` with a small relative error for every x: Taylor series below ½.
pub fn expm1(x: f32) -> f32 {
    if x.abs() > 0.5 {
        return x.exp() - 1.0;
    }
    let mut tail = 1.0 + x / 9.0;
    tail = 1.0 + x / 8.0 * tail;
    tail = 1.0 + x / 7.0 * tail;
    tail = 1.0 + x / 6.0 * tail;
    tail = 1.0 + x / 5.0 * tail;
    tail = 1.0 + x / 4.0 * tail;
    tail = 1.0 + x / 3.0 * tail;
    tail = 1.0 + x / 2.0 * tail;
    x * tail
}

/// `ln(1 + x)` for x > −1 with a small relative error: series of `2·atanh(x / (2 + x))` below ½.
pub fn log1p(x: f32) -> f32 {
    if x.abs() > 0.5 {
        return (1.0 + x).ln();
    }
    let s = x / (2.0 + x);
    let s2 = s * s;
    let mut tail = 1.0 / 15.0;
    tail = 1.0 / 13.0 + s2 * tail;
    tail = 1.0 / 11.0 + s2 * tail;
    tail = 1.0 / 9.0 + s2 * tail;
    tail = 1.0 / 7.0 + s2 * tail;
    tail = 1.0 / 5.0 + s2 * tail;
    tail = 1.0 / 3.0 + s2 * tail;
    2.0 * s * (1.0 + s2 * tail)
}

/// Error function, relative error below 1e-6: Maclaurin series for |x| ≤ 1, beyond it the rational
/// form 7.1.26 of \[Abramowitz & Stegun 1964\] (absolute error 1.5e-7).
#[expect(clippy::excessive_precision, reason = "the coefficients stand as in the source")]
pub fn erf(x: f32) -> f32 {
    let x2 = x * x;
    if x2 <= 1.0 {
        let mut tail = 1.0 - x2 * (19.0 / 210.0);
        tail = 1.0 - x2 * (17.0 / 171.0) * tail;
        tail = 1.0 - x2 * (15.0 / 136.0) * tail;
        tail = 1.0 - x2 * (13.0 / 105.0) * tail;
        tail = 1.0 - x2 * (11.0 / 78.0) * tail;
        tail = 1.0 - x2 * (9.0 / 55.0) * tail;
        tail = 1.0 - x2 * (7.0 / 36.0) * tail;
        tail = 1.0 - x2 * (5.0 / 21.0) * tail;
        tail = 1.0 - x2 * (3.0 / 10.0) * tail;
        tail = 1.0 - x2 * (1.0 / 3.0) * tail;
        return FRAC_2_SQRT_PI * x * tail;
    }
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let mut tail = -1.453_152_027 + t * 1.061_405_429;
    tail = 1.421_413_741 + t * tail;
    tail = -0.284_496_736 + t * tail;
    tail = 0.254_829_592 + t * tail;
    let magnitude = 1.0 - t * tail * (-x2).exp();
    if x < 0.0 { -magnitude } else { magnitude }
}
