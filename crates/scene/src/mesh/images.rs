//! Images of a mesh file.

use glam::Vec4;

use crate::texture::{Channels, Encoding, Texels, Texture, TextureUse};

/// Texels that tell of an image whether it holds normals.
const TEXELS_LOOKED_AT: usize = 4096;

/// Tests whether any texel lets light through.
pub(crate) fn has_alpha(texture: &Texture) -> bool {
    match &texture.texels {
        Texels::Bytes(texels) => texels.iter().any(|texel| texel[3] < u8::MAX),
        Texels::Shorts(texels) => texels.iter().any(|texel| texel[3] < u16::MAX),
        Texels::Halves(texels) => texels.iter().any(|texel| texel[3].to_f32() < 1.0),
    }
}

/// Opacity of a colour image, if any texel lets light through.
pub(super) fn opacity_of(color: &TextureUse) -> Option<TextureUse> {
    let (channels, encoding) = (Channels::Alpha, Encoding::Linear);
    has_alpha(&color.texture).then(|| TextureUse { channels, encoding, ..color.clone() })
}

/// Tests for texels that are vectors of about unit length, along +z on the mean, as those of normal maps.
pub(super) fn holds_normals(texture: &Texture) -> bool {
    let count = texture.width as usize * texture.height as usize;
    let step = count.div_ceil(TEXELS_LOOKED_AT);
    let normals = (0..count).step_by(step).map(|texel| {
        let texel = Vec4::from(texture.linear_texel(Encoding::Linear, texel)).truncate();
        let normal = 2.0 * texel - 1.0;
        normal.extend((normal.length() - 1.0).abs())
    });
    let mean = normals.sum::<Vec4>() / count.div_ceil(step) as f32;
    mean.x.abs().max(mean.y.abs()) < 0.25 && mean.z > 0.5 && mean.w < 0.2
}
