//! The Gaussian kernel and one lobe: value, integral, part above a horizon, spread.

use std::f32::consts::PI;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::special::{erf, expm1};

/// `amplitude · exp(λ(ω·ξ − 1))`. Twin of `Lobe` in `srbf.glsl`: scalar layout, 20 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
#[serde(from = "[f32; 5]", into = "[f32; 5]")]
pub struct Lobe {
    /// Unit axis ξ.
    pub axis: Vec3,
    /// Bandwidth λ, not negative; 0 is a constant.
    pub bandwidth: f32,
    /// Value at the axis, in the unit of the represented function.
    pub amplitude: f32,
}

const _: () = assert!(size_of::<Lobe>() == 20);

impl From<[f32; 5]> for Lobe {
    /// Axis, bandwidth, amplitude.
    fn from([x, y, z, bandwidth, amplitude]: [f32; 5]) -> Self {
        Self { axis: Vec3::new(x, y, z), bandwidth, amplitude }
    }
}

impl From<Lobe> for [f32; 5] {
    fn from(lobe: Lobe) -> Self {
        [lobe.axis.x, lobe.axis.y, lobe.axis.z, lobe.bandwidth, lobe.amplitude]
    }
}

/// Kernel `exp(λ(ω·ξ − 1))`, computed as `exp(−½λ|ω − ξ|²)`: `λ·dot − λ` errs by 1e-2 at λ = 1e5.
pub(crate) fn kernel_value(axis: Vec3, bandwidth: f32, direction: Vec3) -> f32 {
    let d = direction - axis;
    (-0.5 * bandwidth * d.dot(d)).exp()
}

/// Integral of the kernel over the sphere, `2π(1 − e^{−2λ})/λ`; below 1e-3, the start of its series.
pub fn kernel_integral(bandwidth: f32) -> f32 {
    if bandwidth < 1e-3 {
        return 4.0 * PI * (1.0 - bandwidth);
    }
    -2.0 * PI * expm1(-2.0 * bandwidth) / bandwidth
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

/// Share of the kernel's integral above a plane, where `ω·n > 0`; `cosine` is `ξ·n`.
/// \[Tokuyoshi 2022\]'s fit by an error function; largest error 0.005, at λ = 8.
pub fn kernel_hemisphere_part(bandwidth: f32, cosine: f32) -> f32 {
    let steepness = bandwidth
        * ((0.5 * bandwidth + 0.651_733) / ((bandwidth + 1.341_828) * bandwidth + 7.221_669))
            .sqrt();
    // erf(s·c)/erf(s) → c for s → 0.
    let ratio = if steepness < 1e-4 { cosine } else { erf(steepness * cosine) / erf(steepness) };
    let blend = (0.5 + 0.5 * ratio).clamp(0.0, 1.0);
    let e = (-bandwidth).exp();
    (e + (1.0 - e) * blend) / (1.0 + e)
}

/// Value of a lobe.
pub fn lobe_value(lobe: &Lobe, direction: Vec3) -> f32 {
    lobe.amplitude * kernel_value(lobe.axis, lobe.bandwidth, direction)
}

/// Integral of a lobe over the sphere.
pub fn lobe_integral(lobe: &Lobe) -> f32 {
    lobe.amplitude * kernel_integral(lobe.bandwidth)
}
