//! Target of a fit as weighted points: a spherical function cut into patches.

use glam::{DVec3, Vec3};

/// Patch of the sphere with the moments of the target over it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch {
    /// Integral of the target (luminance) over the patch.
    pub energy: f64,
    /// Integral of target × direction; shorter than `energy` by the patch's extent.
    pub moment: DVec3,
    /// Solid angle, steradians.
    pub solid_angle: f64,
}

impl Patch {
    /// Unit mean direction and variance per axis, `½(1 − |m|²)`; none for a patch without energy.
    pub(crate) fn spread(&self) -> Option<(DVec3, f64)> {
        let mean = self.moment / self.energy;
        let direction = mean.try_normalize().filter(|_| self.energy > 0.0)?;
        Some((direction, (0.5 * (1.0 - mean.length_squared())).max(0.0)))
    }
}

/// Averages a kernel over a patch of the given variance, as a Gaussian over a Gaussian. Returns the
/// bandwidth and the factor in front. The kernel at the patch's mean would be too large for a lobe
/// narrower than the patch.
pub fn blurred(bandwidth: f64, variance: f64) -> (f64, f64) {
    let factor = 1.0 / (1.0 + bandwidth * variance);
    (bandwidth * factor, factor)
}

/// Place of a patch in the form that expectation maximization reads.
///
/// The log-kernel averaged over a patch is `λ(m·ξ − 1) = −½λ|m − ξ|² − λ·slack`, with m the patch's
/// mean direction (inside the unit sphere). It is exact, so a large patch cannot pass for a point.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Mean direction m.
    pub mean: Vec3,
    /// `½(1 − |m|²)`.
    pub slack: f32,
}

/// Patches in the form that expectation maximization reads.
#[derive(Clone, Debug, Default)]
pub struct PointSet {
    /// Where the patches lie.
    pub places: Vec<Point>,
    /// Share of the target's energy; sums to 1.
    pub weight: Vec<f32>,
    /// Logarithm of the target density (1/sr), averaged over the patch.
    pub log_density: Vec<f32>,
    /// Integral of the target over the sphere.
    pub energy: f64,
}

impl PointSet {
    /// Keeps the patches that hold energy, in their order.
    pub(crate) fn new(patches: &[Patch]) -> Self {
        Self::weighted(patches.iter().map(|patch| (patch, patch.energy)))
    }

    /// Takes patches with energies in place of their own, such as those of a colour channel.
    pub(crate) fn weighted<'a>(patches: impl Iterator<Item = (&'a Patch, f64)> + Clone) -> Self {
        let energy: f64 = patches.clone().map(|(_, energy)| energy).sum();
        let mut points = Self { energy, ..Self::default() };
        for (patch, patch_energy) in patches {
            if patch_energy <= 0.0 || patch.energy <= 0.0 || patch.solid_angle <= 0.0 {
                continue;
            }
            let mean = patch.moment / patch.energy;
            let weight = patch_energy / energy;
            // Skip negligible points: their products would be slow denormal numbers.
            if weight < 1e-14 {
                continue;
            }
            let slack = (0.5 * (1.0 - mean.length_squared())).max(0.0) as f32;
            points.places.push(Point { mean: mean.as_vec3(), slack });
            points.weight.push(weight as f32);
            points.log_density.push((weight / patch.solid_angle).ln() as f32);
        }
        points
    }

    pub(crate) fn len(&self) -> usize {
        self.weight.len()
    }

    /// True if the target holds no energy.
    pub(crate) fn is_empty(&self) -> bool {
        self.weight.is_empty()
    }

    pub(crate) fn mean(&self, index: usize) -> DVec3 {
        self.places[index].mean.as_dvec3()
    }
}
