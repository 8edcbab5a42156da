//! pbrt-v4 scene descriptions: one `.pbrt` file, and a folder of the same name beside it with the
//! environment (`environment.exr`), images of textures, and binary PLY meshes, a few for each material.
//!
//! Deviations from Fenestra's own picture, each a warning where it applies:
//! - `coateddiffuse` lets light bounce between coat and base at random; its base is chosen so that the
//!   same colour shows through a smooth coat.
//! - A `conductor` has Fresnel's equations, never Schlick's approximation.
//! - Principled materials become a conductor or a `coateddiffuse`, measured ones diffuse.
//! - Further ones are where the warnings are, in `materials` and `lights`.
//!
//! Differences too small for a warning: the environment is resampled to an equal-area map, whose nearest
//! texel pbrt looks up; pbrt subtracts from its Gaussian filter the value at 1.5 pixels.

mod lights;
mod materials;

use std::{fmt::Write, path::Path};

use glam::Vec3;

use self::materials::{Model, Translator, rgb};
use super::{
    Export, Settings,
    folder::{Folder, identifier},
    has_media,
    images::Pictures,
    left_out, parts,
    subject::Subject,
};
use crate::{Camera, FilmSettings, Filter, Scene, files};

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
    let lamps: String = scene.lamps.iter().map(|lamp| lights::lamp(lamp, &mut warnings)).collect();
    warnings.extend(left_out(scene));
    let path = path.to_owned();
    Export::new(warnings, move || {
        let mut text = format!("# Written by Fenestra {}.\n", env!("CARGO_PKG_VERSION"));
        text += &view(scene, settings, &folder.name);
        text += "\nWorldBegin\n";
        text += &lights::write_environment(&scene.environment, &folder)?;
        text += &lamps;
        pictures.write(&folder.path)?;
        for (index, parts) in parts.iter().enumerate() {
            let model = &models[index];
            if parts.each().next().is_none() {
                continue;
            }
            let id = identifier(index, &scene.materials[index].name);
            text += &model.text;
            _ = write!(text, "AttributeBegin\nNamedMaterial \"{id}\"\n{}", model.light);
            if let Some(absorption) = scene.materials[index].kind.absorption() {
                let sigmas = rgb("sigma_a", absorption) + &rgb("sigma_s", Vec3::ZERO);
                _ = writeln!(
                    text,
                    "MakeNamedMedium \"{id}\" \"string type\" \"homogeneous\"{sigmas}\n\
                     MediumInterface \"{id}\" \"\""
                );
            }
            for (part, is_flat) in parts.each() {
                let name = format!("{id}{}.ply", if is_flat { "_flat" } else { "" });
                let file = folder.write_mesh(&name, part, is_flat, model.attributes)?;
                let alpha = &model.alpha;
                _ = writeln!(text, "Shape \"plymesh\" \"string filename\" \"{file}\"{alpha}");
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
    let Camera { vertical_fov_deg, aperture_radius, focus_distance, .. } = scene.camera;
    let FilmSettings { width, height, filter } = scene.film;
    let aspect = f64::from(width) / f64::from(height);
    let tangent = (0.5 * f64::from(vertical_fov_deg)).to_radians().tan();
    let fov = 2.0 * (tangent * aspect.min(1.0)).atan().to_degrees();
    let [eye, target, up] = [position, look_at, up].map(triple);
    let mut text = format!(
        "Scale -1 1 1\nLookAt {eye}\n       {target}\n       {up}\nCamera \"perspective\" \"float fov\" {fov}"
    );
    if aperture_radius > 0.0 {
        _ = write!(
            text,
            " \"float lensradius\" {aperture_radius} \"float focaldistance\" {focus_distance}"
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
