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

#[cfg(test)]
mod tests {
    use super::*;

    fn daylight(sun: Vec3, turbidity: f32) -> Daylight {
        Daylight {
            up: Vec3::Z,
            sun: sun.normalize(),
            turbidity,
            albedo: Vec3::splat(0.2),
            sky_scale: 1.0,
            sun_scale: 1.0,
            sun_radius_rad: (0.5 * 0.5358_f32).to_radians(),
        }
    }

    /// Values of the emitter `sunsky` of Mitsuba 3.9.1 in RGB.
    #[test]
    fn sky_and_sun_are_those_of_mitsuba() {
        let sky = daylight(Vec3::new(0.3, 0.5, 0.6), 3.7);
        let channels = sky.channels();
        for (direction, expected) in [
            (Vec3::Z, [0.02852724, 0.04459, 0.08474188]),
            (Vec3::new(0.5, -0.5, 0.2), [0.06040344, 0.09969734, 0.16682282]),
            (Vec3::new(-0.3, 0.2, 0.4), [0.03280686, 0.05470972, 0.10282528]),
        ] {
            let direction = direction.normalize();
            let angle = direction.angle_between(sky.sun);
            let found = channels.map(|channel| channel.radiance(direction.z, angle));
            let error = (Vec3::from(found) / Vec3::from(expected) - 1.0).abs().max_element();
            assert!(error < 1e-3, "{direction}: {found:?} {expected:?}");
        }
        for (elevation, turbidity, expected) in [
            (25.3_f32, 3.0, [1.3508092, 1.036_220_9, 0.65123785]),
            (7.7, 4.4, [0.663_972_8, 0.356_092_34, 0.098_340_44]),
            (1.0, 3.0, [0.26227944, 0.07084908, 0.0]),
        ] {
            let (sine, cosine) = elevation.to_radians().sin_cos();
            let found = daylight(Vec3::new(cosine, 0.0, sine), turbidity).sun_irradiance();
            assert!(found.abs_diff_eq(Vec3::from(expected), 1e-3), "{elevation}: {found}");
        }
    }

    #[test]
    fn the_sky_shows_the_colour_of_the_ground() {
        let radiance = |albedo: Vec3| {
            let sky = Daylight { albedo, ..daylight(Vec3::Z, 3.0) };
            sky.channels().map(|channel| channel.radiance)
        };
        let (grey, white) = (radiance(Vec3::splat(0.2)), radiance(Vec3::ONE));
        assert_eq!(radiance(Vec3::new(0.2, 1.0, 0.2)), [grey[0], white[1], grey[2]]);
        assert!(white[1] > grey[1]);
    }

    #[test]
    fn the_map_has_the_irradiance_of_sky_and_sun() {
        let mut light = daylight(Vec3::new(0.3, 0.5, 0.6), 3.7);
        light.sky_scale = 0.0;
        let map = light.map(1.0);
        let (width, height) = (map.width as usize, map.height as usize);
        let edge = |row: usize| (PI * row as f32 / height as f32).cos();
        let row = |row: usize| {
            let texels = &map.texels[row * width..(row + 1) * width];
            texels.iter().sum::<Vec3>() * (edge(row) - edge(row + 1)) * 2.0 * PI / width as f32
        };
        let found: Vec3 = (0..height).map(row).sum();
        assert!(found.abs_diff_eq(light.sun_irradiance(), 1e-3), "{found}");
        assert!(daylight(-Vec3::Z, 3.0).map(1.0).is_black());
        let sky = |sky_scale: f32| {
            let light = Daylight { sky_scale, sun_scale: 0.0, ..daylight(Vec3::Z, 3.0) };
            light.map(1.0).texels.iter().sum::<Vec3>()
        };
        assert!((sky(2.0) / sky(0.5)).abs_diff_eq(Vec3::splat(4.0), 1e-3));
    }
}
