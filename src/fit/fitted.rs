//! Fitted maps and BRDFs, as fits return them, fit files hold them and samplers read them.

use std::f64::consts::FRAC_PI_2;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::{
    component::{Component, lobe_energy},
    config::Method,
    judge::{ColouredComponent, FitErrors},
};
use crate::srbf::Lobe;

/// Content of a fit file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Fit {
    /// Environment map.
    Environment(EnvironmentFit),
    /// BRDF.
    Brdf(BrdfFit),
}

/// A lobe of an environment map, ready for upload: scalar layout, 32 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
pub struct EnvironmentLobe {
    /// Unit axis in the frame of the map.
    pub axis: [f32; 3],
    /// Bandwidth λ.
    pub bandwidth: f32,
    /// Radiance at the axis per colour channel, not negative; used for pictures and weights.
    pub colour: [f32; 3],
    /// Luminance at the axis, not negative; used for sampling.
    pub amplitude: f32,
}

const _: () = assert!(size_of::<EnvironmentLobe>() == 32);

impl EnvironmentLobe {
    /// The luminance lobe.
    pub fn lobe(&self) -> Lobe {
        Lobe {
            axis: Vec3::from_array(self.axis),
            bandwidth: self.bandwidth,
            amplitude: self.amplitude,
        }
    }
}

/// A fitted environment map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnvironmentFit {
    /// Origin of the map.
    pub source: String,
    /// Objective.
    pub method: Method,
    /// Lobes asked for; a map with less to fit has fewer.
    pub requested_lobes: usize,
    /// The lobes in the frame of the map, largest luminance integral first.
    pub lobes: Vec<EnvironmentLobe>,
    /// Error figures.
    pub errors: FitErrors,
    /// Notes on departures from what was asked.
    pub notes: Vec<String>,
    /// Seconds spent making the fit, or reading it from the cache.
    #[serde(skip)]
    pub seconds: f64,
    /// True if the fit comes from the cache.
    #[serde(skip)]
    pub is_cached: bool,
}

impl EnvironmentFit {
    /// The lobes in the world, for a map turned by `rotation_rad` about +Y.
    pub fn world_lobes(&self, rotation_rad: f32) -> Vec<EnvironmentLobe> {
        let (s, c) = rotation_rad.sin_cos();
        let turn = |lobe: &EnvironmentLobe| {
            let [x, y, z] = lobe.axis;
            EnvironmentLobe { axis: [c * x + s * z, y, c * z - s * x], ..*lobe }
        };
        self.lobes.iter().map(turn).collect()
    }

    /// The luminance lobes as components of their sum, with colours.
    pub(super) fn components(&self) -> Vec<ColouredComponent> {
        let energy: f64 = self.lobes.iter().map(|lobe| lobe_energy(&lobe.lobe())).sum();
        let coloured = |lobe: &EnvironmentLobe| ColouredComponent {
            component: Component::from_lobe(&lobe.lobe(), energy),
            colour: Vec3::from_array(lobe.colour).as_dvec3(),
        };
        self.lobes.iter().map(coloured).collect()
    }
}

/// Fit for one view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BrdfView {
    /// Angle between normal and view, radians.
    pub theta: f32,
    /// Lobes of BRDF × cosine (luminance, 1/sr) in the local frame, the view toward +x. All views
    /// have the same number; unused lobes have amplitude 0.
    pub lobes: Vec<Lobe>,
    /// Albedo for this view: integral of BRDF × cosine over the hemisphere.
    pub albedo: f32,
    /// Error figures.
    pub errors: FitErrors,
}

/// A fitted BRDF.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BrdfFit {
    /// Name of the material or path of the file.
    pub source: String,
    /// Objective.
    pub method: Method,
    /// Lobes asked for per view.
    pub requested_lobes: usize,
    /// The views, from the normal to the horizon.
    pub views: Vec<BrdfView>,
    /// Figures of the views up to [`SUMMARY_ANGLE_DEG`](super::config::SUMMARY_ANGLE_DEG).
    pub summary: BrdfSummary,
    /// Notes on departures from what was asked.
    pub notes: Vec<String>,
    /// Seconds spent making the fit, or reading it from the cache.
    #[serde(skip)]
    pub seconds: f64,
    /// True if the fit comes from the cache.
    #[serde(skip)]
    pub is_cached: bool,
}

/// Figures over the views up to [`SUMMARY_ANGLE_DEG`](super::config::SUMMARY_ANGLE_DEG) from the normal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BrdfSummary {
    /// Means over the views.
    pub mean: FitErrors,
    /// Largest χ² of a view.
    pub largest_chi_squared: f64,
    /// Largest χ² of the interpolated lobes halfway between two views.
    pub largest_chi_squared_between: f64,
}

/// Angle between the normal and view `view` of `views`, radians.
pub(crate) fn view_theta(view: usize, views: usize) -> f64 {
    (view as f64 + 0.5) / views as f64 * FRAC_PI_2
}

impl BrdfFit {
    /// Lobes for any view in the plane of +x. Interpolates the axes, the logarithms of the
    /// bandwidths and the integrals of the lobes of two views.
    pub fn lobes_at(&self, theta: f32) -> Vec<Lobe> {
        let count = self.views.len();
        let position = f64::from(theta) / FRAC_PI_2 * count as f64 - 0.5;
        let lower = (position.max(0.0) as usize).min(count.saturating_sub(1));
        let upper = (lower + 1).min(count.saturating_sub(1));
        let t = (position - lower as f64).clamp(0.0, 1.0);
        let pairs = self.views[lower].lobes.iter().zip(&self.views[upper].lobes);
        pairs.map(|(a, b)| interpolate(a, b, t)).collect()
    }
}

fn interpolate(a: &Lobe, b: &Lobe, t: f64) -> Lobe {
    // A lobe without energy at one end takes its shape from the other.
    let t_shape = if a.amplitude <= 0.0 {
        1.0
    } else if b.amplitude <= 0.0 {
        0.0
    } else {
        t
    };
    let (from, to) = (Component::from_lobe(a, 1.0), Component::from_lobe(b, 1.0));
    let bandwidth = (from.bandwidth.ln() * (1.0 - t_shape) + to.bandwidth.ln() * t_shape).exp();
    let shape = Component {
        axis: from.axis.lerp(to.axis, t_shape).normalize_or(from.axis),
        bandwidth,
        share: (1.0 - t) * from.share + t * to.share,
    };
    shape.lobe(1.0)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// Halfway between two views, bandwidths have their geometric mean and energies the arithmetic one.
    #[test]
    fn lobes_between_views_have_the_mean_of_their_logarithms() {
        let lobe = |bandwidth, share| Component { axis: DVec3::Z, bandwidth, share }.lobe(1.0);
        let [a, b] = [lobe(4.0, 1.0), lobe(100.0, 3.0)];
        let found = interpolate(&a, &b, 0.5);
        assert!((found.bandwidth / 20.0 - 1.0).abs() < 1e-5, "{found:?}");
        assert!((lobe_energy(&found) - 2.0).abs() < 1e-5, "{found:?}");
        let found = interpolate(&a, &b, 0.25);
        assert!((lobe_energy(&found) - 1.5).abs() < 1e-5, "{found:?}");
        // A lobe without energy at one end keeps the shape of the other.
        let found = interpolate(&a, &Lobe { amplitude: 0.0, ..b }, 0.5);
        assert!((found.bandwidth - 4.0).abs() < 1e-4, "{found:?}");
        assert!((lobe_energy(&found) - 0.5).abs() < 1e-5, "{found:?}");
    }
}
