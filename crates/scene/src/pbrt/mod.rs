//! Scene descriptions of pbrt-v4 \[Pharr et al. 2023\].
//!
//! bytes → `tokens` → `parameters` → `directives`, with the `state` in force → shapes,
//! materials, textures and lights. The format is that of <https://pbrt.org/fileformat-v4>; details that
//! it leaves open follow pbrt-v4's source. Paths are relative to the folder of the main file. Errors
//! carry the place of the directive, parameter or token at fault.
//!
//! The side of a surface from which light leaves, and behind which the inside of a dielectric lies, is
//! that of its normal: of the vertex normals where a mesh has some, else of its winding; turned by
//! `ReverseOrientation`. A mirror in the transformation turns neither, since pbrt undoes it.
//!
//! Deviation: pbrt-v4 turns the normal of mirrored spheres, disks and cylinders that a ray meets, but
//! not of those that it samples as lights. Here neither is turned.

mod camera;
mod directives;
mod lights;
mod materials;
mod parameters;
mod shapes;
mod spectra;
mod state;
mod subdivision;
mod textures;
mod tokens;

use std::{collections::HashMap, path::Path, rc::Rc};

use camera::View;
use directives::{Description, Reader, Shape};
use glam::{DMat4, DVec3, Vec3};
use lights::Lights;
use materials::{Materials, set_opacity};
use parameters::{Entity, Log};
use state::MaterialChoice;
use textures::Textures;

use super::{
    Asked, Geometry, MIN_ALPHA, features,
    geometry::Dropped,
    instance::{Budget, Instance, MAX_INSTANCES},
    mesh::Mesh,
    transform::Transform,
};
use crate::{
    beside::Folder,
    error::{Error, Result},
    files,
    import::{Imported, Value},
    material::{Emission, Material, MaterialKind},
    strands::Detail,
};

/// Most vertices, and most triangles, of a scene with all its instances.
const MAX_COUNT: usize = 1 << 27;

/// Tests whether a path names a scene description, compressed or not.
pub(crate) fn is_pbrt(path: &Path) -> bool {
    match files::extension(path).as_str() {
        "pbrt" => true,
        "gz" => files::extension(Path::new(path.file_stem().unwrap_or_default())) == "pbrt",
        _ => false,
    }
}

/// Reads a scene description and the files that it names, in `folder`. Fails with [`Error::Parse`] with file,
/// line and column for everything that cannot be read or rendered, with [`Error::Io`] for the main file.
pub(crate) fn read(path: &Path, folder: Folder) -> Result<Imported> {
    let (mut description, mut log) = Reader::read(path, folder)?;
    let asked = asked(&description, &mut log);
    let view = camera::view(&description, &mut log)?;
    // A shape's numbers are dropped when its mesh is made.
    let shapes = std::mem::take(&mut description.shapes);
    let mut textures = Textures::new(&description, log);
    let mut lights = Lights::default();
    for (entity, world_from_light) in &description.lights {
        let placed = view.mirror * *world_from_light;
        lights.add(entity, placed, view.sensor, &mut textures)?;
    }
    let mut builder = Builder {
        view,
        materials: Materials::new(&description, textures),
        made: Vec::new(),
        made_by_key: HashMap::new(),
        geometry: Geometry::default(),
        dropped: Dropped::default(),
        triangle_count: 0,
        budget: Budget::default(),
        balls: [None; 2],
        strands: shapes::detail(
            (description.objects.iter().flat_map(|object| &object.shapes))
                .chain(&shapes)
                .map(|shape| &shape.entity),
        ),
    };
    for shape in shapes {
        if let Some((mesh, material)) = builder.prepare(&shape, false)?
            && !builder.share_ball(&mesh, material, &shape)?
        {
            builder.place(&mesh, material, &shape, DMat4::IDENTITY)?;
        }
    }
    for object in &description.objects {
        if let (false, Some(instance)) = (object.is_defined, object.instances.first()) {
            let message = format!("there is no object `{}`", object.name);
            return Err(instance.place.error(message));
        }
        for shape in object.shapes.iter().filter(|_| !object.instances.is_empty()) {
            let Some((mesh, material)) = builder.prepare(shape, true)? else { continue };
            let places: Vec<_> =
                object.instances.iter().map(|instance| instance.world_from_object).collect();
            builder.place_all(&mesh, material, shape, &places)?;
        }
    }
    let environment = lights.environment().map_err(|message| Error::scene(path, message))?;
    let Builder { view, materials, mut made, geometry, dropped, triangle_count, .. } = builder;
    let Materials { reliefs, textures, .. } = materials;
    let mut log = textures.log;
    reliefs.settle(&mut made, &geometry);
    for material in &mut made {
        if let MaterialKind::Plastic { alpha, .. } | MaterialKind::Conductor { alpha, .. } =
            &mut material.kind
        {
            *alpha = alpha.clamp(MIN_ALPHA, 1.0);
        }
    }
    let mut warnings = log.ignored.warnings(path);
    warnings.append(&mut log.warnings);
    warnings.extend(dropped.warnings(&path.display().to_string(), triangle_count));
    Ok(Imported {
        camera: view.camera,
        film: view.film,
        asked,
        environment: Some(environment),
        lamps: lights.lamps,
        materials: made,
        geometry,
        variants: Vec::new(),
        inputs: log.inputs,
        warnings,
    })
}

