//! Counter-based random numbers: (pixel, sample, dimension, seed) → numbers in [0, 1), without state.
//!
//! Bit-for-bit twin of `glsl/include/random.glsl`. A *dimension* names a pair of numbers. Every
//! result is a multiple of 2⁻²⁴, never 1.
//!
//! Source: Jarzynski & Olano 2020, "Hash Functions for GPU Rendering", JCGT 9(3).

/// PCG4D: hashes four words into four well-mixed words. Jarzynski & Olano 2020.
pub fn hash_4d(v: [u32; 4]) -> [u32; 4] {
    let [mut x, mut y, mut z, mut w] =
        v.map(|word| word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    x = x.wrapping_add(y.wrapping_mul(w));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    w = w.wrapping_add(y.wrapping_mul(z));
    [x, y, z, w] = [x, y, z, w].map(|word| word ^ (word >> 16));
    x = x.wrapping_add(y.wrapping_mul(w));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    w = w.wrapping_add(y.wrapping_mul(z));
    [x, y, z, w]
}

/// Maps an integer to a multiple of 2⁻²⁴ in [0, 1).
pub fn unit_float(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Pair of numbers independent across samples, pixels and dimensions.
pub fn random_independent_2d(pixel: u32, sample_index: u32, dimension: u32, seed: u32) -> [f32; 2] {
    let bits = hash_4d([pixel, sample_index, dimension, seed]);
    [unit_float(bits[0]), unit_float(bits[1])]
}

/// First coordinate of [`random_independent_2d`].
pub fn random_independent_1d(pixel: u32, sample_index: u32, dimension: u32, seed: u32) -> f32 {
    random_independent_2d(pixel, sample_index, dimension, seed)[0]
}
