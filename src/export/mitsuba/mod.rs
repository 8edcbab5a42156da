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
//! - Measured materials become diffuse with the same share of reflected light.
//! - Further ones are where the warnings are, in `models` and `lights`.
//!
//! Differences too small for a warning: the Gaussian filter is cut off at 2 pixels, not at 1.5; the
//! light of the back of a surface stands [`BACK_DISTANCE`] behind it; normal maps take the tangent of each
//! triangle instead of those of vertices.

mod images;
mod lights;
mod models;

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use glam::{Vec2, Vec3};

use self::{
    images::Pictures,
    models::{Model, Translator, Triangles, indented},
};
use super::ply::{Attributes, Part};
use crate::{
    brdf::{self, MaterialTables},
    error::Result,
    files,
    scene::{Camera, Filter, Geometry, Scene},
    texture::{TextureUse, lookup::gradient_tangent},
};

/// Distance of a mesh that emits backwards from the one that emits forwards, as a part of the size of
/// the scene.
pub const BACK_DISTANCE: f32 = 1e-5;

/// Settings of the render that are not part of the scene.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Path vertices lit by the environment; 1 is direct light.
    pub depth: u32,
    /// Samples per pixel.
    pub samples: u32,
}

/// A scene on its way to Mitsuba.
#[derive(Debug)]
pub struct Export<'a> {
    scene: &'a Scene,
    settings: Settings,
    path: PathBuf,
    /// Name of the folder beside the scene file, escaped for XML.
    folder_name: String,
    /// One per material.
    models: Vec<Model>,
    lamps: String,
    pictures: Pictures,
    /// Differences that the format forces, one message for each material or lamp concerned.
    pub warnings: Vec<String>,
}

impl<'a> Export<'a> {
    /// Translates the materials and lamps for a scene file at `path`, without writing anything.
    ///
    /// # Errors
    /// [`crate::Error::Scene`] if the tables of the materials are too large.
    pub fn new(scene: &'a Scene, path: &Path, settings: Settings) -> Result<Self> {
        let tables = MaterialTables::new(&scene.materials)?;
        let folder = folder_of(path);
        let folder_name = escaped(&folder.file_name().unwrap_or_default().to_string_lossy());
        let (mut warnings, mut pictures) = (Vec::new(), Pictures::default());
        let triangles = describe(scene);
        let models = scene.materials.iter().zip(triangles).enumerate();
        let models = models.map(|(index, (material, triangles))| {
            let translator = Translator {
                material,
                triangles,
                folder: &folder_name,
                pictures: &mut pictures,
                warnings: &mut warnings,
                color_factor: None,
            };
            translator.model(|| reflected_share(&tables, index))
        });
        let models = models.collect();
        let lamps = scene.lamps.iter().map(|lamp| lights::lamp(lamp, &mut warnings)).collect();
        let path = path.to_owned();
        Ok(Self { scene, settings, path, folder_name, models, lamps, pictures, warnings })
    }

