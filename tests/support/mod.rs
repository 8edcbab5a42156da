//! Shared by the integration tests: the Vulkan device, renderers, and probes of shader functions.
#![allow(dead_code, reason = "every test binary uses a part of this")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

pub mod replicates;
pub mod scenes;
pub mod statistics;

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError},
};

use bytemuck::{Pod, Zeroable};
use fenestra::{
    film::Sums,
    gpu::{Buffer, Commands, DescriptorSet, Device, Pipeline},
    renderer::{Renderer, Settings, Totals},
    scene::Scene,
    shader::constants::{SET_FILM, WORKGROUP_SIZE},
};

/// Lets one test run at a time: the validation layers were seen to crash when several threads made
/// and dropped renderers at once.
pub fn alone() -> MutexGuard<'static, ()> {
    static LOCK: Mutex<()> = Mutex::new(());
    LOCK.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Input of the probe `product_state` for one path: a surface seen along a direction, and a shadow
/// ray with its outcome.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub struct PathInput {
    pub normal: [f32; 3],
    pub material: u32,
    pub outgoing: [f32; 3],
    pub shadow_direction: [f32; 3],
    pub is_visible: u32,
}

/// Returns the device that all tests of one binary share, with validation and synchronization
/// validation on.
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

/// Makes a renderer of `scene` on the shared device.
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

/// Fails if the validation layers have said anything since the device was opened.
pub fn assert_silent() {
    let messages = device().validation_messages();
    assert!(messages.is_empty(), "validation messages:\n{}", messages.join("\n"));
}

/// Runs a probe shader over `invocations` invocations and returns its output, binding 1 of the film
/// set. `buffers` are (set, binding, content); binding 0 of the film set is the probe's input.
pub fn run_probe(
    spirv: &[u8],
    buffers: &[(u32, u32, &[u8])],
    output_bytes: usize,
    invocations: u32,
) -> Vec<u8> {
    let device = device();
    let uploaded: Vec<(u32, u32, Buffer)> = buffers
        .iter()
        .map(|(set, binding, bytes)| {
            let name = format!("probe {set}.{binding}");
            (*set, *binding, Buffer::from_slice(device, &name, bytes).unwrap())
        })
        .collect();
    let output = Buffer::zeroed(device, "probe output", output_bytes as u64).unwrap();
    let mut by_set: BTreeMap<u32, Vec<(u32, &Buffer)>> = BTreeMap::new();
    for (set, binding, buffer) in &uploaded {
        by_set.entry(*set).or_default().push((*binding, buffer));
    }
    by_set.entry(SET_FILM).or_default().push((1, &output));
    let sets: Vec<DescriptorSet> = by_set
        .iter()
        .map(|(set, buffers)| DescriptorSet::new(device, *set, buffers).unwrap())
        .collect();
    let pipeline = Pipeline::new(device, "probe", spirv, &[]).unwrap();
    let mut commands = Commands::begin(device).unwrap();
    commands.dispatch(
        &pipeline,
        &sets.iter().collect::<Vec<_>>(),
        &[],
        invocations.next_multiple_of(WORKGROUP_SIZE),
    );
    commands.submit_and_wait().unwrap();
    let result = output.download(output_bytes).unwrap();
    assert_silent();
    result
}
