//! Objects of the scene file → triangles in world space.

use std::{
    collections::{HashMap, HashSet},
    path::PathBuf,
};

use glam::Vec3;

use super::{FINITE, Loader};
use crate::{
    Geometry, Scene,
    error::{Error, Result},
    features::{self, Ignored},
    file::{ObjectEntry, ObjectKeys, ObjectSource},
    geometry::check_extent,
    instance::{Budget, Instance},
    instances::Prototype,
    material::Material,
    memory,
    mesh::{Mesh, MeshMaterial, label},
    shapes::check_triangles,
    stage,
    transform::Transform,
};

/// Bytes of a placed vertex: position, normal, coordinates, tangent.
const VERTEX_BYTES: u64 = 48;
/// Bytes of a placed triangle: corners and material.
const TRIANGLE_BYTES: u64 = 16;

impl Loader<'_> {
    pub(super) fn geometry(&self, objects: &[ObjectEntry], scene: &mut Scene) -> Result<()> {
        let labelled =
            |(index, object)| (object, object_label(index, object), self.mesh_key(object));
        let objects: Vec<_> = objects.iter().enumerate().map(labelled).collect();
        let mut named = HashMap::new();
        let mut uses: HashMap<&PathBuf, usize> = HashMap::new();
        for (object, label, key) in &objects {
            if let Some(name) = &object.keys.name
                && let Some(first) = named.insert(name, object.line)
            {
                return Err(
                    self.error(format!("{label}: the name is taken by the object of line {first}"))
                );
            }
            let ObjectKeys { scale, rotate_deg, translate, .. } = &object.keys;
            self.check_transform(label, scale.0, *rotate_deg, *translate)?;
            match &object.keys.material {
                Some(name) => self.material_index(label, name, &scene.materials).map(drop)?,
                None => self.check(matches!(object.kind, ObjectSource::Mesh(_)), || {
                    format!("{label}: expected a material, found none")
                })?,
            }
            self.check_light_group(label, object.keys.light_group.as_deref())?;
            *uses.entry(key).or_default() += 1;
        }
        let materials = &scene.materials;
        let keys = |is_asked: &dyn Fn(Option<&Material>) -> bool| -> HashSet<&PathBuf> {
            let asked = objects.iter().filter(|of| is_asked(named_material(of.0, materials)));
            asked.map(|(_, _, key)| key).collect()
        };
        let own_materials = keys(&|named| named.is_none());
        // Shapes without textures need no texture coordinates, and their scenes keep their hashes.
        let textured = keys(&|named| named.is_some_and(|own| own.surface.reads_uvs()));
        let colored = keys(&|named| named.is_some_and(|own| own.surface.vertex_color));
        // Read all meshes before placing any, so that the arrays are allocated once.
        let mut meshes = HashMap::new();
        let mut shape_triangles = 0;
        let mut budget = Budget::default();
        let mut repeated = HashSet::new();
        for (object, label, key) in &objects {
            if !meshes.contains_key(key) {
                let mesh = match &object.kind {
                    ObjectSource::Mesh(name) if self.arrays.meshes.contains_key(name) => {
                        let mut mesh = self.arrays.meshes[name].clone();
                        mesh.check()
                            .map_err(|message| self.error(format!("{label}: {message}")))?;
                        if !mesh.colors.is_empty() && !colored.contains(key) {
                            let remedy = "the material has no `vertex_color = true`";
                            let warning = "ignored the vertex colours";
                            scene.warnings.push(format!("{label}: {warning}: {remedy}"));
                            mesh.colors.clear();
                        }
                        mesh
                    }
                    ObjectSource::Mesh(_) => {
                        let (time, warnings) = (self.options.time, &mut scene.warnings);
                        let mut mesh = Mesh::read_at(key, time, None, None, warnings)?;
                        // The object of the scene is one, whatever parts its file has.
                        mesh.objects.clear();
                        scene.inputs.push(key.clone());
                        scene.inputs.extend_from_slice(&mesh.side_files);
                        let mut ignored = ignored_in_object(&mesh, own_materials.contains(key));
                        let feature = match crate::files::extension(key).as_str() {
                            "ply" => Some(features::PLY_COLOR),
                            "obj" => Some(features::OBJ_COLOR),
                            _ => None,
                        };
                        if let Some(feature) = feature
                            && !mesh.colors.is_empty()
                            && !colored.contains(key)
                        {
                            ignored.add(feature, || "all vertices".to_owned());
                            mesh.colors.clear();
                        }
                        warnings.extend(ignored.warnings(key));
                        mesh
                    }
                    ObjectSource::Shape { shape, .. } => {
                        stage::enter(format_args!("making {label}"));
                        let mut mesh = shape
                            .mesh()
                            .map_err(|message| self.error(format!("{label}: {message}")))?;
                        if !textured.contains(key) {
                            mesh.uvs = Default::default();
                        }
                        shape_triangles += mesh.triangles.len();
                        self.check_shapes(label, shape_triangles)?;
                        mesh
                    }
                };
                let copies = uses[key];
                if copies > 1 && budget.takes_instances(copies, mesh.triangles.len()) {
                    repeated.insert(key);
                }
                meshes.insert(key, mesh);
            }
        }
        let (mut vertices, mut triangles, mut shape_triangles) = (0_usize, 0_usize, 0);
        for (object, label, key) in &objects {
            let mesh = &meshes[key];
            if repeated.contains(key) && !emits(object, mesh, &scene.materials) {
                continue;
            }
            let count = mesh.triangles.len();
            vertices += mesh.positions.len();
            triangles += count;
            if let ObjectSource::Shape { .. } = object.kind {
                shape_triangles += count;
                self.check_shapes(label, shape_triangles)?;
            }
        }
        self.check_counts(&scene.geometry, vertices, triangles)?;
        let mut prototypes: HashMap<&PathBuf, Prototype> = HashMap::new();
        let geometry = &mut scene.geometry;
        geometry.positions.reserve_exact(vertices);
        geometry.normals.reserve_exact(vertices);
        geometry.triangles.reserve_exact(triangles);
        geometry.materials.reserve_exact(triangles);
        for (object, label, key) in &objects {
            let mesh = &meshes[key];
            let is_instance = repeated.contains(key) && !emits(object, mesh, &scene.materials);
            if is_instance && !prototypes.contains_key(key) {
                let own = |triangle| run_material(mesh, triangle) as u32;
                let (prototype, dropped) = scene.geometry.add_prototype(mesh, own);
                scene.warnings.extend(dropped.warnings(label, mesh.triangles.len()));
                prototypes.insert(key, prototype);
            }
            let prototype = prototypes.get(key).copied().filter(|_| is_instance);
            self.place(label, object, mesh, prototype, scene)?;
            // Drop a mesh after its last use, so that a large one is not held twice for long.
            if let Some(left) = uses.get_mut(key) {
                *left -= 1;
                if *left == 0 {
                    meshes.remove(key);
                }
            }
        }
        Ok(())
    }

    /// Key that tells meshes apart: the path of a mesh file or the parameters of a shape.
    fn mesh_key(&self, object: &ObjectEntry) -> PathBuf {
        match &object.kind {
            ObjectSource::Mesh(mesh) => self.file(mesh),
            ObjectSource::Shape { shape, .. } => PathBuf::from(format!("{shape:?}")),
        }
    }

    fn check_shapes(&self, label: &str, triangles: usize) -> Result<()> {
        check_triangles(triangles).map_err(|message| self.error(format!("{label}: {message}")))
    }

    pub(super) fn check_transform(
        &self,
        label: &str,
        scale: [f32; 3],
        rotate_deg: [f32; 3],
        translate: [f32; 3],
    ) -> Result<()> {
        self.check_range(&format!("{label}: translate"), &translate, FINITE)?;
        self.check_range(&format!("{label}: rotate_deg"), &rotate_deg, FINITE)?;
        self.check_range(&format!("{label}: scale"), &scale, FINITE)?;
        self.check(!scale.contains(&0.0), || {
            format!("{label}: scale must not be 0, found {scale:?}")
        })
    }

    /// Checks that 32-bit indices address everything if further vertices and triangles come, and that there
    /// is memory for it.
    pub(super) fn check_counts(
        &self,
        geometry: &Geometry,
        vertices: usize,
        triangles: usize,
    ) -> Result<()> {
        let counts = geometry.counts(vertices, triangles);
        let [vertices, triangles] = counts.map_err(|message| self.error(message))?;
        let vertex_bytes = (vertices as u64).saturating_mul(VERTEX_BYTES);
        let triangle_bytes = (triangles as u64).saturating_mul(TRIANGLE_BYTES);
        let asker = format_args!("{}: {triangles} triangles", self.path.display());
        memory::check(asker, vertex_bytes.saturating_add(triangle_bytes)).map_err(Error::memory)
    }

    pub(super) fn material_index(
        &self,
        label: &str,
        name: &str,
        materials: &[Material],
    ) -> Result<u32> {
        let index = materials.iter().position(|material| material.name == name);
        index.map(|index| index as u32).ok_or_else(|| {
            let known: Vec<_> = materials.iter().map(|known| known.name.as_str()).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            self.error(format!("{label}: unknown material `{name}`, the scene has {known}"))
        })
    }

    /// Rejects an object that lies too far out for traversal.
    pub(super) fn check_extent(
        &self,
        label: &str,
        positions: impl IntoIterator<Item = Vec3>,
    ) -> Result<()> {
        check_extent(positions).map_err(|message| self.error(format!("{label}: {message}")))
    }

    /// Appends an object to the geometry, as an instance of `prototype` or placed, with the materials
    /// of its mesh file if it names none.
    fn place(
        &self,
        label: &str,
        object: &ObjectEntry,
        mesh: &Mesh,
        prototype: Option<Prototype>,
        Scene { geometry, materials, warnings, .. }: &mut Scene,
    ) -> Result<()> {
        geometry.start_object(object.keys.name.as_deref().unwrap_or(label));
        let transform =
            Transform::new(object.keys.scale.0, object.keys.rotate_deg, object.keys.translate);
        let first_vertex = geometry.positions.len();
        let is_named = |material: &Material| Some(&material.name) == object.keys.material.as_ref();
        let named = materials.iter().position(is_named);
        let named = match (&object.keys.light_group, named) {
            (Some(group), Some(named)) => Some(lit_material(named, group, materials)),
            (_, named) => named,
        };
        let first_own = materials.len();
        if named.is_none() {
            let colored =
                !mesh.runs.is_empty() && mesh.runs.iter().all(|run| run.material.is_some());
            self.check(colored, || {
                format!(
                    "{label}: expected a material, found none, and the mesh file does not give one \
                     to every triangle"
                )
            })?;
            let light_group = &object.keys.light_group;
            let object = object.keys.name.as_deref().unwrap_or("mesh");
            materials.extend(mesh.materials.iter().map(|MeshMaterial { material, .. }| {
                let name = format!("{object}/{}", material.name);
                let mut own = Material { name, ..material.clone() };
                if own.surface.emission.is_some() {
                    own.surface.light_group.clone_from(light_group);
                }
                own
            }));
        }
        let own = named.map_or(&materials[first_own..], |index| &materials[index..=index]);
        warnings.extend(own.iter().filter_map(|material| lacking_uvs(label, material, mesh)));
        let of = mesh.triangles.len();
        let first_material = named.unwrap_or(first_own) as u32;
        let instance = prototype.and_then(|prototype| {
            let replaces = named.is_some();
            Some((prototype, Instance::new(prototype.index, &transform, first_material, replaces)?))
        });
        if let Some((prototype, instance)) = instance {
            self.check_extent(label, prototype.corners(&instance))?;
            geometry.instances.push(instance);
        } else {
            self.check_counts(geometry, mesh.positions.len(), of)?;
            let dropped = match named {
                Some(material) => geometry.append(mesh, &transform, |_| material as u32),
                None => geometry.append(mesh, &transform, |triangle| {
                    (first_own + run_material(mesh, triangle)) as u32
                }),
            };
            let placed = geometry.positions[first_vertex..].iter().copied().map(Vec3::from);
            self.check_extent(label, placed)?;
            warnings.extend(dropped.warnings(label, of));
        }
        if object.keys.light_group.is_some() && !emits(object, mesh, materials) {
            warnings.push(format!("{label}: ignored light_group: the object emits no light"));
        }
        if of == 0 {
            warnings.push(format!("{label}: the mesh has no triangles"));
        }
        Ok(())
    }
}

