//! The target of a fit as weighted points: a spherical function cut into patches.

use glam::DVec3;

/// A patch of the sphere with what the target holds there.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    /// Integral of the target (luminance) over the patch.
    pub energy: f64,
    /// Integral of target × direction; its length is below `energy` by the patch's extent.
    pub moment: DVec3,
    /// Steradians.
    pub solid_angle: f64,
}

/// Patches in the form expectation maximization reads, structure of arrays.
///
/// The log-kernel averaged over a patch is `λ(m·ξ − 1) = −½λ|m − ξ|² − λ·slack`, with m the patch's
/// mean direction (inside the unit sphere) and `slack = ½(1 − |m|²)`: exact, so that a large patch
/// cannot pass for a point.
#[derive(Clone, Debug, Default)]
pub struct PointSet {
    /// x of the mean direction.
    pub x: Vec<f32>,
    /// y of the mean direction.
    pub y: Vec<f32>,
    /// z of the mean direction.
    pub z: Vec<f32>,
    /// `½(1 − |m|²)`.
    pub slack: Vec<f32>,
    /// Share of the target's energy; sums to 1.
    pub weight: Vec<f32>,
    /// Logarithm of the target density (1/sr), averaged over the patch.
    pub log_density: Vec<f32>,
    /// Integral of the target over the sphere.
    pub energy: f64,
}

impl PointSet {
    /// The patches that hold energy, in their order.
    pub fn new(patches: &[Patch]) -> Self {
        let energy: f64 = patches.iter().map(|patch| patch.energy).sum();
        let mut points = Self { energy, ..Self::default() };
        for patch in patches.iter().filter(|patch| patch.energy > 0.0 && patch.solid_angle > 0.0) {
            let mean = patch.moment / patch.energy;
            let weight = patch.energy / energy;
            // Next to nothing, and slow: its products would be denormal numbers.
            if weight < 1e-14 {
                continue;
            }
            points.x.push(mean.x as f32);
            points.y.push(mean.y as f32);
            points.z.push(mean.z as f32);
            points.slack.push((0.5 * (1.0 - mean.length_squared())).max(0.0) as f32);
            points.weight.push(weight as f32);
            points.log_density.push((weight / patch.solid_angle).ln() as f32);
        }
        points
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.weight.len()
    }

    /// Whether the target holds no energy.
    pub fn is_empty(&self) -> bool {
        self.weight.is_empty()
    }

    /// Mean direction of a point.
    pub fn mean(&self, index: usize) -> DVec3 {
        DVec3::new(self.x[index].into(), self.y[index].into(), self.z[index].into())
    }
}
