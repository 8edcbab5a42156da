//! Geometry and rays for the traversal tests, and traversal on the device through the passes.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use fenestra::{
    accel::Accel,
    gpu::{Buffer, DescriptorSet},
    pass::{GeometryBuffers, Kernel, Pass, Recording, Schedule, Surfaces},
    scene::Geometry,
    shader::{
        bindings::{Binding, BindingTable, FILM, SCENE, WAVE, film, wave as bindings},
        structs::{Counters, Hit, Ray, ShadowRay, Wave},
    },
};
use glam::{Quat, Vec3};

use super::{random::Random, scenes};

/// Size of a page that holds every test scene.
pub const ONE_PAGE: u64 = 128 << 20;

/// Schedule that refills the lanes of a subgroup of eight.
pub const REFILLING: Schedule = Schedule { rays_per_invocation: 16, refill_lanes: 3 };

/// Adds a flat triangle.
pub fn push(geometry: &mut Geometry, corners: [Vec3; 3]) {
    let first = geometry.positions.len() as u32;
    geometry.positions.extend(corners.map(|corner| corner.to_array()));
    geometry.normals.extend([[0.0; 3]; 3]);
    geometry.triangles.push([first, first + 1, first + 2]);
    geometry.materials.push(geometry.materials.len() as u32 % 7);
}

/// Makes triangles of mixed sizes in the cube −1…1.
pub fn soup(count: usize, seed: u64) -> Geometry {
    let mut random = Random(seed);
    let mut geometry = Geometry::default();
    for _ in 0..count {
        let centre = random.point();
        let size = 0.01 * 50.0_f32.powf(random.uniform_f32());
        push(&mut geometry, [0; 3].map(|_| centre + size * random.point()));
    }
    geometry
}

/// Adds the twelve triangles of a box with shared vertices, turned by `rotation`.
pub fn push_box(geometry: &mut Geometry, centre: Vec3, half: Vec3, rotation: Quat) {
    let first = geometry.positions.len();
    scenes::add_box(geometry, Vec3::ZERO, 2.0 * half, 0);
    for position in &mut geometry.positions[first..] {
        *position = (centre + rotation * Vec3::from(*position)).to_array();
    }
}

/// Makes a closed sphere of `rows`·2·`rows` quads about the origin with smooth normals.
pub fn sphere(rows: u32, radius: f32) -> Geometry {
    let columns = 2 * rows;
    let mut geometry = Geometry::default();
    for row in 0..=rows {
        for column in 0..columns {
            let theta = std::f32::consts::PI * row as f32 / rows as f32;
            let phi = std::f32::consts::TAU * column as f32 / columns as f32;
            let normal = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            // The poles are one point each, so that the mesh is closed.
            let normal = match row {
                0 => Vec3::Y,
                row if row == rows => Vec3::NEG_Y,
                _ => normal.normalize(),
            };
            geometry.positions.push((radius * normal).to_array());
            geometry.normals.push(normal.to_array());
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let next = (column + 1) % columns;
            let (a, b) = (row * columns + column, row * columns + next);
            let (c, d) = (a + columns, b + columns);
            for triangle in [[a, b, d], [a, d, c]] {
                geometry.triangles.push(triangle);
                geometry.materials.push(3);
            }
        }
    }
    geometry
}

/// Multiplies every coordinate by `scale`.
pub fn scaled(geometry: &Geometry, scale: f32) -> Geometry {
    let positions = geometry.positions.iter().map(|position| position.map(|x| x * scale)).collect();
    Geometry { positions, ..geometry.clone() }
}

pub fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray { origin: origin.into(), is_active: 1, direction: direction.into(), brdf_pdf: 0.0 }
}

/// Makes rays from places in the cube −`extent`…`extent`.
pub fn random_rays(count: usize, seed: u64, extent: f32) -> Vec<Ray> {
    let mut random = Random(seed);
    (0..count).map(|_| ray(extent * random.point(), random.direction_from_point())).collect()
}

/// Makes shadow rays that bring light.
pub fn random_shadow_rays(count: usize, random: &mut Random) -> Vec<ShadowRay> {
    let mut direction = || random.direction_from_point().into();
    (0..count).map(|_| ShadowRay { direction: direction(), contribution: [1.0; 3] }).collect()
}

fn wave(paths: usize, shadow_ray_count: u32) -> Wave {
    Wave { pixel_count: paths as u32, sample_count: 1, shadow_ray_count, ..Wave::default() }
}