/// Finds a material whose light belongs to a group, as `of` looks, or adds it.
pub(super) fn lit_material(of: usize, group: &str, materials: &mut Vec<Material>) -> usize {
    let mut lit = materials[of].clone();
    if lit.surface.emission.is_none() {
        return of;
    }
    lit.surface.light_group = Some(group.to_owned());
    let is_it = |known: &Material| {
        known.name == lit.name && known.surface.light_group == lit.surface.light_group
    };
    let found = materials.iter().position(is_it);
    found.unwrap_or_else(|| {
        materials.push(lit);
        materials.len() - 1
    })
}

/// Material of a triangle among those of its mesh file.
fn run_material(mesh: &Mesh, triangle: usize) -> usize {
    mesh.material_of(triangle).unwrap_or(0)
}

/// Tests whether an object emits light: then it is placed, since lamps are triangles in the world.
fn emits(object: &ObjectEntry, mesh: &Mesh, materials: &[Material]) -> bool {
    match named_material(object, materials) {
        Some(material) => material.surface.emission.is_some(),
        None => mesh.materials.iter().any(|own| own.material.surface.emission.is_some()),
    }
}

/// Warning of a material with textures on a mesh without texture coordinates.
pub(super) fn lacking_uvs(label: &str, material: &Material, mesh: &Mesh) -> Option<String> {
    let lacks = |set: u32| mesh.uvs[set.min(1) as usize].is_empty();
    let Some(texture) = material.surface.textures().find(|used| lacks(used.uv_set)) else {
        let name = &material.name;
        return material.surface.tangent_uv_set().filter(|&set| lacks(set)).map(|_| {
            format!(
                "{label}: the material `{name}` stretches highlights along u, but the mesh has no texture \
                 coordinates: their direction is arbitrary"
            )
        });
    };
    Some(format!(
        "{label}: the material `{}` has textures, but the mesh has no texture coordinates for {}: the \
         object has the colour of one texel",
        material.name, texture.texture.name
    ))
}

