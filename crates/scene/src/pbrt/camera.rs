//! Camera, film and filter of a scene description.

use glam::{DMat3, DMat4, DVec2, DVec3, Mat3};

use super::{
    directives::Description,
    parameters::{Entity, Kind, Log},
};
use crate::{
    FilmSettings, Filter, error::Result, features, file::CameraEntry, import::FAR,
    spectrum::white_balance,
};

/// Viewer and image plane.
pub(super) struct View {
    /// Camera in the space of the renderer, if the file has one.
    pub camera: Option<CameraEntry>,
    pub film: FilmSettings,
    /// Light of the picture from that of the scene.
    pub sensor: Mat3,
    /// Renderer from the world of the file: the identity or a mirror.
    pub mirror: DMat4,
}

/// Reads camera, film and filter.
///
/// pbrt looks along +z with +x to the right and +y up, so that a camera without a mirror shows a
/// left-handed world. The renderer is right-handed. If the camera does not mirror already, the whole
/// world is mirrored in z, and the picture is the same.
pub(super) fn view(description: &Description, log: &mut Log) -> Result<View> {
    let (film, mut sensor, crop) = film(description, log)?;
    let left_handed = DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
    let Some((entity, camera_from_world)) = &description.camera else {
        return Ok(View { camera: None, film, sensor, mirror: left_handed });
    };
    match entity.name.as_str() {
        "perspective" => {}
        "orthographic" | "spherical" | "realistic" => {
            let way = if entity.name == "orthographic" { "from afar" } else { "of 90°" };
            let name = format!("Camera `{}`: `perspective` {way} instead", entity.name);
            log.ignore_named(features::PBRT_CAMERA, &name, &entity.place);
            entity.without_effect("mapping lensfile aperturediameter aperture focusdistance");
        }
        _ => return Err(entity.error("expected a perspective camera")),
    }
    let world_from_camera = camera_from_world.inverse();
    let determinant = world_from_camera.determinant();
    if !world_from_camera.is_finite() || determinant == 0.0 {
        return Err(entity.error("the transformation of the camera flattens space"));
    }
    let mirror = if determinant > 0.0 { left_handed } else { DMat4::IDENTITY };
    let open = entity.number("shutteropen", 0.0)?;
    let time = entity.number("shutterclose", 1.0)? - open;
    if time <= 0.0 {
        return Err(entity.error("the shutter closes before it opens"));
    }
    sensor *= time as f32;
    let (vertical_fov_deg, shift, back) = window(entity, &crop, log)?;
    let moved_back = DMat4::from_translation(-back * DVec3::Z);
    let renderer_from_camera = mirror * world_from_camera * moved_back;
    let position = renderer_from_camera.w_axis.truncate();
    let axis = |axis: DVec3| renderer_from_camera.transform_vector3(axis);
    // Look at a point so far away that single precision keeps the direction.
    let distance = position.length().max(1.0);
    let forward = axis(DVec3::Z);
    let focal = entity.number("focaldistance", 1e6)?;
    let lens = entity.number("lensradius", 0.0)? * (1.0 + back / focal.max(1e-6));
    let aperture_radius = lens * axis(DVec3::X).length();
    let focus_distance = (focal + back) * forward.length();
    let camera = CameraEntry {
        position: position.as_vec3().to_array(),
        look_at: (position + distance * forward.normalize_or_zero()).as_vec3().to_array(),
        up: axis(DVec3::Y).normalize_or_zero().as_vec3().to_array(),
        vertical_fov_deg: vertical_fov_deg as f32,
        aperture_radius: aperture_radius as f32,
        focus_distance: Some(focus_distance as f32),
        shift: shift.map(|share| share as f32),
        mirrored: false,
    };
    log.unused(entity);
    Ok(View { camera: Some(camera), film, sensor, mirror })
}

/// Part of a film that is rendered.
struct Crop {
    /// Pixels of the whole film.
    whole: DVec2,
    /// First pixel from the upper left corner, and the one past the last.
    bounds: [DVec2; 2],
}

/// Field of view from bottom to top, degrees, shift of the lens, and the way back from which it sees as an
/// orthographic camera does; `fov` is that of the shorter side of the whole film.
fn window(entity: &Entity, crop: &Crop, log: &mut Log) -> Result<(f64, [f64; 2], f64)> {
    let aspect = crop.whole.x / crop.whole.y;
    let fov = entity.number("fov", 90.0)?;
    if !(fov > 0.0 && fov < 180.0) {
        return Err(entity.error(format!("expected a `fov` from 0 to 180 degrees, found {fov}")));
    }
    let own = entity.optional("frameaspectratio")?;
    if own.is_some_and(|own| (own - aspect).abs() > 1e-3 * aspect) {
        log.ignore(features::PBRT_ASPECT, entity.place_of("frameaspectratio"));
    }
    let mut height = if aspect >= 1.0 { 2.0 } else { 2.0 / aspect };
    let mut shift = DVec2::ZERO;
    if let [left, right, bottom, top] = *entity.numbers("screenwindow", Kind::Float)? {
        height = top - bottom;
        if height <= 0.0 {
            return Err(entity.error("expected a `screenwindow` with a height above 0"));
        }
        shift = DVec2::new(left + right, bottom + top) * 0.5 / height;
        if ((right - left) / height - aspect).abs() > 1e-3 * aspect {
            log.ignore(features::PBRT_SCREEN_WINDOW, entity.place_of("screenwindow"));
        }
    }
    // The window is that of the whole film.
    let [low, high] = crop.bounds;
    let share = (high.y - low.y) / crop.whole.y;
    let middle = (0.5 * (low + high) - 0.5 * crop.whole) / crop.whole.y;
    let (half, back) = match entity.name.as_str() {
        "orthographic" => (1.0 / (FAR * height), FAR * height),
        _ => ((0.5 * fov).to_radians().tan(), 0.0),
    };
    let tangent = half * 0.5 * height * share;
    let shift = (shift + DVec2::new(middle.x, -middle.y)) / share;
    Ok(((2.0 * tangent.atan()).to_degrees(), shift.to_array(), back))
}

