//! pbrt-v4 scene descriptions: one `.pbrt` file, and a folder of the same name beside it with the
//! environment (`environment.exr`), images of textures, and binary PLY meshes, a few for each material.
//!
//! Deviations from Fenestra's own picture, each a warning where it applies:
//! - `coateddiffuse` lets light bounce between coat and base at random; its base is chosen so that the
//!   same colour shows through a smooth coat.
//! - A `conductor` has Fresnel's equations, never Schlick's approximation.
//! - Principled materials become a conductor or a `coateddiffuse`, measured ones diffuse.
//! - Further ones are where the warnings are, in `materials` and here.
//!
//! Differences too small for a warning: the environment is resampled to an equal-area map, whose nearest
//! texel pbrt looks up; pbrt subtracts from its Gaussian filter the value at 1.5 pixels.

mod materials;

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use self::materials::{Model, Translator, rgb};
use super::{
    Export, Settings,
    folder::{Folder, identifier},
    has_media, has_panes,
    images::Pictures,
    left_out, parts,
    subject::Subject,
};
use crate::{
    Camera, EnvironmentMap, FilmSettings, Filter, Lamp, Scene,
    error::Result,
    files,
    lamp::{LampKind, SpotFalloff},
    math::equal_area::direction_from_square,
};

/// Translates the materials and lamps for a scene file at `path`, without writing anything.
pub fn export<'a>(scene: &'a Scene, path: &Path, settings: Settings) -> Export<'a> {
    let folder = Folder::beside(path, escaped);
    let (mut warnings, mut pictures) = (Vec::new(), Pictures::default());
    let parts = parts::divide(scene);
    let models = scene.materials.iter().zip(&parts).enumerate();
    let models = models.map(|(index, (material, parts))| {
        let translator = Translator {
            subject: Subject::new("pbrt", material, parts, &mut warnings),
            id: identifier(index, &material.name),
            folder: &folder,
            pictures: &mut pictures,
            textures: String::new(),
            base: None,
        };
        translator.model()
    });
    let models: Vec<Model> = models.collect();
    let lamps: String = scene.lamps.iter().map(|lamp| light_source(lamp, &mut warnings)).collect();
    if !scene.lamps.is_empty() && has_panes(scene) {
        warnings.push("lamps: their light goes through panes, which stop it in pbrt".to_owned());
    }
    warnings.extend(left_out(scene, path));
    let path = path.to_owned();
    Export::new(warnings, move || {
        let mut text = format!("# Written by Fenestra {}.\n", env!("CARGO_PKG_VERSION"));
        text += &view(scene, settings, &folder.name);
        text += "\nWorldBegin\n";
        text += &write_environment(&scene.environment, &folder)?;
        text += &lamps;
        pictures.write(&folder.path)?;
        for (index, parts) in parts.iter().enumerate() {
            let model = &models[index];
            if parts.each().next().is_none() {
                continue;
            }
            let id = identifier(index, &scene.materials[index].name);
            text +=
                &format!("{}AttributeBegin\nNamedMaterial \"{id}\"\n{}", model.text, model.light);
            if let Some(absorption) = scene.materials[index].kind.absorption() {
                let sigmas = rgb("sigma_a", absorption) + &rgb("sigma_s", Vec3::ZERO);
                text += &format!(
                    "MakeNamedMedium \"{id}\" \"string type\" \"homogeneous\"{sigmas}\n\
                     MediumInterface \"{id}\" \"\"\n"
                );
            }
            for (part, is_flat) in parts.each() {
                let name = format!("{id}{}.ply", if is_flat { "_flat" } else { "" });
                let file = folder.write_mesh(&name, part, is_flat, model.attributes)?;
                let alpha = &model.alpha;
                text += &format!("Shape \"plymesh\" \"string filename\" \"{file}\"{alpha}\n");
            }
            text += "AttributeEnd\n";
        }
        files::write_text(&path, &text)
    })
}

