//! Explanation of one pixel: its first hit, the shadow rays there, and the knowledge of the technique.

use glam::Vec3;
use serde_json::{Value, json};
use std::any::Any;

use crate::{
    film::sky::{Sky, white_of},
    scene::Scene,
    srbf::{kernel_integral, kernel_value},
};

/// Colour of a direction that the technique avoids.
const BLOCKED: [u8; 3] = [235, 40, 40];
const VISIBLE: [u8; 3] = [40, 220, 70];
const UNTRACED: [u8; 3] = [150, 150, 150];

/// A shadow ray and its outcome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayReadback {
    /// Unit direction, world space.
    pub direction: Vec3,
    /// BRDF · radiance · cosine / pdf; a zero vector was not traced.
    pub contribution: Vec3,
    /// True if it reached the environment.
    pub is_visible: bool,
}

impl RayReadback {
    pub(crate) fn numbers(&self) -> Value {
        json!({
            "direction": self.direction.to_array(),
            "contribution": self.contribution.to_array(),
            "visible": self.is_visible,
        })
    }
}

/// A lobe of the product at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeReadback {
    /// Unit axis, world space.
    pub axis: Vec3,
    /// Bandwidth of the SRBF.
    pub bandwidth: f32,
    /// Probability among the lobes for the first ray.
    pub before: f64,
    /// Probability among the lobes for the last ray.
    pub after: f64,
}

/// Account of a pixel, to draw and to print.
pub trait Explanation: Any {
    /// Unit shading normal of the hit.
    fn normal(&self) -> Vec3;
    fn rays(&self) -> Vec<RayReadback>;
    /// Draws functions of direction that the technique chose by, `width` pixels wide.
    fn skies(&self, scene: &Scene, width: usize) -> Vec<Sky>;
    fn numbers(&self) -> Value;
}

/// Draws the environment with the rays of a pixel: green reached it, red were blocked, grey brought nothing.
pub(crate) fn draw_rays(scene: &Scene, explanation: &dyn Explanation, width: usize) -> Sky {
    let environment = |direction| scene.environment.radiance(direction);
    let white = white_of(width, environment);
    let mut sky = Sky::new(width, explanation.normal(), white, environment);
    for ray in explanation.rays() {
        let colour = match (ray.contribution == Vec3::ZERO, ray.is_visible) {
            (true, _) => UNTRACED,
            (false, true) => VISIBLE,
            (false, false) => BLOCKED,
        };
        sky.mark(ray.direction, colour);
    }
    sky
}

/// First hit of a pixel's first sample, with all its shadow rays.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelReadback {
    /// Position, metres.
    pub position: Vec3,
    /// Unit shading normal.
    pub normal: Vec3,
    /// Shadow rays in the order of tracing.
    pub rays: Vec<RayReadback>,
    /// Lobes of the product; empty for samplers without lobes.
    pub lobes: Vec<LobeReadback>,
    /// Unit directions in the cache when the last ray was drawn, oldest first; `None` without a cache.
    pub cached: Option<Vec<Vec3>>,
}

impl Explanation for PixelReadback {
    fn normal(&self) -> Vec3 {
        self.normal
    }

    fn rays(&self) -> Vec<RayReadback> {
        self.rays.clone()
    }

    /// Draws the density of the lobes for the first ray; with a cache also that for the last ray, at the
    /// same exposure, with the blocked directions in the cache.
    fn skies(&self, _scene: &Scene, width: usize) -> Vec<Sky> {
        if self.lobes.is_empty() {
            return Vec::new();
        }
        let density = |probability: fn(&LobeReadback) -> f64| {
            move |direction| {
                let part = |lobe: &LobeReadback| {
                    let kernel = kernel_value(lobe.axis, lobe.bandwidth, direction);
                    probability(lobe) as f32 * kernel / kernel_integral(lobe.bandwidth)
                };
                Vec3::splat(self.lobes.iter().map(part).sum::<f32>())
            }
        };
        let before = density(|lobe| lobe.before);
        let white = white_of(width, before);
        let mut skies = vec![Sky::new(width, self.normal, white, before)];
        if let Some(cached) = &self.cached {
            let mut after = Sky::new(width, self.normal, white, density(|lobe| lobe.after));
            cached.iter().for_each(|direction| after.mark(*direction, BLOCKED));
            skies.push(after);
        }
        skies
    }

    fn numbers(&self) -> Value {
        json!({
            "position": self.position.to_array(),
            "normal": self.normal.to_array(),
            "rays": self.rays.iter().map(RayReadback::numbers).collect::<Vec<_>>(),
            "lobes": self.lobes.iter().map(|lobe| json!({
                "axis": lobe.axis.to_array(),
                "bandwidth": lobe.bandwidth,
                "before": lobe.before,
                "after": lobe.after,
            })).collect::<Vec<_>>(),
            "cached": self.cached.iter().flatten().map(|direction| json!({
                "direction": direction.to_array(),
            })).collect::<Vec<_>>(),
        })
    }
}
