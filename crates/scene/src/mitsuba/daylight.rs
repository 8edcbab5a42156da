//! The emitters `sunsky` of version 3, and `sky`, `sun` and `sunsky` of version 0.6 → an environment map.

use glam::{DMat4, DVec3, Vec3};

use super::{
    Reader,
    parameters::Parameters,
    spectra::{self, Role},
    transforms::turned,
};
use crate::{
    EnvironmentMap,
    environment::{Daylight, Moment, SUN_RADIUS_DEG},
    error::Result,
    features,
};

impl Reader {
    pub(super) fn daylight(&mut self, parameters: &Parameters<'_>) -> Result<EnvironmentMap> {
        let node = parameters.node;
        let is_old = node.version() < 2.0;
        let matrix = parameters.transform("to_world")?;
        // The zenith is +Z, in version 0.6 +Y.
        let up = turned(node, matrix, if is_old { DVec3::Y } else { DVec3::Z })?;
        let sun = match parameters.vector("sun_direction")? {
            Some(direction) => {
                let direction = direction.as_dvec3();
                let matrix = if is_old { matrix } else { DMat4::IDENTITY };
                let direction = matrix.transform_vector3(direction).try_normalize();
                direction
                    .ok_or_else(|| node.error("sun_direction: expected a vector other than 0"))?
            }
            None => {
                let [north, east, up] = moment(parameters)?.sun();
                let [old, new] = [DVec3::new(east, up, -north), DVec3::new(-north, -east, up)];
                turned(node, matrix, if is_old { old } else { new })?
            }
        };
        let positive = (0.0, f32::MAX);
        let scale = parameters.float_in("scale", positive)?.unwrap_or(1.0);
        let sky_scale = parameters.float_in("sky_scale", positive)?.unwrap_or(scale);
        let sun_scale = parameters.float_in("sun_scale", positive)?.unwrap_or(scale);
        let radius_scale = parameters.float_in("sun_radius_scale", (1e-3, 100.0))?.unwrap_or(1.0);
        let aperture = parameters.float_in("sun_aperture", (1e-2, 90.0))?;
        let aperture = aperture.unwrap_or(2.0 * SUN_RADIUS_DEG) * radius_scale;
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
        parameters.without_effect("resolution extend sun_samples");
        let daylight = Daylight {
            up: up.as_vec3(),
            sun: sun.as_vec3(),
            turbidity: parameters.float_in("turbidity", (1.0, 10.0))?.unwrap_or(3.0),
            albedo: albedo.clamp(Vec3::ZERO, Vec3::ONE),
            sky_scale: if node.kind() == "sun" { 0.0 } else { sky_scale },
            sun_scale: if node.kind() == "sky" { 0.0 } else { sun_scale },
            sun_radius_rad: (0.5 * aperture).to_radians(),
        };
        Ok(daylight.map(1.0))
    }
}

fn moment(parameters: &Parameters<'_>) -> Result<Moment> {
    let number =
        |name: &str, default: f32| Ok(f64::from(parameters.float(name)?.unwrap_or(default)));
    let date = [number("year", 2010.0)?, number("month", 7.0)?, number("day", 10.0)?];
    let (hour, minute, second) =
        (number("hour", 15.0)?, number("minute", 0.0)?, number("second", 0.0)?);
    Ok(Moment {
        date: date.map(|number| number as i64),
        hours: hour - number("timezone", 9.0)? + (minute + second / 60.0) / 60.0,
        place_deg: [number("latitude", 35.6894)?, number("longitude", 139.6917)?],
    })
}
