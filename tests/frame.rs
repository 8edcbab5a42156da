//! Frames and the lat-long mapping: properties on the host, and the shader twin.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use fenestra::math::{
    frame::{direction_from_lat_long, frame_from_normal, lat_long_from_direction, sin_cos_pi},
    random::random_independent_2d,
};
use glam::{Vec2, Vec3};

use crate::support;

/// Returns axes, directions on both sides of z = 0 and near the poles of either axis, and random ones.
fn directions() -> Vec<Vec3> {
    let mut directions = vec![
        Vec3::X,
        Vec3::Y,
        Vec3::Z,
        -Vec3::X,
        -Vec3::Y,
        -Vec3::Z,
        Vec3::new(1.0, 0.0, -0.0),
        Vec3::new(0.0, 1.0, 1e-7),
        Vec3::new(1e-7, -1.0, 0.0),
        Vec3::new(1e-4, 1e-4, -1.0).normalize(),
    ];
    for i in 0..10_000 {
        let [x, y] = random_independent_2d(i, 0, 0, 1);
        directions.push(direction_from_lat_long(Vec2::new(x, y)));
    }
    directions
}

#[test]
fn frames_are_orthonormal_and_right_handed() {
    for normal in directions() {
        let frame = frame_from_normal(normal);
        let (t, b, n) = (frame.tangent, frame.bitangent, frame.normal);
        for (a, b, expected) in
            [(t, t, 1.0), (b, b, 1.0), (n, n, 1.0), (t, b, 0.0), (t, n, 0.0), (b, n, 0.0)]
        {
            assert!((a.dot(b) - expected).abs() < 1e-6, "{normal}");
        }
        assert!(t.cross(b).distance(n) < 1e-6, "{normal}");
        assert!(frame.to_local(normal).distance(Vec3::Z) < 1e-6);
        assert!(frame.to_world(Vec3::X).distance(t) == 0.0);
    }
}

#[test]
fn sine_and_cosine_keep_relative_accuracy_near_their_zeros() {
    for i in 0..=40_000_u32 {
        let x = i as f32 / 20_000.0;
        let exact = std::f64::consts::PI * f64::from(x);
        let [s, c] = sin_cos_pi(x).to_array();
        assert!((f64::from(s) - exact.sin()).abs() < 1.5e-7, "sin π·{x}");
        assert!((f64::from(c) - exact.cos()).abs() < 1.5e-7, "cos π·{x}");
        // Below ¼, the distance of x from the zeros of the sine is exact in single precision.
        let tiny = x * 1e-6;
        let exact = (std::f64::consts::PI * f64::from(tiny)).sin();
        assert!((f64::from(sin_cos_pi(tiny).x) - exact).abs() <= 2e-7 * exact, "sin π·{tiny}");
    }
    assert_eq!(sin_cos_pi(1.0).to_array(), [0.0, -1.0]);
    assert_eq!(sin_cos_pi(0.5).to_array(), [1.0, 0.0]);
}

#[test]
fn the_lat_long_mapping_inverts_itself() {
    for direction in directions() {
        let uv = lat_long_from_direction(direction);
        assert!((0.0..=1.0).contains(&uv.x) && (0.0..=1.0).contains(&uv.y), "{direction}: {uv}");
        assert!(direction_from_lat_long(uv).distance(direction) < 2e-6, "{direction}");
    }
}

#[test]
fn the_shader_agrees() {
    let directions = directions();
    let inputs: Vec<[f32; 8]> = directions
        .iter()
        .enumerate()
        .map(|(index, normal)| {
            let direction = directions[(index * 7 + 3) % directions.len()];
            let [u, v] = random_independent_2d(index as u32, 1, 0, 1);
            let mut input = [0.0; 8];
            input[..3].copy_from_slice(&normal.to_array());
            input[3..6].copy_from_slice(&direction.to_array());
            input[6..].copy_from_slice(&[u, v]);
            input
        })
        .collect();
    let output: Vec<[f32; 16]> = support::run_probe("frame", &[], &[], &inputs);
    let mut worst = [0.0_f32; 16];
    for (input, shader) in inputs.iter().zip(&output) {
        let (normal, direction) = (Vec3::from_slice(input), Vec3::from_slice(&input[3..]));
        let uv = Vec2::from_slice(&input[6..]);
        let frame = frame_from_normal(normal);
        let direction_local = frame.to_local(direction);
        let mut host = Vec::new();
        for vector in
            [frame.tangent, frame.bitangent, direction_local, frame.to_world(direction_local)]
        {
            host.extend(vector.to_array());
        }
        host.extend(lat_long_from_direction(direction).to_array());
        host.extend(sin_cos_pi(2.0 * uv.x).to_array());
        // u has a seam where 0 and 1 coincide.
        let seam = (shader[12] - host[12]).abs() > 0.9;
        for (slot, (a, b)) in host.iter().zip(shader).enumerate() {
            let difference = (a - b).abs();
            worst[slot] = worst[slot].max(if slot == 12 && seam { 0.0 } else { difference });
        }
    }
    // The implementation's arc tangent is the weak point: 1.05e-6 with lavapipe.
    for (slot, worst) in worst.iter().enumerate() {
        let tolerance = if (12..14).contains(&slot) { 3e-6 } else { 5e-7 };
        assert!(*worst < tolerance, "output {slot} differs by {worst:e}");
    }
}
