//! Visibility cache at one hit, read back from the device.

use glam::Vec3;

use super::Visibility;
use crate::{error::Result, math::octahedron, pass::BLOCK_PIXELS, shader::rooms::product};

/// Head bit of a cache that holds the last ray of its hit; twin of `cache.glsl`.
const CACHE_GROWN: u32 = 1 << 31;

impl Visibility {
    /// V of the first path's lobes for its last ray, in a wave of one block; twin of
    /// `weights.glsl`. Fails if the device does.
    pub(super) fn visibility_weights(&self, lobe_count: usize) -> Result<Vec<f64>> {
        let places = self.cache_places as usize;
        let cache: Vec<u32> =
            self.lobes.set.buffer(product::VISIBILITY_CACHE).download(1 + places)?;
        // Weights do not yet include what the last ray taught.
        let recorded =
            (cache[0] & !CACHE_GROWN) as usize - usize::from(cache[0] & CACHE_GROWN != 0);
        let stride = BLOCK_PIXELS as usize;
        let words_per_mask = self.kept_lobes.div_ceil(32) as usize;
        let length = ((places + 1) * words_per_mask - 1) * stride + 1;
        let masks: Vec<u32> = self.lobes.set.buffer(product::CLOSE_LOBES).download(length)?;
        let weight = |lobe: usize| {
            let is_close = |entry: &usize| {
                let word = entry % (places + 1) * words_per_mask + lobe / 32;
                masks[word * stride] >> (lobe % 32) & 1 != 0
            };
            let close = (recorded - recorded.min(places)..recorded).filter(is_close).count();
            (1.0 + close as f64).powf(-f64::from(self.parameters.exponent))
        };
        Ok((0..lobe_count).map(weight).collect())
    }

    /// Reads the first path's cached directions in world space, oldest first. Fails if the device does.
    pub(super) fn cached_directions(&self) -> Result<Vec<Vec3>> {
        let places = self.cache_places as usize;
        let words: Vec<u32> =
            self.lobes.set.buffer(product::VISIBILITY_CACHE).download(1 + places)?;
        let recorded = (words[0] & !CACHE_GROWN) as usize;
        let oldest = if recorded > places { recorded % places } else { 0 };
        let in_order = (0..recorded.min(places)).map(|i| words[1 + (oldest + i) % places]);
        Ok(in_order.map(octahedron::unpack).collect())
    }
}
