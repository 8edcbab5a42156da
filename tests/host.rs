//! The Vulkan host: uploads, dispatches, timestamps, device choice, limits.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use fenestra::{
    gpu::{
        Buffer, Commands, DescriptorSet, Pipeline,
        capabilities::{Capabilities, choose},
    },
    shader::bindings::{PROBE, probe},
};

use crate::support::{self, assert_error};

#[test]
fn a_probe_sees_its_input_and_returns_its_output() {
    let input: Vec<u32> = (0..1000).map(|i| i * i).collect();
    let output: Vec<u32> = support::run_probe("probe", &[], &[], &input);
    assert!(input.iter().zip(&output).all(|(input, output)| input + 1 == *output));
}

#[test]
fn copies_longer_than_one_staging_piece_arrive_whole() {
    let device = support::device();
    let words: Vec<u32> = (0..(20 << 20) / 4 + 3).collect();
    let buffer = Buffer::from_slice(device, "long", &words).unwrap();
    assert_eq!(buffer.download::<u32>(words.len()).unwrap(), words);
    support::assert_silent();
}

#[test]
fn every_timed_pass_has_its_row() {
    let device = support::device();
    let input = Buffer::zeroed(device, "input", 4 << 20).unwrap();
    let output = Buffer::zeroed(device, "output", 4 << 20).unwrap();
    let forth = DescriptorSet::new(
        device,
        &PROBE,
        &[(probe::PROBE_INPUT, &input), (probe::PROBE_OUTPUT, &output)],
    )
    .unwrap();
    let back = DescriptorSet::new(
        device,
        &PROBE,
        &[(probe::PROBE_INPUT, &output), (probe::PROBE_OUTPUT, &input)],
    )
    .unwrap();
    let pipeline = Pipeline::new(device, "probe", &support::spirv("probe"), &[]).unwrap();
    let mut commands = Commands::begin_timed(device, 4).unwrap();
    for _ in 0..2 {
        commands.dispatch(&pipeline, &[&forth], &[], 1 << 20).unwrap();
        commands.dispatch(&pipeline, &[&back], &[], 1 << 20).unwrap();
    }
    let times = commands.submit_and_wait().unwrap();
    assert_eq!(times.keys().collect::<Vec<_>>(), ["probe"]);
    assert!(times["probe"] > 0.0);
    // Passes of few invocations take their part of the time too.
    let mut few = Commands::begin_timed(device, 1).unwrap();
    few.dispatch(&pipeline, &[&forth], &[], 64).unwrap();
    assert!(few.submit_and_wait().unwrap()["probe"] > 0.0);
    // Each dispatch sees the writes of the one before.
    assert!(input.download::<u32>(1 << 20).unwrap().iter().all(|word| *word == 4));
    support::assert_silent();
}

#[test]
fn a_buffer_over_the_limit_is_refused_with_both_figures() {
    let device = support::device();
    let allowed = device.capabilities().max_storage_buffer_range;
    let [limit, asked] = [allowed, allowed + 4].map(|bytes| bytes.to_string());
    let refused = Buffer::new(device, "too large", allowed + 4);
    assert_error(refused, &[&limit, &asked, "too large"]);
}

fn capabilities(index: usize, name: &str, kind: &'static str) -> Capabilities {
    Capabilities { index, name: name.into(), kind, ..support::device().capabilities().clone() }
}

#[test]
fn a_discrete_device_comes_before_an_integrated_one_before_software() {
    let list = [
        capabilities(0, "llvmpipe", "software"),
        capabilities(1, "Small", "integrated"),
        capabilities(2, "Big", "discrete"),
    ];
    assert_eq!(choose(&list, None).unwrap().index, 2);
    assert_eq!(choose(&list[..2], None).unwrap().index, 1);
    assert_eq!(choose(&list, Some("0")).unwrap().name, "llvmpipe");
    assert_eq!(choose(&list, Some("small")).unwrap().index, 1);
    assert_error(choose(&list, Some("huge")), &["huge", "[2] Big"]);
}

#[test]
fn a_device_without_a_needed_limit_is_refused_with_needed_and_found() {
    let mut weak = capabilities(0, "Weak", "discrete");
    weak.scalar_block_layout = false;
    weak.max_storage_buffers = 4;
    weak.api_version = (1, 1, 0);
    let parts = ["Weak", "scalarBlockLayout", "found 4", "needed 1.2, found 1.1.0"];
    assert_error(choose(std::slice::from_ref(&weak), None), &parts);
    // The choice passes over it where another device will do.
    let list = [weak, capabilities(1, "llvmpipe", "software")];
    assert_eq!(choose(&list, None).unwrap().index, 1);
}

/// Lavapipe 22.3 lets a stage see 32 storage and 128 texel buffers.
#[test]
fn the_passes_fit_devices_that_show_few_buffers() {
    let mut small = capabilities(0, "Small", "integrated");
    (small.max_storage_buffers, small.max_texel_buffers) = (16, 64);
    assert_eq!(small.missing(), Vec::<String>::new());
}

#[test]
fn a_mistake_is_heard_by_the_validation_layers() {
    // Use a device of its own, so that the shared one stays silent.
    let device = fenestra::gpu::Device::open(None, true).unwrap();
    let buffer = Buffer::zeroed(&device, "buffer", 64).unwrap();
    let set = DescriptorSet::new(
        &device,
        &PROBE,
        &[(probe::PROBE_INPUT, &buffer), (probe::PROBE_OUTPUT, &buffer)],
    )
    .unwrap();
    let pipeline = Pipeline::new(&device, "probe", &support::spirv("probe"), &[]).unwrap();
    let mut commands = Commands::begin(&device).unwrap();
    // Push constants come in multiples of four bytes.
    commands.dispatch(&pipeline, &[&set], &[0; 3], 1).unwrap();
    let _ = commands.submit_and_wait();
    let messages = device.validation_messages();
    assert!(messages.iter().any(|message| message.contains("vkCmdPushConstants")), "{messages:?}");
}
