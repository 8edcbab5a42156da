//! Textures of a scene → the texels and uses that the shaders read.

use std::{collections::HashMap, ops::Range, sync::Arc};

use crate::{
    error::{Error, Result},
    shader::{
        constants::{
            NO_TEXTURE, TEXTURE_BYTES, TEXTURE_CHANNEL_SHIFT, TEXTURE_HALVES, TEXTURE_NEAREST,
            TEXTURE_SECOND_UVS, TEXTURE_SHORTS, TEXTURE_SRGB, TEXTURE_WRAP_U_SHIFT,
            TEXTURE_WRAP_V_SHIFT,
        },
        structs,
    },
    texture::{Encoding, Interpolation, Texels, Texture, TextureUse},
};

/// Most pages (buffers) of texels, bindings `TEXTURE_WORDS_0` to `_3`; of triangle attributes too.
pub(crate) const MAX_PAGES: usize = 4;

/// Most words of a page, whatever the device allows.
pub(crate) const MAX_PAGE_WORDS: u64 = 1 << 27;

/// Base-2 logarithm of the words of a page on a device with texel buffers of `device_words`.
pub fn page_shift(device_words: u64) -> u32 {
    device_words.clamp(1, MAX_PAGE_WORDS).ilog2()
}

/// Uses of textures, and the images behind them, each once. Word `w` of their texels lies in page `w >>
/// shift`; a texture may lie in two.
#[derive(Clone, Debug, Default)]
pub struct TextureTables {
    /// Uses in the order of [`TextureTables::add`].
    pub uses: Vec<structs::TextureUse>,
    images: Vec<(u64, Arc<Texture>)>,
    places: HashMap<*const Texture, u64>,
    /// Words of all texels.
    pub word_count: u64,
}

impl TextureTables {
    /// Adds a use; returns its index, or `NO_TEXTURE` for none.
    pub fn add(&mut self, texture: Option<&TextureUse>) -> u32 {
        let Some(used) = texture else { return NO_TEXTURE };
        let first_word = *self.places.entry(Arc::as_ptr(&used.texture)).or_insert_with(|| {
            let first_word = self.word_count;
            self.images.push((first_word, Arc::clone(&used.texture)));
            self.word_count += words_of(&used.texture);
            first_word
        });
        let [image_u, image_v] = used.image_from_uv;
        self.uses.push(structs::TextureUse {
            // Too many words are refused before a shader sees this.
            first_word: u32::try_from(first_word).unwrap_or(u32::MAX),
            width: used.texture.width,
            height: used.texture.height,
            flags: flags(used),
            image_u,
            image_v,
            scale: used.scale,
            bias: used.bias,
        });
        self.uses.len() as u32 - 1
    }

    /// Checks that the texels fit into [`MAX_PAGES`] pages.
    ///
    /// # Errors
    /// [`Error::Usage`] with the sizes and the largest image.
    pub fn check(&self, page_shift: u32) -> Result<()> {
        let limit = (MAX_PAGES as u64) << page_shift;
        let largest = self.images.iter().max_by_key(|(_, image)| words_of(image));
        if let Some((_, largest)) = largest
            && self.word_count > limit
        {
            let mebibytes = |words: u64| words.div_ceil(1 << 18);
            return Err(Error::Usage {
                message: format!(
                    "textures: {} images need {} MiB, but this device's buffers hold {} MiB; the \
                     largest is {} ({}×{}, {} MiB): use smaller images or another device (--device)",
                    self.images.len(),
                    mebibytes(self.word_count),
                    limit >> 18,
                    largest.name,
                    largest.width,
                    largest.height,
                    mebibytes(words_of(largest)),
                ),
            });
        }
        Ok(())
    }

    /// Makes the words of `range`, such as a page.
    pub fn words(&self, range: Range<u64>) -> Vec<u32> {
        let range = range.start..range.end.min(self.word_count);
        let mut words = Vec::with_capacity(range.end.saturating_sub(range.start) as usize);
        for (first, image) in &self.images {
            let from = range.start.clamp(*first, first + words_of(image)) - first;
            let to = range.end.clamp(*first, first + words_of(image)) - first;
            let (from, to) = (from as usize, to as usize);
            if from < to {
                match &image.texels {
                    Texels::Bytes(texels) => {
                        words.extend(
                            texels[from..to].iter().map(|texel| u32::from_le_bytes(*texel)),
                        );
                    }
                    Texels::Shorts(texels) => extend_by_pairs(&mut words, texels, from..to),
                    Texels::Halves(texels) => {
                        let texels: &[[u16; 4]] = bytemuck::cast_slice(texels);
                        extend_by_pairs(&mut words, texels, from..to);
                    }
                }
            }
        }
        words
    }
}

fn extend_by_pairs(words: &mut Vec<u32>, texels: &[[u16; 4]], range: Range<usize>) {
    words.extend(range.map(|word| {
        let texel = texels[word / 2];
        let first = 2 * (word % 2);
        u32::from(texel[first]) | u32::from(texel[first + 1]) << 16
    }));
}

fn words_of(image: &Texture) -> u64 {
    match &image.texels {
        Texels::Bytes(texels) => texels.len() as u64,
        Texels::Shorts(texels) => 2 * texels.len() as u64,
        Texels::Halves(texels) => 2 * texels.len() as u64,
    }
}

fn flags(used: &TextureUse) -> u32 {
    let format = match &used.texture.texels {
        Texels::Bytes(_) => TEXTURE_BYTES,
        Texels::Shorts(_) => TEXTURE_SHORTS,
        Texels::Halves(_) => TEXTURE_HALVES,
    };
    let is_srgb = used.encoding == Encoding::Srgb && format != TEXTURE_HALVES;
    let is_nearest = used.interpolation == Interpolation::Nearest;
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    format
        | flag(is_srgb, TEXTURE_SRGB)
        | flag(is_nearest, TEXTURE_NEAREST)
        | flag(used.uv_set == 1, TEXTURE_SECOND_UVS)
        | (used.wrap[0] as u32) << TEXTURE_WRAP_U_SHIFT
        | (used.wrap[1] as u32) << TEXTURE_WRAP_V_SHIFT
        | (used.channels as u32) << TEXTURE_CHANNEL_SHIFT
}
