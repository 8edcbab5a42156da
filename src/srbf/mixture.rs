//! Sums of lobes.

use glam::{Vec2, Vec3};

use super::{
    kernel::{Lobe, lobe_integral, lobe_value},
    product::lobe_product,
    sample::{kernel_pdf, kernel_sample},
};

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
