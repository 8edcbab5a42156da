//! Product lobes of all hits of a wave on the device, with the fits they are made from.

use std::sync::Arc;

use super::fits::Fits;
use crate::{
    error::Result,
    gpu::{Buffer, DescriptorSet, Device},
    math::octahedron,
    pass::{BLOCK_PIXELS, LobeReadback, PathDemand},
    shader::rooms::product::{self, LOBES_PER_SUM},
};

/// Storage for the lobes of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LobeSize {
    /// Lobes kept per path.
    pub kept_lobes: u32,
    /// Directions in a visibility cache; 0 without one.
    pub cache_capacity: u32,
    /// Pixels of the window if caches belong to pixels; `None` if they belong to paths.
    pub cached_pixels: Option<u64>,
}

impl LobeSize {
    /// Words per path for the lobes close to cached directions: `MASK_WORDS` of `cache.glsl` for
    /// every place of the cache and for the direction under way.
    fn mask_words(self) -> u64 {
        u64::from(self.kept_lobes.div_ceil(32)) * (u64::from(self.cache_capacity) + 1)
    }

    /// Memory per path in flight.
    pub fn demand(self) -> PathDemand {
        let lobes = u64::from(self.kept_lobes);
        let masks = self.mask_words();
        let (bytes, texels) = ((8 * lobes).max(4 * masks), lobes.max(masks));
        PathDemand { bytes, texels, ..PathDemand::default() }
    }
}

/// Descriptor set 1 of `product` and `visibility`.
pub struct LobeBuffers {
    /// Descriptor set 1.
    pub set: DescriptorSet,
    pub(super) fits: Fits,
}

impl LobeBuffers {
    /// Allocates the lobes of `paths` paths. Fails if the device does or its limits are exceeded.
    pub fn new(device: &Arc<Device>, fits: Fits, size: LobeSize, paths: u32) -> Result<Self> {
        let paths = u64::from(paths);
        let kept = u64::from(size.kept_lobes);
        let make = |name, count: u64, bytes: u64| Buffer::new(device, name, count * bytes);
        let caches = size.cached_pixels.unwrap_or(paths);
        let cache_words =
            if size.cache_capacity > 0 { 1 + u64::from(size.cache_capacity) } else { 0 };
        let sum_count = paths * kept.div_ceil(u64::from(LOBES_PER_SUM));
        let caches = Buffer::zeroed(device, "visibility caches", 4 * caches * cache_words)?;
        let mut bound = fits.bound.to_vec();
        bound.extend([
            (product::LOBES, make("product lobes", paths * kept, 8)?),
            (product::LOBE_COUNTS, make("lobe counts", paths, 4)?),
            (product::LOBE_SUMS, make("lobe sums", sum_count, 4)?),
            (product::CLOSE_LOBES, make("close lobes", paths * size.mask_words(), 4)?),
            (product::VISIBILITY_CACHE, caches),
        ]);
        let set = DescriptorSet::new(device, &product::TABLE, &bound)?;
        Ok(Self { set, fits })
    }

    /// Number of lobes of the first path of the last wave. Fails if the device does.
    pub fn count(&self) -> Result<usize> {
        let counts: Vec<u32> = self.set.buffer(product::LOBE_COUNTS).download(1)?;
        Ok(counts[0] as usize)
    }

    /// Reads the lobes of the first path in a wave of one block: fills `lobes` on the first call, updates
    /// their last probabilities on every call. `factors` are the weights V. Fails if the device does.
    pub fn read(&self, factors: &[f64], lobes: &mut Vec<LobeReadback>) -> Result<()> {
        let count = factors.len();
        if count == 0 {
            return Ok(());
        }
        let stride = BLOCK_PIXELS as usize;
        let words: Vec<[u32; 2]> =
            self.set.buffer(product::LOBES).download((count - 1) * stride + 1)?;
        let weight = |lobe: usize| f64::from(half(words[lobe * stride][1] >> 16)) * factors[lobe];
        let total: f64 = (0..count).map(weight).sum();
        let probability = |lobe: usize| if total > 0.0 { weight(lobe) / total } else { 0.0 };
        if lobes.is_empty() {
            lobes.extend((0..count).map(|lobe| LobeReadback {
                axis: octahedron::unpack(words[lobe * stride][0]),
                bandwidth: half(words[lobe * stride][1]),
                before: probability(lobe),
                after: 0.0,
            }));
        }
        for (index, lobe) in lobes.iter_mut().enumerate() {
            lobe.after = probability(index);
        }
        Ok(())
    }
}

fn half(word: u32) -> f32 {
    half::f16::from_bits(word as u16).to_f32()
}
