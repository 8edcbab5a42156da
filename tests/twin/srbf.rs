//! Products, integrals and samples of lobes: twin of `glsl/include/srbf.glsl`, in the same arithmetic. Tests
//! alone compare with mixtures, convolutions, inverses, deviations and the exact error function.
//!
//! `x = 1 − ω·ξ` has density `λe^{−λx}/(1 − e^{−2λ})` on 0…2 under a kernel; the azimuth is uniform.
//! Densities are per steradian over the whole sphere.
//!
//! Deviation: \[Wu & Shih 2009\] draw the elevation by a Metropolis walk, whose samples are
//! correlated and whose density holds only in the limit. The distribution inverts in closed form.

use std::f32::consts::{FRAC_2_SQRT_PI, PI};

use fenestra::srbf::{Lobe, expm1, kernel_integral, kernel_value, lobe_value};
use glam::{Vec2, Vec3};

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

/// Root mean square of `x = 1 − ω·ξ` under the kernel: σ of Eq. 9 and 10 of \[Wu & Shih 2009\] in
/// closed form, √2/λ for λ ≳ 5. A direction is close to the lobe where `½|ω − ξ|² < τσ`.
///
/// Deviation: the thesis calls x the cosine of the angle, but its formula is that of 1 − cosine.
/// Below λ = ½ the closed form cancels; a series for `∫₀²x²e^{−λx}dx` replaces it.
pub fn kernel_deviation(bandwidth: f32) -> f32 {
    if bandwidth < 0.5 {
        // ∫₀²x²e^{−λx}dx = Σ_n (−λ)ⁿ·2ⁿ⁺³/(n!·(n + 3)), ∫₀²e^{−λx}dx = I(λ)/2π
        let y = -2.0 * bandwidth;
        let mut second_moment = 1.0 / 12.0 + y / 10.0 * (1.0 / 13.0);
        second_moment = 1.0 / 11.0 + y / 9.0 * second_moment;
        second_moment = 1.0 / 10.0 + y / 8.0 * second_moment;
        second_moment = 1.0 / 9.0 + y / 7.0 * second_moment;
        second_moment = 1.0 / 8.0 + y / 6.0 * second_moment;
        second_moment = 1.0 / 7.0 + y / 5.0 * second_moment;
        second_moment = 1.0 / 6.0 + y / 4.0 * second_moment;
        second_moment = 1.0 / 5.0 + y / 3.0 * second_moment;
        second_moment = 1.0 / 4.0 + y / 2.0 * second_moment;
        second_moment = 1.0 / 3.0 + y * second_moment;
        return (16.0 * PI * second_moment / kernel_integral(bandwidth)).sqrt();
    }
    let b = 1.0 / bandwidth;
    let e = (-2.0 * bandwidth).exp();
    // Multiply by λ throughout, so that nothing underflows at λ = 1e5.
    let second_moment = 2.0 * b * b - e * (4.0 + 4.0 * b + 2.0 * b * b);
    (second_moment / (1.0 - e)).sqrt()
}

/// Steepness of the error function that gives a kernel's share above a plane. \[Tokuyoshi 2022\].
pub fn kernel_steepness(bandwidth: f32) -> f32 {
    bandwidth
        * ((0.5 * bandwidth + 0.651_733) / ((bandwidth + 1.341_828) * bandwidth + 7.221_669)).sqrt()
}

/// That share, where `ratio` is erf(steepness · cosine) / erf(steepness).
pub fn kernel_part_of_ratio(bandwidth: f32, ratio: f32) -> f32 {
    let blend = (0.5 + 0.5 * ratio).clamp(0.0, 1.0);
    let e = (-bandwidth).exp();
    (e + (1.0 - e) * blend) / (1.0 + e)
}

/// Share of the kernel's integral above a plane, where `ω·n > 0`; `cosine` is `ξ·n`. \[Tokuyoshi
/// 2022\]'s fit by an error function; largest error 0.005, at λ = 8.
pub fn kernel_hemisphere_part(bandwidth: f32, cosine: f32) -> f32 {
    let steepness = kernel_steepness(bandwidth);
    // erf(s·c)/erf(s) → c for s → 0.
    let ratio = if steepness < 1e-4 { cosine } else { erf(steepness * cosine) / erf(steepness) };
    kernel_part_of_ratio(bandwidth, ratio)
}

/// Integral of a lobe over the sphere.
pub fn lobe_integral(lobe: &Lobe) -> f32 {
    lobe.amplitude * kernel_integral(lobe.bandwidth)
}

/// Product of two lobes, again a lobe: `λ₃ = |λ₁ξ₁ + λ₂ξ₂|`, `ξ₃ = (λ₁ξ₁ + λ₂ξ₂)/λ₃`,
/// `a₃ = a₁a₂·e^{λ₃−λ₁−λ₂}`. \[Tsai & Shih 2006\].
///
/// The exponent is computed as `−λ₁λ₂|ξ₁ − ξ₂|²/(λ₁ + λ₂ + λ₃)`, which does not cancel. Opposite
/// lobes of equal bandwidth give a constant.
///
/// Deviation: Eq. 8 of \[Wu & Shih 2009\] swaps the indices in ξ₃ and omits the exponential from a₃.
pub fn lobe_product(a: &Lobe, b: &Lobe) -> Lobe {
    let d = a.axis - b.axis;
    let u = a.bandwidth * a.axis + b.bandwidth * b.axis;
    let bandwidth = u.length();
    let axis = if bandwidth > 1e-20 { u / bandwidth } else { a.axis };
    let sum = (a.bandwidth + b.bandwidth + bandwidth).max(1e-20);
    // Divide before multiplying: λ₁λ₂ alone reaches 1e10.
    let exponent = -a.bandwidth * (b.bandwidth / sum) * d.dot(d);
    Lobe { axis, bandwidth, amplitude: a.amplitude * b.amplitude * exponent.exp() }
}

