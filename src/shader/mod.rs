//! Shared by Rust and GLSL: constants, structs, buffers, and the SPIR-V that `build.rs` compiles.

pub mod bindings;
pub mod constants;
pub mod rooms;
pub mod spirv;
pub mod structs;

use fenestra_scene::{
    math::colour,
    measured::layout,
    texture::{Channels, Wrap},
};

/// Checks the numbers that the data of scenes and shaders share.
const _: () = {
    macro_rules! same {
        ($($name:ident),*) => { $(assert!(constants::$name == layout::$name);)* };
    }
    same!(
        BRDF_COSINE_INTERVALS,
        MEASURED_THETA_HALF_BINS,
        MEASURED_THETA_DIFFERENCE_BINS,
        MEASURED_PHI_DIFFERENCE_BINS,
        MEASURED_ELEVATION_BINS,
        MEASURED_POLAR_BINS,
        MEASURED_AZIMUTH_BINS,
        MEASURED_COSINE_SHARE_OFFSET,
        MEASURED_CUMULATIVE_OFFSET,
        MEASURED_DENSITY_OFFSET,
        MEASURED_GRID_OFFSET,
        MEASURED_TURN_BINS,
        MEASURED_TURN_THETA_DIFFERENCE_BINS,
        MEASURED_TURN_PHI_DIFFERENCE_BINS,
        MEASURED_TURN_OFFSET
    );
    let (ours, theirs) = (constants::LUMINANCE_WEIGHTS, colour::LUMINANCE_WEIGHTS);
    assert!(ours[0] == theirs[0] && ours[1] == theirs[1] && ours[2] == theirs[2]);
    assert!(constants::TEXTURE_REPEAT == Wrap::Repeat as u32);
    assert!(constants::TEXTURE_MIRROR == Wrap::Mirror as u32);
    assert!(constants::TEXTURE_CLAMP == Wrap::Clamp as u32);
    assert!(Channels::Color as u32 == 0 && Channels::Alpha as u32 == 4);
};
