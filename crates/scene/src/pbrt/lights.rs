//! Lights of a scene description → lamps and the environment map.
//!
//! pbrt-v4 divides the spectrum of a light by its luminance before it applies `scale`: that of `rgb`
//! by the luminance of the white alone, so that `rgb` 1 is radiance 1 in the picture, that of others by
//! their own. `spectra` returns colours to which this has been done.

use std::f64::consts::PI;

use glam::{DMat3, DMat4, DVec3, Mat3, Vec2, Vec3};
use rayon::prelude::*;

use super::{parameters::Entity, spectra, textures::Textures};
use crate::{
    EnvironmentMap, Lamp,
    error::Result,
    features,
    lamp::{LampKind, Spot, SpotFalloff},
    material::Emission,
    math::{colour::luminance, equal_area::square_from_direction, frame::direction_from_lat_long},
};

/// Largest side of an equal-area map, texels.
const MAX_SIDE: u32 = 8192;

#[derive(Default)]
pub(super) struct Lights {
    pub lamps: Vec<Lamp>,
    /// Radiance from everywhere.
    constant: Vec3,
    /// Equal-area maps as the files give them, and light from world.
    maps: Vec<(EnvironmentMap, DMat3)>,
}

fn color(entity: &Entity, name: &str, textures: &Textures) -> Result<Vec3> {
    let found = entity.find_of(name, &spectra::KINDS)?;
    found.map_or(Ok(Vec3::ONE), |parameter| spectra::light(parameter, &textures.log))
}

/// Light in the picture; the balance of white may leave the colours that there are.
fn exposed(sensor: Mat3, light: Vec3) -> Vec3 {
    let shown = sensor * light;
    if light.is_finite() && light.min_element() >= 0.0 { shown.max(Vec3::ZERO) } else { shown }
}

/// Reads the emission of a shape with this area, in the units of the scene.
pub(super) fn area_light(
    entity: &Entity,
    area: f64,
    sensor: Mat3,
    textures: &mut Textures,
) -> Result<Emission> {
    if entity.name != "diffuse" {
        return Err(entity.error("expected a diffuse light"));
    }
    let two_sided = entity.boolean("twosided", false)?;
    let mut scale = entity.number("scale", 1.0)?;
    let texture = textures.light_image(entity)?;
    if let Some(power) = entity.optional("power")?.filter(|power| *power > 0.0) {
        let sides = if two_sided { 2.0 } else { 1.0 };
        let mean = texture.as_ref().map_or(1.0, |image| luminance(image.mean().into()));
        scale *= power / (sides * area * PI * f64::from(mean));
    }
    if let (Some(_), Some(color)) = (&texture, entity.find("L")) {
        let message = "expected either `L` or `filename`, found both";
        return Err(color.place.error(format!("{}: {message}", entity.label())));
    }
    let radiance = exposed(sensor, color(entity, "L", textures)? * scale as f32);
    textures.log.unused(entity);
    if !radiance.is_finite() || radiance.min_element() < 0.0 {
        return Err(
            entity.error(format!("expected finite radiance of at least 0, found {radiance}"))
        );
    }
    Ok(Emission { radiance, texture, two_sided })
}

