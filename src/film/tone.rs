//! Tone: linear radiance → values that a screen can show; twin of `glsl/include/tone.glsl`.

use super::RgbImage;
use crate::math::colour::{display_from_linear, luminance};

/// Luminance that [`auto_exposure`] gives to the middle of a picture.
const MIDDLE_GREY: f64 = 0.18;
/// Luminance that [`Curve::Reinhard`] maps to white.
const WHITE: f32 = 4.0;

/// Curves that compress radiance to 0…1, before the sRGB transfer function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Curve {
    /// None: values above 1 are clipped.
    #[default]
    Clip,
    /// Luminance by Reinhard et al. 2002, Eq. 4, with white at 4; keeps hues.
    Reinhard,
    /// Each channel by the fit of the ACES film curve (Narkowicz 2015); bright colours fade to white.
    Filmic,
}

impl Curve {
    /// Every curve.
    pub const ALL: [Self; 3] = [Self::Clip, Self::Reinhard, Self::Filmic];
}

/// Exposure and curve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tone {
    /// Exposure in stops: radiance is scaled by 2 to this power.
    pub exposure: f32,
    /// Curve after it.
    pub curve: Curve,
}

impl Tone {
    /// Maps a linear picture to bytes.
    pub(crate) fn shown(&self, picture: &RgbImage) -> Vec<[u8; 3]> {
        picture.pixels.iter().map(|pixel| self.display(*pixel)).collect()
    }

    /// Maps a linear pixel to bytes. NaN becomes 0.
    fn display(&self, pixel: [f32; 3]) -> [u8; 3] {
        let scale = self.exposure.exp2();
        let scaled = pixel.map(|value| value * scale);
        let mapped = match self.curve {
            Curve::Clip => scaled,
            Curve::Reinhard => reinhard(scaled),
            Curve::Filmic => scaled.map(filmic),
        };
        mapped.map(display_from_linear)
    }
}

fn reinhard(pixel: [f32; 3]) -> [f32; 3] {
    // Beyond this all is white, and infinity would give NaN.
    let pixel = pixel.map(|value| value.clamp(-1e6, 1e6));
    let luminance = luminance(pixel.into());
    let scale = (1.0 + luminance / (WHITE * WHITE)) / (1.0 + luminance);
    pixel.map(|value| value * scale)
}

fn filmic(value: f32) -> f32 {
    let value = value.clamp(0.0, 1e6);
    value * (2.51 * value + 0.03) / (value * (2.43 * value + 0.59) + 0.14)
}

/// Returns the exposure, in stops, that makes the geometric mean of the luminance middle grey (0.18),
/// as in Reinhard et al. 2002. Pixels without light do not count; 0 where none has any.
pub(crate) fn auto_exposure(pixels: &[[f32; 3]]) -> f32 {
    let logarithms = pixels
        .iter()
        .map(|pixel| f64::from(luminance((*pixel).into())))
        .filter(|luminance| luminance.is_finite() && *luminance > 0.0)
        .map(f64::log2);
    let (sum, count) = logarithms.fold((0.0, 0_u64), |(sum, count), log| (sum + log, count + 1));
    if count == 0 { 0.0 } else { (MIDDLE_GREY.log2() - sum / count as f64) as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_rise_from_black_to_white_and_take_any_value() {
        for curve in Curve::ALL {
            let tone = Tone { exposure: 0.0, curve };
            let shown = |value: f32| tone.display([value; 3])[0];
            let steps: Vec<u8> = (0..400).map(|step| shown(step as f32 * 0.05)).collect();
            assert!(steps.is_sorted(), "{curve:?}");
            assert_eq!((steps[0], steps[399]), (0, 255), "{curve:?}");
            assert_eq!(
                (shown(f32::INFINITY), shown(f32::NAN), shown(-1.0)),
                (255, 0, 0),
                "{curve:?}"
            );
        }
        // Worked out by hand: 0.18 → 0.18 · (1 + 0.18/16) / 1.18 = 0.15426 → sRGB 0.4292.
        let tone = Tone { exposure: 0.0, curve: Curve::Reinhard };
        assert_eq!(tone.display([0.18; 3]), [109; 3]);
        // 0.18 → 0.18 · 0.4818 / (0.18 · 1.0274 + 0.14) = 0.26692 → sRGB 0.5534.
        let tone = Tone { exposure: -1.0, curve: Curve::Filmic };
        assert_eq!(tone.display([0.36; 3]), [141; 3]);
    }

    #[test]
    fn auto_exposure_makes_the_middle_grey() {
        let bad = [[0.0; 3], [f32::NAN; 3], [f32::INFINITY; 3]];
        let pixels = [&[[0.045; 3], [0.09; 3], [0.18; 3]][..], &bad].concat();
        assert!((auto_exposure(&pixels) - 1.0).abs() < 1e-5);
        // A sun of a pixel in a hundred does not darken the room.
        let mut room = vec![[0.18; 3]; 99];
        room.push([1e5; 3]);
        assert!(auto_exposure(&room).abs() < 0.2);
        assert_eq!(auto_exposure(&[[0.0; 3]]), 0.0);
    }
}
