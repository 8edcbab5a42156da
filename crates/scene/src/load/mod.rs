//! Scene file or mesh file → validated [`Scene`]: checks everything the numbers of the file must satisfy.
//!
//! Messages name the object or material and the line of its entry.

mod include;
mod inside;
mod light;
mod materials;
mod objects;
mod whole;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use glam::Vec3;

use super::{
    Asked, Camera, EnvironmentMap, FilmSettings, Geometry, Scene,
    file::{CameraEntry, Entry, KeyframeEntry, SceneFile},
};
use crate::{
    error::{Error, Result},
    files,
    instance::bounds,
    material::{Material, MaterialKind},
    math::keys::{between, monotone},
    mesh::Mesh,
    picture::RgbImage,
};

pub use super::{MAX_FILM_SIDE, MIN_ALPHA};

/// Formats of scenes, for messages.
const SCENE_EXTENSIONS: &str = ".toml, .gltf, .glb, .obj, .pbrt or .xml (Mitsuba)";

/// Options of the command line that add to a scene file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// Environment map, instead of the scene's.
    pub environment: Option<PathBuf>,
    /// Rotation of the map about +Y, degrees, counter-clockwise seen from above, instead of the
    /// scene's.
    pub rotation_deg: Option<f32>,
    /// Name of the camera in a glTF file, or its number from 0.
    pub camera: Option<String>,
    /// Name of a variant of a glTF file's materials.
    pub variant: Option<String>,
    /// Place of the camera, the point that it looks at, and its vertical field of view in degrees, instead
    /// of the scene's.
    pub look_from: Option<[f32; 3]>,
    /// See [`LoadOptions::look_from`].
    pub look_at: Option<[f32; 3]>,
    /// See [`LoadOptions::look_from`].
    pub vertical_fov_deg: Option<f32>,
    /// Time at which an animation is seen, seconds; none for the scene as it stands without.
    pub time: Option<f32>,
    /// Folder whose files pbrt and Mitsuba scenes may name, beside their own.
    pub allow_root: Option<PathBuf>,
}

/// Meshes and images for [`Scene::parse_with`], by the names that its text gives in place of files.
#[derive(Clone, Debug, Default)]
pub struct Arrays {
    /// Meshes of objects. They bring no materials.
    pub meshes: BTreeMap<PathBuf, Mesh>,
    /// Linear Rec.709 images, for `environment.map` and for textures.
    pub images: BTreeMap<PathBuf, RgbImage>,
}

/// Arrays of a scene that is in files alone.
static NONE: Arrays = Arrays { meshes: BTreeMap::new(), images: BTreeMap::new() };

impl Scene {
    /// Reads a scene file and everything it refers to by paths relative to it. The file is a scene
    /// in TOML, a glTF or OBJ file as a whole scene, or a Mitsuba file.
    ///
    /// # Errors
    /// [`Error::Io`] for a file that cannot be read, [`Error::Parse`] with line and column for text
    /// that is not a scene, [`Error::Scene`] with the name of the object or material for numbers
    /// that cannot be rendered, and the errors of the mesh, map and BRDF readers.
    pub fn load(path: &Path) -> Result<Self> {
        Self::load_with(path, &LoadOptions::default())
    }

    /// As [`Scene::load`], with options of the command line.
    ///
    /// # Errors
    /// As [`Scene::load`], and for a camera that the file does not have.
    pub fn load_with(path: &Path, options: &LoadOptions) -> Result<Self> {
        let loader = Loader { path, options, arrays: &NONE };
        if let Some(name) = &options.variant {
            let is_gltf = matches!(files::extension(path).as_str(), "gltf" | "glb");
            loader.check(is_gltf, || format!("--variant {name}: the option is for glTF files"))?;
        }
        if let Some(imported) = loader.import(None)? {
            return loader.imported(imported);
        }
        let extension = files::extension(path);
        if !matches!(extension.as_str(), "toml" | "") && path.is_file() {
            let message = format!("expected a scene in {SCENE_EXTENSIONS}, found .{extension}");
            return Err(Error::format(path, message));
        }
        Self::parse_with(path, &files::read_text(path)?, options, &NONE)
    }