/// Camera, film, filter and sampler. pbrt's camera looks along +z with +x to the right, so that a
/// mirror makes it one of a right-handed world. `fov` is that of the shorter side.
fn view(scene: &Scene, settings: Settings, name: &str) -> String {
    let Camera { position, look_at, up, .. } = scene.camera;
    let Camera { vertical_fov_deg, aperture_radius, focus_distance, shift, mirrored, .. } =
        scene.camera;
    let FilmSettings { width, height, filter } = scene.film;
    let aspect = f64::from(width) / f64::from(height);
    let tangent = (0.5 * f64::from(vertical_fov_deg)).to_radians().tan();
    let fov = 2.0 * (tangent * aspect.min(1.0)).atan().to_degrees();
    let [eye, target, up] = [position, look_at, up].map(triple);
    let side = if mirrored { 1 } else { -1 };
    let mut text = format!(
        "Scale {side} 1 1\nLookAt {eye}\n       {target}\n       {up}\nCamera \"perspective\" \
         \"float fov\" {fov}"
    );
    if aperture_radius > 0.0 {
        text += &format!(
            " \"float lensradius\" {aperture_radius} \"float focaldistance\" {focus_distance}"
        );
    }
    if shift != [0.0; 2] {
        let height = if aspect > 1.0 { 2.0 } else { 2.0 / aspect };
        let [x, y] = shift.map(|share| f64::from(share) * height);
        let [half_width, half_height] = [0.5 * aspect * height, 0.5 * height];
        text += &format!(
            " \"float screenwindow\" [{} {} {} {}]",
            x - half_width,
            x + half_width,
            y - half_height,
            y + half_height
        );
    }
    let filter = match filter {
        Filter::Box => r#""box" "float xradius" 0.5 "float yradius" 0.5"#,
        Filter::Gaussian => {
            r#""gaussian" "float xradius" 1.5 "float yradius" 1.5 "float sigma" 0.5"#
        }
    };
    let integrator = if has_media(scene) { "volpath" } else { "path" };
    let Settings { samples, depth } = settings;
    text + &format!(
        r#"
Film "rgb" "integer xresolution" {width} "integer yresolution" {height}
    "string sensor" "cie1931" "string filename" "{name}.exr"
PixelFilter {filter}
Sampler "independent" "integer pixelsamples" {samples}
Integrator "{integrator}" "integer maxdepth" {depth}
"#
    )
}

fn triple(vector: Vec3) -> String {
    format!("{} {} {}", vector.x, vector.y, vector.z)
}

/// Text of a string in quotes.
fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"")
}

/// Sides of the square map, texels.
const SIDES: (u32, u32) = (64, 4096);
/// Points of a texel of a square map with twice the rows of the other, along each side, whose mean it is.
const POINTS: u32 = 3;

/// Returns the light source of a lamp, and warns where it is not Fenestra's.
fn light_source(lamp: &Lamp, warnings: &mut Vec<String>) -> String {
    match lamp.kind {
        LampKind::Point { position, intensity } => format!(
            "LightSource \"point\" \"rgb I\" [{}] \"point3 from\" [{}]\n",
            triple(intensity),
            triple(position)
        ),
        LampKind::Directional { direction, irradiance } => format!(
            "LightSource \"distant\" \"rgb L\" [{}] \"point3 from\" [0 0 0] \"point3 to\" [{}]\n",
            triple(irradiance),
            triple(direction)
        ),
        LampKind::Spot(spot) => {
            if spot.falloff != SpotFalloff::SmoothCosine {
                warnings.push(format!(
                    "lamp `{}`: between its two angles pbrt's spot falls off by 3t² − 2t³, with t \
                     linear in the cosine, Fenestra's by another curve",
                    lamp.name
                ));
            }
            let DVec3 { x, y, z } = spot.position.as_dvec3() + spot.direction.as_dvec3();
            let [inner, outer] = [spot.inner_angle_rad, spot.outer_angle_rad]
                .map(|angle| f64::from(angle).to_degrees());
            format!(
                "LightSource \"spot\" \"rgb I\" [{}] \"point3 from\" [{}]\n    \
                 \"point3 to\" [{x} {y} {z}] \"float coneangle\" {outer} \"float conedeltaangle\" {}\n",
                triple(spot.intensity),
                triple(spot.position),
                outer - inner
            )
        }
    }
}

/// Writes the environment into `folder` and returns its light source; black ones need none.
///
/// A square equal-area map twice as high as the lat-long one has texels smaller than those at its
/// horizon. The directions of the map are those of the world.
fn write_environment(map: &EnvironmentMap, folder: &Folder) -> Result<String> {
    if map.is_black() {
        return Ok(String::new());
    }
    if let Some(radiance) = map.uniform_radiance() {
        return Ok(format!("LightSource \"infinite\" \"rgb L\" [{}]\n", triple(radiance)));
    }
    let (side, texels) = equal_area(map);
    let file = folder.write_environment([side; 2], |column, row| texels[row * side + column])?;
    Ok(format!("LightSource \"infinite\" \"string filename\" \"{file}\"\n"))
}

/// Side and rows of the map as an equal-area square, in the directions of the world.
fn equal_area(map: &EnvironmentMap) -> (usize, Vec<Vec3>) {
    let side = map.height.saturating_mul(2).clamp(SIDES.0, SIDES.1);
    let points = POINTS * map.height.saturating_mul(2).div_ceil(side);
    let texel = |index: u32| {
        let corner = Vec2::new((index % side) as f32, (index / side) as f32);
        let point = |index: u32| {
            let inside = Vec2::new((index % points) as f32, (index / points) as f32) + 0.5;
            let place = (corner + inside / points as f32) / side as f32;
            map.radiance(direction_from_square(place))
        };
        let sum: Vec3 = (0..points * points).map(point).sum();
        sum / (points * points) as f32
    };
    (side as usize, (0..side * side).into_par_iter().map(texel).collect())
}
