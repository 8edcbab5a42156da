//! What the passes did at the first hit of one pixel, read back from the device.
//!
//! Buffers of a wave hold the last group of shadow rays only, and lobe weights as they were at the
//! end. So the pixel is rendered with one ray, then with two, and so on: the random numbers of a ray
//! do not depend on how many follow it, so each round repeats the one before and adds a ray.

use glam::Vec3;

use super::{BLOCK_PIXELS, Renderer};
use crate::{
    error::{Error, Result},
    sampler::Sampler,
    shader::{
        constants::NO_MATERIAL,
        structs::{Hit, ShadowRay},
    },
};

/// A shadow ray of a [`RecordedPixel`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedRay {
    /// Unit direction, world space.
    pub direction: Vec3,
    /// BRDF · radiance · cosine / pdf; a zero vector was not traced.
    pub contribution: Vec3,
    /// Whether it reached the environment.
    pub is_visible: bool,
}

/// A lobe of the product at a [`RecordedPixel`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedLobe {
    /// Unit axis, world space.
    pub axis: Vec3,
    /// Bandwidth of the SRBF.
    pub bandwidth: f32,
    /// Probability among the lobes for the first ray.
    pub before: f64,
    /// Probability among the lobes for the last ray.
    pub after: f64,
}

/// The first hit of a pixel's first sample with all its shadow rays.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedPixel {
    /// Position of the hit, metres.
    pub position: Vec3,
    /// Unit shading normal.
    pub normal: Vec3,
    /// Shadow rays in the order they were traced.
    pub rays: Vec<RecordedRay>,
    /// Lobes of the product; empty for samplers without.
    pub lobes: Vec<RecordedLobe>,
    /// Visibility cache when the last ray was drawn, the oldest entry first; `None` for samplers
    /// without.
    pub cached: Option<Vec<CachedDirection>>,
}

/// An entry of a visibility cache.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CachedDirection {
    /// Unit direction, world space.
    pub direction: Vec3,
    /// Whether it was visible; always `false` without `count_visible`.
    pub is_visible: bool,
}

impl Renderer {
    /// Renders one sample of a renderer's only pixel and reads back what happened; `None` where the
    /// camera ray left the scene. The film is emptied.
    ///
    /// # Errors
    /// [`Error::Usage`] for the sampler `guided`, whose choices rest on the whole picture: see
    /// [`Renderer::record_guided_pixel`]; [`Error::Vulkan`] if the device fails.
    ///
    /// # Panics
    /// If the window is larger than one pixel.
    pub fn record_pixel(&mut self) -> Result<Option<RecordedPixel>> {
        assert!(self.window.width == 1 && self.window.height == 1, "a window of one pixel");
        if self.settings.sampler == Sampler::Guided {
            return Err(Error::usage(
                "guided learns from the whole picture: one pixel alone has nothing to record",
            ));
        }
        let most = self.settings.shadow_rays;
        let mut recorded: Option<RecordedPixel> = None;
        for count in 1..=most.max(1) {
            self.passes.limit_shadow_rays(count.min(most));
            self.restart(self.settings.seed)?;
            self.render_pass(1)?;
            let hit = self.read::<Hit>("hits", 0)?;
            if hit.material == NO_MATERIAL {
                recorded = None;
                break;
            }
            let pixel = recorded.get_or_insert_with(|| RecordedPixel {
                position: hit.position.into(),
                normal: hit.shading_normal.into(),
                rays: Vec::new(),
                lobes: Vec::new(),
                cached: None,
            });
            if most == 0 {
                break;
            }
            let last = (count - 1) % self.passes.rays_per_group() * BLOCK_PIXELS;
            let ray = self.read::<ShadowRay>("shadow rays", last)?;
            pixel.rays.push(RecordedRay {
                direction: ray.direction.into(),
                contribution: ray.contribution.into(),
                is_visible: self.read::<u32>("visibility", last)? != 0,
            });
            if self.settings.sampler.uses_lobes() {
                self.read_lobes(&mut pixel.lobes)?;
            }
            if self.settings.sampler == Sampler::Visibility {
                pixel.cached = Some(self.read_cache()?);
            }
        }
        self.passes.limit_shadow_rays(most);
        Ok(recorded)
    }

    /// Element `index` of a wave buffer.
    pub(super) fn read<T: bytemuck::Pod>(&self, name: &'static str, index: u32) -> Result<T> {
        let values = self.read_all(name, index as usize + 1)?;
        Ok(values[index as usize])
    }

