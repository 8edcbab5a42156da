//! Russian roulette: ends paths that carry little, and weighs those that survive (Arvo & Kirk 1990,
//! "Particle transport and image synthesis").

use crate::shader::constants::{CONSTANT_ROULETTE_THROUGHPUT, CONSTANT_ROULETTE_VERTEX};

/// Where and how russian roulette ends paths. The pixels of a block of 8×8 draw the same number, so that
/// invocations which run together end together; each survives with its own probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roulette {
    /// First vertex, from 0 on, that a path may fail to reach.
    pub vertex: u32,
    /// A path survives with its largest throughput of any channel over this, if that is below 1; with 0
    /// all do.
    pub throughput: f32,
}

impl Default for Roulette {
    fn default() -> Self {
        Self { vertex: 2, throughput: 0.1 }
    }
}

impl Roulette {
    /// No roulette.
    pub const NEVER: Self = Self { vertex: u32::MAX, throughput: 1.0 };

    /// Specialization of the passes that continue paths.
    pub(crate) fn constants(&self) -> [(u32, u32); 2] {
        let vertex = if self.throughput > 0.0 { self.vertex } else { u32::MAX };
        [
            (CONSTANT_ROULETTE_VERTEX, vertex),
            (CONSTANT_ROULETTE_THROUGHPUT, self.throughput.to_bits()),
        ]
    }
}
