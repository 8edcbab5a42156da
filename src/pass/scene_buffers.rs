//! Data on the device that stays constant during a render.

use std::{borrow::Borrow, collections::BTreeMap, sync::Arc, time::Instant};

use glam::Vec3;

use super::{
    geometry::{GeometryBuffers, triangle_page_bytes},
    lamp_cells::LampCells,
    lamps::LampTables,
    passages::Passages,
    surfaces::{self, Surfaces},
    texture_buffers::TextureBuffers,
};
use crate::{
    accel::{Accel, attributes::TriangleAttributes},
    brdf::MaterialTables,
    error::{Error, Result},
    film::{
        Window,
        cryptomatte::{self, NAMELESS},
    },
    gpu::{Buffer, DescriptorSet, Device},
    scene::{
        Camera, EnvironmentMap, Filter, Scene, environment::EnvironmentTables,
        light_group::LightGroups,
    },
    shader::{
        bindings::{SCENE, scene as bindings},
        constants::{FILTER_BOX, FILTER_GAUSSIAN, SURFACES_INSTANCED, SURFACES_LAMP_CELLS},
        structs::SceneParameters,
    },
    surface::SurfaceTables,
};

/// A scene on a device: geometry, materials, environment and camera.
pub struct SceneBuffers {
    /// Descriptor set 0.
    pub set: DescriptorSet,
    pub(crate) geometry: GeometryBuffers,
    parameters: SceneParameters,
    /// Specialization of passes by the surfaces of the scene.
    pub surfaces: Surfaces,
    /// Part of the film that the parameters describe.
    pub(crate) window: Window,
    pub(crate) light_groups: LightGroups,
    /// Host milliseconds by stage: `bvh`, `upload`.
    pub(crate) host_ms: BTreeMap<String, f64>,
}

impl SceneBuffers {
    /// Builds acceleration structure and tables, and uploads everything. Fails if a limit of the
    /// device is exceeded, the scene cannot be traced, or the device fails.
    pub fn new(device: &Arc<Device>, scene: &Scene, window: Window) -> Result<Self> {
        // Free the host copy of each stage before the next one: large scenes need the memory.
        let start = Instant::now();
        let accel = Accel::build(&scene.geometry, triangle_page_bytes(device.capabilities()))?;
        let bvh_ms = start.elapsed().as_secs_f64() * 1e3;
        let mut scene_buffers = Self::from_accel(device, scene, window, accel)?;
        scene_buffers.host_ms.insert("bvh".to_owned(), bvh_ms);
        Ok(scene_buffers)
    }

