//! Shared by the integration tests: the Vulkan device, renderers, and probes of shader functions.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

pub mod c_library;
pub mod command;
pub mod faulty_layer;
#[path = "../../crates/scene/tests/support/folder.rs"]
pub mod folder;
#[path = "../../crates/scene/tests/support/fuzz.rs"]
pub mod fuzz;
#[path = "../../crates/scene/tests/support/gltf.rs"]
pub mod gltf;
pub mod guide;
pub mod hemisphere;
pub mod lobes;
pub mod materials;
pub mod page;
pub mod random;
pub mod rays;
pub mod replicates;
pub mod scenes;
pub mod source;
pub mod statistics;
pub mod x11;

use std::{
    borrow::Borrow,
    fs,
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError},
};

use bytemuck::{Pod, Zeroable};
use fenestra::{
    film::{Checkpoint, Metadata, SampleRange, Sums},
    gpu::{Buffer, Commands, DescriptorSet, Device, Pipeline},
    pass::{Totals, WaveBuffers},
    sampler::Parameters,
    scene::Scene,
    session::{Renderer, Settings},
    shader::bindings::{Binding, PROBE, SCENE, probe},
};
use glam::Vec3;

/// Gives the calling test the device to itself: the validation layers 1.3.239 crash at times where several
/// threads make and drop renderers, of one device or of two.
pub fn alone() -> MutexGuard<'static, ()> {
    static IN_USE: Mutex<()> = Mutex::new(());
    IN_USE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Parameters after assignments as those of `--set`.
pub fn parameters(assignments: &[&str]) -> Parameters {
    let mut parameters = Parameters::default();
    assignments.iter().for_each(|assignment| parameters.set(assignment).unwrap());
    parameters
}

/// Input of the probe `product_state` for one path: a surface seen along a direction, and a shadow
/// ray with its outcome.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub struct PathInput {
    pub normal: Vec3,
    pub material: u32,
    pub outgoing: Vec3,
    shadow_direction: Vec3,
    is_visible: u32,
}

impl PathInput {
    /// A surface whose shadow ray goes up and is visible.
    pub fn new(material: u32, normal: Vec3, outgoing: Vec3) -> Self {
        Self { normal, material, outgoing, shadow_direction: Vec3::Y, is_visible: 1 }
    }

    /// The same surface with another shadow ray.
    pub fn with_outcome(self, (shadow_direction, is_visible): (Vec3, bool)) -> Self {
        Self { shadow_direction, is_visible: u32::from(is_visible), ..self }
    }

    /// Writes ray, hit, and a shadow ray with its outcome for every path of a wave.
    pub fn put(inputs: &[Self], waves: &WaveBuffers) {
        let input = Buffer::from_slice(device(), "paths", inputs).unwrap();
        let pipeline =
            Pipeline::new(device(), "product_state", &spirv("product_state"), &[]).unwrap();
        let film = DescriptorSet::new(device(), &PROBE, &[(probe::PROBE_INPUT, &input)]).unwrap();
        let mut commands = Commands::begin(device()).unwrap();
        commands.dispatch(&pipeline, &[&waves.set, &film], &[], inputs.len() as u32).unwrap();
        commands.submit_and_wait().unwrap();
    }
}

/// Makes a chunk of a PNG file.
pub fn png_chunk(name: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let content = [name, data].concat();
    let mut sum = flate2::Crc::new();
    sum.update(&content);
    [&(data.len() as u32).to_be_bytes()[..], &content, &sum.sum().to_be_bytes()].concat()
}

/// A checkpoint of 4×2 pixels whose sums all differ.
pub fn checkpoint() -> Checkpoint {
    let mut sums = Sums::new([0, 0], 4, 2, [4, 2]);
    for (index, value) in sums.sum.as_flattened_mut().iter_mut().enumerate() {
        *value = 1.0 + index as f32;
    }
    sums.squares = sums.sum.clone();
    sums.visible = vec![[3, 5]; 8];
    sums.sample_count = 6;
    let metadata = Metadata {
        version: "0.1.0".to_owned(),
        scene: "room".to_owned(),
        sampler: "mis".to_owned(),
        shadow_rays: 5,
        depth: 1,
        sample_ranges: vec![SampleRange { seed: 1, first: 2, count: 6 }],
        seconds: 1.5,
        ..Metadata::default()
    };
    Checkpoint { sums, metadata }
}