/// Takes the samples and the length of paths; reports an integrator that makes other pictures than the
/// renderer's.
fn asked(description: &Description, log: &mut Log) -> Asked {
    let number = |entity: &Option<Entity>, name: &str| {
        let number = entity.as_ref()?.find(name)?.numbers().first().copied()?;
        (number >= 0.0).then_some(number as u32)
    };
    let of_strata = || {
        let [across, down] =
            ["xsamples", "ysamples"].map(|name| number(&description.sampler, name));
        across?.checked_mul(down?)
    };
    let samples = number(&description.sampler, "pixelsamples").or_else(of_strata);
    // pbrt's own depth where the file states none.
    let depth = number(&description.integrator, "maxdepth").unwrap_or(5);
    if depth > Asked::MAX_DEPTH
        && let Some(entity) = &description.integrator
    {
        let name = format!("`maxdepth` above {}", Asked::MAX_DEPTH);
        log.ignore_named(features::PBRT_INTEGRATOR, &name, &entity.place);
    }
    let asked = Asked {
        samples: samples.filter(|samples| *samples > 0),
        depth: Some(depth.clamp(1, Asked::MAX_DEPTH)),
        roulette_depth: None,
    };
    for entity in [&description.sampler, &description.integrator].into_iter().flatten() {
        entity.without_effect(
            "seed randomization jitter lightsampler mutationsperpixel bootstrapsamples chains sigma \
             largestepprobability photonsperiteration iterations radius rrthreshold",
        );
        log.unused(entity);
    }
    let Some(entity) = &description.integrator else { return asked };
    let is_known =
        ["path", "volpath", "simplepath", "simplevolpath", "bdpt", "mlt", "sppm", "lightpath"];
    if !is_known.contains(&entity.name.as_str()) {
        let name = format!("Integrator `{}`", entity.name);
        log.ignore_named(features::PBRT_INTEGRATOR, &name, &entity.place);
    }
    asked
}

/// Tells materials apart: the choice, the alpha of the shape, the medium inside and the light.
type MaterialKey = (String, String, Option<String>, Option<([u32; 3], bool, String)>);

/// Puts shapes in the world.
struct Builder<'a> {
    view: View,
    materials: Materials<'a>,
    /// Materials made so far.
    made: Vec<Material>,
    /// Numbers of these; none for a surface that is not there.
    made_by_key: HashMap<MaterialKey, Option<u32>>,
    geometry: Geometry,
    dropped: Dropped,
    triangle_count: usize,
    budget: Budget,
    /// Prototypes of spheres with their radii: as they are, and turned inside out.
    balls: [Option<(u32, f64)>; 2],
    strands: Detail,
}