/// Film, the light that its sensor makes of that of the scene, and the part that the film is of a whole one.
fn film(description: &Description, log: &mut Log) -> Result<(FilmSettings, Mat3, Crop)> {
    let mut film = FilmSettings { width: 1280, height: 720, filter: filter(description, log)? };
    let mut sensor = Mat3::IDENTITY;
    let mut bounds = None;
    if let Some(entity) = &description.film {
        let side = |name: &str, otherwise: u32| {
            let found = entity.number(name, f64::from(otherwise))?;
            if found >= 1.0 && found <= f64::from(u32::MAX) {
                return Ok(found as u32);
            }
            Err(entity.error(format!("`{name}`: expected pixels, found {found}")))
        };
        film.width = side("xresolution", film.width)?;
        film.height = side("yresolution", film.height)?;
        // With iso 100 and an open time of 1, the sensor `cie1931` gives radiance as it is.
        let exposure = entity.number("iso", 100.0)? / 100.0;
        if !(exposure >= 0.0 && exposure.is_finite()) {
            return Err(entity.error("`iso`: expected a number of at least 0"));
        }
        let kelvin = entity.number("whitebalance", 0.0)?;
        let balance = if kelvin > 0.0 { white_balance(kelvin) } else { DMat3::IDENTITY };
        sensor = (balance * exposure).as_mat3();
        if !sensor.is_finite() {
            let message = format!("`whitebalance`: expected a temperature, found {kelvin}");
            return Err(entity.error(message));
        }
        if let Some(sensor) = entity.find("sensor")
            && sensor.text() != "cie1931"
        {
            let name = format!("sensor `{}`", sensor.text());
            log.ignore_named(features::PBRT_SENSOR, &name, &sensor.place);
        }
        let size = DVec2::new(film.width.into(), film.height.into());
        if let [left, right, top, bottom] = *entity.numbers("pixelbounds", Kind::Integer)? {
            bounds = Some([DVec2::new(left, top), DVec2::new(right, bottom)]);
        }
        if let [left, right, top, bottom] = *entity.numbers("cropwindow", Kind::Float)? {
            let pixel = |x, y| (DVec2::new(x, y) * size).ceil();
            bounds = Some([pixel(left, top), pixel(right, bottom)]);
        }
        let most = entity.place_of("maxcomponentvalue");
        log.ignore_named(features::PBRT_FILM, "`maxcomponentvalue` of the film", most);
        // No part of the picture.
        entity.without_effect("filename savefp16 diagonal coordinatesystem");
        log.unused(entity);
    }
    let whole = DVec2::new(film.width.into(), film.height.into());
    let [low, high] = bounds.unwrap_or([DVec2::ZERO, whole]).map(|at| at.clamp(DVec2::ZERO, whole));
    let size = high - low;
    if let (Some(entity), true) = (&description.film, size.min_element() < 1.0) {
        return Err(entity.error(format!("expected a crop of at least a pixel, found {size}")));
    }
    (film.width, film.height) = (size.x as u32, size.y as u32);
    Ok((film, sensor, Crop { whole, bounds: [low, high] }))
}

fn filter(description: &Description, log: &mut Log) -> Result<Filter> {
    let Some(entity) = &description.filter else { return Ok(Filter::Gaussian) };
    let (filter, radius, sigma) = match entity.name.as_str() {
        "box" => (Filter::Box, 0.5, None),
        "gaussian" => (Filter::Gaussian, 1.5, Some(0.5)),
        "triangle" | "mitchell" | "sinc" => {
            let name = format!("PixelFilter `{}`", entity.name);
            log.ignore_named(features::PBRT_FILTER, &name, &entity.place);
            return Ok(Filter::Gaussian);
        }
        other => return Err(entity.error(format!("unknown filter `{other}`"))),
    };
    let is_same = |name: &str, own: f64| Ok((entity.number(name, own)? - own).abs() < 1e-6);
    let mut is_exact = is_same("xradius", radius)? && is_same("yradius", radius)?;
    if let Some(sigma) = sigma {
        is_exact &= is_same("sigma", sigma)?;
    }
    if !is_exact {
        let name = format!("radius of PixelFilter `{}`", entity.name);
        log.ignore_named(features::PBRT_FILTER, &name, &entity.place);
    }
    log.unused(entity);
    Ok(filter)
}
