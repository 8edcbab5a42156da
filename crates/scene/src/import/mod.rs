//! Shared by the readers of other formats: the scene that they return, media and illuminants by name,
//! mixtures of materials, bump maps, and the gamut of reflectances.

pub(crate) mod blend;
pub(crate) mod media;
pub(crate) mod relief;

use std::path::PathBuf;

use glam::{DVec3, Vec3, Vec4};

use crate::{
    Asked, EnvironmentMap, FilmSettings, Geometry, Lamp, MIN_ALPHA,
    features::{Feature, Ignored},
    file::CameraEntry,
    material::{Anisotropy, Distribution, Material, MaterialKind},
    texture::{
        TextureUse,
        linear::{Texelwise, lie_alike},
    },
};

/// Everything that a file of another format says.
#[derive(Debug)]
pub(crate) struct Imported {
    /// Viewer, before its numbers are checked; none if the file has none.
    pub camera: Option<CameraEntry>,
    pub film: FilmSettings,
    /// Settings of the render.
    pub asked: Asked,
    /// Light from everywhere, black if the file has none; `None` for a format without.
    pub environment: Option<EnvironmentMap>,
    pub lamps: Vec<Lamp>,
    pub materials: Vec<Material>,
    pub geometry: Geometry,
    pub variants: Vec<String>,
    /// Files that were read, the file itself first.
    pub inputs: Vec<PathBuf>,
    /// Repairs, and one warning for each kind of thing that is left out.
    pub warnings: Vec<String>,
}

/// Heights of its picture from which an orthographic camera is seen, where rays are all but parallel.
pub(crate) const FAR: f64 = 100.0;

/// Refractive indices of solids.
pub(crate) const SOLID_IOR: (f32, f32) = (0.1, 10.0);

/// Width of the microfacet distribution, constant or by place.
pub(crate) struct Width {
    pub alpha: f32,
    /// Factor of √α, for which `alpha` is then 1.
    pub texture: Option<TextureUse>,
    /// Stretch of the width, of which `alpha` is then the smaller.
    pub anisotropy: Anisotropy,
    pub distribution: Distribution,
}

impl Width {
    pub(crate) fn round(alpha: f32, texture: Option<TextureUse>) -> Self {
        let (anisotropy, distribution) = (Anisotropy::default(), Distribution::default());
        Self { alpha, texture, anisotropy, distribution }
    }

    /// Width of two along u and v.
    pub(crate) fn of_pair(widths: [f32; 2]) -> Self {
        let (alpha, anisotropy) = Anisotropy::of_widths(widths);
        Self { anisotropy, ..Self::round(alpha, None) }
    }

    /// Width of a roughness √α that the parameter `anisotropic` of \[Burley 2012\], 0…1, stretches.
    pub(crate) fn stretched(roughness: f32, anisotropic: f32) -> Self {
        let aspect = (1.0 - 0.9 * anisotropic).sqrt();
        let alpha = roughness * roughness;
        Self::of_pair([alpha / aspect, alpha * aspect].map(|width| width.clamp(MIN_ALPHA, 1.0)))
    }

    /// Mean of all directions, for a model without anisotropy; `ignore` counts the loss.
    pub(crate) fn rounded(mut self, ignore: impl FnOnce()) -> Self {
        if self.anisotropy.strength > 0.0 {
            ignore();
            self.alpha = self.anisotropy.mean_width(self.alpha);
            self.anisotropy = Anisotropy::default();
        }
        self
    }

    /// √α, by the mean of an image.
    pub(crate) fn mean_roughness(&self) -> f32 {
        self.texture.as_ref().map_or(self.alpha.sqrt(), |texture| texture.mean()[0])
    }
}

/// Value over a surface.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    /// The same everywhere; all three are equal for a number.
    Constant(Vec3),
    Image(TextureUse),
    /// Colours of the vertices, times a factor.
    Vertices(Vec3),
}

impl Value {
    pub(crate) fn number(number: f64) -> Self {
        Self::Constant(Vec3::splat(number as f32))
    }

    /// Returns factor · value + shift.
    pub(crate) fn affine(self, factor: Vec3, shift: Vec3) -> Self {
        match self {
            Self::Constant(value) => Self::Constant(value * factor + shift),
            Self::Image(image) => Self::Image(image.affine(factor, shift)),
            Self::Vertices(value) => Self::Vertices(value * factor + shift),
        }
    }

    pub(crate) fn scaled(self, factor: f32) -> Self {
        self.affine(Vec3::splat(factor), Vec3::ZERO)
    }

    pub(crate) fn image(&self) -> Option<&TextureUse> {
        match self {
            Self::Image(image) => Some(image),
            _ => None,
        }
    }

