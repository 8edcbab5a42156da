//! Spherical radial basis functions with the Gaussian kernel: pure functions in 32-bit floats.
//!
//! A lobe is `amplitude · G(ω; ξ, λ)` with the kernel `G = exp(λ(ω·ξ − 1))`, unit axis ξ and
//! bandwidth λ. \[Tsai & Shih 2006\] and \[Wu & Shih 2009\], Eq. 6.
//! All functions hold for bandwidths from 1e-3 to 1e5; most textbook forms fail there, because they
//! subtract numbers as large as λ. Integrals cover the whole sphere.
//!
//! The arithmetic is that of `glsl/include/srbf.glsl`. Products and samples of lobes, which only shaders
//! need, have their twin in `tests/twin`.

use std::f32::consts::PI;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use serde::{Deserialize, Serialize};

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
pub fn kernel_value(axis: Vec3, bandwidth: f32, direction: Vec3) -> f32 {
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

/// Value of a lobe.
pub fn lobe_value(lobe: &Lobe, direction: Vec3) -> f32 {
    lobe.amplitude * kernel_value(lobe.axis, lobe.bandwidth, direction)
}