impl Lights {
    /// Adds a light. `world_from_light` leads to the renderer's world.
    pub(super) fn add(
        &mut self,
        entity: &Entity,
        world_from_light: DMat4,
        sensor: Mat3,
        textures: &mut Textures,
    ) -> Result<()> {
        let scale = entity.number("scale", 1.0)?;
        let power = entity.optional("power")?.filter(|power| *power > 0.0);
        let illuminance = entity.optional("illuminance")?.filter(|power| *power > 0.0);
        let from = entity.point("from", DVec3::ZERO)?;
        let to = entity.point("to", DVec3::Z)?;
        let place = |point: DVec3| world_from_light.transform_point3(point).as_vec3();
        let direction = |direction: DVec3| {
            let turned = world_from_light.transform_vector3(direction).try_normalize();
            let message = "`from` and `to` must differ";
            turned.map(DVec3::as_vec3).ok_or_else(|| entity.error(message))
        };
        let spot = |axis: DVec3, intensity: Vec3, [inner, outer]: [f64; 2]| -> Result<LampKind> {
            Ok(LampKind::Spot(Spot {
                position: place(from),
                direction: direction(axis)?,
                intensity,
                // A falloff needs some width.
                inner_angle_rad: inner.min(outer * (1.0 - 1e-4)) as f32,
                outer_angle_rad: outer as f32,
                falloff: SpotFalloff::SmoothCosine,
            }))
        };
        let kind = match entity.name.as_str() {
            "infinite" => {
                self.infinite(entity, world_from_light, scale, illuminance, sensor, textures)?;
                textures.log.unused(entity);
                return Ok(());
            }
            "distant" => {
                let factor = (scale * illuminance.unwrap_or(1.0)) as f32;
                let irradiance = exposed(sensor, color(entity, "L", textures)? * factor);
                LampKind::Directional { direction: direction(to - from)?, irradiance }
            }
            "point" | "goniometric" => {
                // pbrt takes the mean of the channels; a given power replaces it.
                let mean = match entity.name.as_str() {
                    "point" => 1.0,
                    _ => f64::from(mean_of_image(entity, textures)?.0.element_sum() / 3.0),
                };
                let factor = scale * power.map_or(mean, |power| power / (4.0 * PI));
                let intensity = exposed(sensor, color(entity, "I", textures)? * factor as f32);
                LampKind::Point { position: place(from), intensity }
            }
            "spot" => {
                // A turn and one size for all axes keep a cone round.
                let axes = DMat3::from_mat4(world_from_light);
                let square = axes.transpose() * axes;
                let size = square.x_axis.x;
                if !square.abs_diff_eq(DMat3::from_diagonal(DVec3::splat(size)), 1e-3 * size) {
                    let name = "stretch of LightSource `spot`";
                    textures.log.ignore_named(features::PBRT_LIGHT_IMAGE, name, &entity.place);
                }
                let outer = entity.number("coneangle", 30.0)?.clamp(0.01, 180.0);
                let inner = outer - entity.number("conedeltaangle", 5.0)?;
                let [inner, outer] = [inner.clamp(0.0, outer), outer].map(f64::to_radians);
                let cone = 2.0 * PI * (1.0 - 0.5 * (inner.cos() + outer.cos()));
                let factor = scale * power.map_or(1.0, |power| power / cone);
                let intensity = exposed(sensor, color(entity, "I", textures)? * factor as f32);
                spot(to - from, intensity, [inner, outer])?
            }
            "projection" => {
                let (mean, aspect) = mean_of_image(entity, textures)?;
                let tangent =
                    (0.5 * entity.number("fov", 90.0)?.clamp(0.01, 179.0)).to_radians().tan();
                let [wide, high] = [tangent * aspect.max(1.0), tangent * (1.0 / aspect).max(1.0)];
                // Solid angle of a rectangle seen from above its middle.
                let solid_angle = 4.0
                    * (wide * high / (1.0 + wide * wide).sqrt() / (1.0 + high * high).sqrt())
                        .asin();
                let outer = (1.0 - solid_angle / (2.0 * PI)).acos();
                let of_power =
                    |power: f64| power / (solid_angle * f64::from(luminance(mean)).max(1e-30));
                let factor = scale * power.map_or(1.0, of_power);
                spot(DVec3::Z, exposed(sensor, mean * factor as f32), [outer; 2])?
            }
            other => return Err(entity.error(format!("unknown light `{other}`"))),
        };
        textures.log.unused(entity);
        let (LampKind::Point { intensity: color, .. }
        | LampKind::Spot(Spot { intensity: color, .. })
        | LampKind::Directional { irradiance: color, .. }) = kind;
        if !color.is_finite() || color.min_element() < 0.0 {
            return Err(entity.error(format!("expected finite light of at least 0, found {color}")));
        }
        let name = format!("{} of line {}", entity.name, entity.place.line);
        self.lamps.push(Lamp { name, kind, light_group: None });
        Ok(())
    }

