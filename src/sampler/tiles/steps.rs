//! Passes of `tiles`: `sample_tiles`, and in the pilot `count_tiles`.

use super::parameters::TilesParameters;
use crate::{
    pass::{Domain, Kernel, Steps, Surfaces},
    shader::{
        rooms::tiles::{CONSTANT_SECTOR_JITTER, CONSTANT_TILES, CONSTANT_TILES_LEARN},
        structs::Wave,
    },
};

/// Steps of the picture, or of the pilot before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileSteps {
    tiles: u32,
    has_jitter: bool,
    learns: bool,
    surfaces: Surfaces,
}

impl TileSteps {
    /// Returns the steps of the picture.
    pub fn new(parameters: &TilesParameters, tiles: usize, surfaces: Surfaces) -> Self {
        let has_jitter = parameters.sector_jitter;
        Self { tiles: tiles as u32, has_jitter, learns: false, surfaces }
    }

    /// Returns the same steps for the pilot.
    pub fn learning(self) -> Self {
        Self { learns: true, ..self }
    }

    /// Specialization constant of all passes over the cache.
    pub fn constants(&self) -> [(u32, u32); 1] {
        [(CONSTANT_TILES, self.tiles)]
    }
}

impl Steps for TileSteps {
    fn walks_lists(&self) -> bool {
        true
    }

    fn sample(&self, _wave: &Wave) -> Vec<Kernel> {
        let own = [
            (CONSTANT_SECTOR_JITTER, u32::from(self.has_jitter)),
            (CONSTANT_TILES_LEARN, u32::from(self.learns)),
        ];
        let constants = [&own[..], &self.constants(), &self.surfaces.constants()].concat();
        vec![Kernel::new("sample_tiles", Domain::Surfaces, &constants)]
    }

    fn after_shadow_rays(&self, _wave: &Wave) -> Vec<Kernel> {
        let count = Kernel::new("count_tiles", Domain::ShadowRays, &self.constants());
        if self.learns { vec![count] } else { Vec::new() }
    }
}