    /// Builds a scene from its text; `path` serves messages, its folder is that of relative paths.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        Self::parse_with(path, text, &LoadOptions::default(), &NONE)
    }

    /// As [`Scene::parse`], with options of the command line, and arrays in place of files that the text
    /// would name.
    ///
    /// # Errors
    /// As [`Scene::load_with`], and for arrays that do not fit each other.
    pub fn parse_with(
        path: &Path,
        text: &str,
        options: &LoadOptions,
        arrays: &Arrays,
    ) -> Result<Self> {
        let file = SceneFile::parse(path, text)?;
        let loader = Loader { path, options, arrays };
        if let Some(name) = &options.camera {
            let message = "a scene in .toml has one camera; the option is for glTF files";
            return Err(loader.error(format!("--camera {name}: {message}")));
        }
        let mut scene = loader.scene(&loader.camera_at(&file)?, file.film)?;
        loader.materials(&file.materials, &mut scene)?;
        loader.geometry(&file.objects, &mut scene)?;
        file.includes.iter().try_for_each(|entry| loader.include(entry, &mut scene))?;
        if scene.materials.is_empty() {
            scene.materials.push(default_material());
        }
        loader.light(&file, &mut scene)?;
        Ok(loader.finished(scene))
    }
}

/// Name of a scene: stem of the file, or the name of its folder if the stem is `scene`.
pub fn scene_name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default();
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let folder = absolute.parent().and_then(Path::file_name);
    let name = if stem == "scene" { folder.unwrap_or(stem) } else { stem };
    name.to_string_lossy().into_owned()
}

/// Material of a scene that has nothing but an environment.
fn default_material() -> Material {
    Material::new("default", MaterialKind::Diffuse { reflectance: Vec3::splat(0.5) })
}

/// Camera with what the options say of it. A camera that is moved alone keeps its direction.
fn viewed(camera: &CameraEntry, options: &LoadOptions) -> CameraEntry {
    let mut viewed = camera.clone();
    if let Some(place) = options.look_from {
        let way = Vec3::from(viewed.look_at) - Vec3::from(viewed.position);
        viewed.position = place;
        viewed.look_at = (Vec3::from(place) + way).to_array();
    }
    if let Some(point) = options.look_at {
        viewed.look_at = point;
    }
    if let Some(fov) = options.vertical_fov_deg {
        viewed.vertical_fov_deg = fov;
    }
    viewed
}

/// Steps of single precision that the longest side of a scene should have.
const LEAST_STEPS: f32 = 2e4;
/// Colour above which a material reflects too much, but for rounding.
const CUT: f32 = 1.001;
/// Range of every finite number.
const FINITE: (f32, f32) = (f32::MIN, f32::MAX);

struct Loader<'a> {
    path: &'a Path,
    options: &'a LoadOptions,
    /// Parts of the scene that are in no file.
    arrays: &'a Arrays,
}

impl<'a> Loader<'a> {
    /// Loader of another file of the same scene.
    fn beside(&self, path: &'a Path) -> Self {
        Self { path, ..*self }
    }

    /// Path of a file that the scene names.
    fn file(&self, name: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(name)
    }

    /// Empty scene in the dark, with checked camera and film.
    fn scene(&self, camera: &CameraEntry, film: FilmSettings) -> Result<Scene> {
        let camera = self.camera(&viewed(camera, self.options))?;
        for (name, side) in [("width", film.width), ("height", film.height)] {
            self.check((1..=MAX_FILM_SIDE).contains(&side), || {
                format!("film.{name}: expected 1 to {MAX_FILM_SIDE} pixels, found {side}")
            })?;
        }
        Ok(Scene {
            name: scene_name(self.path),
            path: self.path.to_path_buf(),
            camera,
            film,
            environment: self.uniform_light(Vec3::ZERO)?,
            lamps: Vec::new(),
            portals: Vec::new(),
            materials: Vec::new(),
            geometry: Geometry::default(),
            inputs: vec![self.path.to_path_buf()],
            variants: Vec::new(),
            asked: Asked::default(),
            warnings: Vec::new(),
            hash: String::new(),
        })
    }

