//! Daylight of a scene file: a clear or hazy sky \[Hosek & Wilkie 2012\] with the sun \[Hosek & Wilkie
//! 2013\], which stands where it does at a date.
//!
//! `hosek_wilkie.bin` holds singles in little endian: nine coefficients of the sky's distribution for 10
//! turbidities from 1, two albedos of the ground, six points of the sun's elevation and three channels;
//! its radiances in the same order; the sun's irradiance for the turbidities, [`SUN_NODES`] elevations and
//! the channels. Radiances are those that Mitsuba 3 renders, per unit of its luminance.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{DVec3, Vec3};
use serde::Deserialize;

use super::{EnvironmentMap, check_range, render, sky::add_disc};

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

/// Earth's radius over its distance from the sun, which is the sun's parallax.
const PARALLAX: f64 = 6371.01 / 149_597_890.0;

/// Date and place on the Earth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    /// Year, month and day at the place.
    pub date: [i64; 3],
    /// Time at Greenwich in hours from the midnight that begins this date.
    pub hours: f64,
    /// Latitude and longitude, degrees, north and east positive.
    pub place_deg: [f64; 2],
}

impl Moment {
    /// Unit direction to the sun along north, east and the zenith \[Blanco-Muriel et al. 2001\].
    pub(crate) fn sun(&self) -> [f64; 3] {
        let ([year, month, day], hours) = (self.date, self.hours);
        let [latitude, longitude] = self.place_deg;
        let days = julian_day(year, month, day) as f64 - 0.5 + hours / 24.0 - 2_451_545.0;

        let node = 2.1429 - 0.001_039_459_4 * days;
        let mean_longitude = 4.895_063 + 0.017_202_791_698 * days;
        let anomaly = 6.240_06 + 0.017_201_969_9 * days;
        let longitude_of_sun =
            mean_longitude + 0.033_416_07 * anomaly.sin() + 0.000_348_94 * (2.0 * anomaly).sin()
                - 0.000_113_4
                - 0.000_020_3 * node.sin();
        let obliquity = 0.409_092_8 - 6.214e-9 * days + 0.000_039_6 * node.cos();
        let ascension = (obliquity.cos() * longitude_of_sun.sin()).atan2(longitude_of_sun.cos());
        let declination = (obliquity.sin() * longitude_of_sun.sin()).asin();

        let sidereal_hours = 6.697_424_324_2 + 0.065_709_828_3 * days + hours;
        let hour_angle = (15.0 * sidereal_hours + longitude).to_radians() - ascension;
        let (sine, cosine) = latitude.to_radians().sin_cos();
        let height = cosine * hour_angle.cos() * declination.cos() + declination.sin() * sine;
        let zenith = height.clamp(-1.0, 1.0).acos();
        let azimuth =
            (-hour_angle.sin()).atan2(declination.tan() * cosine - sine * hour_angle.cos());
        let (sine, cosine) = (zenith + PARALLAX * zenith.sin()).sin_cos();
        [azimuth.cos() * sine, azimuth.sin() * sine, cosine]
    }
}

/// Julian day at noon of a date of our calendar.
fn julian_day(year: i64, month: i64, day: i64) -> i64 {
    let century = (month - 14) / 12;
    1461 * (year + 4800 + century) / 4 + 367 * (month - 2 - 12 * century) / 12
        - 3 * ((year + 4900 + century) / 100) / 4
        + day
        - 32075
}

/// Daylight over a dark ground; north is −Z, east +X.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DaylightParameters {
    /// Haze, 1…10.
    pub turbidity: f32,
    /// Reflectance of the ground, 0…1, which the sky shows.
    pub albedo: [f32; 3],
    /// Direction to the sun, of any length. Default: by date and place.
    pub sun_direction: Option<[f32; 3]>,
    /// Year, month, day.
    pub date: [u32; 3],
    /// Local time, 0…24.
    pub hour: f32,
    /// Hours by which local time is ahead of UTC.
    pub timezone: f32,
    /// Latitude and longitude, degrees north and east.
    pub place: [f32; 2],
    /// Factor of the sun alone.
    pub sun_scale: f32,
}

impl Default for DaylightParameters {
    fn default() -> Self {
        Self {
            turbidity: 3.0,
            albedo: [0.3, 0.3, 0.3],
            sun_direction: None,
            date: [2010, 7, 10],
            hour: 15.0,
            timezone: 9.0,
            place: [35.6894, 139.6917],
            sun_scale: 1.0,
        }
    }
}

impl EnvironmentMap {
    /// Renders daylight \[Hosek & Wilkie 2012, 2013\], radiance times `scale`.
    ///
    /// # Errors
    /// Returns a message that names the parameter, its value and the allowed range.
    pub fn daylight(parameters: &DaylightParameters, scale: f32) -> Result<Self, String> {
        let DaylightParameters { turbidity, albedo, hour, timezone, place, sun_scale, .. } =
            *parameters;
        let [year, month, day] = parameters.date.map(i64::from);
        check_range("turbidity", turbidity, 1.0, 10.0)?;
        albedo.iter().try_for_each(|share| check_range("albedo", *share, 0.0, 1.0))?;
        check_range("date: year", year as f32, 1900.0, 2100.0)?;
        check_range("date: month", month as f32, 1.0, 12.0)?;
        let days = julian_day(year, month + 1, 1) - julian_day(year, month, 1);
        check_range("date: day", day as f32, 1.0, days as f32)?;
        check_range("hour", hour, 0.0, 24.0)?;
        check_range("timezone", timezone, -14.0, 14.0)?;
        check_range("place: latitude", place[0], -90.0, 90.0)?;
        check_range("place: longitude", place[1], -180.0, 180.0)?;
        check_range("sun_scale", sun_scale, 0.0, 1e6)?;
        check_range("scale", scale, 0.0, 1e6)?;
        let sun = match parameters.sun_direction {
            Some(direction) => {
                Vec3::from(direction).as_dvec3().try_normalize().ok_or_else(|| {
                    format!("sun_direction = {direction:?}; expected a vector other than 0")
                })?
            }
            None => {
                let hours = f64::from(hour) - f64::from(timezone);
                let date = [year, month, day];
                let [north, east, up] =
                    Moment { date, hours, place_deg: place.map(f64::from) }.sun();
                DVec3::new(east, up, -north)
            }
        };
        let daylight = Daylight {
            up: Vec3::Y,
            sun: sun.as_vec3(),
            turbidity,
            albedo: albedo.into(),
            sky_scale: 1.0,
            sun_scale,
            sun_radius_rad: SUN_RADIUS_DEG.to_radians(),
        };
        Ok(daylight.map(scale))
    }
}
