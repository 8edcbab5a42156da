//! `glsl/include/srbf.glsl` against its Rust twin over the whole range of bandwidths.

use bytemuck::{Pod, Zeroable};
use fenestra::srbf::{expm1, kernel_integral, kernel_value};
use glam::{Vec2, Vec3};

use crate::{
    support::{
        self,
        lobes::{BANDWIDTHS, random_bandwidth},
        random::Random,
    },
    twin::srbf,
};

/// Twin of `Input` in `glsl/test/srbf.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ProbeInput {
    axis: Vec3,
    bandwidth: f32,
    direction: Vec3,
    u: Vec2,
    x: f32,
}

/// Twin of `Output` in `glsl/test/srbf.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ProbeOutput {
    expm1_x: f32,
    log1p_x: f32,
    integral: f32,
    steepness: f32,
    hemisphere_part: f32,
    value: f32,
    distance: f32,
    sampled: Vec3,
}

/// Returns the relative difference, or an absolute one where both are tiny.
fn difference(a: f32, b: f32) -> f32 {
    (a - b).abs() / a.abs().max(b.abs()).max(1e-30)
}

#[test]
fn shader_twin_agrees_over_the_whole_range() {
    let mut random = Random(5);
    let inputs: Vec<ProbeInput> = (0..10_000)
        .map(|i| {
            let axis = random.direction();
            let bandwidth =
                BANDWIDTHS.get(i).copied().unwrap_or_else(|| random_bandwidth(&mut random));
            let u = Vec2::new(random.uniform() as f32, random.uniform() as f32);
            let near = srbf::kernel_sample(axis, bandwidth, u).normalize();
            let magnitude = random.power_of_ten(-7.0, 1.0);
            ProbeInput {
                axis,
                bandwidth,
                direction: near,
                u: Vec2::new(random.uniform() as f32, random.uniform() as f32),
                x: if i % 2 == 0 { magnitude } else { -magnitude },
            }
        })
        .collect();
    let outputs: Vec<ProbeOutput> = support::run_probe("srbf", &[], &[], &inputs);
    for (input, shader) in inputs.iter().zip(&outputs) {
        let check = |name: &str, found: f32, expected: f32, tolerance: f32| {
            assert!(
                difference(found, expected) < tolerance || (found - expected).abs() < 1e-30,
                "{name}: shader {found:e}, host {expected:e} at {input:?}"
            );
        };
        check("expm1", shader.expm1_x, expm1(input.x), 2e-6);
        check("log1p", shader.log1p_x, srbf::log1p(input.x.max(-0.9999)), 2e-6);
        check("integral", shader.integral, kernel_integral(input.bandwidth), 1e-6);
        check("steepness", shader.steepness, srbf::kernel_steepness(input.bandwidth), 1e-6);
        let part = srbf::kernel_part_of_ratio(input.bandwidth, input.axis.dot(input.direction));
        check("hemisphere part", shader.hemisphere_part, part, 1e-5);
        // The shader reproduces the exponent to a few units in its last place.
        let d = input.direction - input.axis;
        let exponent = 0.5 * input.bandwidth * d.dot(d);
        let value = kernel_value(input.axis, input.bandwidth, input.direction);
        check("value", shader.value, value, 2e-6 + 5e-7 * exponent);
        let distance = srbf::kernel_sample_distance(input.bandwidth, input.u.x);
        check("distance", shader.distance, distance, 5e-6);
        let sampled = srbf::kernel_sample(input.axis, input.bandwidth, input.u);
        // Near the antipode the cosine, which GPUs round otherwise, says little about the angle.
        let from_antipode = (1.0 + sampled.dot(input.axis)).max(1e-6).sqrt();
        let tolerance = if support::is_software() { 5e-6 } else { 5e-6 + 4e-7 / from_antipode };
        assert!(shader.sampled.distance(sampled) < tolerance, "{input:?} {shader:?}");
        let inverse = srbf::kernel_inverse(input.axis, input.bandwidth, shader.sampled);
        assert!((inverse.x - input.u.x).abs() < 5e-4, "{input:?} {shader:?}");
    }
}
