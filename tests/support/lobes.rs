//! Bandwidths for the tests of the kernels.

use super::random::Random;

/// Bandwidths from wider than the sphere to a sixth of a degree.
pub const BANDWIDTHS: [f32; 17] = [
    1e-3, 3e-3, 0.01, 0.05, 0.099, 0.101, 0.3, 0.499, 0.501, 1.0, 3.0, 8.0, 30.0, 300.0, 3e3, 3e4,
    1e5,
];

/// Draws a bandwidth in the range of [`BANDWIDTHS`], its logarithm uniform.
pub fn random_bandwidth(random: &mut Random) -> f32 {
    random.power_of_ten(-3.0, 5.0)
}