    /// Writes the scene file and the folder of the same name beside it.
    ///
    /// # Errors
    /// [`crate::Error::Io`] for a file that cannot be written.
    pub fn write(&self) -> Result<()> {
        let scene = self.scene;
        let folder = folder_of(&self.path);
        let mut xml = format!(
            "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!-- Written by Fenestra {}. -->\n\
             <scene version=\"3.0.0\">\n    <integrator type=\"path\">\n        \
             <integer name=\"max_depth\" value=\"{}\"/>\n        \
             <boolean name=\"hide_emitters\" value=\"false\"/>\n    </integrator>\n",
            env!("CARGO_PKG_VERSION"),
            // Mitsuba counts the edges of a path, the one to the light included.
            u64::from(self.settings.depth) + 1
        );
        xml += &self.sensor();
        xml += &lights::write_environment(&scene.environment, &folder, &self.folder_name)?;
        xml += &self.lamps;
        self.pictures.write(&folder)?;
        let mut parts: Vec<[Part; 2]> = Vec::new();
        parts.resize_with(scene.materials.len(), Default::default);
        for (&triangle, &material) in scene.geometry.triangles.iter().zip(&scene.geometry.materials)
        {
            let has_normal =
                |vertex: &u32| scene.geometry.normals[*vertex as usize] != [0.0_f32; 3];
            let is_flat = !triangle.iter().all(has_normal);
            parts[material as usize][usize::from(is_flat)].push(triangle);
        }
        let back_distance = BACK_DISTANCE * diagonal(&scene.geometry.positions);
        for (index, parts) in parts.iter().enumerate() {
            if parts.iter().all(Part::is_empty) {
                continue;
            }
            let model = &self.models[index];
            let id = identifier(index, &scene.materials[index].name);
            xml += &indented(&model.bsdf.replacen('>', &format!(" id=\"{id}\">"), 1));
            for (part, is_flat) in parts.iter().zip([false, true]) {
                if part.is_empty() {
                    continue;
                }
                let backs = if model.has_back { &[false, true][..] } else { &[false] };
                for &is_back in backs {
                    let name = format!(
                        "{id}{}{}.ply",
                        if is_flat { "_flat" } else { "" },
                        if is_back { "_back" } else { "" }
                    );
                    let attributes = Attributes {
                        normals: !is_flat,
                        uv_set: model.uv_set,
                        color_factor: model.color_factor,
                        back_distance: is_back.then_some(back_distance),
                    };
                    files::write_atomically(&folder.join(&name), |file| {
                        part.write(file, &scene.geometry, attributes)
                    })?;
                    let file = relative(&self.folder_name, &name);
                    let emitter = model.emitter.as_deref().unwrap_or_default();
                    let emitter = indented(&indented(emitter));
                    _ = write!(
                        xml,
                        "    <shape type=\"ply\">\n        \
                         <string name=\"filename\" value=\"{file}\"/>\n        \
                         <boolean name=\"face_normals\" value=\"{is_flat}\"/>\n        \
                         <ref id=\"{id}\"/>\n{emitter}    </shape>\n"
                    );
                }
            }
        }
        xml += "</scene>\n";
        files::write_text(&self.path, &xml)
    }

    /// Camera, sampler and film. Mitsuba leaves out surfaces nearer or farther than its clip planes.
    fn sensor(&self) -> String {
        let Camera { position, look_at, up, .. } = self.scene.camera;
        let Camera { vertical_fov_deg, aperture_radius, focus_distance, .. } = self.scene.camera;
        let positions = self.scene.geometry.positions.iter();
        let distances = positions.map(|&vertex| position.distance(vertex.into()));
        let far = 2.0 * distances.fold(focus_distance, f32::max);
        let kind = if aperture_radius > 0.0 { "thinlens" } else { "perspective" };
        let mut xml = format!("    <sensor type=\"{kind}\">\n");
        let mut number = |name: &str, value: f32| {
            _ = writeln!(xml, "        <float name=\"{name}\" value=\"{value}\"/>");
        };
        number("fov", vertical_fov_deg);
        if aperture_radius > 0.0 {
            number("aperture_radius", aperture_radius);
            number("focus_distance", focus_distance);
        }
        number("near_clip", 1e-6 * far);
        number("far_clip", far);
        let filter = match self.scene.film.filter {
            Filter::Box => "<rfilter type=\"box\"/>",
            Filter::Gaussian => {
                "<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"0.5\"/></rfilter>"
            }
        };
        _ = write!(
            xml,
            r#"        <string name="fov_axis" value="y"/>
        <transform name="to_world">
            <lookat origin="{}" target="{}" up="{}"/>
        </transform>
        <sampler type="independent">
            <integer name="sample_count" value="{}"/>
        </sampler>
        <film type="hdrfilm">
            <integer name="width" value="{}"/>
            <integer name="height" value="{}"/>
            <string name="pixel_format" value="rgb"/>
            <string name="component_format" value="float32"/>
            {filter}
        </film>
    </sensor>
"#,
            triple(position),
            triple(look_at),
            triple(up),
            self.settings.samples,
            self.scene.film.width,
            self.scene.film.height,
        );
        xml
    }
}

