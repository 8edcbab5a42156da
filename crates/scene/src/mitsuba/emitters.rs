//! Lights: lamps, the environment, and the emission of shapes; media inside these.
//!
//! Mitsuba's texel columns have centres at (i + ½)/width as Fenestra's, but its rows lie at
//! j/(height − 1), on the poles too. Its middle looks along +Z, Fenestra's along −Z. The emitters `sunsky` of
//! version 3, and `sky`, `sun` and `sunsky` of version 0.6, become a map too.

use std::{f32::consts::PI, path::Path};

use glam::{DMat3, DMat4, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::{
    Reader,
    document::Node,
    parameters::{Parameters, turned},
    spectra::{self, Role},
};
use crate::{
    EnvironmentMap, Lamp,
    environment::{Daylight, Moment, SUN_RADIUS_DEG},
    error::Result,
    features,
    import::Value,
    lamp::{LampKind, Spot, SpotFalloff},
    material::{Emission, MaterialKind},
    math::frame::direction_from_lat_long,
};

impl Reader {
    /// Reads an emitter that belongs to no shape.
    pub(super) fn emitter(&mut self, node: Node<'_>) -> Result<()> {
        let parameters = Parameters::new(node);
        let map = match node.kind() {
            "constant" => {
                let map = EnvironmentMap::constant(light(&parameters, "radiance")?, 1.0);
                Some(map.map_err(|message| node.error(message))?)
            }
            "envmap" => match self.environment_map(&parameters)? {
                None => return Ok(()),
                map => map,
            },
            "sunsky" | "sky" | "sun" => Some(self.daylight(&parameters)?),
            _ => None,
        };
        let kind = match node.kind() {
            _ if map.is_some() => None,
            "point" => Some(point(&parameters)?),
            "spot" => Some(self.spot(&parameters)?),
            "directional" | "distant" => Some(directional(&parameters)?),
            // Shapes that refer to it read it.
            "area" if node.attribute("id").is_some() => return Ok(()),
            "area" => return Err(node.error("an area light must stand in a shape")),
            found => {
                let name = format!("emitter `{found}`");
                self.ignored.add_named(features::MI_EMITTER, &name, || node.place());
                return Ok(());
            }
        };
        parameters.without_effect("sampling_weight");
        parameters.finish(&mut self.ignored);
        if let Some(kind) = kind {
            let name = node.attribute("id").unwrap_or_default().to_owned();
            self.lamps.push(Lamp { name, kind, light_group: None });
        }
        if map.is_some() && std::mem::replace(&mut self.environment, map).is_some() {
            return Err(node.error("expected at most one envmap or constant, found another"));
        }
        Ok(())
    }

    /// Map of an emitter; none of a file that is not there.
    fn environment_map(&mut self, parameters: &Parameters<'_>) -> Result<Option<EnvironmentMap>> {
        let node = parameters.node;
        let name = parameters.required("filename", parameters.string("filename")?)?;
        let Some(path) = node.file_if_there(name)? else {
            let name = format!("emitter `envmap` of `{name}`, which is not there");
            self.ignored.add_named(features::MI_EMITTER, &name, || node.place());
            return Ok(None);
        };
        let scale = parameters.float_in("scale", (0.0, f32::MAX))?.unwrap_or(1.0);
        let matrix = parameters.transform("to_world")?;
        parameters.without_effect("mis_compensation cache gamma");
        let map = load_map(&path, scale, matrix, &mut self.warnings)?;
        self.inputs.push(path);
        let message = "to_world: expected a rotation, found a matrix without inverse";
        map.map(Some).ok_or_else(|| node.error(message))
    }

    fn spot(&mut self, parameters: &Parameters<'_>) -> Result<LampKind> {
        let node = parameters.node;
        let matrix = parameters.transform("to_world")?;
        let outer = parameters.float_in("cutoff_angle", (0.01, 179.0))?.unwrap_or(20.0);
        let inner = parameters.float_in("beam_width", (0.0, 179.0))?.unwrap_or(0.75 * outer);
        let texture = self.value(parameters, "texture", Role::Reflectance)?;
        if matches!(texture, Some(Value::Image(_))) {
            self.ignored.add(features::MI_SPOT_TEXTURE, || node.place());
        }
        let factor = texture.map_or(Vec3::ONE, |texture| texture.mean());
        Ok(LampKind::Spot(Spot {
            position: matrix.w_axis.truncate().as_vec3(),
            direction: turned(node, matrix, DVec3::Z)?.as_vec3(),
            intensity: light(parameters, "intensity")? * factor,
            // A sharp edge is a steep one.
            inner_angle_rad: inner.min(0.999 * outer).to_radians(),
            outer_angle_rad: outer.to_radians(),
            falloff: SpotFalloff::LinearAngle,
        }))
    }

    /// Reads the light of a shape; none if it is of another kind, which is named.
    pub(super) fn emission(&mut self, node: Node<'_>) -> Result<Option<Emission>> {
        if node.kind() != "area" {
            let name = format!("emitter `{}` of a shape", node.kind());
            self.ignored.add_named(features::MI_EMITTER, &name, || node.place());
            return Ok(None);
        }
        let parameters = Parameters::new(node);
        let value = self.value_or(&parameters, "radiance", Role::Light, 1.0)?;
        parameters.without_effect("sampling_weight");
        parameters.finish(&mut self.ignored);
        if matches!(value, Value::Vertices(_)) {
            let name = "emitter `area` of the colours of vertices";
            self.ignored.add_named(features::MI_EMITTER, name, || node.place());
            return Ok(None);
        }
        let (radiance, texture) = value.split();
        Ok(Some(Emission { radiance, texture, two_sided: false }))
    }

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

    /// Lets a dielectric absorb as the medium inside it does; names a medium that scatters, or that
    /// another surface bounds.
    pub(super) fn fill(&mut self, kind: &mut MaterialKind, medium: Node<'_>) -> Result<()> {
        match (kind, self.absorption(medium)?) {
            (MaterialKind::Dielectric { absorption, .. }, Some(found)) => *absorption = found,
            _ => self.ignored.add(features::MI_MEDIUM, || medium.place()),
        }
        Ok(())
    }

    /// Absorption coefficient, per metre, of a medium that scatters no light.
    fn absorption(&mut self, medium: Node<'_>) -> Result<Option<Vec3>> {
        if medium.kind() != "homogeneous" {
            return Ok(None);
        }
        let parameters = Parameters::new(medium);
        let color = |name: &str| spectra::parameter(&parameters, name, Role::Index);
        // Mitsuba 0.6 names absorption and scattering, Mitsuba 3 their sum and the share of scattering.
        let (absorption, scattered) = match color("sigma_a")? {
            Some(absorption) => (absorption, color("sigma_s")?.unwrap_or(Vec3::ZERO)),
            None => {
                let albedo = color("albedo")?.unwrap_or(Vec3::splat(0.75));
                (color("sigma_t")?.unwrap_or(Vec3::ONE), albedo)
            }
        };
        let scale = parameters.float_in("scale", (0.0, 1e6))?.unwrap_or(1.0);
        if scattered != Vec3::ZERO {
            return Ok(None);
        }
        parameters.objects("phase")?;
        parameters.without_effect("sample_emitters");
        parameters.finish(&mut self.ignored);
        Ok(Some((scale * absorption).clamp(Vec3::ZERO, Vec3::splat(1e6))))
    }
}

fn light(parameters: &Parameters<'_>, name: &str) -> Result<Vec3> {
    Ok(spectra::parameter(parameters, name, Role::Light)?.unwrap_or(Vec3::ONE))
}

fn point(parameters: &Parameters<'_>) -> Result<LampKind> {
    let position = match parameters.vector("position")? {
        Some(position) => position,
        None => parameters.transform("to_world")?.w_axis.truncate().as_vec3(),
    };
    Ok(LampKind::Point { position, intensity: light(parameters, "intensity")? })
}

fn directional(parameters: &Parameters<'_>) -> Result<LampKind> {
    let node = parameters.node;
    let direction = match parameters.vector("direction")? {
        Some(direction) => direction
            .try_normalize()
            .ok_or_else(|| node.error("direction: expected a vector other than 0, found 0 0 0"))?,
        None => turned(node, parameters.transform("to_world")?, DVec3::Z)?.as_vec3(),
    };
    Ok(LampKind::Directional { direction, irradiance: light(parameters, "irradiance")? })
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

/// Most texels for which rows are doubled to keep the file's sharpness.
const MAX_DOUBLED_TEXELS: usize = 1 << 26;
/// Rounding of half precision in a mean of rows.
const MEAN_TOLERANCE: f32 = 2e-3;
/// Tilt of the vertical axis that counts as rounding of the file.
const AXIS_TOLERANCE: f64 = 1e-4;

/// Reads a map and turns it by the rotation of `matrix`; none if the matrix has no inverse. Fails as
/// [`EnvironmentMap::load`].
fn load_map(
    path: &Path,
    scale: f32,
    matrix: DMat4,
    warnings: &mut Vec<String>,
) -> Result<Option<EnvironmentMap>> {
    let mut own = Vec::new();
    let mut map = EnvironmentMap::load(path, scale, &mut own)?;
    if let Some(texels) = halved(&map) {
        map.texels = texels;
        map.height /= 2;
        // The file's rows were more than twice as many as they tell.
        own.retain(|warning| !warning.contains("twice as wide"));
    } else {
        map.texels = resampled_rows(&map);
        map.height = (map.texels.len() / map.width as usize) as u32;
    }
    warnings.append(&mut own);
    let linear = DMat3::from_mat4(matrix);
    let axes = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::try_normalize);
    let [Some(x), Some(y), Some(z)] = axes else { return Ok(None) };
    let turned = DMat3::from_cols(x, y, z);
    if turned.determinant().abs() < 1e-6 {
        return Ok(None);
    }
    if y.distance(DVec3::Y) < AXIS_TOLERANCE && turned.determinant() > 0.0 {
        map.rotation_rad = (z.x.atan2(z.z) as f32 + PI).rem_euclid(2.0 * PI);
        return Ok(Some(map));
    }
    map.rotation_rad = PI;
    let map_from_world = turned.inverse();
    let (width, height) = (map.width as usize, map.height as usize);
    let size = Vec2::new(width as f32, height as f32);
    let texel = |index: usize| {
        let at = Vec2::new((index % width) as f32, (index / width) as f32);
        let direction = direction_from_lat_long((at + 0.5) / size);
        let own = map_from_world * direction.as_dvec3();
        map.radiance(own.normalize_or(DVec3::Y).as_vec3())
    };
    let texels = (0..width * height).into_par_iter().map(texel).collect();
    warnings.push(format!(
        "{}: turned about another axis than +Y, or mirrored; resampled at its {width}×{height} \
         texels",
        path.display()
    ));
    Ok(Some(EnvironmentMap { texels, rotation_rad: 0.0, ..map }))
}

/// Rows of a map that Fenestra has exported: the odd ones, if all even ones are means of them.
fn halved(map: &EnvironmentMap) -> Option<Vec<Vec3>> {
    let (width, height) = (map.width as usize, map.height as usize);
    if height < 3 || height.is_multiple_of(2) {
        return None;
    }
    let row = |index: usize| &map.texels[index * width..(index + 1) * width];
    let is_mean = |index: usize| {
        let above = row(if index == 0 { 1 } else { index - 1 });
        let below = row(if index + 1 == height { index - 1 } else { index + 1 });
        row(index).iter().zip(above.iter().zip(below)).all(|(own, (above, below))| {
            let mean = 0.5 * *above + 0.5 * *below;
            own.abs_diff_eq(mean, MEAN_TOLERANCE * mean.max_element())
        })
    };
    let are_means = (0..height).step_by(2).all(is_mean);
    are_means.then(|| (1..height).step_by(2).flat_map(|index| row(index).to_vec()).collect())
}

/// Rows at the heights of Fenestra's, twice as many, so that little sharpness is lost: between two rows
/// of the file, those at ¼ and ¾.
fn resampled_rows(map: &EnvironmentMap) -> Vec<Vec3> {
    let (width, height) = (map.width as usize, map.height as usize);
    if height < 2 {
        return map.texels.clone();
    }
    let doubled = 2 * (height - 1);
    let rows = if width * doubled <= MAX_DOUBLED_TEXELS { doubled } else { height };
    let mut texels = Vec::with_capacity(width * rows);
    for row in 0..rows {
        let place = (row as f64 + 0.5) / rows as f64 * (height - 1) as f64;
        let above = (place as usize).min(height - 2);
        let share = (place - above as f64) as f32;
        let of_row = |row: usize| &map.texels[row * width..(row + 1) * width];
        let pairs = of_row(above).iter().zip(of_row(above + 1));
        texels.extend(pairs.map(|(above, below)| above.lerp(*below, share)));
    }
    texels
}