    fn infinite(
        &mut self,
        entity: &Entity,
        world_from_light: DMat4,
        scale: f64,
        illuminance: Option<f64>,
        sensor: Mat3,
        textures: &mut Textures,
    ) -> Result<()> {
        textures.log.ignore(features::PBRT_PORTAL, entity.place_of("portal"));
        let Some(file) = entity.string("filename")? else {
            // A hemisphere of radiance 1 gives an illuminance of π.
            let factor = scale * illuminance.map_or(1.0, |illuminance| illuminance / PI);
            self.constant += exposed(sensor, color(entity, "L", textures)? * factor as f32);
            return Ok(());
        };
        if let Some(color) = entity.find("L") {
            let message = "expected either `L` or `filename`, found both";
            return Err(color.place.error(format!("{}: {message}", entity.label())));
        }
        let path = textures.log.folder.file(file).map_err(|message| entity.error(message))?;
        let mut map = EnvironmentMap::read(&path, 1.0, &mut textures.log.warnings)
            .map_err(|error| entity.error(error.to_string()))?;
        if map.width != map.height || map.width > MAX_SIDE {
            return Err(entity.error(format!(
                "{}: expected a square equal-area map of at most {MAX_SIDE} texels a side, found \
                 {}×{}; pbrt's `imgtool makeequiarea` makes one of a lat-long map",
                path.display(),
                map.width,
                map.height
            )));
        }
        let light_from_world = DMat3::from_mat4(world_from_light).inverse();
        if !light_from_world.is_finite() {
            return Err(entity.error("the transformation of the light flattens space"));
        }
        let factor = scale
            * illuminance.map_or(1.0, |wanted| wanted / upper_illuminance(&map.texels, map.width));
        let texels = map.texels.iter_mut();
        texels.for_each(|texel| *texel = exposed(sensor, *texel * factor as f32));
        self.maps.push((map, light_from_world));
        textures.log.inputs.push(path);
        Ok(())
    }

    /// Sum of the infinite lights as one map. Fails for radiance that is not finite or negative.
    pub(super) fn environment(&mut self) -> Result<EnvironmentMap, String> {
        // Resample the largest first, and the others to its size.
        let side = self.maps.iter().map(|(map, _)| map.width).max().unwrap_or(0);
        let mut sum: Option<EnvironmentMap> = None;
        for (map, light_from_world) in self.maps.drain(..) {
            let texels = enlarge(map.texels, map.width, side);
            let map = resample(&texels, side, light_from_world.as_mat3(), map.source);
            match &mut sum {
                None => sum = Some(map),
                Some(sum) => {
                    sum.texels.iter_mut().zip(&map.texels).for_each(|(sum, texel)| *sum += *texel);
                }
            }
        }
        let Some(mut sum) = sum else { return EnvironmentMap::constant(self.constant, 1.0) };
        sum.texels.iter_mut().for_each(|texel| *texel += self.constant);
        let is_radiance = |texel: &Vec3| texel.is_finite() && texel.min_element() >= 0.0;
        if sum.texels.iter().all(is_radiance) {
            return Ok(sum);
        }
        Err(format!("{}: radiance that is not finite or negative", sum.source))
    }
}

/// Mean colour of the image of a lamp, and its width over its height.
fn mean_of_image(entity: &Entity, textures: &mut Textures) -> Result<(Vec3, f64)> {
    let Some(image) = textures.light_image(entity)? else {
        return Err(entity.error("expected the parameter `filename`"));
    };
    let name = format!("image of LightSource `{}`", entity.name);
    textures.log.ignore_named(features::PBRT_LIGHT_IMAGE, &name, &entity.place);
    let aspect = f64::from(image.texture.width) / f64::from(image.texture.height);
    Ok((image.mean().into(), aspect))
}

/// Repeats texels of a square map so that it has `wanted` rows.
fn enlarge(texels: Vec<Vec3>, side: u32, wanted: u32) -> Vec<Vec3> {
    if side == wanted {
        return texels;
    }
    let at = |index: u32| (u64::from(index) * u64::from(side) / u64::from(wanted)) as usize;
    let rows = (0..wanted).flat_map(|row| (0..wanted).map(move |column| (row, column)));
    rows.map(|(row, column)| texels[at(row) * side as usize + at(column)]).collect()
}