/// Folder of the same name beside the scene file.
fn folder_of(path: &Path) -> PathBuf {
    path.with_extension("")
}

/// Collects what the models of all materials need to know about their triangles.
fn describe(scene: &Scene) -> Vec<Triangles> {
    let Geometry { colors, triangles, materials, .. } = &scene.geometry;
    let mut all = vec![Triangles::default(); scene.materials.len()];
    for (&triangle, &material) in triangles.iter().zip(materials) {
        let facts = &mut all[material as usize];
        let surface = &scene.materials[material as usize].surface;
        if surface.vertex_color && !colors.is_empty() {
            facts.has_colors = true;
            facts.has_transparency |= triangle.iter().any(|&at| colors[at as usize][3] < 1.0);
        }
        if let Some(normal) = &surface.normal {
            let sign = bitangent_sign(&scene.geometry, triangle, normal);
            facts.bitangents[usize::from(sign < 0.0)] += usize::from(sign != 0.0);
        }
    }
    all
}

/// Sign of the bitangent of a triangle by its vertices, or else by the coordinates of an image; 0 if
/// these do not tell.
fn bitangent_sign(geometry: &Geometry, triangle: [u32; 3], used: &TextureUse) -> f32 {
    let [a, b, c] = triangle.map(|at| at as usize);
    if let Some(tangent) = geometry.tangents.get(a)
        && tangent[..3] != [0.0; 3]
    {
        return tangent[3].signum();
    }
    let uvs = &geometry.uvs[used.uv_set as usize & 1];
    let (Some(_), [row_u, row_v]) = (uvs.get(a), used.image_from_uv.map(Vec3::from)) else {
        return 0.0;
    };
    let image = |at: usize| {
        let uv = Vec2::from(uvs[at]).extend(1.0);
        Vec2::new(row_u.dot(uv), row_v.dot(uv))
    };
    let place = |at: usize| Vec3::from(geometry.positions[at]);
    let edges = [place(b) - place(a), place(c) - place(a)];
    let normal = edges[0].cross(edges[1]).normalize_or_zero();
    gradient_tangent(edges, [image(b) - image(a), image(c) - image(a)], normal).w
}

/// Length of the diagonal of the box around all positions, metres.
fn diagonal(positions: &[[f32; 3]]) -> f32 {
    let all = || positions.iter().map(|&position| Vec3::from(position));
    let low = all().fold(Vec3::INFINITY, Vec3::min);
    let high = all().fold(Vec3::NEG_INFINITY, Vec3::max);
    if positions.is_empty() { 0.0 } else { low.distance(high) }
}

/// Share of light from a uniform hemisphere that a material reflects: 2 ∫ E(μ) μ dμ by midpoints.
fn reflected_share(tables: &MaterialTables, material: usize) -> Vec3 {
    const STEPS: u32 = 64;
    let step = |index: u32| {
        let cosine = (index as f32 + 0.5) / STEPS as f32;
        let outgoing_local = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        brdf::albedo(tables, material, outgoing_local) * (2.0 * cosine / STEPS as f32)
    };
    (0..STEPS).map(step).sum()
}

fn triple(vector: Vec3) -> String {
    format!("{}, {}, {}", vector.x, vector.y, vector.z)
}

/// Returns an identifier that Mitsuba and file systems take: `m00_name`, other characters as `_`.
fn identifier(index: usize, name: &str) -> String {
    format!("m{index:02}_{}", safe_name(name))
}

/// Name of letters and digits, other characters as `_`.
fn safe_name(name: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    name.chars().take(60).map(safe).collect()
}

/// Path of a file in `folder` relative to the scene file.
fn relative(folder: &str, name: &str) -> String {
    PathBuf::from(folder).join(name).display().to_string()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