    fn uniform_light(&self, radiance: Vec3) -> Result<EnvironmentMap> {
        EnvironmentMap::constant(radiance, 1.0).map_err(|message| self.error(message))
    }

    /// Gives a scene its hash; warns of one without any light, and of one whose place single precision blurs.
    fn finished(&self, mut scene: Scene) -> Scene {
        let is_dark = scene.lamps.is_empty()
            && scene.materials.iter().all(|material| material.surface.emission.is_none())
            && scene.environment.is_black();
        if is_dark {
            scene.warnings.push(format!("{}: no light: nothing is lit", self.path.display()));
        }
        if let Some([low, high]) = bounds(scene.geometry.used_extent()) {
            let (farthest, size) =
                (low.abs().max(high.abs()).max_element(), (high - low).max_element());
            let step = farthest * f32::EPSILON;
            if size < LEAST_STEPS * step {
                scene.warnings.push(format!(
                    "{}: coordinates of {farthest:e} have steps of {step:e} in a scene of {size:e}: move it \
                     to the origin",
                    self.path.display()
                ));
            }
        }
        let is_unseen = |material: &&Material| {
            material.surface.emission.is_some() && material.surface.opacity.factor == 0.0
        };
        if let Some(Material { name, .. }) = scene.materials.iter().find(is_unseen) {
            let file = self.path.display();
            let message = format!("{file}: the light of `{name}` is not seen: its opacity is 0");
            scene.warnings.push(message);
        }
        let largest = scene.materials.iter().map(|own| (own.largest_color(), &own.name));
        let cut: Vec<_> = largest.filter(|(largest, _)| *largest > CUT).collect();
        if let Some((largest, name)) = cut.iter().max_by(|(a, _), (b, _)| a.total_cmp(b)) {
            let count = cut.len();
            scene.warnings.push(format!(
                "{}: colours of images above 1 are cut off in {count} of {} materials: `{name}` has \
                 {largest}",
                self.path.display(),
                scene.materials.len()
            ));
        }
        scene.hash = super::hash::hash(&scene);
        scene
    }

    fn error(&self, message: impl Into<String>) -> Error {
        Error::scene(self.path, message)
    }

    fn check(&self, holds: bool, message: impl FnOnce() -> String) -> Result<()> {
        if holds { Ok(()) } else { Err(self.error(message())) }
    }

    /// Checks that all of `values` lie from `low` to `high`, both included; NaN does not.
    fn check_range(&self, what: &str, values: &[f32], (low, high): (f32, f32)) -> Result<()> {
        match values.iter().find(|value| !(low..=high).contains(*value)) {
            None => Ok(()),
            Some(found) => {
                let expected = match (low, high) {
                    FINITE => "a finite number".to_owned(),
                    (low, f32::MAX) => format!("a finite number of at least {low}"),
                    (low, high) => format!("a number from {low} to {high}"),
                };
                Err(self.error(format!("{what}: expected {expected}, found {found}")))
            }
        }
    }

    /// Makes a vector of numbers that pass [`Self::check_range`].
    fn vector(&self, what: &str, values: [f32; 3], range: (f32, f32)) -> Result<Vec3> {
        self.check_range(what, &values, range)?;
        Ok(Vec3::from_array(values))
    }

