//! Lamps and emitting triangles → an alias table by power, and densities over triangles.

use std::f32::consts::PI;

use glam::Vec3;

use crate::{
    accel::Accel,
    math::{
        alias::{alias_table, probabilities},
        colour::luminance,
    },
    scene::{
        Scene, instance,
        lamp::{LampKind, SpotFalloff},
    },
    shader::{
        constants::{
            LAMP_BIT, LAMP_DIRECTIONAL, LAMP_POINT, LAMP_SPOT_LINEAR_ANGLE,
            LAMP_SPOT_SMOOTH_COSINE, LAMP_SPOT_SQUARED_COSINE,
        },
        structs,
    },
};

/// Threshold of a column that always keeps its own source.
const THRESHOLD_SCALE: u64 = u32::MAX as u64;

/// Contents of the lamp buffers.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LampTables {
    /// Alias table over emitting triangles and lamps, in proportion to their power.
    pub choices: Vec<structs::LampChoice>,
    /// Lights without a surface.
    pub lamps: Vec<structs::Lamp>,
    /// Density of sampling points on the triangles of each material, per square metre.
    pub emission_densities: Vec<f32>,
}

impl LampTables {
    /// Lays out the lamps of `scene`, whose triangles `accel` holds in BVH order.
    ///
    /// Power weighs the choice: of a triangle π · area · luminance of its mean radiance, for both
    /// sides if both emit. A textured triangle takes the mean of the whole image.
    pub(crate) fn new(scene: &Scene, accel: &Accel) -> Self {
        let per_area: Vec<f32> = scene
            .materials
            .iter()
            .map(|material| {
                let Some(emission) = &material.surface.emission else { return 0.0 };
                let mean = emission
                    .texture
                    .as_ref()
                    .map_or(1.0, |texture| luminance(texture.mean().into()));
                let sides = if emission.two_sided { 2.0 } else { 1.0 };
                let power = sides * PI * luminance(emission.radiance) * mean;
                if power.is_finite() { power.max(0.0) } else { 0.0 }
            })
            .collect();
        let mut sources = Vec::new();
        let mut weights = Vec::new();
        if per_area.iter().any(|&power| power > 0.0) {
            // Surfaces that emit are placed in the world.
            let placed = &accel.triangle_materials[..accel.placed_count()];
            for (triangle, &material) in (0_u32..).zip(placed) {
                let power = per_area[material as usize];
                if power > 0.0 {
                    sources.push(triangle);
                    weights.push(f64::from(power) * area(accel, triangle));
                }
            }
        }
        let radius = radius(scene.geometry.extent());
        for (index, lamp) in (0_u32..).zip(&scene.lamps) {
            sources.push(LAMP_BIT | index);
            weights.push(power(&lamp.kind, radius));
        }
        let lamps = scene.lamps.iter().map(|lamp| convert(&lamp.kind)).collect();
        let Some(table) = alias_table(&weights, THRESHOLD_SCALE) else {
            return Self {
                lamps,
                emission_densities: vec![0.0; per_area.len()],
                ..Self::default()
            };
        };
        let drawn = probabilities(&table, THRESHOLD_SCALE);
        let total: f64 = weights.iter().sum();
        let choices = table.iter().zip(&sources).zip(&drawn).map(|((entry, &source), &drawn)| {
            structs::LampChoice {
                threshold: entry.threshold as u32,
                alias: entry.alias,
                source,
                probability: drawn as f32,
            }
        });
        Self {
            choices: choices.collect(),
            lamps,
            emission_densities: per_area.iter().map(|&p| (f64::from(p) / total) as f32).collect(),
        }
    }
}

/// Area of a triangle, square metres.
fn area(accel: &Accel, triangle: u32) -> f64 {
    let [a, b, c] = accel
        .triangle(triangle)
        .vertices
        .map(|vertex| Vec3::from_array(vertex.position).as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}

/// Radius of a sphere around all positions, metres.
fn radius(positions: impl Iterator<Item = Vec3>) -> f32 {
    instance::bounds(positions).map_or(0.0, |[low, high]| 0.5 * (high - low).length())
}

/// Luminous part of the power that a lamp sends into the scene.
fn power(kind: &LampKind, radius: f32) -> f64 {
    let power = match *kind {
        LampKind::Point { intensity, .. } => 4.0 * PI * luminance(intensity),
        LampKind::Spot { intensity, inner_angle_rad, outer_angle_rad, .. } => {
            let mean = 0.5 * (inner_angle_rad.cos() + outer_angle_rad.cos());
            2.0 * PI * (1.0 - mean) * luminance(intensity)
        }
        LampKind::Directional { irradiance, .. } => PI * radius * radius * luminance(irradiance),
    };
    if power.is_finite() { f64::from(power.max(0.0)) } else { 0.0 }
}

fn convert(kind: &LampKind) -> structs::Lamp {
    match *kind {
        LampKind::Point { position, intensity } => structs::Lamp {
            kind: LAMP_POINT,
            position: position.into(),
            intensity: intensity.into(),
            ..structs::Lamp::default()
        },
        LampKind::Spot {
            position,
            direction,
            intensity,
            inner_angle_rad,
            outer_angle_rad,
            falloff,
        } => {
            let (kind, inner, outer) = match falloff {
                SpotFalloff::SquaredCosine => {
                    (LAMP_SPOT_SQUARED_COSINE, inner_angle_rad.cos(), outer_angle_rad.cos())
                }
                SpotFalloff::SmoothCosine => {
                    (LAMP_SPOT_SMOOTH_COSINE, inner_angle_rad.cos(), outer_angle_rad.cos())
                }
                SpotFalloff::LinearAngle => {
                    (LAMP_SPOT_LINEAR_ANGLE, inner_angle_rad, outer_angle_rad)
                }
            };
            structs::Lamp {
                kind,
                position: position.into(),
                direction: direction.into(),
                intensity: intensity.into(),
                inner,
                outer,
            }
        }
        LampKind::Directional { direction, irradiance } => structs::Lamp {
            kind: LAMP_DIRECTIONAL,
            direction: direction.into(),
            intensity: irradiance.into(),
            ..structs::Lamp::default()
        },
    }
}
