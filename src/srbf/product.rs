//! Lobe × lobe.

use super::kernel::{Lobe, kernel_integral};

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