/// Makes a set of `table` with `buffers`, and with `spare` where a pass names a buffer that it does not
/// touch in these scenes.
fn set(
    table: &'static BindingTable,
    buffers: &[(Binding, &Buffer)],
    spare: &Buffer,
) -> DescriptorSet {
    let is_free =
        |binding: &&Binding| !buffers.iter().any(|(other, _)| other.number == binding.number);
    let mut all = buffers.to_vec();
    all.extend(table.bindings.iter().filter(is_free).map(|binding| (*binding, spare)));
    DescriptorSet::new(super::device(), table, &all).unwrap()
}

/// Geometry on the shared device, traced by it or by the host.
pub struct OnDevice {
    geometry: GeometryBuffers,
    spare: Buffer,
    scene: DescriptorSet,
    counters: Buffer,
    film: DescriptorSet,
}

impl OnDevice {
    pub fn new(accel: &Accel) -> Self {
        Self::with(GeometryBuffers::new(super::device(), accel).unwrap())
    }

    /// Geometry that the device traces, and one that the host traces where the library for it is installed.
    pub fn both(accel: &Accel) -> Vec<(&'static str, Self)> {
        let device = super::device();
        let geometry = GeometryBuffers::new(device, accel).unwrap();
        let geometry = geometry.traced_by_host(device, accel, None).unwrap();
        let host = geometry.host_tracer.is_some().then(|| ("host", Self::with(geometry)));
        if host.is_none() {
            eprintln!("not tested: there is no library by which the host traces (./setup)");
        }
        [("device", Self::new(accel))].into_iter().chain(host).collect()
    }

    fn with(geometry: GeometryBuffers) -> Self {
        let device = super::device();
        let spare = Buffer::zeroed(device, "spare", 256).unwrap();
        let own: Vec<_> = geometry.bound.iter().map(|(at, buffer)| (*at, buffer)).collect();
        let scene = set(&SCENE, &own, &spare);
        let counters = Buffer::zeroed(device, "counters", size_of::<Counters>() as u64).unwrap();
        let film = DescriptorSet::new(device, &FILM, &[(film::COUNTERS, &counters)]).unwrap();
        Self { geometry, spare, scene, counters, film }
    }

    /// Returns the number of rays given up so far.
    pub fn overruns(&self) -> u32 {
        self.counters.download::<Counters>(1).unwrap()[0].traversal_overruns
    }

    /// Traces `rays` by the pass and returns their hits.
    pub fn trace(&self, rays: &[Ray], schedule: Schedule) -> Vec<Hit> {
        let device = super::device();
        let ray_buffer = Buffer::from_slice(device, "rays", rays).unwrap();
        let hits = Buffer::zeroed(device, "hits", (size_of::<Hit>() * rays.len()) as u64).unwrap();
        let instances =
            Buffer::zeroed(device, "instances", (size_of::<u32>() * rays.len()) as u64).unwrap();
        let own = [
            (bindings::RAY_TEXELS, &ray_buffer),
            (bindings::HITS, &hits),
            (bindings::HIT_INSTANCES, &instances),
        ];
        let kernel = self.geometry.traversal.trace(schedule, Surfaces::default());
        self.run(kernel, &own, wave(rays.len(), 0));
        hits.download(rays.len()).unwrap()
    }

    /// Traces `shadow_rays`, a multiple of the number of hits, by the pass and returns their visibility.
    pub fn shadow(&self, hits: &[Hit], shadow_rays: &[ShadowRay], schedule: Schedule) -> Vec<u32> {
        let device = super::device();
        let hit_buffer = Buffer::from_slice(device, "hits", hits).unwrap();
        let ray_buffer = Buffer::from_slice(device, "shadow rays", shadow_rays).unwrap();
        let visibility =
            Buffer::from_slice(device, "visibility", &vec![0xdead_beef_u32; shadow_rays.len()])
                .unwrap();
        let own = [
            (bindings::HIT_TEXELS, &hit_buffer),
            (bindings::SHADOW_RAY_TEXELS, &ray_buffer),
            (bindings::VISIBILITY, &visibility),
        ];
        let directions = (shadow_rays.len() / hits.len()) as u32;
        let kernel = self.geometry.traversal.shadow(schedule, Surfaces::default());
        self.run(kernel, &own, wave(hits.len(), directions));
        visibility.download(shadow_rays.len()).unwrap()
    }

    fn run(&self, kernel: Kernel, own: &[(Binding, &Buffer)], wave: Wave) {
        let device = super::device();
        let wave_set = set(&WAVE, own, &self.spare);
        let pass = Pass::new(device, kernel).unwrap();
        let host = self.geometry.host_tracer.as_ref();
        let mut recording = Recording::begin(device, 1, host, false).unwrap();
        recording.add(&pass, &[&self.scene, &wave_set, &self.film], &wave).unwrap();
        recording.finish().unwrap();
        super::assert_silent();
    }
}