    /// As [`SceneBuffers::new`], with an acceleration structure, which is dropped early unless the caller
    /// keeps it.
    pub(crate) fn from_accel(
        device: &Arc<Device>,
        scene: &Scene,
        window: Window,
        accel: impl Borrow<Accel>,
    ) -> Result<Self> {
        let start = Instant::now();
        let built = accel.borrow();
        let mut surface_tables = SurfaceTables::new(&scene.materials);
        let light_groups = LightGroups::new(scene);
        let lamps = LampTables::new(scene, built, &light_groups);
        // Lamps are chosen by place where there are many clusters.
        let has_cells = !lamps.clusters.is_empty();
        let lamp_cells = has_cells.then(|| LampCells::new(scene, built, &lamps));
        for (surface, density) in surface_tables.surfaces.iter_mut().zip(&lamps.emission_densities)
        {
            surface.emission_density = *density;
        }
        for (surface, material) in surface_tables.surfaces.iter_mut().zip(&scene.materials) {
            surface.light_group = light_groups.index(material.surface.light_group.as_deref());
        }
        let attributes = TriangleAttributes::new(&scene.geometry, built, surface_tables.attributes);
        let textures = TextureBuffers::new(device, &surface_tables, &attributes)?;
        drop(attributes);
        let tables = MaterialTables::new(&scene.materials)?;
        let (materials, access) = (&tables.materials, textures.access);
        let passages = Passages::new(&scene.materials, materials, &surface_tables, access, built);
        drop(surface_tables);
        let geometry =
            GeometryBuffers::new(device, built)?.traced_by_host(device, built, passages)?;
        let mattes = Mattes::new(scene, built);
        drop(accel);
        let mut host_ms = BTreeMap::new();
        let material_kinds =
            tables.materials.iter().fold(0, |bits, material| bits | 1 << material.kind);
        let surfaces = Surfaces {
            material_kinds,
            features: surfaces::features(&scene.materials)
                | if geometry.traversal.is_instanced { SURFACES_INSTANCED } else { 0 }
                | if lamp_cells.is_some() { SURFACES_LAMP_CELLS } else { 0 },
            lamp_count: lamps.source_count,
            has_black_environment: scene.environment.is_black(),
            access: textures.access,
        };
        let materials = Buffer::from_slice(device, "materials", &tables.materials)?;
        let brdf_table = Buffer::texels_from_slice(device, "BRDF tables", &tables.words)?;
        drop(tables);

        // Free each copy of a large map before the next one.
        let map = &scene.environment;
        check_environment(device, map)?;
        let uploaded = |tables: EnvironmentTables, [rows, cells]: [&str; 2]| -> Result<_> {
            let rows = Buffer::texels_from_slice(device, rows, &tables.rows)?;
            Ok((rows, Buffer::texels_from_slice(device, cells, &tables.cells)?, tables.total))
        };
        let names = ["environment rows", "environment cells"];
        let (rows, cells, total) = uploaded(EnvironmentTables::new(map), names)?;
        let compensated = EnvironmentTables::compensated(map);
        let texels = {
            let texel = |texel: &Vec3| texel.extend(compensated.weight(*texel)).to_array();
            let texels: Vec<[f32; 4]> = map.texels.iter().map(texel).collect();
            Buffer::texels_from_slice(device, "environment texels", &texels)?
        };
        let names = ["compensated rows", "compensated cells"];
        let (compensated_rows, compensated_cells, compensated_total) =
            uploaded(compensated, names)?;
        let lamp_cells = lamp_cells.unwrap_or_default();
        let parameters = SceneParameters {
            lamp_count: lamps.source_count,
            lamp_grid_origin: lamp_cells.grid.origin.into(),
            lamp_cells_per_metre: lamp_cells.grid.cells_per_metre,
            lamp_grid_size: lamp_cells.grid.size,
            lamp_list_length: lamp_cells.list_length,
            compensated_total,
            ..parameters(scene, map, total, window)
        };
        let words = |name, words: &[u32]| Buffer::from_slice(device, name, words);
        let texels_of_words = |name, words: &[u32]| Buffer::texels_from_slice(device, name, words);
        let mut bound = vec![
            (bindings::PARAMETERS, Buffer::from_slice(device, "parameters", &[parameters])?),
            (bindings::ENVIRONMENT_TEXELS, texels),
            (bindings::ENVIRONMENT_ROWS, rows),
            (bindings::ENVIRONMENT_CELLS, cells),
            (bindings::COMPENSATED_ROWS, compensated_rows),
            (bindings::COMPENSATED_CELLS, compensated_cells),
            (
                bindings::LAMP_CHOICE_TEXELS,
                Buffer::texels_from_slice(device, "lamp choices", &lamps.choices)?,
            ),
            (bindings::LAMP_TEXELS, Buffer::texels_from_slice(device, "lamps", &lamps.lamps)?),
            (bindings::LAMP_CELLS, texels_of_words("lamp cells", &lamp_cells.lists)?),
            (
                bindings::LAMP_ENTRY_TEXELS,
                Buffer::texels_from_slice(device, "lamp entries", &lamp_cells.entries)?,
            ),
            (bindings::LAMP_CLUSTERS, texels_of_words("lamp clusters", &lamps.triangle_clusters)?),
            (bindings::TRIANGLE_OBJECTS, words("triangle objects", &mattes.triangle_objects)?),
            (bindings::INSTANCE_OBJECTS, words("instance objects", &mattes.instance_objects)?),
            (bindings::MATERIAL_IDENTIFIERS, words("material identifiers", &mattes.materials)?),
            (bindings::MATERIALS, materials),
            (bindings::BRDF_TABLE, brdf_table),
        ];
        bound.extend_from_slice(&geometry.bound);
        bound.extend(textures.bound);
        let set = DescriptorSet::new(device, &SCENE, &bound)?;
        host_ms.insert("upload".to_owned(), start.elapsed().as_secs_f64() * 1e3);
        Ok(Self { set, geometry, parameters, surfaces, window, light_groups, host_ms })
    }

