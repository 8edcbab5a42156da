//! Mitsuba 3 XML (version 3.0.0): one scene file, and a folder of the same name beside it with the
//! environment (`environment.exr`), images of textures, and binary PLY meshes, a few for each material.
//!
//! Deviations from Fenestra's own picture, each a warning where it applies:
//! - `roughconductor`, `roughdielectric`, `roughplastic` and `principled` mask and shadow separately,
//!   Fenestra together (\[Heitz 2014\] Eq. 99): a difference that grows with α.
//! - `roughplastic` loses light that Fenestra's coupled base keeps (\[Kelemen & Szirmay-Kalos 2001\]):
//!   a white one of Mitsuba 3.9.1 reflects 0.96 of it at α = 0.05 and 0.69 at 0.3. Its linear variant
//!   is nearer, since the base's albedo enters once.
//! - `principled` has Disney's diffuse part.
//! - Measured materials become diffuse with the same share of reflected light, but those of RGL files are
//!   `measured`.
//! - Further ones are where the warnings are, in `models` and here.
//!
//! Differences too small for a warning: the Gaussian filter is cut off at 2 pixels, not at 1.5; the
//! light of the back of a surface stands [`BACK_DISTANCE`] behind it; normal maps take the tangent of each
//! triangle instead of those of vertices.

mod models;

use std::path::Path;

use glam::{DVec3, Vec3};

use self::models::{Model, Translator, indented, interior, property, rgb};
use super::{
    Export, Settings,
    folder::{Folder, identifier},
    has_media, has_panes,
    images::Pictures,
    left_out,
    parts::{self, Parts},
    subject::Subject,
    triple,
};
use crate::{
    Camera, EnvironmentMap, FilmSettings, Filter, Lamp, Scene,
    error::Result,
    files,
    lamp::{LampKind, SpotFalloff},
    material::Opacity,
};

/// Distance of a mesh that emits backwards from the one that emits forwards, as a part of the size of
/// the scene.
pub const BACK_DISTANCE: f32 = 1e-5;

/// Translates the materials and lamps for a scene file at `path`, without writing anything.
pub fn export<'a>(scene: &'a Scene, path: &Path, settings: Settings) -> Export<'a> {
    let folder = Folder::beside(path, escaped);
    let (mut warnings, mut pictures) = (Vec::new(), Pictures::default());
    let parts = parts::divide(scene);
    let models = scene.materials.iter().zip(&parts).map(|(material, parts)| {
        let subject = Subject::new("Mitsuba", material, parts, &mut warnings);
        let pictures = &mut pictures;
        Translator { subject, folder: &folder, pictures, color_factor: None }.model()
    });
    let models: Vec<Model> = models.collect();
    let lamps: String = scene.lamps.iter().map(|lamp| emitter_of(lamp, &mut warnings)).collect();
    if scene.camera.aperture_radius > 0.0 && scene.camera.shift != [0.0; 2] {
        let difference = "Mitsuba shifts no thin lens; all distances are in focus";
        warnings.push(format!("camera: {difference}"));
    }
    // To `path`, surfaces that light goes straight through count as vertices, and lamps do not shine through.
    let has_holes = scene.materials.iter().any(|own| own.surface.opacity != Opacity::default());
    let is_passed = has_holes || has_panes(scene) || has_media(scene);
    warnings.extend(left_out(scene, path));
    let path = path.to_owned();
    Export::new(warnings, move || {
        let mut xml = format!(
            "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!-- Written by Fenestra {}. -->\n\
             <scene version=\"3.0.0\">\n    <integrator type=\"{}\">\n        \
             <integer name=\"max_depth\" value=\"{}\"/>\n        \
             <boolean name=\"hide_emitters\" value=\"false\"/>\n    </integrator>\n",
            env!("CARGO_PKG_VERSION"),
            if is_passed { "volpath" } else { "path" },
            // Mitsuba counts the edges of a path, the one to the light included.
            u64::from(settings.depth) + 1
        );
        xml += &sensor(scene, &parts, settings.samples);
        xml += &write_environment(&scene.environment, &folder)?;
        xml += &lamps;
        pictures.write(&folder.path)?;
        let size = parts::bounds(&parts).map_or(0.0, |[low, high]| low.distance(high));
        for (index, parts) in parts.iter().enumerate() {
            let model = &models[index];
            let id = identifier(index, &scene.materials[index].name);
            if parts.each().next().is_some() {
                xml += &indented(&model.bsdf.replacen('>', &format!(" id=\"{id}\">"), 1));
            }
            for (part, is_flat) in parts.each() {
                let suffix = if is_flat { "_flat" } else { "" };
                let mut meshes = vec![(format!("{id}{suffix}.ply"), part.clone())];
                if model.has_back {
                    let back = part.turned(BACK_DISTANCE * size);
                    meshes.push((format!("{id}{suffix}_back.ply"), back));
                }
                for (name, part) in meshes {
                    let file = folder.write_mesh(&name, &part, is_flat, model.attributes)?;
                    let emitter = indented(&indented(&model.emitter));
                    let medium = indented(&indented(&interior(&scene.materials[index].kind)));
                    xml += &format!(
                        "    <shape type=\"ply\">\n        \
                         <string name=\"filename\" value=\"{file}\"/>\n        \
                         <boolean name=\"face_normals\" value=\"{is_flat}\"/>\n        \
                         <ref id=\"{id}\"/>\n{emitter}{medium}    </shape>\n"
                    );
                }
            }
        }
        xml += "</scene>\n";
        files::write_text(&path, &xml)
    })
}

