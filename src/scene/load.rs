//! Scene file → validated [`Scene`]: everything the numbers of the file must satisfy.
//!
//! Messages name the object or material and the line of its entry.

use std::{
    collections::{BTreeMap, HashMap},
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::Vec3;

use super::{
    Camera, EnvironmentMap, FilmSettings, Filter, Geometry, Material, Scene,
    file::{
        CameraEntry, ConductorEntry, EnvironmentEntry, FilmEntry, FilterEntry, MaterialEntry,
        MaterialKindEntry, ObjectEntry, ObjectSource, SceneFile,
    },
    material::{ConductorFresnel, MaterialKind},
    mesh::Mesh,
    transform::Transform,
};
use crate::{
    accel::MAX_COORDINATE,
    brdf::table::MeasuredTable,
    error::{Error, Result},
};

/// Largest width and height of the film, pixels.
pub const MAX_FILM_SIDE: u32 = 16_384;

/// Smallest GGX width: below it the highlight is a mirror image that single precision cannot sample.
pub const MIN_ALPHA: f32 = 1e-3;

impl Scene {
    /// Reads a scene file and everything it refers to, relative to the scene file.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] for a file that cannot be read, [`Error::Parse`] with line and column for text
    /// that is no scene, [`Error::Scene`] with the name of the object or material for numbers that
    /// cannot be rendered, and the errors of the mesh, map and BRDF readers.
    pub fn load(path: &Path) -> Result<Self> {
        refuse_other_formats(path)?;
        let bytes = fs::read(path).map_err(|source| Error::io(path, "read", source))?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let valid_bytes = error.utf8_error().valid_up_to();
            Error::format(path, format!("not a text file: byte {valid_bytes} is not UTF-8"))
        })?;
        Self::parse(path, &text)
    }

    /// Makes a scene of its text; `path` is for messages, and its folder is that of relative paths.
    ///
    /// # Errors
    ///
    /// As [`Scene::load`].
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let file = SceneFile::parse(path, text)?;
        let loader = Loader { path, folder: path.parent().unwrap_or(Path::new("")) };
        let mut warnings = Vec::new();
        let camera = loader.camera(&file.camera)?;
        let film = loader.film(&file.film)?;
        let mut materials = loader.materials(&file.materials, &mut warnings)?;
        let geometry = loader.geometry(&file.objects, &mut materials, &mut warnings)?;
        if materials.is_empty() {
            materials.push(default_material());
        }
        let environment = loader.environment(&file.environment, &mut warnings)?;
        let mut scene = Self {
            name: scene_name(path),
            path: path.to_path_buf(),
            camera,
            film,
            environment,
            materials,
            geometry,
            warnings,
            hash: String::new(),
        };
        scene.hash = super::hash::hash(&scene);
        Ok(scene)
    }
}

/// The stem of the file, or the name of its folder where the stem is `scene`.
fn scene_name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default();
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let folder = absolute.parent().and_then(Path::file_name);
    let name = if stem == "scene" { folder.unwrap_or(stem) } else { stem };
    name.to_string_lossy().into_owned()
}

fn refuse_other_formats(path: &Path) -> Result<()> {
    let extension = path.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase);
    let (format, remedy) = match extension.as_deref() {
        Some("gltf" | "glb") => {
            ("a glTF file", "; write a .toml scene with an [[object]] whose `mesh` is this file")
        }
        Some("pbrt") => ("a pbrt file", ""),
        _ => return Ok(()),
    };
    Err(Error::format(
        path,
        format!(
            "expected a scene in .toml, found {format}, which cannot be rendered as a scene yet{remedy}"
        ),
    ))
}

/// What surfaces are made of where the scene has nothing but an environment.
fn default_material() -> Material {
    Material {
        name: "default".to_owned(),
        kind: MaterialKind::Diffuse { reflectance: Vec3::splat(0.5) },
    }
}

