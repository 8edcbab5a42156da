//! Mixtures of two materials: pbrt's `mix`, Mitsuba's `blendbsdf` and `mixturebsdf`. Those of diffuse
//! materials are diffuse, others by one diffuse and one specular colour.

use std::sync::Arc;

use glam::Vec3;

use super::Value;
use crate::{
    MIN_ALPHA,
    coat::{DIELECTRIC, metallic_roughness, normal_reflectance},
    features::Feature,
    material::{Anisotropy, Material, MaterialKind, Principled, Surface},
    math::colour::luminance,
    texture::{
        Channels, TextureUse,
        linear::{Texelwise, lie_alike},
    },
};

/// Mixes two materials, else takes the greater of them; `share`, 0…1, is that of the second. The name is that
/// of either. Returns what is lost, if something is: `lobes` for one lobe in place of two, `lesser` for a
/// material that is left out.
pub(crate) fn mixed(
    [first, second]: [Material; 2],
    share: &Value,
    [lobes, lesser]: [Feature; 2],
) -> (Material, Option<Feature>) {
    let pair = [&first, &second].map(|part| (&part.kind, &part.surface));
    let whole = blend(pair, share).map(|mixture| (mixture, None));
    let found = whole.or_else(|| Some((blend_lobes(pair, share)?, Some(lobes))));
    if let Some(((kind, surface), loss)) = found {
        return (Material { kind, surface, ..first }, loss);
    }
    let share = match share {
        Value::Constant(share) => share.x,
        _ => 0.5,
    };
    let loss = (share > 0.0 && share < 1.0).then_some(lesser);
    (if share <= 0.5 { first } else { second }, loss)
}

/// Mixes two materials; none if the mixture is not one of the renderer's materials.
///
/// Two diffuse ones are diffuse with the mixed reflectance, of which at most one of first, second and
/// share may be an image, or first and second the same one.
fn blend(
    [(first, own), (second, other)]: [(&MaterialKind, &Surface); 2],
    share: &Value,
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
        (Value::Constant(share), None, None) => (a.lerp(*b, share.x), None),
        (Value::Constant(share), Some(image), None) => {
            (Vec3::ONE, Some(image.clone().affine(*a * (1.0 - share), *b * *share)))
        }
        (Value::Constant(share), None, Some(image)) => {
            (Vec3::ONE, Some(image.clone().affine(*b * *share, *a * (1.0 - share))))
        }
        (Value::Constant(share), Some(one), Some(two)) => {
            let (scale, bias) = (Vec3::from(two.scale), Vec3::from(two.bias));
            let same = TextureUse { scale: one.scale, bias: one.bias, ..two.clone() };
            if !Arc::ptr_eq(&one.texture, &two.texture) || same != *one {
                return None;
            }
            let mixed = one.clone().affine(*a * (1.0 - share), *b * *share * bias);
            let scale = Vec3::from(mixed.scale) + *b * *share * scale;
            (Vec3::ONE, Some(TextureUse { scale: scale.to_array(), ..mixed }))
        }
        (Value::Image(share), None, None) => (Vec3::ONE, Some(numbers(share).affine(*b - *a, *a))),
        _ => return None,
    };
    let surface = Surface { color, ..rest(own) };
    Some((MaterialKind::Diffuse { reflectance }, surface))
}

/// Mixes the diffuse and the specular reflection of two materials; none if one lets light through or is
/// measured, or their surfaces differ in opacity.
///
/// The gloss becomes one lobe. Images that lie as the first of them count texel by texel, others by their
/// means.
fn blend_lobes(
    [(first, own), (second, other)]: [(&MaterialKind, &Surface); 2],
    share: &Value,
) -> Option<(MaterialKind, Surface)> {
    // Materials that have lobes at all have them with any textures.
    Lobes::of(first)?;
    Lobes::of(second)?;
    if own.opacity != other.opacity || own.vertex_color || other.vertex_color {
        return None;
    }
    let share_image = share.image();
    let [own_images, other_images] = [own, other]
        .map(|surface| [&surface.color, &surface.roughness, &surface.metallic].map(Option::as_ref));
    let all = || [share_image].into_iter().chain(own_images).chain(other_images);
    let place = all().flatten().next();
    let alike = |used: &&TextureUse| place.is_some_and(|place| lie_alike(place, used));
    let grid = Texelwise::of(&all().map(|used| used.filter(alike)).collect::<Vec<_>>());
    let factor = |used: Option<&TextureUse>| match used {
        None => Value::Constant(Vec3::ONE),
        Some(used) if alike(&used) => Value::Image(used.clone()),
        Some(used) => Value::Constant(used.mean().into()),
    };
    let share = share_image.map_or(share.clone(), |image| factor(Some(image)));
    let [own_factors, other_factors] = [own_images, other_images].map(|images| images.map(factor));
    let lobes = |kind: &MaterialKind, surface: &Surface, factors: &[Value; 3], index: usize| {
        let [color, rough, metal] =
            factors.each_ref().map(|factor| factor.at(&grid, index).truncate());
        let kind = kind.scaled(color, luminance(rough), luminance(metal));
        Lobes::of(&surface.anisotropy.rounded(kind)).unwrap_or_default()
    };
    let mixture = |index: usize| {
        let share = luminance(share.at(&grid, index).truncate()).clamp(0.0, 1.0);
        let one = lobes(first, own, &own_factors, index);
        Lobes::mixed([one, lobes(second, other, &other_factors, index)], share)
    };
    let rest = Surface {
        color: None,
        roughness: None,
        metallic: None,
        anisotropy: Anisotropy::default(),
        normal: own.normal.clone().or(other.normal.clone()),
        two_sided: own.two_sided || other.two_sided,
        ..own.clone()
    };
    if place.is_none() {
        return Some((mixture(0).material(), rest));
    }
    if let (MaterialKind::Diffuse { .. }, MaterialKind::Diffuse { .. }) = (first, second) {
        let color = Some(grid.color(|index| mixture(index).diffuse));
        let kind = MaterialKind::Diffuse { reflectance: Vec3::ONE };
        return Some((kind, Surface { color, ..rest }));
    }
    let images = grid.material(|index| {
        let lobes = mixture(index);
        let (base, metallic) = lobes.base_color(DIELECTRIC);
        (base.extend(1.0), lobes.roughness, metallic)
    });
    let kind = MaterialKind::Principled(Principled::default());
    let (roughness, metallic) = (Some(images.roughness), Some(images.metallic));
    Some((kind, Surface { color: Some(images.base_color), roughness, metallic, ..rest }))
}

