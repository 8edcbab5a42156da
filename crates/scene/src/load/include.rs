//! Files of other formats: as whole scenes, with the options of the command line, and by `[[include]]`,
//! placed in another scene.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{Loader, default_material, objects::lit_material, whole};
use crate::{
    EnvironmentMap, Geometry, Lamp, Scene,
    beside::Folder,
    error::Result,
    file::{Entry, IncludeKeys},
    files,
    import::Imported,
    instance::Instance,
    lamp::{LampKind, Spot},
    material::{Material, MaterialKind},
    mesh::Mesh,
    mitsuba, pbrt,
    transform::Transform,
};

impl Loader<'_> {
    /// Appends triangles, lamps and materials of a file to those of the scene, apart from the materials that
    /// the entry replaces.
    pub(super) fn include(&self, entry: &Entry<IncludeKeys>, scene: &mut Scene) -> Result<()> {
        let IncludeKeys { file, scale, rotate_deg, translate, materials: replaced, light_group } =
            &entry.keys;
        let label = format!("include {} (line {})", file.display(), entry.line);
        self.check_light_group(&label, light_group.as_deref())?;
        self.check_transform(&label, scale.0, *rotate_deg, *translate)?;
        let path = self.file(file);
        let imported = self.beside(&path).import(Some(replaced))?.ok_or_else(|| {
            self.error(format!(
                "{label}: expected a file in .gltf, .glb, .obj, .pbrt or .xml; other meshes are objects"
            ))
        })?;
        let Imported { materials: own_materials, geometry: mut placed, mut lamps, .. } = imported;
        let Scene { materials, geometry, inputs, warnings, .. } = scene;
        inputs.extend(imported.inputs);
        warnings.extend(imported.warnings);
        if imported.environment.is_some_and(|environment| !environment.is_black()) {
            warnings.push(format!("{label}: ignored the environment of the file"));
        }
        for name in replaced.keys() {
            let is_there = own_materials.iter().any(|material| material.name == *name);
            self.check(is_there, || {
                let names: Vec<_> = own_materials.iter().map(|own| own.name.as_str()).collect();
                format!(
                    "{label}: materials: expected names of the file's materials, found `{name}`; \
                     the file has {}",
                    names.join(", ")
                )
            })?;
        }
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let transform = Transform::new(scale.0, *rotate_deg, *translate);
        let length_scale = transform.linear.determinant().abs().cbrt();
        let mut places = Vec::with_capacity(own_materials.len());
        for mut own in own_materials {
            if let MaterialKind::Dielectric { absorption, .. } = &mut own.kind {
                *absorption /= length_scale;
            }
            places.push(match replaced.get(&own.name) {
                Some(name) => {
                    let index = self.material_index(&label, name, materials)?;
                    light_group.as_ref().map_or(index, |group| {
                        lit_material(index as usize, group, materials) as u32
                    })
                }
                None => {
                    if own.surface.emission.is_some() {
                        own.surface.light_group.clone_from(light_group);
                    }
                    let name = format!("{stem}/{}", own.name);
                    materials.push(Material { name, ..own });
                    materials.len() as u32 - 1
                }
            });
        }
        if let Some(group) = light_group {
            let is_lit = |place: &u32| materials[*place as usize].surface.emission.is_some();
            if lamps.is_empty() && !places.iter().any(is_lit) {
                warnings.push(format!("{label}: ignored light_group: the file emits no light"));
            }
            lamps.iter_mut().for_each(|lamp| lamp.light_group = Some(group.clone()));
        }
        self.check_counts(geometry, placed.positions.len(), placed.triangles.len())?;
        let first_vertex = geometry.positions.len();
        let count = placed.triangle_count() as usize;
        for start in &mut placed.objects {
            start.name = format!("{stem}/{}", start.name);
        }
        self.include_instances(&label, geometry, &mut placed, &transform, &places, materials)?;
        let Geometry { positions, normals, uvs, tangents, colors, triangles, objects, .. } = placed;
        let rest = Mesh::default();
        let mesh = Mesh { positions, normals, uvs, tangents, colors, triangles, objects, ..rest };
        let of = |index: usize| places[placed.materials[index] as usize];
        let dropped = geometry.append(&mesh, &transform, of);
        let positions = geometry.positions[first_vertex..].iter().copied().map(Vec3::from);
        self.check_extent(&label, positions)?;
        warnings.extend(dropped.warnings(&label, count));
        if count == 0 && lamps.is_empty() {
            warnings.push(format!("{label}: the file has no triangles and no lamps"));
        }
        scene.lamps.extend(lamps.into_iter().map(|lamp| place_lamp(lamp, &transform)));
        Ok(())
    }

    /// Takes over the instances of an included file, whose materials have `places` among those of the scene.
    fn include_instances(
        &self,
        label: &str,
        geometry: &mut Geometry,
        placed: &mut Geometry,
        transform: &Transform,
        places: &[u32],
        materials: &[Material],
    ) -> Result<()> {
        let first_prototype = geometry.prototypes.len() as u32;
        geometry.prototypes.append(&mut placed.prototypes);
        let boxes = geometry.prototypes();
        let mut objects = placed.objects.iter().peekable();
        for (index, instance) in placed.instances.iter().enumerate() {
            while let Some(object) = objects.next_if(|start| start.first_instance <= index) {
                geometry.start_object(&object.name);
            }
            // In files of other formats an instance has one material.
            let prototype = first_prototype + instance.prototype;
            let first_material = places[instance.first_material as usize];
            let placed = Instance { prototype, first_material, ..*instance };
            let moved = placed.moved(transform).ok_or_else(|| {
                self.error(format!("{label}: expected a placement of instances with an inverse"))
            })?;
            self.check_extent(label, boxes[prototype as usize].corners(&moved))?;
            if materials[first_material as usize].surface.emission.is_some() {
                // A material of the scene may emit in place of one of the file that does not.
                let mesh = std::mem::take(&mut geometry.prototypes[prototype as usize]);
                let checked =
                    self.check_counts(geometry, mesh.positions.len(), mesh.triangles.len());
                if checked.is_ok() {
                    geometry.place_instance(&moved, &mesh);
                }
                geometry.prototypes[prototype as usize] = mesh;
                checked?;
            } else {
                geometry.instances.push(moved);
            }
        }
        Ok(())
    }

    /// Reads the file at the loader's path by its extension; none for a format that is no whole scene. A file
    /// to be included comes with the names of its materials that others replace.
    pub(super) fn import(
        &self,
        replaced: Option<&BTreeMap<String, String>>,
    ) -> Result<Option<Imported>> {
        let camera = self.options.camera.as_deref();
        let folder = || Folder::of(self.path).allowing(self.options.allow_root.as_deref());
        let mut imported = if files::extension(self.path) == "xml" {
            mitsuba::read(self.path, camera, folder())?
        } else if pbrt::is_pbrt(self.path) {
            if let Some(name) = camera {
                let message = "a pbrt file has one camera; the option is for glTF files";
                return Err(self.error(format!("--camera {name}: {message}")));
            }
            pbrt::read(self.path, folder())?
        } else if whole::is_whole(self.path) {
            self.whole(replaced)?
        } else {
            return Ok(None);
        };
        self.check_extent("the scene", imported.geometry.extent())?;
        if imported.materials.is_empty() {
            imported.materials.push(default_material());
        }
        Ok(Some(imported))
    }

    /// Makes a scene of an imported file. The map of `--environment` replaces its own; a format without
    /// one is lit by white.
    pub(super) fn imported(&self, imported: Imported) -> Result<Scene> {
        let Imported { asked, lamps, materials, geometry, variants, inputs, mut warnings, .. } =
            imported;
        let camera = match imported.camera {
            Some(camera) => camera,
            None => self.frame(&geometry, &mut warnings)?,
        };
        let empty = self.scene(&camera, imported.film)?;
        let mut scene =
            Scene { asked, lamps, materials, geometry, variants, inputs, warnings, ..empty };
        scene.environment = match (&self.options.environment, imported.environment) {
            (Some(map), _) => {
                scene.inputs.push(map.clone());
                EnvironmentMap::load(map, 1.0, &mut scene.warnings)?
            }
            (None, Some(environment)) => environment,
            (None, None) => {
                scene.warnings.push(format!(
                    "{}: no --environment; lit by white light of radiance 1 from everywhere",
                    self.path.display()
                ));
                self.uniform_light(Vec3::ONE)?
            }
        };
        if let Some(rotation_deg) = self.options.rotation_deg {
            scene.environment = scene.environment.turned(rotation_deg);
        }
        Ok(self.finished(scene))
    }
}

/// Places a lamp of a file. Intensities grow with the square of the scale, so that the lamp lights its
/// file as before, and as surfaces that emit do.
fn place_lamp(mut lamp: Lamp, transform: &Transform) -> Lamp {
    let area = transform.linear.determinant().abs().powf(2.0 / 3.0);
    if let LampKind::Point { position, intensity }
    | LampKind::Spot(Spot { position, intensity, .. }) = &mut lamp.kind
    {
        *position = transform.position(position.to_array()).into();
        *intensity *= area;
    }
    if let LampKind::Spot(Spot { direction, .. }) | LampKind::Directional { direction, .. } =
        &mut lamp.kind
    {
        *direction = (transform.linear * *direction).normalize_or(*direction);
    }
    lamp
}