    pub(super) fn read_all<T: bytemuck::Pod>(
        &self,
        name: &'static str,
        count: usize,
    ) -> Result<Vec<T>> {
        let buffer = self.waves.buffer(name);
        assert!(buffer.is_some(), "the sampler has a buffer {name}");
        buffer.map_or_else(|| Ok(Vec::new()), |buffer| buffer.download(count))
    }

    /// Fills in the lobes on the first call, their last probabilities on every one.
    fn read_lobes(&self, lobes: &mut Vec<RecordedLobe>) -> Result<()> {
        let count = self.read::<u32>("lobe counts", 0)? as usize;
        if count == 0 {
            return Ok(());
        }
        let stride = BLOCK_PIXELS as usize;
        let words: Vec<[u32; 2]> = self.read_all("product lobes", (count - 1) * stride + 1)?;
        let factors = self.visibility_weights(count)?;
        let weight = |lobe: usize| f64::from(half(words[lobe * stride][1] >> 16)) * factors[lobe];
        let total: f64 = (0..count).map(weight).sum();
        let probability = |lobe: usize| if total > 0.0 { weight(lobe) / total } else { 0.0 };
        if lobes.is_empty() {
            lobes.extend((0..count).map(|lobe| RecordedLobe {
                axis: unpack_normal(words[lobe * stride][0]),
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

    /// V of every lobe for the last ray; twin of `weights.glsl`.
    fn visibility_weights(&self, lobe_count: usize) -> Result<Vec<f64>> {
        if self.settings.sampler != Sampler::Visibility {
            return Ok(vec![1.0; lobe_count]);
        }
        let parameters = &self.settings.parameters.lobes;
        let places = parameters.cache_places(self.settings.shadow_rays) as usize;
        let cache: Vec<u32> = self.read_all("visibility caches", 1 + places)?;
        // What the last ray taught is not in force: the top bit tells that weights are out of date.
        let recorded = (cache[0] & 0x7fff_ffff) as usize - (cache[0] >> 31) as usize;
        let stride = BLOCK_PIXELS as usize;
        let words_per_mask = parameters.kept_lobes.div_ceil(32) as usize;
        let length = ((places + 1) * words_per_mask - 1) * stride + 1;
        let masks: Vec<u32> = self.read_all("close lobes", length)?;
        let weight = |lobe: usize| {
            let is_close = |entry: &usize| {
                let word = entry % (places + 1) * words_per_mask + lobe / 32;
                masks[word * stride] >> (lobe % 32) & 1 != 0
            };
            let entries = recorded - recorded.min(places)..recorded;
            let close: Vec<usize> = entries.filter(is_close).collect();
            let is_visible = |entry: &&usize| cache[1 + *entry % places] & 1 != 0;
            let visible = close.iter().filter(is_visible).count() as f64;
            let ratio = (1.0 + visible) / (1.0 + close.len() as f64);
            ratio.powf(f64::from(parameters.exponent))
        };
        Ok((0..lobe_count).map(weight).collect())
    }

    fn read_cache(&self) -> Result<Vec<CachedDirection>> {
        let places =
            self.settings.parameters.lobes.cache_places(self.settings.shadow_rays) as usize;
        let words: Vec<u32> = self.read_all("visibility caches", 1 + places)?;
        // The top bit tells that the weights are to be added up again.
        let recorded = (words[0] & 0x7fff_ffff) as usize;
        let oldest = if recorded > places { recorded % places } else { 0 };
        let in_order = (0..recorded.min(places)).map(|i| words[1 + (oldest + i) % places]);
        // The last bit of an entry tells whether it was visible.
        let entry = |word: u32| CachedDirection {
            direction: unpack_normal(word & !1),
            is_visible: word & 1 != 0,
        };
        Ok(in_order.map(entry).collect())
    }
}

/// The half in the lower 16 bits.
fn half(word: u32) -> f32 {
    half::f16::from_bits(word as u16).to_f32()
}

/// Twin of `unpack_normal` of `glsl/include/frame.glsl`.
fn unpack_normal(word: u32) -> Vec3 {
    let part = |bits: u32| f32::from(bits as u16 as i16) / 32767.0;
    let (x, y) = (part(word), part(word >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let sign = |value: f32| if value < 0.0 { -1.0 } else { 1.0 };
    let folded = Vec3::new((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y), z);
    (if z < 0.0 { folded } else { Vec3::new(x, y, z) }).normalize()
}