struct Loader<'a> {
    path: &'a Path,
    folder: &'a Path,
}

impl Loader<'_> {
    fn error(&self, message: impl Into<String>) -> Error {
        Error::scene(self.path, message)
    }

    fn check(&self, holds: bool, message: impl FnOnce() -> String) -> Result<()> {
        if holds { Ok(()) } else { Err(self.error(message())) }
    }

    /// All of `values` from `low` to `high`, both included; NaN is not.
    fn check_range(&self, what: &str, values: &[f32], (low, high): (f32, f32)) -> Result<()> {
        match values.iter().find(|value| !(low..=high).contains(*value)) {
            None => Ok(()),
            Some(found) => {
                let expected = match (low, high) {
                    (f32::MIN, f32::MAX) => "a finite number".to_owned(),
                    (low, f32::MAX) => format!("a finite number of at least {low}"),
                    (low, high) => format!("a number from {low} to {high}"),
                };
                Err(self.error(format!("{what}: expected {expected}, found {found}")))
            }
        }
    }

    fn camera(&self, entry: &CameraEntry) -> Result<Camera> {
        let finite = (f32::MIN, f32::MAX);
        self.check_range("camera.position", &entry.position, finite)?;
        self.check_range("camera.look_at", &entry.look_at, finite)?;
        self.check_range("camera.up", &entry.up, finite)?;
        self.check_range("camera.vertical_fov_deg", &[entry.vertical_fov_deg], (0.01, 179.0))?;
        self.check_range("camera.aperture_radius", &[entry.aperture_radius], (0.0, f32::MAX))?;
        let position = Vec3::from_array(entry.position);
        let look_at = Vec3::from_array(entry.look_at);
        let up = Vec3::from_array(entry.up);
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
        })
    }

    fn film(&self, entry: &FilmEntry) -> Result<FilmSettings> {
        for (name, side) in [("width", entry.width), ("height", entry.height)] {
            self.check((1..=MAX_FILM_SIDE).contains(&side), || {
                format!("film.{name}: expected 1 to {MAX_FILM_SIDE} pixels, found {side}")
            })?;
        }
        let filter = match entry.filter {
            FilterEntry::Box => Filter::Box,
            FilterEntry::Gaussian => Filter::Gaussian,
        };
        Ok(FilmSettings { width: entry.width, height: entry.height, filter })
    }

    fn environment(
        &self,
        entry: &EnvironmentEntry,
        warnings: &mut Vec<String>,
    ) -> Result<EnvironmentMap> {
        let (scale, rotation_deg) = (entry.scale, entry.rotation_deg);
        self.check_range("environment.scale", &[scale], (0.0, f32::MAX))?;
        self.check_range("environment.rotation_deg", &[rotation_deg], (f32::MIN, f32::MAX))?;
        match (&entry.map, &entry.constant, &entry.court, &entry.sky) {
            (Some(map), None, None, None) => {
                EnvironmentMap::load(&self.folder.join(map), scale, rotation_deg, warnings)
            }
            (None, Some(constant), None, None) => {
                self.check_range("environment.constant", constant, (0.0, f32::MAX))?;
                EnvironmentMap::constant(Vec3::from_array(*constant), scale)
                    .map_err(|message| self.error(format!("environment.constant: {message}")))
            }
            (None, None, Some(court), None) => EnvironmentMap::court(court, scale, rotation_deg)
                .map_err(|message| self.error(format!("environment.court: {message}"))),
            (None, None, None, Some(sky)) => EnvironmentMap::sky(sky, scale, rotation_deg)
                .map_err(|message| self.error(format!("environment.sky: {message}"))),
            (map, constant, court, sky) => {
                let found: Vec<_> = [
                    ("map", map.is_some()),
                    ("constant", constant.is_some()),
                    ("court", court.is_some()),
                    ("sky", sky.is_some()),
                ]
                .into_iter()
                .filter_map(|(name, is_there)| is_there.then_some(name))
                .collect();
                let found = if found.is_empty() { "none".to_owned() } else { found.join(" and ") };
                Err(self.error(format!(
                    "environment: expected exactly one of map, constant, court, sky, found {found}"
                )))
            }
        }
    }

    fn materials(
        &self,
        entries: &[MaterialEntry],
        warnings: &mut Vec<String>,
    ) -> Result<Vec<Material>> {
        let mut lines = HashMap::new();
        let mut tables = BTreeMap::new();
        let mut materials = Vec::with_capacity(entries.len());
        for entry in entries {
            let label = format!("material `{}` (line {})", entry.name, entry.line);
            if let Some(first) = lines.insert(&entry.name, entry.line) {
                return Err(self
                    .error(format!("{label}: the name is taken by the material of line {first}")));
            }
            let kind = self.material_kind(&label, &entry.kind, &mut tables)?;
            materials.push(Material { name: entry.name.clone(), kind });
        }
        for (path, table) in &tables {
            let named = |warning: &String| format!("{}: {warning}", path.display());
            warnings.extend(table.warnings.iter().map(named));
        }
        Ok(materials)
    }

    fn material_kind(
        &self,
        label: &str,
        kind: &MaterialKindEntry,
        tables: &mut BTreeMap<PathBuf, Arc<MeasuredTable>>,
    ) -> Result<MaterialKind> {
        Ok(match kind {
            MaterialKindEntry::Diffuse(entry) => MaterialKind::Diffuse {
                reflectance: self.reflectance(label, "reflectance", entry.reflectance)?,
            },
            MaterialKindEntry::Plastic(entry) => {
                self.check_range(&format!("{label}: ior"), &[entry.ior], (1.01, 4.0))?;
                MaterialKind::Plastic {
                    diffuse: self.reflectance(label, "diffuse", entry.diffuse)?,
                    alpha: self.alpha(label, entry.alpha, entry.roughness)?,
                    ior: entry.ior,
                }
            }
            MaterialKindEntry::Conductor(entry) => MaterialKind::Conductor {
                alpha: self.alpha(label, entry.alpha, entry.roughness)?,
                fresnel: self.fresnel(label, entry)?,
            },
            MaterialKindEntry::Measured(entry) => {
                let path = self.folder.join(&entry.file);
                let table = match tables.get(&path) {
                    Some(table) => Arc::clone(table),
                    None => {
                        let table = Arc::new(MeasuredTable::load(&path)?);
                        tables.insert(path.clone(), Arc::clone(&table));
                        table
                    }
                };
                MaterialKind::Measured { path, table }
            }
        })
    }

    fn reflectance(&self, label: &str, key: &str, reflectance: [f32; 3]) -> Result<Vec3> {
        self.check_range(&format!("{label}: {key}"), &reflectance, (0.0, 1.0))?;
        Ok(Vec3::from_array(reflectance))
    }

    fn alpha(&self, label: &str, alpha: Option<f32>, roughness: Option<f32>) -> Result<f32> {
        match (alpha, roughness) {
            (Some(alpha), None) => {
                self.check_range(&format!("{label}: alpha"), &[alpha], (MIN_ALPHA, 1.0))?;
                Ok(alpha)
            }
            (None, Some(roughness)) => {
                let range = (MIN_ALPHA.sqrt(), 1.0);
                self.check_range(&format!("{label}: roughness"), &[roughness], range)?;
                Ok((roughness * roughness).max(MIN_ALPHA))
            }
            (alpha, _) => {
                let found = if alpha.is_some() { "both" } else { "neither" };
                Err(self.error(format!(
                    "{label}: expected exactly one of alpha and roughness, found {found}"
                )))
            }
        }
    }

    fn fresnel(&self, label: &str, entry: &ConductorEntry) -> Result<ConductorFresnel> {
        match (entry.reflectance, entry.eta, entry.k) {
            (Some(reflectance), None, None) => Ok(ConductorFresnel::Schlick {
                reflectance: self.reflectance(label, "reflectance", reflectance)?,
            }),
            (None, Some(eta), Some(k)) => {
                self.check_range(&format!("{label}: eta"), &eta, (0.01, 100.0))?;
                self.check_range(&format!("{label}: k"), &k, (0.0, 100.0))?;
                Ok(ConductorFresnel::Exact { eta: Vec3::from_array(eta), k: Vec3::from_array(k) })
            }
            _ => {
                Err(self
                    .error(format!("{label}: a conductor needs either reflectance, or eta and k")))
            }
        }
    }

    fn geometry(
        &self,
        objects: &[ObjectEntry],
        materials: &mut Vec<Material>,
        warnings: &mut Vec<String>,
    ) -> Result<Geometry> {
        let mut named = HashMap::new();
        let mut uses: HashMap<PathBuf, usize> = HashMap::new();
        for (index, object) in objects.iter().enumerate() {
            let label = object_label(index, object);
            if let Some(name) = &object.name
                && let Some(first) = named.insert(name, object.line)
            {
                return Err(
                    self.error(format!("{label}: the name is taken by the object of line {first}"))
                );
            }
            self.check_placement(&label, object)?;
            self.check_material(&label, object, materials)?;
            *uses.entry(self.mesh_key(object)).or_default() += 1;
        }
        // All meshes are read before any is placed, so that the arrays are allocated once.
        let mut meshes = HashMap::new();
        let (mut vertices, mut triangles) = (0, 0);
        for (index, object) in objects.iter().enumerate() {
            let key = self.mesh_key(object);
            if !meshes.contains_key(&key) {
                let mesh = match &object.source {
                    ObjectSource::Mesh(_) => Mesh::read(&key, warnings)?,
                    ObjectSource::Shape(shape) => shape.mesh().map_err(|message| {
                        self.error(format!("{}: {message}", object_label(index, object)))
                    })?,
                };
                meshes.insert(key.clone(), mesh);
            }
            vertices += meshes[&key].positions.len();
            triangles += meshes[&key].triangles.len();
        }
        self.check(u32::try_from(vertices).is_ok() && u32::try_from(triangles).is_ok(), || {
            format!(
                "{vertices} vertices and {triangles} triangles, at most {} can be used",
                u32::MAX
            )
        })?;
        let mut geometry = Geometry::default();
        geometry.positions.reserve_exact(vertices);
        geometry.normals.reserve_exact(vertices);
        geometry.triangles.reserve_exact(triangles);
        geometry.materials.reserve_exact(triangles);
        for (index, object) in objects.iter().enumerate() {
            let key = self.mesh_key(object);
            self.place(index, object, &meshes[&key], &mut geometry, materials, warnings)?;
            // A mesh is let go with its last use, so that a large one is not held twice for long.
            let left = uses.get_mut(&key).map_or(0, |left| {
                *left -= 1;
                *left
            });
            if left == 0 {
                meshes.remove(&key);
            }
        }
        Ok(geometry)
    }

    /// What tells meshes apart: the path of a mesh file, the parameters of a shape.
    fn mesh_key(&self, object: &ObjectEntry) -> PathBuf {
        match &object.source {
            ObjectSource::Mesh(mesh) => self.folder.join(mesh),
            ObjectSource::Shape(shape) => PathBuf::from(format!("{shape:?}")),
        }
    }

    fn check_placement(&self, label: &str, object: &ObjectEntry) -> Result<()> {
        let finite = (f32::MIN, f32::MAX);
        self.check_range(&format!("{label}: translate"), &object.translate, finite)?;
        self.check_range(&format!("{label}: rotate_deg"), &object.rotate_deg, finite)?;
        self.check_range(&format!("{label}: scale"), &object.scale, finite)?;
        self.check(!object.scale.contains(&0.0), || {
            format!("{label}: scale must not be 0, found {:?}", object.scale)
        })
    }

    fn check_material(
        &self,
        label: &str,
        object: &ObjectEntry,
        materials: &[Material],
    ) -> Result<()> {
        match &object.material {
            Some(name) => {
                let is_known = materials.iter().any(|material| material.name == *name);
                self.check(is_known, || {
                    let known: Vec<_> = materials.iter().map(|known| known.name.as_str()).collect();
                    let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                    format!("{label}: unknown material `{name}`, the scene has {known}")
                })
            }
            None => self.check(matches!(object.source, ObjectSource::Mesh(_)), || {
                format!("{label}: expected a material, found none")
            }),
        }
    }

    /// Refuses an object that lies too far out for traversal.
    fn check_extent(&self, label: &str, positions: &[[f32; 3]]) -> Result<()> {
        let distances = positions.iter().flatten().map(|coordinate| coordinate.abs());
        let farthest = distances.fold(0.0, f32::max);
        self.check(farthest <= MAX_COORDINATE, || {
            format!(
                "{label}: a vertex has the coordinate {farthest:e}; expected at most \
                 {MAX_COORDINATE:e} m: scale or move the object"
            )
        })
    }

    /// Appends one object to the geometry, and the materials of its mesh file where it names none.
    fn place(
        &self,
        index: usize,
        object: &ObjectEntry,
        mesh: &Mesh,
        geometry: &mut Geometry,
        materials: &mut Vec<Material>,
        warnings: &mut Vec<String>,
    ) -> Result<()> {
        let label = object_label(index, object);
        let transform = Transform::new(object.scale, object.rotate_deg, object.translate);
        let first_vertex = geometry.positions.len();
        let named = object
            .material
            .as_ref()
            .and_then(|name| materials.iter().position(|material| material.name == *name));
        let dropped = if let Some(material) = named {
            geometry.append(mesh, &transform, |_| material as u32)
        } else {
            let first = materials.len();
            let colored =
                !mesh.runs.is_empty() && mesh.runs.iter().all(|run| run.material.is_some());
            self.check(colored, || {
                format!(
                    "{label}: expected a material, found none, and the mesh file does not give one \
                     to every triangle"
                )
            })?;
            materials.extend(mesh.materials.iter().map(|material| Material {
                name: format!("{}/{}", object.name.as_deref().unwrap_or("mesh"), material.name),
                kind: MaterialKind::Diffuse { reflectance: Vec3::from_array(material.base_color) },
            }));
            geometry.append(mesh, &transform, |triangle| {
                let run = mesh.runs.partition_point(|run| run.first_triangle <= triangle) - 1;
                (first + mesh.runs[run].material.unwrap_or(0)) as u32
            })
        };
        let of = mesh.triangles.len();
        self.check_extent(&label, &geometry.positions[first_vertex..])?;
        for (count, what) in [
            (dropped.degenerate, format!("triangles of zero area of {of}")),
            (dropped.non_finite, format!("triangles with infinite or NaN corners of {of}")),
            (dropped.normals, "infinite or NaN normals (shaded flat there)".to_owned()),
        ] {
            if count > 0 {
                warnings.push(format!("{label}: dropped {count} {what}"));
            }
        }
        if of == 0 {
            warnings.push(format!("{label}: the mesh has no triangles"));
        }
        Ok(())
    }
}

/// The object in messages: its name, or its number and what it is made of.
fn object_label(index: usize, object: &ObjectEntry) -> String {
    let source = match &object.source {
        ObjectSource::Mesh(mesh) => mesh.display().to_string(),
        ObjectSource::Shape(shape) => shape.name().to_owned(),
    };
    match &object.name {
        Some(name) => format!("object `{name}` ({source}, line {})", object.line),
        None => format!("object {index} ({source}, line {})", object.line),
    }
}
