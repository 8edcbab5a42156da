//! A glTF or OBJ file as a whole scene: its meshes, materials, lamps and camera in a given environment.

use std::{collections::BTreeMap, path::Path};

use glam::Vec3;

use super::{
    LoadOptions, Loader, MAX_FILM_SIDE, default_material,
    inside::{self, View},
    objects::lacking_uvs,
};
use crate::{
    Asked, FilmSettings, Filter, Geometry,
    error::Result,
    features::{self, Ignored},
    file::CameraEntry,
    files,
    geometry::{Dropped, DroppedOfMany},
    import::Imported,
    instance::{Budget, Instance, MAX_INSTANCES, bounds},
    material::{Material, MaterialKind, Principled},
    mesh::{Mesh, MeshCamera, MeshMaterial, RepeatedMesh},
    transform::Transform,
};

/// Width of the film, pixels; the camera's aspect ratio gives the height.
const FILM_WIDTH: u32 = 640;
/// Aspect ratio of a camera that states none.
const ASPECT_RATIO: f32 = 4.0 / 3.0;
/// Direction from the middle of the scene to the camera that frames it, and its field of view.
const FRAMING_DIRECTION: Vec3 = Vec3::new(0.5, 0.4, 1.0);
const FRAMING_FOV_DEG: f32 = 45.0;
/// Field of view of a camera in a room.
const INSIDE_FOV_DEG: f32 = 60.0;