impl Builder<'_> {
    /// Makes the mesh of a shape and finds its material; none for a shape without a surface.
    fn prepare(&mut self, shape: &Shape, in_object: bool) -> Result<Option<(Mesh, u32)>> {
        let log = &mut self.materials.textures.log;
        let mut mesh = shapes::mesh(&shape.entity, &mut self.strands, log)?;
        if mesh.triangles.is_empty() {
            return Ok(None);
        }
        let light = match &shape.state.area_light {
            Some(entity) if in_object => {
                self.materials.textures.log.ignore(features::PBRT_INSTANCE_LIGHT, &entity.place);
                None
            }
            Some(entity) => {
                let area = area(&mesh, self.view.mirror * shape.state.ctm);
                let textures = &mut self.materials.textures;
                Some(lights::area_light(entity, area, self.view.sensor, textures)?)
            }
            None => None,
        };
        let material = self.material(shape, light)?;
        self.materials.textures.log.unused(&shape.entity);
        let Some(material) = material else { return Ok(None) };
        let surface = &self.made[material as usize].surface;
        if surface.reads_uvs() {
            let error = |message: String| shape.entity.error(message);
            shapes::give_coordinates(&mut mesh).map_err(error)?;
        }
        if shape.state.reverse {
            mesh.reverse();
        }
        let reliefs = &self.materials.reliefs;
        if surface.normal.as_ref().is_some_and(|normal| !reliefs.hold(normal)) {
            shapes::give_tangents(&mut mesh, shape.state.ctm.determinant() < 0.0);
        }
        Ok(Some((mesh, material)))
    }

    fn material(&mut self, shape: &Shape, light: Option<Emission>) -> Result<Option<u32>> {
        let choice = match &shape.state.material {
            MaterialChoice::Default => String::new(),
            MaterialChoice::Own(entity) => format!("{:p}", Rc::as_ptr(entity)),
            MaterialChoice::Named(name, _) => format!("named {name}"),
        };
        let alpha = shape.entity.find("alpha");
        let alpha_key = alpha.map_or(String::new(), |alpha| format!("{:?}", alpha.values));
        let light_key = light.as_ref().map(|light| {
            let image = light.texture.as_ref().map_or("", |image| &image.texture.name);
            (light.radiance.to_array().map(f32::to_bits), light.two_sided, image.to_owned())
        });
        let key = (choice, alpha_key, shape.state.interior.clone(), light_key);
        let kept = match self.made_by_key.get(&key) {
            Some(kept) => *kept,
            None => {
                let mut made = self.materials.make(&shape.state.material)?;
                if let Some(medium) = &shape.state.interior {
                    let kind = made.as_mut().map(|made| &mut made.kind);
                    self.materials.fill(kind, medium, &shape.entity.place)?;
                }
                let opacity = self.materials.textures.number(&shape.entity, "alpha")?;
                let kept = made.map(|mut material| {
                    match (opacity, &light) {
                        // pbrt's rays pass such a light, which shines all the same.
                        (Some(Value::Constant(Vec3::ZERO)), Some(_)) => {
                            material.kind = MaterialKind::Diffuse { reflectance: Vec3::ZERO };
                            let log = &mut self.materials.textures.log;
                            log.ignore(features::PBRT_INVISIBLE_LIGHT, &shape.entity.place);
                        }
                        (Some(opacity), _) => set_opacity(&mut material.surface, opacity),
                        (None, _) => {}
                    }
                    material.surface.emission = light.filter(|light| light.radiance != Vec3::ZERO);
                    self.made.push(material);
                    (self.made.len() - 1) as u32
                });
                self.made_by_key.insert(key, kept);
                kept
            }
        };
        if let (None, Some(entity)) = (kept, &shape.state.area_light) {
            self.materials.textures.log.ignore(features::PBRT_INTERFACE_LIGHT, &entity.place);
        }
        Ok(kept)
    }

    /// Puts a mesh of an object at the `places` of its instances: one in memory if they are many.
    fn place_all(
        &mut self,
        mesh: &Mesh,
        material: u32,
        shape: &Shape,
        places: &[DMat4],
    ) -> Result<()> {
        let is_instanced =
            places.len() > 1 && self.budget.takes_instances(places.len(), mesh.triangles.len());
        let Entity { name, place, .. } = &shape.entity;
        self.geometry.start_object(&format!("{name} of line {}", place.line));
        if !is_instanced {
            self.check_counts(mesh, places.len(), shape)?;
            return places.iter().try_for_each(|place| self.place(mesh, material, shape, *place));
        }
        let count = self.geometry.instances.len() + places.len();
        if count > MAX_INSTANCES {
            let message = format!("{count} instances, at most {MAX_INSTANCES} can be used");
            return Err(shape.entity.error(message));
        }
        let index = self.geometry.prototypes.len() as u32;
        let instances: Vec<_> = places
            .iter()
            .map(|place| {
                let placed = self.view.mirror * *place * shape.state.ctm;
                let transform = Transform::from_matrix(placed)?;
                Instance::new(index, &transform, material, true)
            })
            .collect();
        let too_extreme = instances.iter().filter(|instance| instance.is_none()).count();
        self.check_counts(mesh, too_extreme, shape)?;
        let (_, dropped) = self.geometry.add_prototype(mesh, |_| 0);
        self.triangle_count += mesh.triangles.len();
        self.dropped.add(dropped);
        for (place, instance) in places.iter().zip(instances) {
            match instance {
                Some(instance) => self.geometry.instances.push(instance),
                None => self.place(mesh, material, shape, *place)?,
            }
        }
        Ok(())
    }

    /// Adds a sphere as a copy of the first; false for a shape that is none, or is to be placed. Pictures of
    /// point clouds have thousands.
    fn share_ball(&mut self, mesh: &Mesh, material: u32, shape: &Shape) -> Result<bool> {
        let entity = &shape.entity;
        let is_whole = ["zmin", "zmax", "phimax"].iter().all(|part| entity.find(part).is_none());
        let is_ball = entity.name == "sphere" && is_whole && mesh.tangents.is_empty();
        let emits = self.made[material as usize].surface.emission.is_some();
        if !is_ball || emits || !self.budget.takes_instances(1, mesh.triangles.len()) {
            return Ok(false);
        }
        let radius = entity.number("radius", 1.0)?;
        let kind = usize::from(shape.state.reverse);
        let (prototype, own) = *self.balls[kind].get_or_insert_with(|| {
            let (prototype, dropped) = self.geometry.add_prototype(mesh, |_| 0);
            self.dropped.add(dropped);
            (prototype.index, radius)
        });
        let grown = DMat4::from_scale(DVec3::splat(radius / own));
        let transform = Transform::from_matrix(self.view.mirror * shape.state.ctm * grown);
        let instance = transform.and_then(|own| Instance::new(prototype, &own, material, true));
        let instance = instance.filter(|_| self.geometry.instances.len() < MAX_INSTANCES);
        self.geometry.instances.extend(instance);
        Ok(instance.is_some())
    }

    /// Checks, before any is placed, that so many copies of a mesh can be used.
    fn check_counts(&self, mesh: &Mesh, copies: usize, shape: &Shape) -> Result<()> {
        let with = |own: usize, so_far: usize| own.saturating_mul(copies).saturating_add(so_far);
        let vertices = with(mesh.positions.len(), self.geometry.positions.len());
        let triangles = with(mesh.triangles.len(), self.triangle_count);
        if vertices.max(triangles) <= MAX_COUNT {
            return Ok(());
        }
        Err(shape.entity.error(format!(
            "{vertices} vertices and {triangles} triangles with the instances so far, at most \
             {MAX_COUNT} can be used"
        )))
    }

    fn place(&mut self, mesh: &Mesh, material: u32, shape: &Shape, outer: DMat4) -> Result<()> {
        let placed = self.view.mirror * outer * shape.state.ctm;
        let Some(transform) = Transform::from_matrix(placed) else {
            self.materials.textures.log.ignore(features::PBRT_FLAT, &shape.entity.place);
            return Ok(());
        };
        self.check_counts(mesh, 1, shape)?;
        self.triangle_count += mesh.triangles.len();
        let dropped = self.geometry.append(mesh, &transform, |_| material);
        self.dropped.add(dropped);
        Ok(())
    }
}

fn area(mesh: &Mesh, world_from_shape: DMat4) -> f64 {
    let corner = |at: u32| {
        let position = Vec3::from_array(mesh.positions[at as usize]).as_dvec3();
        world_from_shape.transform_point3(position)
    };
    let triangles = mesh.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(corner);
        0.5 * (b - a).cross(c - a).length()
    });
    triangles.filter(|area| area.is_finite()).sum()
}