/// Camera, sampler and film. Mitsuba leaves out surfaces nearer or farther than its clip planes.
fn sensor(scene: &Scene, parts: &[Parts], samples: u32) -> String {
    let Camera { position, look_at, up, .. } = scene.camera;
    let Camera { vertical_fov_deg, aperture_radius, focus_distance, shift, mirrored, .. } =
        scene.camera;
    // The farthest corner of the box is at least as far as all vertices.
    let corner = parts::bounds(parts)
        .map_or(0.0, |[low, high]| (low - position).abs().max((high - position).abs()).length());
    let far = 2.0 * corner.max(1e-3);
    let has_lens = aperture_radius > 0.0 && shift == [0.0; 2];
    let kind = if has_lens { "thinlens" } else { "perspective" };
    let mut xml = format!("    <sensor type=\"{kind}\">\n");
    let mut number = |name, value: f32| xml += &indented(&property("float", name, value));
    number("fov", vertical_fov_deg);
    if has_lens {
        number("aperture_radius", aperture_radius);
        number("focus_distance", focus_distance);
    }
    number("near_clip", 1e-6 * far);
    // The plane of focus lies between the clip planes.
    number("far_clip", if has_lens { far.max(2.0 * focus_distance) } else { far });
    let FilmSettings { width, height, filter } = scene.film;
    if shift != [0.0; 2] {
        number("principal_point_offset_x", shift[0] * height as f32 / width as f32);
        number("principal_point_offset_y", -shift[1]);
    }
    let filter = match filter {
        Filter::Box => "<rfilter type=\"box\"/>",
        Filter::Gaussian => {
            "<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"0.5\"/></rfilter>"
        }
    };
    let [origin, target, up] = [position, look_at, up].map(triple);
    let mirror = if mirrored { "<scale x=\"-1\"/>" } else { "" };
    xml += &format!(
        r#"        <string name="fov_axis" value="y"/>
        <transform name="to_world">{mirror}
            <lookat origin="{origin}" target="{target}" up="{up}"/>
        </transform>
        <sampler type="independent">
            <integer name="sample_count" value="{samples}"/>
        </sampler>
        <film type="hdrfilm">
            <integer name="width" value="{width}"/>
            <integer name="height" value="{height}"/>
            <string name="pixel_format" value="rgb"/>
            <string name="component_format" value="float32"/>
            {filter}
        </film>
    </sensor>
"#
    );
    xml
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// Returns the emitter of a lamp, and warns where it is not Fenestra's.
fn emitter_of(lamp: &Lamp, warnings: &mut Vec<String>) -> String {
    let point = |tag: &str, name: &str, value: Vec3| {
        let [x, y, z] = value.to_array();
        format!("    <{tag} name=\"{name}\" x=\"{x}\" y=\"{y}\" z=\"{z}\"/>\n")
    };
    match lamp.kind {
        LampKind::Point { position, intensity } => {
            emitter("point", &(point("point", "position", position) + &rgb("intensity", intensity)))
        }
        LampKind::Directional { direction, irradiance } => {
            let along = point("vector", "direction", direction);
            emitter("directional", &(along + &rgb("irradiance", irradiance)))
        }
        LampKind::Spot(spot) => {
            if spot.falloff != SpotFalloff::LinearAngle {
                warnings.push(format!(
                    "lamp `{}`: between its two angles Mitsuba's spot falls off in proportion to \
                     the angle, Fenestra's by a smooth curve",
                    lamp.name
                ));
            }
            let DVec3 { x, y, z } = spot.position.as_dvec3() + spot.direction.as_dvec3();
            let [origin, up] = [spot.position, spot.direction.any_orthonormal_vector()].map(triple);
            let place = format!(
                "    <transform name=\"to_world\">\n        <lookat origin=\"{origin}\" \
                 target=\"{x}, {y}, {z}\" up=\"{up}\"/>\n    </transform>\n"
            );
            let angles = [
                property("float", "cutoff_angle", spot.outer_angle_rad.to_degrees()),
                property("float", "beam_width", spot.inner_angle_rad.to_degrees()),
            ];
            emitter("spot", &(place + &rgb("intensity", spot.intensity) + &angles.concat()))
        }
    }
}

fn emitter(kind: &str, content: &str) -> String {
    indented(&format!("<emitter type=\"{kind}\">\n{content}</emitter>\n"))
}

/// Writes the environment into `folder` and returns its emitter; black ones need none.
///
/// Mitsuba's texel columns have centres at (i + ½)/width as Fenestra's, but its rows lie at
/// j/(height − 1), on the poles too. A map of 2·height + 1 rows holds Fenestra's bilinear function
/// exactly: odd rows are the texels, even ones the means of their neighbours. Mitsuba's middle looks
/// along +Z, Fenestra's along −Z: half a turn.
fn write_environment(map: &EnvironmentMap, folder: &Folder) -> Result<String> {
    if map.is_black() {
        return Ok(String::new());
    }
    if let Some(radiance) = map.uniform_radiance() {
        return Ok(emitter("constant", &rgb("radiance", radiance)));
    }
    let (width, height) = (map.width as usize, map.height as usize);
    let texel = |column: usize, row: usize| map.texels[row * width + column];
    let file = folder.write_environment([width, 2 * height + 1], |column, row| {
        let [above, below] = [row.saturating_sub(1) / 2, (row / 2).min(height - 1)];
        0.5 * texel(column, above) + 0.5 * texel(column, below)
    })?;
    let turn = f64::from(map.rotation_rad).to_degrees() + 180.0;
    let place = format!(
        "    <transform name=\"to_world\">\n        <rotate y=\"1\" angle=\"{turn}\"/>\n    </transform>\n"
    );
    Ok(emitter("envmap", &(property("string", "filename", file) + &place)))
}