    /// Factor for the model and texture for the surface.
    pub(crate) fn split(self) -> (Vec3, Option<TextureUse>) {
        match self {
            Self::Constant(value) | Self::Vertices(value) => (value, None),
            Self::Image(image) => (Vec3::ONE, Some(image)),
        }
    }

    /// Value of which every colour is `of` the former one; colours of vertices take it of the factor.
    pub(crate) fn mapped(self, of: impl Fn(f32) -> f32 + Sync) -> Self {
        match self {
            Self::Constant(value) => Self::Constant(value.map(of)),
            Self::Image(image) => Self::Image(image.mapped(of)),
            Self::Vertices(value) => Self::Vertices(value.map(of)),
        }
    }

    /// Image, or 1 without one, times a factor.
    pub(crate) fn of(image: Option<TextureUse>, factor: Vec3) -> Self {
        image.map_or(Self::Constant(Vec3::ONE), Self::Image).affine(factor, Vec3::ZERO)
    }

    /// Value and opacity at a texel of a grid that the image, if it is one, lies on.
    pub(crate) fn at(&self, grid: &Texelwise, index: usize) -> Vec4 {
        match self {
            Self::Constant(value) | Self::Vertices(value) => value.extend(1.0),
            Self::Image(image) => grid.texel(image, index),
        }
    }

    /// Makes a value of others by `of`, texel by texel where any is an image. Images that do not lie as the
    /// first of them count by their means, of which the second part tells.
    pub(crate) fn combined<const N: usize>(
        values: [Self; N],
        of: impl Fn([Vec3; N]) -> Vec3 + Sync,
    ) -> (Self, bool) {
        let place = values.iter().find_map(Self::image).cloned();
        let mut any_mean = false;
        let values = values.map(|value| match value {
            Self::Image(image) if place.as_ref().is_some_and(|place| !lie_alike(place, &image)) => {
                any_mean = true;
                Self::Constant(image.mean().into())
            }
            value => value,
        });
        let grid = Texelwise::of(&values.each_ref().map(Self::image));
        let value = |index| of(values.each_ref().map(|value| value.at(&grid, index).truncate()));
        let combined = match place {
            Some(_) => Self::Image(grid.color(value)),
            None => Self::Constant(value(0)),
        };
        (combined, any_mean)
    }

    /// Mean, which is that of the factor for colours of vertices.
    pub(crate) fn mean(&self) -> Vec3 {
        match self {
            Self::Constant(value) | Self::Vertices(value) => *value,
            Self::Image(image) => image.mean().into(),
        }
    }
}

/// Sheet that scatters light to both sides: its kind, and the texture of all that it scatters, which both
/// sides share by their means. The last part tells whether that loses anything.
pub(crate) fn sheet(sides: [Value; 2]) -> (MaterialKind, Option<TextureUse>, bool) {
    let [reflectance, transmittance] = sides.each_ref().map(Value::mean);
    let (all, any_mean) =
        Value::combined(sides.clone(), |[reflected, transmitted]| reflected + transmitted);
    let Value::Image(all) = all else {
        let [reflectance, transmittance] =
            [reflectance, transmittance].map(|side| side.clamp(Vec3::ZERO, Vec3::ONE));
        return (MaterialKind::DiffuseTransmission { reflectance, transmittance }, None, false);
    };
    let (unlike, _) = Value::combined(sides, |[reflected, transmitted]| {
        (reflected * transmittance - transmitted * reflectance).abs()
    });
    let is_unlike = |image: &TextureUse| {
        image.values().iter().any(|value| Vec3::from_slice(value).max_element() > SAME_SIDES)
    };
    let whole = (reflectance + transmittance).max(Vec3::splat(f32::MIN_POSITIVE));
    let kind = MaterialKind::DiffuseTransmission {
        reflectance: reflectance / whole,
        transmittance: transmittance / whole,
    };
    (kind, Some(all), any_mean || unlike.image().is_some_and(is_unlike))
}

/// Largest difference of two sides, each weighed by the mean of the other, that is rounding.
const SAME_SIDES: f32 = 0.01;

/// Largest change of a channel that is no loss of colour.
const ROUNDING: f64 = 1e-3;

/// Clips the colour of a reflectance spectrum to Rec.709, which saturated spectra lie outside, and counts
/// that as `feature`.
pub(crate) fn clipped(
    color: DVec3,
    feature: Feature,
    ignored: &mut Ignored,
    place: impl FnOnce() -> String,
) -> DVec3 {
    let clipped = color.clamp(DVec3::ZERO, DVec3::ONE);
    if (clipped - color).abs().max_element() > ROUNDING {
        ignored.add(feature, place);
    }
    clipped
}
