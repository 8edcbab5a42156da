//! The emitters `sunsky` of version 3, and `sky`, `sun` and `sunsky` of version 0.6 → an environment map.

use glam::{DMat4, DVec3, Vec3};

use super::{
    Reader,
    parameters::Parameters,
    spectra::{self, Role},
};
use crate::{EnvironmentMap, environment::Daylight, error::Result, features};

/// Diameter of the sun, degrees.
const SUN_APERTURE_DEG: f32 = 0.5358;
/// Earth's radius over its distance from the sun, which is the sun's parallax.
const PARALLAX: f64 = 6371.01 / 149_597_890.0;

impl Reader<'_> {
    /// Reads the emitter as a map.
    pub(super) fn daylight(&mut self, parameters: &Parameters<'_>) -> Result<EnvironmentMap> {
        let node = parameters.node;
        let is_old = node.version() < 2.0;
        let matrix = parameters.transform("to_world")?;
        // The zenith is +Z, in version 0.6 +Y.
        let turned = |direction: DVec3| {
            let direction = matrix.transform_vector3(direction).try_normalize();
            direction.ok_or_else(|| node.error("to_world: expected a matrix with an inverse"))
        };
        let up = turned(if is_old { DVec3::Y } else { DVec3::Z })?;
        let sun = match parameters.vector("sun_direction")? {
            Some(direction) => {
                let direction = direction.as_dvec3();
                let matrix = if is_old { matrix } else { DMat4::IDENTITY };
                let direction = matrix.transform_vector3(direction).try_normalize();
                direction
                    .ok_or_else(|| node.error("sun_direction: expected a vector other than 0"))?
            }
            None => {
                let [zenith, azimuth] = sun_of_date(parameters)?;
                let (sine, cosine) = zenith.sin_cos();
                let (along, across) = (azimuth.cos() * sine, azimuth.sin() * sine);
                // The azimuth is measured from north.
                turned(if is_old {
                    DVec3::new(across, cosine, -along)
                } else {
                    DVec3::new(-along, -across, cosine)
                })?
            }
        };
        let positive = (0.0, f32::MAX);
        let scale = parameters.float_in("scale", positive)?.unwrap_or(1.0);
        let sky_scale = parameters.float_in("sky_scale", positive)?.unwrap_or(scale);
        let sun_scale = parameters.float_in("sun_scale", positive)?.unwrap_or(scale);
        let radius_scale = parameters.float_in("sun_radius_scale", (1e-3, 100.0))?.unwrap_or(1.0);
        let aperture = parameters.float_in("sun_aperture", (1e-2, 90.0))?;
        let aperture = aperture.unwrap_or(SUN_APERTURE_DEG) * radius_scale;
        let albedo = spectra::parameter(parameters, "albedo", Role::Reflectance)?;
        let albedo = albedo.unwrap_or(Vec3::splat(if is_old { 0.15 } else { 0.3 }));
        if parameters.boolean("complex_sun")? == Some(true) {
            let name = "`complex_sun` of `sunsky`";
            self.ignored.add_named(features::MI_PARAMETER, name, || node.place());
        }
        if parameters.float("stretch")?.is_some_and(|stretch| stretch != 1.0) {
            let name = format!("`stretch` of `{}`", node.kind());
            self.ignored.add_named(features::MI_PARAMETER, &name, || node.place());
        }
        parameters.without_effect(&["resolution", "extend", "sun_samples"]);
        let daylight = Daylight {
            up: up.as_vec3(),
            sun: sun.as_vec3(),
            turbidity: parameters.float_in("turbidity", (1.0, 10.0))?.unwrap_or(3.0),
            albedo: albedo.clamp(Vec3::ZERO, Vec3::ONE),
            sky_scale: if node.kind() == "sun" { 0.0 } else { sky_scale },
            sun_scale: if node.kind() == "sky" { 0.0 } else { sun_scale },
            sun_radius_rad: (0.5 * aperture).to_radians(),
        };
        Ok(daylight.map())
    }
}

/// Angle of the sun from the zenith, and its azimuth from north over east, at a date and place
/// \[Blanco-Muriel et al. 2001\].
fn sun_of_date(parameters: &Parameters<'_>) -> Result<[f64; 2]> {
    let number =
        |name: &str, default: f32| Ok(f64::from(parameters.float(name)?.unwrap_or(default)));
    let (year, month, day) = (number("year", 2010.0)?, number("month", 7.0)?, number("day", 10.0)?);
    let (hour, minute, second) =
        (number("hour", 15.0)?, number("minute", 0.0)?, number("second", 0.0)?);
    let (latitude, longitude) = (number("latitude", 35.6894)?, number("longitude", 139.6917)?);
    let hours = hour - number("timezone", 9.0)? + (minute + second / 60.0) / 60.0;
    // The Julian day of a date of our calendar, in whole numbers.
    let [year, month, day] = [year, month, day].map(|number| number as i64);
    let century = (month - 14) / 12;
    let noon = 1461 * (year + 4800 + century) / 4 + 367 * (month - 2 - 12 * century) / 12
        - 3 * ((year + 4900 + century) / 100) / 4
        + day
        - 32075;
    let days = noon as f64 - 0.5 + hours / 24.0 - 2_451_545.0;

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
    let azimuth = (-hour_angle.sin()).atan2(declination.tan() * cosine - sine * hour_angle.cos());
    Ok([zenith + PARALLAX * zenith.sin(), azimuth])
}
