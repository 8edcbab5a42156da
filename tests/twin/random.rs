//! Padded Owen-scrambled Sobol points: twin of `random_2d` and `random_1d` in `glsl/include/random.glsl`, bit
//! for bit.
//!
//! Within a pixel and dimension, every aligned run of 2ᵏ samples is a (0, k, 2)-net in base 2; independent
//! keys scramble and shuffle different dimensions, pixels and seeds. Such samples depend on each other: where
//! the outcome of earlier samples decides how later numbers are used, only `random_independent_2d` is
//! unbiased.
//!
//! Sources: Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4); Laine & Karras 2011,
//! "Stratified Sampling for Stochastic Transparency"; Vegdahl 2021, "Building a Better LK Hash".

use fenestra::math::random::{hash_4d, unit_float};

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
fn reversed_sobol_1(mut index: u32) -> u32 {
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

/// First coordinate of [`random_2d`].
pub fn random_1d(pixel: u32, sample_index: u32, dimension: u32, seed: u32) -> f32 {
    random_2d(pixel, sample_index, dimension, seed)[0]
}

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
