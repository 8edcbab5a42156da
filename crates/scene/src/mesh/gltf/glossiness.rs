//! `KHR_materials_pbrSpecularGlossiness` texel by texel as metallic-roughness.

use glam::Vec3;

use crate::{
    gloss::metallic_roughness,
    texture::{
        TextureUse,
        texelwise::{Converted, Texelwise},
    },
};

/// Colour that is the same everywhere, or an image whose scale holds the factor.
pub(super) type Colour = Result<TextureUse, Vec3>;

/// Converts colours of which at least one is an image; two images lie alike. The alpha of the specular image
/// is a factor of the glossiness.
pub(super) fn convert(diffuse: &Colour, specular: &Colour, glossiness: f32) -> Converted {
    let grid = Texelwise::of(&[diffuse.as_ref().ok(), specular.as_ref().ok()]);
    let texel = |colour: &Colour, index: usize| match colour {
        Ok(used) => grid.texel(used, index),
        Err(colour) => colour.extend(1.0),
    };
    grid.material(|index| {
        let (color, gloss) = (texel(diffuse, index), texel(specular, index));
        let (base, metallic) = metallic_roughness(color.truncate(), gloss.truncate());
        (base.extend(color.w), 1.0 - glossiness * gloss.w, metallic)
    })
}