    /// Looks at the scene through another camera, on a whole film of `size` pixels. Fails if the device does.
    pub(crate) fn look(&self, camera: &Camera, [width, height]: [u32; 2]) -> Result<()> {
        let parameters = SceneParameters {
            film_width: width,
            film_height: height,
            crop_x: 0,
            crop_y: 0,
            crop_width: width,
            crop_height: height,
            ..with_camera(self.parameters, camera)
        };
        self.set.buffer(bindings::PARAMETERS).upload(bytemuck::bytes_of(&parameters))
    }

    pub(crate) fn filter(&self) -> Filter {
        match self.parameters.film_filter {
            FILTER_GAUSSIAN => Filter::Gaussian,
            _ => Filter::Box,
        }
    }
}

/// Refuses a map too large for the device, before the work on it.
fn check_environment(device: &Device, map: &EnvironmentMap) -> Result<()> {
    let cells = EnvironmentTables::cell_count(map.width, map.height) as u64;
    let most = device.capabilities().max_texel_buffer_elements;
    if cells <= most {
        return Ok(());
    }
    let EnvironmentMap { width, height, source, .. } = map;
    Err(Error::Device {
        reason: format!(
            "the environment map {source} of {width}x{height} texels takes {cells} numbers in one \
             buffer, but {} allows {most}",
            device.capabilities().name
        ),
        help: "make the map smaller, or choose another device with --device".into(),
    })
}

fn parameters(
    scene: &Scene,
    map: &EnvironmentMap,
    environment_total: f32,
    window: Window,
) -> SceneParameters {
    let parameters = SceneParameters {
        film_width: scene.film.width,
        film_height: scene.film.height,
        crop_x: window.x,
        crop_y: window.y,
        crop_width: window.width,
        crop_height: window.height,
        film_filter: match scene.film.filter {
            Filter::Box => FILTER_BOX,
            Filter::Gaussian => FILTER_GAUSSIAN,
        },
        environment_width: map.width,
        environment_height: map.height,
        environment_cos_rotation: map.rotation_rad.cos(),
        environment_sin_rotation: map.rotation_rad.sin(),
        environment_total,
        ..SceneParameters::default()
    };
    with_camera(parameters, &scene.camera)
}

fn with_camera(parameters: SceneParameters, camera: &Camera) -> SceneParameters {
    let [right, up, forward] = camera.axes();
    SceneParameters {
        camera_position: camera.position.into(),
        camera_aperture_radius: camera.aperture_radius,
        camera_right: right.into(),
        camera_focus_distance: camera.focus_distance,
        camera_up: up.into(),
        camera_tan_half_fov: (0.5 * camera.vertical_fov_deg).to_radians().tan(),
        camera_forward: forward.into(),
        camera_shift: [2.0 * camera.shift[0], -2.0 * camera.shift[1]],
        ..parameters
    }
}

/// Identifiers of Cryptomatte for a scene, as the pass `mattes` reads them.
struct Mattes {
    /// By triangle in BVH order; those of meshes that instances place mean nothing.
    triangle_objects: Vec<u32>,
    /// By instance in the order of the scene.
    instance_objects: Vec<u32>,
    materials: Vec<u32>,
}

impl Mattes {
    fn new(scene: &Scene, accel: &Accel) -> Self {
        let geometry = &scene.geometry;
        let nameless = cryptomatte::identifier(NAMELESS);
        // Hash each name once.
        let starts: Vec<u32> =
            geometry.objects.iter().map(|start| cryptomatte::identifier(&start.name)).collect();
        let of = |next: usize| next.checked_sub(1).map_or(nameless, |start| starts[start]);
        let of_triangle = |&triangle: &u32| {
            let triangle = triangle as usize;
            of(geometry.objects.partition_point(|start| start.first_triangle <= triangle))
        };
        let of_instance = |instance: usize| {
            of(geometry.objects.partition_point(|start| start.first_instance <= instance))
        };
        let materials = scene.materials.iter();
        Self {
            triangle_objects: accel.scene_triangles.iter().map(of_triangle).collect(),
            instance_objects: (0..geometry.instances.len()).map(of_instance).collect(),
            materials: materials.map(|own| cryptomatte::identifier(&own.name)).collect(),
        }
    }
}
