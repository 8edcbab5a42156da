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

pub use fenestra::math::random::random_2d;
use fenestra::math::random::reversed_sobol_1;

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