/// Parts of a mesh file that an object of a scene file leaves out: cameras, lamps and, if its own
/// materials are used, parts of these.
fn ignored_in_object(mesh: &Mesh, own_materials: bool) -> Ignored {
    let mut ignored = Ignored::default();
    for (index, camera) in mesh.cameras.iter().enumerate() {
        ignored.add(features::GLTF_CAMERAS, || camera.label(index));
    }
    for lamp in &mesh.lamps {
        ignored.add(features::GLTF_OBJECT_LIGHTS, || format!("light `{}`", lamp.name));
    }
    if own_materials {
        ignored.merge(&mesh.ignored_in_materials(|_| false));
    }
    ignored
}

fn named_material<'a>(object: &ObjectEntry, materials: &'a [Material]) -> Option<&'a Material> {
    materials.iter().find(|material| Some(&material.name) == object.keys.material.as_ref())
}

/// Label of an object in messages: name or number, source and line.
fn object_label(index: usize, object: &ObjectEntry) -> String {
    let source = match &object.kind {
        ObjectSource::Mesh(mesh) => mesh.display().to_string(),
        ObjectSource::Shape { name, .. } => name.clone(),
    };
    let name = label("object", index, object.keys.name.as_deref());
    format!("{name} ({source}, line {})", object.line)
}