/// Integral over the sphere of the product of two lobes. \[Wu & Shih 2009\] Eq. 7.
pub fn lobe_convolution(a: &Lobe, b: &Lobe) -> f32 {
    let product = lobe_product(a, b);
    product.amplitude * kernel_integral(product.bandwidth)
}

/// Two unit vectors that complete `axis` to a right-handed frame. \[Duff et al. 2017\].
pub fn lobe_frame(axis: Vec3) -> (Vec3, Vec3) {
    let sign = if axis.z < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + axis.z);
    let b = axis.x * axis.y * a;
    (
        Vec3::new(1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x),
        Vec3::new(b, sign + axis.y * axis.y * a, -axis.y),
    )
}

/// Maps a uniform number `u` in 0…1 to a distance `x = 1 − ω·ξ` in 0…2.
pub fn kernel_sample_distance(bandwidth: f32, u: f32) -> f32 {
    let x = if bandwidth < 1e-4 {
        2.0 * u
    } else if bandwidth > 10.0 {
        // 1 − e^{−2λ} is 1 in 32 bits; the guard keeps the logarithm finite at u = 1.
        -log1p(-u.min(0.999_999_94)) / bandwidth
    } else {
        -log1p(u * expm1(-2.0 * bandwidth)) / bandwidth
    };
    x.clamp(0.0, 2.0)
}

/// Samples a direction with the density of the kernel; `u` is uniform in the unit square.
pub fn kernel_sample(axis: Vec3, bandwidth: f32, u: Vec2) -> Vec3 {
    let x = kernel_sample_distance(bandwidth, u.x);
    let sine = (x * (2.0 - x)).sqrt();
    let azimuth = 2.0 * PI * u.y;
    let (tangent, bitangent) = lobe_frame(axis);
    (1.0 - x) * axis + sine * azimuth.cos() * tangent + sine * azimuth.sin() * bitangent
}

/// Density of [`kernel_sample`] per steradian.
pub fn kernel_pdf(axis: Vec3, bandwidth: f32, direction: Vec3) -> f32 {
    kernel_value(axis, bandwidth, direction) / kernel_integral(bandwidth)
}

/// Point of the unit square that [`kernel_sample`] maps to `direction`.
pub fn kernel_inverse(axis: Vec3, bandwidth: f32, direction: Vec3) -> Vec2 {
    let d = direction - axis;
    let x = 0.5 * d.dot(d);
    let u =
        if bandwidth < 1e-4 { 0.5 * x } else { expm1(-bandwidth * x) / expm1(-2.0 * bandwidth) };
    let (tangent, bitangent) = lobe_frame(axis);
    let azimuth = direction.dot(bitangent).atan2(direction.dot(tangent)) / (2.0 * PI);
    Vec2::new(u.clamp(0.0, 1.0), if azimuth < 0.0 { azimuth + 1.0 } else { azimuth })
}

/// `Σ_l a_l·G(ω; ξ_l, λ_l)` with non-negative amplitudes, so that it is a density up to scale.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mixture {
    /// The lobes.
    pub lobes: Vec<Lobe>,
}

impl Mixture {
    /// Value in a direction.
    pub fn value(&self, direction: Vec3) -> f32 {
        self.lobes.iter().map(|lobe| lobe_value(lobe, direction)).sum()
    }

    /// Integral over the sphere.
    pub fn integral(&self) -> f32 {
        self.lobes.iter().map(lobe_integral).sum()
    }

    /// Density of [`Mixture::sample`] per steradian, `Σ_l P_l·G_l/I_l` with `P_l` the lobe's share
    /// of the integral. A mixture without energy has density 0.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        let integral = self.integral();
        if integral <= 0.0 {
            return 0.0;
        }
        let weighted = |lobe: &Lobe| {
            lobe_integral(lobe) / integral * kernel_pdf(lobe.axis, lobe.bandwidth, direction)
        };
        self.lobes.iter().map(weighted).sum()
    }

    /// Samples a direction with the density of the mixture; `u` is uniform in the unit square.
    /// Chooses a lobe by its integral with `u.x` and reuses the rest of `u.x`. None for a mixture
    /// without energy.
    pub fn sample(&self, u: Vec2) -> Option<Vec3> {
        let integral = self.integral();
        let mut rest = u.x * integral;
        let mut chosen = None;
        for lobe in self.lobes.iter().filter(|lobe| lobe_integral(lobe) > 0.0) {
            let energy = lobe_integral(lobe);
            chosen = Some((lobe, (rest / energy).clamp(0.0, 1.0)));
            if rest < energy {
                break;
            }
            rest -= energy;
        }
        chosen.map(|(lobe, x)| kernel_sample(lobe.axis, lobe.bandwidth, Vec2::new(x, u.y)))
    }

    /// Products of every lobe of `self` with every lobe of `other`. \[Wu & Shih 2009\] Eq. 8.
    pub fn product(&self, other: &Self) -> Self {
        let lobes = self
            .lobes
            .iter()
            .flat_map(|a| other.lobes.iter().map(move |b| lobe_product(a, b)))
            .collect();
        Self { lobes }
    }
}