/// Returns the device of the tests, with validation and synchronization validation on.
///
/// # Panics
/// Without a Vulkan device or the validation layers: run `./setup`.
pub fn device() -> &'static Arc<Device> {
    static DEVICE: OnceLock<Arc<Device>> = OnceLock::new();
    DEVICE.get_or_init(|| match Device::open(None, true) {
        Ok(device) => {
            eprintln!("device: {} ({})", device.capabilities().name, device.capabilities().driver);
            device
        }
        Err(error) => {
            panic!("GPU tests need a Vulkan device and validation layers, run ./setup: {error}")
        }
    })
}

/// True if the test's device is software: it rounds as the host does, and shares its memory and cores.
pub fn is_software() -> bool {
    device().capabilities().is_software()
}

/// Makes a renderer of `scene` on the test's device.
pub fn renderer(scene: &Scene, settings: Settings) -> Renderer {
    Renderer::new(device(), scene, settings).unwrap()
}

/// Renders `samples` samples per pixel and returns sums and totals.
pub fn render(scene: &Scene, settings: Settings, samples: u32) -> (Sums, Totals) {
    let mut renderer = renderer(scene, settings);
    renderer.render_pass(samples).unwrap();
    assert_silent();
    (renderer.sums().unwrap(), renderer.totals().clone())
}

/// Renders passes of as many samples per pixel as `passes` says and returns the sums.
pub fn render_passes(scene: &Scene, settings: Settings, passes: &[u32]) -> Sums {
    let mut renderer = renderer(scene, settings);
    passes.iter().for_each(|samples| renderer.render_pass(*samples).unwrap());
    assert_silent();
    renderer.sums().unwrap()
}

/// Goes on from `first` with `samples` samples per pixel and returns the sums.
pub fn resume(scene: &Scene, settings: Settings, first: &Sums, samples: u32) -> Sums {
    let mut renderer = renderer(scene, settings);
    renderer.restore(first).unwrap();
    renderer.render_pass(samples).unwrap();
    renderer.sums().unwrap()
}

/// Fails if the validation layers have said anything since the device was opened.
pub fn assert_silent() {
    let messages = device().validation_messages();
    assert!(messages.is_empty(), "validation messages:\n{}", messages.join("\n"));
}

/// Fails unless `result` is an error whose message has all `parts`.
#[track_caller]
pub fn assert_error<T>(result: Result<T, impl ToString>, parts: &[&str]) {
    let message = result.err().expect("an error").to_string();
    for part in parts {
        assert!(message.contains(part), "expected {part:?} in: {message}");
    }
}

/// Reads the SPIR-V that the build makes of `glsl/test/<name>.comp`.
pub fn spirv(name: &str) -> Vec<u8> {
    fs::read(format!("{}/test/{name}.spv", env!("OUT_DIR"))).unwrap()
}

/// Runs a probe kernel over `queries` with specialization constants and with buffers of the scene, and
/// returns its answer to each.
pub fn run_probe<Q: Pod, A: Pod>(
    kernel: &str,
    constants: &[(u32, u32)],
    buffers: &[(Binding, &[u8])],
    queries: &[Q],
) -> Vec<A> {
    let upload = |(binding, bytes): &(Binding, &[u8])| {
        (*binding, Buffer::from_slice(device(), binding.name, bytes).unwrap())
    };
    let uploaded: Vec<(Binding, Buffer)> = buffers.iter().map(upload).collect();
    let bound: Vec<_> = uploaded.iter().map(|(binding, buffer)| (*binding, buffer)).collect();
    let make = || DescriptorSet::new(device(), &SCENE, &bound).unwrap();
    let scene = (!bound.is_empty()).then(make);
    run_probe_with(kernel, constants, scene.as_slice(), &[], queries)
}

/// As [`run_probe`], with the sets and the push constants of a pass.
pub fn run_probe_with<Q: Pod, A: Pod>(
    kernel: &str,
    constants: &[(u32, u32)],
    sets: &[impl Borrow<DescriptorSet>],
    push: &[u8],
    queries: &[Q],
) -> Vec<A> {
    let device = device();
    let input = Buffer::from_slice(device, "queries", queries).unwrap();
    let bytes = (queries.len() * size_of::<A>()) as u64;
    let output = Buffer::zeroed(device, "answers", bytes).unwrap();
    let bound = [(probe::PROBE_INPUT, &input), (probe::PROBE_OUTPUT, &output)];
    let own = DescriptorSet::new(device, &PROBE, &bound).unwrap();
    let pipeline = Pipeline::new(device, kernel, &spirv(kernel), constants).unwrap();
    let sets: Vec<_> = sets.iter().map(Borrow::borrow).chain([&own]).collect();
    let mut commands = Commands::begin(device).unwrap();
    commands.dispatch(&pipeline, &sets, push, queries.len() as u32).unwrap();
    commands.submit_and_wait().unwrap();
    let answers = output.download(queries.len()).unwrap();
    assert_silent();
    answers
}
