//! Lobe as fits see it: a von Mises-Fisher density with its share of the energy, in 64 bits.

use std::f64::consts::PI;

use glam::DVec3;

use crate::srbf::Lobe;

/// Smallest bandwidth of a fit; a wider lobe is a constant for every purpose.
pub(crate) const MIN_BANDWIDTH: f64 = 1e-3;
/// Largest bandwidth of a fit: 0.4° wide at half height, a sun of one texel in a map of 1024.
pub(crate) const MAX_BANDWIDTH: f64 = 1e5;

/// `share · exp(λ(ω·ξ − 1)) / I(λ)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component {
    /// Unit axis ξ.
    pub axis: DVec3,
    /// Bandwidth λ.
    pub bandwidth: f64,
    /// Share of the mixture's energy.
    pub share: f64,
}

impl Component {
    /// The component as a lobe of a function with integral `energy`.
    pub(crate) fn lobe(&self, energy: f64) -> Lobe {
        Lobe {
            axis: self.axis.as_vec3(),
            bandwidth: self.bandwidth as f32,
            amplitude: (energy * self.share / kernel_integral(self.bandwidth)) as f32,
        }
    }

    /// The component that a lobe is in a function with integral `energy`.
    pub(crate) fn from_lobe(lobe: &Lobe, energy: f64) -> Self {
        let bandwidth = f64::from(lobe.bandwidth);
        Self {
            axis: lobe.axis.as_dvec3().normalize(),
            bandwidth,
            share: lobe_energy(lobe) / energy,
        }
    }
}

/// Integral of the kernel over the sphere in 64 bits.
pub fn kernel_integral(bandwidth: f64) -> f64 {
    if bandwidth < 1e-9 {
        return 4.0 * PI;
    }
    -2.0 * PI * (-2.0 * bandwidth).exp_m1() / bandwidth
}

/// Integral of a lobe in 64 bits.
pub(crate) fn lobe_energy(lobe: &Lobe) -> f64 {
    f64::from(lobe.amplitude) * kernel_integral(lobe.bandwidth.into())
}

/// `1 − A(λ)` with the mean resultant length `A(λ) = coth λ − 1/λ`, without cancellation.
pub(crate) fn mean_shortfall(bandwidth: f64) -> f64 {
    if bandwidth < 1e-2 {
        return 1.0 - bandwidth / 3.0;
    }
    1.0 / bandwidth - 2.0 / (2.0 * bandwidth).exp_m1()
}

/// Bandwidth whose mean resultant length is 1 − `shortfall`, clamped to
/// [`MIN_BANDWIDTH`]…[`MAX_BANDWIDTH`]: `λ = r̄(3 − r̄²)/(1 − r̄²)` of \[Banerjee et al. 2005\],
/// refined by Newton's method to be exact, so that expectation maximization never gets worse.
pub(crate) fn bandwidth_from_shortfall(shortfall: f64) -> f64 {
    let mean = 1.0 - shortfall;
    if mean <= MIN_BANDWIDTH / 3.0 {
        return MIN_BANDWIDTH;
    }
    if shortfall <= 0.5 / MAX_BANDWIDTH {
        return MAX_BANDWIDTH;
    }
    let mut bandwidth = mean * (3.0 - mean * mean) / (shortfall * (1.0 + mean));
    for _ in 0..4 {
        if bandwidth < 1e-2 {
            break;
        }
        let resultant = 1.0 - mean_shortfall(bandwidth);
        let slope = 1.0 - resultant * resultant - 2.0 * resultant / bandwidth;
        if slope <= 0.0 {
            break;
        }
        let next = bandwidth + (mean_shortfall(bandwidth) - shortfall) / slope;
        bandwidth = next.clamp(0.5 * bandwidth, 2.0 * bandwidth);
    }
    bandwidth.clamp(MIN_BANDWIDTH, MAX_BANDWIDTH)
}

/// Integral over the sphere of the product of two kernels, in 64 bits. \[Wu & Shih 2009\] Eq. 7.
pub fn convolution(a: &Component, b: &Component) -> f64 {
    let length = (a.bandwidth * a.axis + b.bandwidth * b.axis).length();
    let d = a.axis - b.axis;
    let sum = a.bandwidth + b.bandwidth + length;
    let exponent = a.bandwidth * b.bandwidth * d.length_squared() / sum.max(1e-300);
    (-exponent).exp() * kernel_integral(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bandwidths_invert_their_mean_resultant_length() {
        for exponent in -20..=44 {
            let bandwidth = 10_f64.powf(f64::from(exponent) / 10.0);
            let found = bandwidth_from_shortfall(mean_shortfall(bandwidth));
            assert!((found / bandwidth - 1.0).abs() < 1e-4, "{bandwidth}: {found}");
        }
        assert_eq!(bandwidth_from_shortfall(0.0), MAX_BANDWIDTH);
        assert_eq!(bandwidth_from_shortfall(1.0), MIN_BANDWIDTH);
    }
}
