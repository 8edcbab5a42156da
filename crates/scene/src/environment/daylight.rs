//! Daylight of a clear or hazy sky \[Hosek & Wilkie 2012\] with the sun \[Hosek & Wilkie 2013\].
//!
//! `hosek_wilkie.bin` holds singles in little endian: nine coefficients of the sky's distribution for 10
//! turbidities from 1, two albedos of the ground, six points of the sun's elevation and three channels;
//! its radiances in the same order; the sun's irradiance for the turbidities, [`SUN_NODES`] elevations and
//! the channels. Radiances are those that Mitsuba 3 renders, per unit of its luminance.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::Vec3;

use super::{EnvironmentMap, procedural::render, sky::add_disc};

const DATA: &[u8] = include_bytes!("hosek_wilkie.bin");
const TURBIDITIES: usize = 10;
const ALBEDOS: usize = 2;
const POINTS: usize = 6;
const COEFFICIENTS: usize = 9;
const SUN_NODES: usize = 30;
/// Numbers of a turbidity: coefficients and radiances.
const DISTRIBUTION: usize = ALBEDOS * POINTS * 3 * COEFFICIENTS;
const RADIANCE: usize = ALBEDOS * POINTS * 3;
/// Binomials of Bézier's curve of five segments.
const BINOMIALS: [f32; POINTS] = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0];
/// Lowest and highest elevation of the sun's nodes, degrees.
const SUN_RANGE_DEG: (f32, f32) = (2.0, 88.0);
/// Width of the map, texels: the sun is three texels wide.
const WIDTH: u32 = 2048;

/// Angular radius of the sun, degrees.
pub(crate) const SUN_RADIUS_DEG: f32 = 0.2679;

/// Sky and sun over a ground.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Daylight {
    /// Unit direction of the zenith.
    pub up: Vec3,
    /// Unit direction of the sun.
    pub sun: Vec3,
    /// Haze, 1…10.
    pub turbidity: f32,
    /// Reflectance of the ground, which the sky shows.
    pub albedo: Vec3,
    pub sky_scale: f32,
    pub sun_scale: f32,
    /// Angular radius of the sun, radians; its irradiance stays.
    pub sun_radius_rad: f32,
}

fn number(index: usize) -> f32 {
    DATA.as_chunks::<4>().0.get(index).map_or(0.0, |bytes| f32::from_le_bytes(*bytes))
}

/// Distribution of the sky for one channel.
#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    coefficients: [f32; COEFFICIENTS],
    radiance: f32,
}

impl Channel {
    fn radiance(&self, zenith_cosine: f32, angle: f32) -> f32 {
        let [a, b, c, d, e, f, g, h, anisotropy] = self.coefficients;
        let cosine = angle.cos();
        let peak = (1.0 + cosine * cosine)
            / (1.0 + anisotropy * anisotropy - 2.0 * anisotropy * cosine).powf(1.5);
        let horizon = 1.0 + a * (b / (zenith_cosine + 0.01)).exp();
        let glow = c
            + d * (e * angle).exp()
            + f * cosine * cosine
            + g * peak
            + h * zenith_cosine.max(0.0).sqrt();
        (horizon * glow * self.radiance).max(0.0)
    }
}

impl Daylight {
    fn sun_elevation(&self) -> f32 {
        self.sun.dot(self.up).clamp(-1.0, 1.0).asin()
    }

    /// Turbidity below, and the way from it to the next.
    fn turbidity(&self) -> (usize, f32) {
        let place = (self.turbidity - 1.0).clamp(0.0, (TURBIDITIES - 1) as f32);
        let below = (place as usize).min(TURBIDITIES - 2);
        (below, place - below as f32)
    }

    fn channels(&self) -> [Channel; 3] {
        let along = (self.sun_elevation().max(0.0) / FRAC_PI_2).cbrt();
        let (turbidity, hazier) = self.turbidity();
        std::array::from_fn(|channel| {
            let albedo = self.albedo[channel];
            let mut found = Channel::default();
            for (step, turbidity_share) in [(0, 1.0 - hazier), (1, hazier)] {
                for (ground, albedo_share) in [(0, 1.0 - albedo), (1, albedo)] {
                    for (point, binomial) in BINOMIALS.into_iter().enumerate() {
                        let power = along.powi(point as i32) * (1.0 - along).powi(5 - point as i32);
                        let weight = turbidity_share * albedo_share * binomial * power;
                        let row = ((turbidity + step) * ALBEDOS + ground) * POINTS + point;
                        let row = row * 3 + channel;
                        for (index, coefficient) in found.coefficients.iter_mut().enumerate() {
                            *coefficient += weight * number(row * COEFFICIENTS + index);
                        }
                        found.radiance += weight * number(TURBIDITIES * DISTRIBUTION + row);
                    }
                }
            }
            found
        })
    }

    /// Irradiance of the sun on a surface that faces it.
    fn sun_irradiance(&self) -> Vec3 {
        let (turbidity, hazier) = self.turbidity();
        let (low, high) = SUN_RANGE_DEG;
        let place = ((self.sun_elevation().to_degrees() - low) / (high - low)).clamp(0.0, 1.0);
        let place = place * (SUN_NODES - 1) as f32;
        let below = (place as usize).min(SUN_NODES - 2);
        let share = place - below as f32;
        let start = TURBIDITIES * (DISTRIBUTION + RADIANCE);
        let node = |turbidity: usize, node: usize| {
            let at = start + 3 * (turbidity * SUN_NODES + node);
            Vec3::new(number(at), number(at + 1), number(at + 2))
        };
        let of = |turbidity: usize| node(turbidity, below).lerp(node(turbidity, below + 1), share);
        of(turbidity).lerp(of(turbidity + 1), hazier).max(Vec3::ZERO)
    }

    /// Renders the map, radiance times `scale`; black if the sun is down.
    pub(crate) fn map(&self, scale: f32) -> EnvironmentMap {
        let mut texels = vec![Vec3::ZERO; (WIDTH * (WIDTH / 2)) as usize];
        if self.sun_elevation() >= 0.0 {
            let channels = self.channels();
            texels = render(WIDTH, 1, |direction| {
                let cosine = direction.dot(self.up);
                if cosine < 0.0 {
                    return Vec3::ZERO;
                }
                let angle = 2.0 * (0.5 * direction.distance(self.sun)).min(1.0).asin();
                let radiance = channels.map(|channel| channel.radiance(cosine, angle));
                self.sky_scale * Vec3::from(radiance)
            });
            // 2π (1 − cos r), without the cancellation of small radii.
            let solid_angle = 4.0 * PI * (0.5 * self.sun_radius_rad).sin().powi(2);
            let disc = self.sun_scale * self.sun_irradiance() / solid_angle;
            add_disc(&mut texels, WIDTH, self.sun, self.sun_radius_rad, disc);
        }
        EnvironmentMap::procedural("daylight", WIDTH, texels, scale)
    }
}
