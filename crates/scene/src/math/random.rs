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

/// Takes the place of the sample index when [`random_2d`] hashes its keys.
const RANDOM_KEY_TAG: u32 = 0x9e37_79b9;

/// Laine–Karras permutation: flips every bit depending on the key and the bits below it, which is
/// Owen scrambling of a bit-reversed number. Constants: Vegdahl 2021.
fn laine_karras_permutation(mut x: u32, key: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(key);
    x = x.wrapping_mul((key >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x
}

/// Second coordinate of the Sobol sequence, bit-reversed.
///
/// The direction numbers of the polynomial x + 1 form Pascal's triangle modulo 2. That is a Kronecker
/// power of a 2×2 matrix and factors into one step per bit of the bit index.
pub fn reversed_sobol_1(mut index: u32) -> u32 {
    index ^= (index >> 1) & 0x5555_5555;
    index ^= (index >> 2) & 0x3333_3333;
    index ^= (index >> 4) & 0x0f0f_0f0f;
    index ^= (index >> 8) & 0x00ff_00ff;
    index ^= index >> 16;
    index
}

/// Keys of one pixel and dimension, for the shuffled index and the two coordinates.
fn random_keys(pixel: u32, dimension: u32, seed: u32) -> [u32; 4] {
    hash_4d([pixel, RANDOM_KEY_TAG, dimension, seed])
}

/// Point `sample_index` of the shuffled, Owen-scrambled Sobol (0,2)-sequence of this pixel and
/// dimension. Burley 2020.
pub fn random_2d(pixel: u32, sample_index: u32, dimension: u32, seed: u32) -> [f32; 2] {
    let keys = random_keys(pixel, dimension, seed);
    let shuffled = laine_karras_permutation(sample_index.reverse_bits(), keys[0]).reverse_bits();
    let first = laine_karras_permutation(shuffled, keys[1]).reverse_bits();
    let second = laine_karras_permutation(reversed_sobol_1(shuffled), keys[2]).reverse_bits();
    [unit_float(first), unit_float(second)]
}