/// Illuminance of a plane that faces +z of a square equal-area map, as pbrt sums it: with 2π/N for the solid
/// angle of each of N texels, which is 4π/N, so that a light that states its illuminance has twice of that.
fn upper_illuminance(texels: &[Vec3], side: u32) -> f64 {
    let sum: f64 = (0..texels.len())
        .map(|index| {
            let index = index as u32;
            let [u, v] = [index % side, index / side]
                .map(|at| 2.0 * (f64::from(at) + 0.5) / f64::from(side) - 1.0);
            // Inside the diamond, the distance from its edge gives the height.
            let radius = u.abs() + v.abs();
            let cosine = if radius < 1.0 { 1.0 - radius * radius } else { 0.0 };
            cosine * f64::from(luminance(texels[index as usize]))
        })
        .sum();
    2.0 * PI * sum / texels.len() as f64
}

/// Points of a texel of the lat-long map, along each side, whose mean it is; toward the poles, where
/// texels are narrow, fewer in a row.
const POINTS: u32 = 6;
/// Share of the brightest by which centre and corners of a texel may differ for their mean to stand for it: a
/// texel of the lat-long map is smaller than one of the square.
const LIKE: f32 = 0.02;

/// Resamples a square equal-area map \[Clarberg 2008\] to a lat-long one, whose `texels` are those of `side`
/// rows. `light_from_world` turns a direction of the renderer to one of the map, up to its length.
///
/// Every texel is the mean of the map over points of it, and a factor for each channel keeps the mean
/// radiance of the sphere, which in an equal-area map is that of the texels.
fn resample(texels: &[Vec3], side: u32, light_from_world: Mat3, source: String) -> EnvironmentMap {
    let (width, height) = (2 * side.max(32), side.max(32));
    let lookup = |direction: Vec3| {
        let uv = square_from_direction((light_from_world * direction).normalize_or(Vec3::Z));
        let [column, row] =
            uv.to_array().map(|at| ((at * side as f32) as u32).min(side - 1) as usize);
        texels[row * side as usize + column]
    };
    let size = Vec2::new(width as f32, height as f32);
    let texel = |index: u32| {
        let corner = Vec2::new((index % width) as f32, (index / width) as f32);
        let at =
            |x: f32, y: f32| lookup(direction_from_lat_long((corner + Vec2::new(x, y)) / size));
        let few =
            [(0.5, 0.5), (0.1, 0.1), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9)].map(|(x, y)| at(x, y));
        let [least, most] = few
            .iter()
            .fold([few[0]; 2], |[least, most], texel| [least.min(*texel), most.max(*texel)]);
        if (most - least).cmple(LIKE * most).all() {
            return few.iter().sum::<Vec3>() / few.len() as f32;
        }
        let narrow = (std::f32::consts::PI * (corner.y + 0.5) / size.y).sin();
        let across = (POINTS as f32 * narrow).ceil() as u32;
        let point = |index: u32| {
            let inside = Vec2::new((index % across) as f32, (index / across) as f32) + 0.5;
            at(inside.x / across as f32, inside.y / POINTS as f32)
        };
        (0..across * POINTS).map(point).sum::<Vec3>() / (across * POINTS) as f32
    };
    let mut resampled: Vec<Vec3> = (0..width * height).into_par_iter().map(texel).collect();
    let row_mean = |row: usize| -> DVec3 {
        let texels = &resampled[row * width as usize..(row + 1) * width as usize];
        let edge = |row: usize| (PI * row as f64 / f64::from(height)).cos();
        let weight = 0.5 * (edge(row) - edge(row + 1)) / f64::from(width);
        texels.iter().map(|texel| texel.as_dvec3() * weight).sum()
    };
    let found: DVec3 = (0..height as usize).map(row_mean).sum();
    let expected: DVec3 = texels.iter().map(|texel| texel.as_dvec3()).sum();
    let expected = expected / texels.len() as f64;
    let factor = Vec3::from_array(std::array::from_fn(|channel| {
        let factor = (expected[channel] / found[channel]) as f32;
        if factor.is_finite() { factor } else { 1.0 }
    }));
    resampled.iter_mut().for_each(|texel| *texel *= factor);
    EnvironmentMap { width, height, texels: resampled, rotation_rad: 0.0, source }
}