    fn camera(&self, entry: &CameraEntry) -> Result<Camera> {
        let position = self.vector("camera.position", entry.position, FINITE)?;
        let look_at = self.vector("camera.look_at", entry.look_at, FINITE)?;
        let up = self.vector("camera.up", entry.up, FINITE)?;
        self.check_range("camera.vertical_fov_deg", &[entry.vertical_fov_deg], (0.01, 179.0))?;
        self.check_range("camera.aperture_radius", &[entry.aperture_radius], (0.0, f32::MAX))?;
        self.check_range("camera.shift", &entry.shift, (-1e5, 1e5))?;
        let view = look_at - position;
        let Some(view_direction) = view.try_normalize() else {
            return Err(self.error(format!(
                "camera.position and camera.look_at must differ, found {position} and {look_at}"
            )));
        };
        let across = up.try_normalize().map_or(0.0, |up| up.cross(view_direction).length());
        self.check(across > 1e-4, || {
            format!("camera.up must not be zero or along the view {view_direction}, found {up}")
        })?;
        if entry.aperture_radius > 0.0 && entry.focus_distance.is_none() {
            return Err(self.error("camera.aperture_radius needs camera.focus_distance"));
        }
        let focus_distance = entry.focus_distance.unwrap_or(view.length());
        let positive = (f32::MIN_POSITIVE, f32::MAX);
        self.check_range("camera.focus_distance", &[focus_distance], positive)?;
        Ok(Camera {
            position,
            look_at,
            up,
            vertical_fov_deg: entry.vertical_fov_deg,
            aperture_radius: entry.aperture_radius,
            focus_distance,
            shift: entry.shift,
            mirrored: entry.mirrored,
        })
    }

    /// Returns the camera at the time of the options: that of the key frames, each number along a smooth
    /// curve that never leaves the range of its two keys; before the first and after the last it stands.
    /// Without a time or key frames, the camera of `[camera]`.
    fn camera_at(&self, file: &SceneFile) -> Result<CameraEntry> {
        let mut keys = Vec::new();
        for Entry { keys: frame, .. } in &file.keyframes {
            let camera = completed(frame, &file.camera);
            let at = |error: Error| match error {
                Error::Scene { message, .. } => {
                    self.error(format!("camera.keyframe at {} s: {message}", frame.time))
                }
                other => other,
            };
            self.camera(&camera).map_err(at)?;
            keys.push(camera);
        }
        let times: Vec<f32> = file.keyframes.iter().map(|frame| frame.keys.time).collect();
        let ascend = times.iter().all(|time| time.is_finite()) && times.is_sorted_by(|a, b| a < b);
        self.check(ascend, || {
            format!("camera.keyframe: expected times that ascend, found {times:?}")
        })?;
        let Some(time) = self.options.time.filter(|_| !keys.is_empty()) else {
            return Ok(file.camera.clone());
        };
        let place = between(&times, time);
        let number =
            |of: &dyn Fn(&CameraEntry) -> f32| monotone(&times, |key| of(&keys[key]), place);
        let vector = |of: &dyn Fn(&CameraEntry) -> [f32; 3]| {
            std::array::from_fn(|axis| number(&|camera| of(camera)[axis]))
        };
        Ok(CameraEntry {
            position: vector(&|camera| camera.position),
            look_at: vector(&|camera| camera.look_at),
            up: vector(&|camera| camera.up),
            vertical_fov_deg: number(&|camera| camera.vertical_fov_deg),
            aperture_radius: number(&|camera| camera.aperture_radius),
            focus_distance: keys
                .iter()
                .any(|camera| camera.focus_distance.is_some())
                .then(|| number(&focus_distance)),
            ..file.camera.clone()
        })
    }
}

fn completed(frame: &KeyframeEntry, camera: &CameraEntry) -> CameraEntry {
    CameraEntry {
        position: frame.position.unwrap_or(camera.position),
        look_at: frame.look_at.unwrap_or(camera.look_at),
        up: frame.up.unwrap_or(camera.up),
        vertical_fov_deg: frame.vertical_fov_deg.unwrap_or(camera.vertical_fov_deg),
        aperture_radius: frame.aperture_radius.unwrap_or(camera.aperture_radius),
        focus_distance: frame.focus_distance.or(camera.focus_distance),
        ..camera.clone()
    }
}

fn focus_distance(camera: &CameraEntry) -> f32 {
    let [from, to] = [camera.position, camera.look_at].map(Vec3::from);
    camera.focus_distance.unwrap_or(from.distance(to))
}