/// Reflection of a material as a diffuse and a specular part.
#[derive(Clone, Copy, Debug, Default)]
struct Lobes {
    /// Share of light that is reflected diffusely.
    diffuse: Vec3,
    /// Reflectance of the gloss at normal incidence.
    specular: Vec3,
    /// Roughness √α of the gloss.
    roughness: f32,
}

impl Lobes {
    fn of(kind: &MaterialKind) -> Option<Self> {
        Some(match kind {
            MaterialKind::Diffuse { reflectance } => {
                Self { diffuse: *reflectance, specular: Vec3::ZERO, roughness: 1.0 }
            }
            MaterialKind::Plastic { diffuse, alpha, ior } => {
                let coat = normal_reflectance(*ior);
                let specular = Vec3::splat(coat);
                Self { diffuse: *diffuse * (1.0 - coat), specular, roughness: alpha.sqrt() }
            }
            MaterialKind::Conductor { alpha, fresnel } => {
                let specular = fresnel.at_normal_incidence();
                Self { diffuse: Vec3::ZERO, specular, roughness: alpha.sqrt() }
            }
            MaterialKind::Mirror { reflectance } => {
                let roughness = MIN_ALPHA.sqrt();
                Self { diffuse: Vec3::ZERO, specular: *reflectance, roughness }
            }
            &MaterialKind::Principled(own) => {
                let coat = normal_reflectance(own.ior) * own.specular_color;
                let coat = coat.min(Vec3::ONE) * own.specular;
                let below = (1.0 - own.metallic) * (1.0 - coat.max_element());
                let (diffuse, roughness) = (own.base_color * below, own.roughness);
                Self { diffuse, specular: coat.lerp(own.base_color, own.metallic), roughness }
            }
            MaterialKind::Dielectric { .. }
            | MaterialKind::ThinDielectric { .. }
            | MaterialKind::DiffuseTransmission { .. }
            | MaterialKind::Measured { .. } => return None,
        })
    }

    fn mixed([one, two]: [Self; 2], share: f32) -> Self {
        let weights = [1.0 - share, share];
        let gloss = [luminance(one.specular) * weights[0], luminance(two.specular) * weights[1]];
        let sum = gloss[0] + gloss[1];
        let roughness = (gloss[0] * one.roughness + gloss[1] * two.roughness) / sum;
        Self {
            diffuse: one.diffuse.lerp(two.diffuse, share),
            specular: one.specular.lerp(two.specular, share),
            roughness: if sum > 0.0 { roughness } else { 1.0 },
        }
    }

    /// Base colour and share of metal, for a dielectric that reflects `coat` at normal incidence. Each
    /// channel reflects as much as before.
    fn base_color(&self, coat: f32) -> (Vec3, f32) {
        let below = (1.0 - self.specular.max_element()).max(f32::MIN_POSITIVE);
        let (_, metallic) =
            metallic_roughness((self.diffuse / below).min(Vec3::ONE), self.specular);
        let dielectric = 1.0 - metallic;
        let light = self.diffuse + self.specular - coat * dielectric;
        let base = light / ((1.0 - coat) * dielectric + metallic);
        (base.clamp(Vec3::ZERO, Vec3::ONE), metallic)
    }

    fn material(&self) -> MaterialKind {
        if self.specular == Vec3::ZERO {
            return MaterialKind::Diffuse { reflectance: self.diffuse };
        }
        // A weak gloss is that of a dielectric with a factor.
        let specular = (self.specular.max_element() / DIELECTRIC).min(1.0);
        let (base_color, metallic) = self.base_color(specular * DIELECTRIC);
        MaterialKind::Principled(Principled {
            base_color,
            metallic,
            roughness: self.roughness,
            specular,
            ..Principled::default()
        })
    }
}

/// The one number of an image, as the value of all channels.
pub(crate) fn numbers(image: &TextureUse) -> TextureUse {
    if image.channels != Channels::Color {
        return image.clone();
    }
    let numbers = image.with_texels(|[r, g, b, _]| [luminance(Vec3::new(r, g, b)); 4]);
    TextureUse { channels: Channels::Red, ..numbers }
}
