//! Reproducible random numbers.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

pub use super::fuzz::Random;

impl Random {
    /// Draws a number in [0, 1) with 53 random bits.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Draws a number in [0, 1) with 24 random bits.
    pub fn uniform_f32(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1_u64 << 24) as f32
    }

    /// Draws a number between two powers of ten, its logarithm uniform.
    pub fn power_of_ten(&mut self, from: f64, to: f64) -> f32 {
        10_f64.powf(from + (to - from) * self.uniform()) as f32
    }

    /// Draws a unit vector, uniform over the sphere.
    pub fn direction(&mut self) -> Vec3 {
        let z = 2.0 * self.uniform() - 1.0;
        let azimuth = 2.0 * PI * self.uniform();
        let radius = (1.0 - z * z).sqrt();
        DVec3::new(radius * azimuth.cos(), radius * azimuth.sin(), z).as_vec3().normalize()
    }

    /// Draws a point in the cube −1…1.
    pub fn point(&mut self) -> Vec3 {
        Vec3::new(self.uniform_f32(), self.uniform_f32(), self.uniform_f32()) * 2.0 - 1.0
    }

    /// Draws a unit vector by rejection. Keeps the sequence that the limits of the traversal tests
    /// belong to; elsewhere use [`Random::direction`].
    pub fn direction_from_point(&mut self) -> Vec3 {
        loop {
            let point = self.point();
            if (0.01..1.0).contains(&point.length_squared()) {
                return point.normalize();
            }
        }
    }
}
