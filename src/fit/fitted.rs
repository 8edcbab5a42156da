//! Fitted maps and BRDFs: what fits return, fit files hold and samplers read.

use std::f64::consts::FRAC_PI_2;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::{
    component::{Component, lobe_energy},
    judge::{ColouredComponent, FitErrors},
    options::Method,
};
use crate::srbf::Lobe;

/// What a fit file holds.
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
    /// Radiance at the axis per colour channel, not negative: for pictures and weights.
    pub colour: [f32; 3],
    /// Luminance at the axis, not negative: what is sampled.
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
    /// Where the map came from.
    pub source: String,
    /// Objective.
    pub method: Method,
    /// Lobes asked for; there are fewer where the map has less to fit.
    pub requested_lobes: usize,
    /// The lobes in the frame of the map, largest luminance integral first.
    pub lobes: Vec<EnvironmentLobe>,
    /// How good it is.
    pub errors: FitErrors,
    /// What the fit did besides what was asked.
    pub notes: Vec<String>,
    /// Seconds the fit took; of a fit from the cache, that reading it took.
    #[serde(skip)]
    pub seconds: f64,
    /// Whether the fit comes from the cache.
    #[serde(skip)]
    pub is_cached: bool,
}

impl EnvironmentFit {
    /// The lobes in the world, for a map that is turned about +Y.
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

/// The fit for one view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BrdfView {
    /// Angle between normal and view, radians.
    pub theta: f32,
    /// Lobes of BRDF × cosine (luminance, 1/sr) in the local frame, the view toward +x; as many as in
    /// every other view, those without use with an amplitude of 0.
    pub lobes: Vec<Lobe>,
    /// Integral of BRDF × cosine over the hemisphere: the albedo for this view.
    pub albedo: f32,
    /// How good it is.
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
    /// Figures of the views up to [`config::SUMMARY_ANGLE_DEG`].
    pub summary: BrdfSummary,
    /// What the fit did besides what was asked.
    pub notes: Vec<String>,
    /// Seconds the fit took; of a fit from the cache, that reading it took.
    #[serde(skip)]
    pub seconds: f64,
    /// Whether the fit comes from the cache.
    #[serde(skip)]
    pub is_cached: bool,
}

/// Figures over the views up to [`config::SUMMARY_ANGLE_DEG`] from the normal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BrdfSummary {
    /// Means over the views.
    pub mean: FitErrors,
    /// Largest χ² of a view.
    pub largest_chi_squared: f64,
    /// Largest χ² halfway between two views, of the interpolated lobes.
    pub largest_chi_squared_between: f64,
}

/// Angle between normal and view of a view's index, radians.
pub fn view_theta(view: usize, views: usize) -> f64 {
    (view as f64 + 0.5) / views as f64 * FRAC_PI_2
}

impl BrdfFit {
    /// Lobes for any view in the plane of +x, by interpolation between the lobes of two views: axes
    /// and logarithms of the bandwidths, and the integrals.
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
    // A lobe that holds nothing at one end has its shape from the other.
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
