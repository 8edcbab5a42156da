//! Counter-based random numbers: (pixel, sample, dimension, seed) → numbers in [0, 1), without state.
//!
//! Bit-for-bit twin of `glsl/include/random.glsl`. A *dimension* names a pair of numbers. Every
//! result is a multiple of 2⁻²⁴, never 1.
//!
//! [`random_2d`] returns padded Owen-scrambled Sobol points. Within a pixel and dimension, every
//! aligned run of 2ᵏ samples is a (0, k, 2)-net in base 2; independent keys scramble and shuffle
//! different dimensions, pixels and seeds. Such samples depend on each other: where the outcome of
//! earlier samples decides how later numbers are used, only [`random_independent_2d`] is unbiased.
//!
//! Sources: Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4); Laine & Karras 2011,
//! "Stratified Sampling for Stochastic Transparency"; Vegdahl 2021, "Building a Better LK Hash";
//! Jarzynski & Olano 2020, "Hash Functions for GPU Rendering", JCGT 9(3).

/// Takes the place of the sample index when [`random_2d`] hashes its keys.
const RANDOM_KEY_TAG: u32 = 0x9e37_79b9;

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
fn reversed_sobol_1(mut index: u32) -> u32 {
    index ^= (index >> 1) & 0x5555_5555;
    index ^= (index >> 2) & 0x3333_3333;
    index ^= (index >> 4) & 0x0f0f_0f0f;
    index ^= (index >> 8) & 0x00ff_00ff;
    index ^= index >> 16;
    index
}

/// Maps an integer to a multiple of 2⁻²⁴ in [0, 1).
pub fn unit_float(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
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

/// First coordinate of [`random_2d`].
pub fn random_1d(pixel: u32, sample_index: u32, dimension: u32, seed: u32) -> f32 {
    random_2d(pixel, sample_index, dimension, seed)[0]
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

#[cfg(test)]
mod tests {
    use super::reversed_sobol_1;

    /// Second coordinate of the Sobol sequence from its direction numbers: polynomial x + 1, m₁ = 1,
    /// mⱼ = 2 mⱼ₋₁ ⊕ mⱼ₋₁ (Joe & Kuo 2008, section 2).
    fn sobol_1_from_direction_numbers(index: u32) -> u32 {
        let mut direction_number: u64 = 1;
        let mut result = 0;
        for bit in 0..32 {
            if (index >> bit) & 1 == 1 {
                result ^= (direction_number << (31 - bit)) as u32;
            }
            direction_number ^= direction_number << 1;
        }
        result
    }

    #[test]
    fn the_factored_sobol_matrix_equals_the_direction_numbers() {
        for index in (0..20_000).chain((0..32).map(|bit| 1 << bit)).chain([u32::MAX, 0xdead_beef]) {
            assert_eq!(
                reversed_sobol_1(index),
                sobol_1_from_direction_numbers(index).reverse_bits(),
                "index {index}"
            );
        }
    }
}
