//! Images made texel by texel of others that lie on a surface in the same way.

use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};
use half::f16;
use rayon::prelude::*;

use super::{Channels, Texels, Texture, TextureUse};

/// Images of a metallic-roughness material.
pub(crate) struct Converted {
    pub base_color: TextureUse,
    pub roughness: TextureUse,
    pub metallic: TextureUse,
}

/// Grid of the largest of some images.
pub(crate) struct Texelwise {
    width: u32,
    height: u32,
    /// The first of them, on whose coordinates all lie.
    first: Option<TextureUse>,
}

/// Tests whether two textures lie on a surface in the same way.
pub(crate) fn lie_alike(one: &TextureUse, other: &TextureUse) -> bool {
    (one.uv_set, one.image_from_uv, one.wrap) == (other.uv_set, other.image_from_uv, other.wrap)
}

impl Texelwise {
    /// Grid for images that lie alike.
    pub(crate) fn of(uses: &[Option<&TextureUse>]) -> Self {
        let sizes = uses.iter().flatten().map(|used| (used.texture.width, used.texture.height));
        let larger = |a: (u32, u32), b: (u32, u32)| (a.0.max(b.0), a.1.max(b.1));
        let (width, height) = sizes.reduce(larger).unwrap_or((1, 1));
        Self { width, height, first: uses.iter().flatten().next().copied().cloned() }
    }

    /// Value of an image at a texel of the grid, and its opacity.
    pub(crate) fn texel(&self, used: &TextureUse, index: usize) -> Vec4 {
        if (used.texture.width, used.texture.height) == (self.width, self.height) {
            return used.read(used.texture.linear_texel(used.encoding, index)).into();
        }
        let size = Vec2::new(self.width as f32, self.height as f32);
        let (x, y) = (index % self.width as usize, index / self.width as usize);
        used.value((Vec2::new(x as f32, y as f32) + 0.5) / size)
    }

    fn indices(&self) -> impl IndexedParallelIterator<Item = usize> {
        (0..self.width as usize * self.height as usize).into_par_iter()
    }

    fn image(&self, what: &str, texels: Texels) -> TextureUse {
        let (width, height) = (self.width, self.height);
        let name = self.first.as_ref().map_or("", |first| &first.texture.name);
        let name = format!("{name}, {what}");
        let texture = Arc::new(Texture { name, width, height, texels });
        let place = self.first.clone().unwrap_or_else(|| TextureUse::new(Arc::clone(&texture)));
        place.showing(texture)
    }

    /// Image of the colours that `of` gives for texels.
    pub(crate) fn color(&self, of: impl Fn(usize) -> Vec3 + Sync) -> TextureUse {
        let texel = |index| of(index).extend(1.0).to_array().map(f16::from_f32);
        self.image("with others", Texels::Halves(self.indices().map(texel).collect()))
    }

    /// Images of the base colour with its opacity, the roughness and the share of metal that `of` gives for
    /// texels.
    pub(crate) fn material(&self, of: impl Fn(usize) -> (Vec4, f32, f32) + Sync) -> Converted {
        let byte = |share: f32| (255.0 * share).round() as u8;
        let texel = |index: usize| {
            let (base, roughness, metallic) = of(index);
            let base = base.to_array().map(f16::from_f32);
            (base, [0, byte(roughness), byte(metallic), u8::MAX])
        };
        let (base, packed) = self.indices().map(texel).unzip();
        let packed = self.image("as metallic-roughness", Texels::Bytes(packed));
        Converted {
            base_color: self.image("as metallic-roughness", Texels::Halves(base)),
            roughness: TextureUse { channels: Channels::Green, ..packed.clone() },
            metallic: TextureUse { channels: Channels::Blue, ..packed },
        }
    }
}