impl Loader<'_> {
    /// Reads the mesh file at the loader's path as a whole scene, or as one to be included: no camera of it
    /// is used, and nothing of the materials that are `replaced`.
    pub(super) fn whole(&self, replaced: Option<&BTreeMap<String, String>>) -> Result<Imported> {
        let mut warnings = Vec::new();
        let variant = self.options.variant.as_deref().filter(|_| replaced.is_none());
        let budget = Some(Budget::default());
        let mesh = Mesh::read_at(self.path, self.options.time, variant, budget, &mut warnings)?;
        let mut ignored = mesh.ignored_in_materials(|name| {
            replaced.is_some_and(|replaced| replaced.contains_key(name))
        });
        let chosen = if replaced.is_some() {
            for (index, camera) in mesh.cameras.iter().enumerate() {
                ignored.add(features::GLTF_CAMERAS, || camera.label(index));
            }
            None
        } else {
            self.choose_camera(&mesh.cameras, &mut ignored)?
        };
        let (materials, geometry) = self.place_whole(&mesh, &mut ignored, &mut warnings)?;
        warnings.extend(ignored.warnings(self.path));
        let aspect_ratio = chosen.and_then(|camera| camera.perspective.aspect_ratio);
        let aspect_ratio = aspect_ratio.filter(|ratio| *ratio > 0.0).unwrap_or(ASPECT_RATIO);
        let height = (FILM_WIDTH as f32 / aspect_ratio).round();
        let film = FilmSettings {
            width: FILM_WIDTH,
            height: (height as u32).clamp(1, MAX_FILM_SIDE),
            filter: Filter::Gaussian,
        };
        let inputs = [vec![self.path.to_path_buf()], mesh.side_files].concat();
        let (environment, lamps) = (None, mesh.lamps);
        let asked = Asked::default();
        Ok(Imported {
            camera: chosen.map(camera_entry),
            film,
            asked,
            environment,
            lamps,
            materials,
            geometry,
            variants: mesh.variants,
            inputs,
            warnings,
        })
    }

    /// Finds the camera that the options name, else the first, rather one with perspective; the others are
    /// ignored.
    fn choose_camera<'a>(
        &self,
        cameras: &'a [MeshCamera],
        ignored: &mut Ignored,
    ) -> Result<Option<&'a MeshCamera>> {
        let chosen = match &self.options.camera {
            None => (0..cameras.len()).min_by_key(|index| cameras[*index].is_orthographic),
            Some(name) => {
                let has_name = |camera: &MeshCamera| camera.names.iter().any(|own| own == name);
                let by_number = || name.parse().ok().filter(|&index: &usize| index < cameras.len());
                let found = cameras.iter().position(has_name).or_else(by_number);
                let Some(index) = found else {
                    let labels: Vec<_> = (0..).zip(cameras).map(|(i, c)| c.label(i)).collect();
                    let known =
                        if labels.is_empty() { "none".to_owned() } else { labels.join(", ") };
                    return Err(self.error(format!(
                        "--camera {name}: there is no such camera, the file has {known}"
                    )));
                };
                Some(index)
            }
        };
        for (index, camera) in cameras.iter().enumerate() {
            let feature = match camera.is_orthographic {
                true => features::GLTF_ORTHOGRAPHIC,
                false if Some(index) != chosen => features::GLTF_CAMERAS,
                false => continue,
            };
            ignored.add(feature, || camera.label(index));
        }
        Ok(chosen.map(|index| &cameras[index]))
    }

    /// Takes the mesh as it stands, with one material more for triangles without.
    fn place_whole(
        &self,
        mesh: &Mesh,
        ignored: &mut Ignored,
        warnings: &mut Vec<String>,
    ) -> Result<(Vec<Material>, Geometry)> {
        let named = |(index, entry): (usize, &MeshMaterial)| match entry.material.name.as_str() {
            "" => Material { name: format!("material {index}"), ..entry.material.clone() },
            _ => entry.material.clone(),
        };
        let mut materials: Vec<_> = mesh.materials.iter().enumerate().map(named).collect();
        let lacking = materials.len();
        if mesh.runs.is_empty()
            || mesh.runs.iter().any(|run| run.material.is_none())
            || mesh.repeated.iter().any(|repeated| repeated.material.is_none())
        {
            // An OBJ file leaves the material open; glTF defines the one that is meant.
            let is_colored = !mesh.colors.is_empty()
                || mesh.repeated.iter().any(|repeated| !repeated.mesh.colors.is_empty());
            let mut default = if files::extension(self.path) != "obj" {
                Material::new("default", MaterialKind::Principled(Principled::default()))
            } else if is_colored {
                Material::new("default", MaterialKind::Diffuse { reflectance: Vec3::ONE })
            } else {
                if !mesh.triangles.is_empty() {
                    ignored.add(features::OBJ_NO_MATERIAL, || "the first faces".to_owned());
                }
                default_material()
            };
            default.surface.vertex_color = is_colored;
            materials.push(default);
        }
        let has_material = mesh.runs.iter().any(|run| run.material.is_some());
        if files::extension(self.path) == "obj" && !mesh.colors.is_empty() && has_material {
            ignored.add(features::OBJ_COLOR, || "all vertices".to_owned());
        }
        let mut geometry = Geometry::default();
        let transform = Transform::new([1.0; 3], [0.0; 3], [0.0; 3]);
        geometry.start_object(&self.path.file_stem().unwrap_or_default().to_string_lossy());
        let dropped = geometry.append(mesh, &transform, |triangle| {
            mesh.material_of(triangle).unwrap_or(lacking) as u32
        });
        let mut dropped_of_repeated = DroppedOfMany::default();
        for repeated in &mesh.repeated {
            let material = repeated.material.unwrap_or(lacking);
            let emits = materials[material].surface.emission.is_some();
            let dropped = self.place_repeated(repeated, material as u32, emits, &mut geometry)?;
            let triangles = repeated.mesh.triangles.len();
            dropped_of_repeated.add(dropped, triangles, || "a mesh of several nodes".to_owned());
        }
        warnings.extend(dropped_of_repeated.warnings(self.path));
        let label = self.path.display().to_string();
        let is_repeated =
            |index: usize| mesh.repeated.iter().any(|repeated| repeated.material == Some(index));
        let copied = materials.iter().enumerate().filter(|(index, _)| !is_repeated(*index));
        warnings.extend(copied.filter_map(|(_, own)| lacking_uvs(&label, own, mesh)));
        warnings.extend(dropped.warnings(&label, mesh.triangles.len()));
        Ok((materials, geometry))
    }

    /// Adds the instances of a mesh that the file repeats; copies, if it emits light.
    fn place_repeated(
        &self,
        repeated: &RepeatedMesh,
        material: u32,
        emits: bool,
        geometry: &mut Geometry,
    ) -> Result<Dropped> {
        let mesh = &*repeated.mesh;
        let count = geometry.instances.len() + repeated.places.len();
        self.check(count <= MAX_INSTANCES, || {
            format!("{count} instances, at most {MAX_INSTANCES} can be used")
        })?;
        geometry.start_object(&repeated.name);
        let (prototype, mut dropped) = geometry.add_prototype(mesh, |_| 0);
        for place in &repeated.places {
            let Some(transform) = Transform::from_matrix(place.as_dmat4()) else {
                // Scaled to nothing.
                dropped.degenerate += mesh.triangles.len();
                continue;
            };
            let instance = Instance::new(prototype.index, &transform, material, true);
            match instance.filter(|_| !emits) {
                Some(instance) => geometry.instances.push(instance),
                None => {
                    self.check_counts(geometry, mesh.positions.len(), mesh.triangles.len())?;
                    dropped.add(geometry.append(mesh, &transform, |_| material));
                }
            }
        }
        Ok(dropped)
    }

    /// Camera of the options, if these state all of it; else one inside a room, or one that sees the whole
    /// bounding sphere of the bounding box, with a warning.
    pub(super) fn frame(
        &self,
        geometry: &Geometry,
        warnings: &mut Vec<String>,
    ) -> Result<CameraEntry> {
        let Some([low, high]) = bounds(geometry.used_extent()) else {
            let why = warnings.iter().find(|text| text.contains("dropped"));
            let why = why.map_or(String::new(), |text| format!(" ({text})"));
            let message = "expected triangles or a camera, found neither";
            return Err(self.error(format!("{message}{why}")));
        };
        if let LoadOptions {
            look_from: Some(position),
            look_at: Some(look_at),
            vertical_fov_deg: Some(fov),
            ..
        } = *self.options
        {
            return Ok(pinhole(position.into(), look_at.into(), Vec3::Y, fov));
        }
        let (position, look_at, fov, does) = match inside::view(geometry, low, high) {
            Some(View { from, at }) => (from, at, INSIDE_FOV_DEG, "stands in the room"),
            None => {
                let (centre, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
                let distance = radius / (0.5 * FRAMING_FOV_DEG).to_radians().sin();
                let position = centre + distance * FRAMING_DIRECTION.normalize();
                (position, centre, FRAMING_FOV_DEG, "frames the bounding box")
            }
        };
        let ([x, y, z], [u, v, w]) = (position.to_array(), look_at.to_array());
        warnings.push(format!(
            "{}: no perspective camera; one that {does} takes its place: --look-from \
             {x:.3},{y:.3},{z:.3} --look-at {u:.3},{v:.3},{w:.3} --fov {fov}",
            self.path.display(),
        ));
        Ok(pinhole(position, look_at, Vec3::Y, fov))
    }
}

fn pinhole(position: Vec3, look_at: Vec3, up: Vec3, vertical_fov_deg: f32) -> CameraEntry {
    CameraEntry {
        position: position.to_array(),
        look_at: look_at.to_array(),
        up: up.to_array(),
        vertical_fov_deg,
        aperture_radius: 0.0,
        focus_distance: None,
        shift: [0.0; 2],
        mirrored: false,
    }
}

/// Entry of a camera of the file, for the checks that all cameras pass.
fn camera_entry(camera: &MeshCamera) -> CameraEntry {
    let matrix = camera.world_from_camera;
    let position = matrix.w_axis.truncate();
    // Look at a point so far away that single precision keeps the direction.
    let distance = position.length().max(1.0);
    let forward = matrix.transform_vector3(Vec3::NEG_Z).normalize_or_zero();
    let up = matrix.transform_vector3(Vec3::Y).normalize_or_zero();
    let fov_deg = camera.perspective.vertical_fov_rad.to_degrees();
    pinhole(position, position + distance * forward, up, fov_deg)
}

/// Checks that a mesh file is one that [`Loader::whole`] reads.
pub(super) fn is_whole(path: &Path) -> bool {
    matches!(files::extension(path).as_str(), "gltf" | "glb" | "obj")
}
