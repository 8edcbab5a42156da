//! Mixtures of two diffuse materials, which are diffuse too: pbrt's `mix` and Mitsuba's `blendbsdf`.

use std::sync::Arc;

use glam::Vec3;
use half::f16;

use crate::{
    material::{MaterialKind, Surface},
    math::colour::luminance,
    texture::{Channels, Encoding, Texels, Texture, TextureUse},
};

/// Share of the second of two materials.
#[derive(Clone, Debug)]
pub(crate) enum Share {
    /// The same everywhere, 0…1.
    Constant(f32),
    /// By place, one number.
    Image(TextureUse),
}

/// Mixes two materials; none if the mixture is not one of the renderer's materials.
///
/// Two diffuse ones are diffuse with the mixed reflectance, of which at most one of first, second and
/// share may be an image, or first and second the same one.
pub(crate) fn blend(
    [(first, own), (second, other)]: [(&MaterialKind, &Surface); 2],
    share: &Share,
) -> Option<(MaterialKind, Surface)> {
    let (MaterialKind::Diffuse { reflectance: a }, MaterialKind::Diffuse { reflectance: b }) =
        (first, second)
    else {
        return None;
    };
    let rest = |surface: &Surface| Surface { color: None, ..surface.clone() };
    if own.vertex_color || rest(own) != rest(other) {
        return None;
    }
    let (reflectance, color) = match (share, &own.color, &other.color) {
        (Share::Constant(share), None, None) => (a.lerp(*b, *share), None),
        (Share::Constant(share), Some(image), None) => {
            (Vec3::ONE, Some(affine(image, *a * (1.0 - share), *b * *share)))
        }
        (Share::Constant(share), None, Some(image)) => {
            (Vec3::ONE, Some(affine(image, *b * *share, *a * (1.0 - share))))
        }
        (Share::Constant(share), Some(one), Some(two)) => {
            let (scale, bias) = (Vec3::from(two.scale), Vec3::from(two.bias));
            let same = TextureUse { scale: one.scale, bias: one.bias, ..two.clone() };
            if !Arc::ptr_eq(&one.texture, &two.texture) || same != *one {
                return None;
            }
            let mixed = affine(one, *a * (1.0 - share), *b * *share * bias);
            let scale = Vec3::from(mixed.scale) + *b * *share * scale;
            (Vec3::ONE, Some(TextureUse { scale: scale.to_array(), ..mixed }))
        }
        (Share::Image(share), None, None) => {
            (Vec3::ONE, Some(affine(&numbers(share), *b - *a, *a)))
        }
        (Share::Image(_), ..) => return None,
    };
    let surface = Surface { color, ..rest(own) };
    Some((MaterialKind::Diffuse { reflectance }, surface))
}

/// Returns factor · value + shift.
fn affine(image: &TextureUse, factor: Vec3, shift: Vec3) -> TextureUse {
    TextureUse {
        scale: (Vec3::from(image.scale) * factor).to_array(),
        bias: (Vec3::from(image.bias) * factor + shift).to_array(),
        ..image.clone()
    }
}

/// The one number of an image, as the value of all channels.
fn numbers(image: &TextureUse) -> TextureUse {
    if image.channels != Channels::Color {
        return image.clone();
    }
    let texel = |[r, g, b, _]: [f32; 4]| [f16::from_f32(luminance(Vec3::new(r, g, b))); 4];
    let texels = Texels::Halves(image.values().into_iter().map(texel).collect());
    TextureUse {
        texture: Arc::new(Texture { texels, ..Texture::clone(&image.texture) }),
        channels: Channels::Red,
        encoding: Encoding::Linear,
        scale: [1.0; 3],
        bias: [0.0; 3],
        ..image.clone()
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    fn image() -> TextureUse {
        let texels = Texels::Bytes(vec![[255, 0, 0, 255], [0, 255, 0, 255]]);
        let texture = Texture { name: "a.png".to_owned(), width: 2, height: 1, texels };
        TextureUse { encoding: Encoding::Linear, ..TextureUse::new(Arc::new(texture)) }
    }

    /// Reflectance of both texels of a mixture.
    fn mixed(own: Option<TextureUse>, other: Option<TextureUse>, share: &Share) -> [Vec3; 2] {
        let kinds = [Vec3::new(0.8, 0.4, 0.2), Vec3::new(0.1, 0.3, 0.5)]
            .map(|reflectance| MaterialKind::Diffuse { reflectance });
        let [own, other] = [own, other].map(|color| Surface { color, ..Surface::default() });
        let found = blend([(&kinds[0], &own), (&kinds[1], &other)], share).unwrap();
        let MaterialKind::Diffuse { reflectance } = found.0 else { unreachable!("diffuse") };
        let values = found.1.color.map_or(vec![[1.0; 4]; 2], |color| color.values());
        [0, 1].map(|at| reflectance * Vec3::from_slice(&values[at][..3]))
    }

    #[test]
    fn mixtures_are_linear_in_reflectance() {
        let [a, b] = [Vec3::new(0.8, 0.4, 0.2), Vec3::new(0.1, 0.3, 0.5)];
        let quarter = Share::Constant(0.25);
        let texels = [Vec3::X, Vec3::Y];
        for (own, other) in [(false, false), (true, false), (false, true), (true, true)] {
            let used = image();
            let found = mixed(own.then(|| used.clone()), other.then_some(used), &quarter);
            for (texel, found) in texels.iter().zip(found) {
                let first = if own { a * texel } else { a };
                let second = if other { b * texel } else { b };
                assert!(found.abs_diff_eq(first.lerp(second, 0.25), 1e-3), "{found}");
            }
        }
        let found = mixed(None, None, &Share::Image(image()));
        for (texel, found) in texels.iter().zip(found) {
            assert!(found.abs_diff_eq(a.lerp(b, luminance(*texel)), 1e-3), "{found}");
        }
        let mirror = MaterialKind::Mirror { reflectance: Vec3::ONE };
        let plain = Surface::default();
        let diffuse = MaterialKind::Diffuse { reflectance: Vec3::ONE };
        assert!(blend([(&mirror, &plain), (&diffuse, &plain)], &quarter).is_none());
    }
}
