//! Denoised pictures. They are biased: marked as such, and never a part of a merge or a reference.

use std::path::Path;

use super::{Attribute, Image, cryptomatte};
use crate::error::{Error, Result};

/// Attribute of an image that a denoiser has made, with its name.
pub(crate) const DENOISED: &str = "fenestra.denoised";

/// Layers of an image that a denoiser needs: the noise that it expects, and surfaces that guide it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Guides {
    /// `Unfiltered`: the picture of pixels that share no sample. A denoiser keeps noise that they share.
    pub unfiltered: Option<Vec<[f32; 3]>>,
    /// `Albedo`.
    pub albedo: Option<Vec<[f32; 3]>>,
    /// `N`, only beside albedo.
    pub normal: Option<Vec<[f32; 3]>>,
}

impl Guides {
    /// Takes the layers that `image` has.
    pub(crate) fn of(image: &Image) -> Self {
        let unfiltered = image.triple(["Unfiltered.R", "Unfiltered.G", "Unfiltered.B"]);
        let albedo = image.triple(["Albedo.R", "Albedo.G", "Albedo.B"]);
        let normal = albedo.as_ref().and_then(|_| image.triple(["N.X", "N.Y", "N.Z"]));
        Self { unfiltered, albedo, normal }
    }

    /// Names of the layers: "Albedo, N".
    pub(crate) fn names(&self) -> String {
        let names = [("Albedo", self.albedo.is_some()), ("N", self.normal.is_some())];
        let present: Vec<&str> = names.iter().filter(|name| name.1).map(|name| name.0).collect();
        present.join(", ")
    }
}

/// Gives pixels that are not finite the mean of their finite neighbours, and black where there is none.
/// Returns how many they were.
pub(crate) fn repair(pixels: &mut [[f32; 3]], width: u32) -> usize {
    let width = width as usize;
    let is_finite = |pixel: &[f32; 3]| pixel.iter().all(|value| value.is_finite());
    let bad: Vec<usize> = (0..pixels.len()).filter(|index| !is_finite(&pixels[*index])).collect();
    let mean = |index: &usize| {
        let (row, column) = (index / width, index % width);
        let rows = row.saturating_sub(1)..(row + 2).min(pixels.len() / width);
        let near = rows.flat_map(|row| {
            (column.saturating_sub(1)..(column + 2).min(width)).map(move |at| row * width + at)
        });
        let good: Vec<[f32; 3]> = near.map(|at| pixels[at]).filter(is_finite).collect();
        let share = 1.0 / good.len().max(1) as f32;
        good.iter().fold([0.0; 3], |sum, pixel| {
            std::array::from_fn(|channel| sum[channel] + share * pixel[channel])
        })
    };
    let means: Vec<[f32; 3]> = bad.iter().map(mean).collect();
    for (index, mean) in bad.iter().zip(means) {
        pixels[*index] = mean;
    }
    bad.len()
}

/// Makes the image of a denoised picture: the window and the attributes of `film`, and the mark. Panics if
/// `pixels` are not as many as those of `film`.
pub(crate) fn image_of(film: &Image, pixels: &[[f32; 3]], denoiser: String) -> Image {
    let mut image = Image {
        channels: std::collections::BTreeMap::new(),
        attributes: cryptomatte::without(&film.attributes),
        ..*film
    };
    image.insert_triple(["R", "G", "B"], pixels);
    image.attributes.insert(DENOISED.to_owned(), Attribute::Text(denoiser));
    image
}

/// Refuses a denoised image where the samples of a film are meant. Fails with [`Error::Format`], which names
/// the denoiser.
pub(crate) fn check_film(image: &Image, path: &Path) -> Result<()> {
    let name = match image.attributes.get(DENOISED) {
        None => return Ok(()),
        Some(Attribute::Text(name)) => name.as_str(),
        Some(_) => "a denoiser",
    };
    let message = format!(
        "made by {name}, and so biased: no film to merge, to refer to or to denoise; take the image that it \
         was made of"
    );
    Err(Error::format(path, message))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_are_not_finite_take_the_mean_of_their_neighbours() {
        let mut pixels =
            [1.0, 2.0, 3.0, 4.0, f32::NAN, 6.0, 7.0, 8.0, 18.0].map(|value| [value; 3]);
        assert_eq!(repair(&mut pixels, 3), 1);
        assert!((pixels[4][1] - 49.0 / 8.0).abs() < 1e-5, "{pixels:?}");
        let mut corners = [[f32::INFINITY; 3], [2.0; 3], [4.0; 3], [f32::NAN; 3]];
        assert_eq!(
            (repair(&mut corners, 2), corners),
            (2, [[3.0; 3], [2.0; 3], [4.0; 3], [3.0; 3]])
        );
        assert_eq!((repair(&mut [[f32::NAN; 3]; 4], 2)), 4);
    }

    /// Its channels have no Cryptomatte, so neither have its attributes.
    #[test]
    fn denoised_pictures_are_marked_and_describe_no_layers() {
        let mut film = Image::new(1, 1);
        for name in [&format!("{}0a1b2c3/name", cryptomatte::PREFIX), "fenestra.scene"] {
            film.attributes.insert(name.to_owned(), Attribute::Text("room".into()));
        }
        let image = image_of(&film, &[[1.0; 3]], "filter".into());
        let names: Vec<&str> = image.attributes.keys().map(String::as_str).collect();
        assert_eq!(names, [DENOISED, "fenestra.scene"]);
        assert!(check_film(&image, Path::new("a.exr")).is_err());
        assert!(check_film(&film, Path::new("a.exr")).is_ok());
    }
}
