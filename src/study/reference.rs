//! The reference of a scene: two independent halves r₁ and r₂, rendered or read.
//!
//! Errors are estimated by (x − r₁)(x − r₂), which is free of the reference's own noise on average.
//! The reference's own error, that of the mean of the halves, is ¼·mean (r₁ − r₂)², and a sampler
//! whose error is not well above it is not judged ([`is_judged`]).

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{
    folder::Folder,
    metrics::{Errors, Metrics, not_finite, parts::PartErrors},
    plan::{JUDGED_FROM, ReferencePlan},
    statistics::{mean_standard_error, percentile},
};
use crate::{
    error::{Error, Result},
    files,
    film::{Attribute, Image, Metadata, RgbImage, denoised::check_film},
    scene::Scene,
};

pub(crate) const HALF_STEMS: [&str; 2] = ["reference_1", "reference_2"];
/// Seeds of the halves; those of runs count up from 1.
pub const SEEDS: [u32; 2] = [u32::MAX - 1, u32::MAX];

/// A reference with its own errors.
#[derive(Clone, Debug)]
pub(crate) struct Reference {
    pub first: RgbImage,
    /// Second half; the first again if there is only one image.
    pub second: RgbImage,
    pub sampler: Option<String>,
    pub own: OwnErrors,
}

/// Describes a reference for the records of runs, so that different ones can be told apart.
pub(crate) fn identity(plan: &ReferencePlan, scene: &str) -> Result<String> {
    match plan {
        ReferencePlan::Render { contender, half_spp } => {
            let mut name = contender.sampler.name().to_owned();
            for (key, value) in contender.describe_parameters() {
                name += &format!(" {key}={value}");
            }
            Ok(format!("{name}, 2 x {half_spp} spp"))
        }
        ReferencePlan::Files(_) | ReferencePlan::Study(_) => {
            let mut hasher = Sha256::new();
            for path in given_files(plan, scene)? {
                let bytes = files::read(&path)?;
                hasher.update((bytes.len() as u64).to_le_bytes());
                hasher.update(bytes);
            }
            Ok(format!("given images {}", files::hexadecimal(&hasher.finalize()[..6])))
        }
    }
}

/// Lists the files of a reference that is not rendered here.
fn given_files(plan: &ReferencePlan, scene: &str) -> Result<Vec<PathBuf>> {
    match plan {
        ReferencePlan::Render { .. } => Ok(Vec::new()),
        ReferencePlan::Files(files) => Ok(files.clone()),
        ReferencePlan::Study(folder) => {
            let folder = Folder::existing(folder)?;
            Ok(HALF_STEMS.map(|stem| folder.image(scene, stem)).to_vec())
        }
    }
}

/// Reads an image and checks that it shows the scene.
pub(super) fn read_checked(path: &Path, scene: &Scene) -> Result<Image> {
    let image = Image::read_exr(path)?;
    check_film(&image, path)?;
    check(&image, path, scene)?;
    Ok(image)
}

/// Reads the images of a reference and checks that they show the scene.
pub(super) fn read_images(paths: Vec<PathBuf>, scene: &Scene) -> Result<Vec<(PathBuf, Image)>> {
    let read = |path: PathBuf| read_checked(&path, scene).map(|image| (path, image));
    paths.into_iter().map(read).collect()
}

pub fn mean(first: &RgbImage, second: &RgbImage) -> RgbImage {
    let mean = |(a, b): (&[f32; 3], &[f32; 3])| {
        std::array::from_fn(|channel| 0.5 * (a[channel] + b[channel]))
    };
    let pixels = first.pixels.iter().zip(&second.pixels).map(mean).collect();
    RgbImage { width: first.width, height: first.height, pixels }
}

/// Exposure in stops at which 85% of the pixels stay below white, by their brightest channel.
pub(crate) fn exposure(picture: &RgbImage) -> f32 {
    let brightest = |pixel: &[f32; 3]| f64::from(pixel[0].max(pixel[1]).max(pixel[2]));
    let white = percentile(picture.pixels.iter().map(brightest).collect(), 85);
    white.filter(|white| *white > 0.0).map_or(0.0, |white| -(white as f32).log2())
}

impl Reference {
    /// Reads given images: one, or two independent halves. Fails for another size or scene, values that are
    /// not finite, a black picture, and halves that share samples.
    pub(crate) fn read(plan: &ReferencePlan, scene: &Scene) -> Result<Self> {
        let images = read_images(given_files(plan, &scene.name)?, scene)?;
        if let [(first_path, first), (second_path, second)] = &images[..] {
            let metadata = (Metadata::load(first, first_path), Metadata::load(second, second_path));
            if let (Ok(ours), Ok(theirs)) = metadata
                && let Some(range) = ours
                    .sample_ranges
                    .iter()
                    .find(|range| theirs.sample_ranges.iter().any(|other| range.overlaps(other)))
            {
                return Err(Error::comparison(format!(
                    "{} and {} share samples ({range}); a reference's halves must be \
                     independent: render them with different seeds",
                    first_path.display(),
                    second_path.display()
                )));
            }
        }
        let names: Vec<String> =
            images.iter().map(|(path, _)| path.display().to_string()).collect();
        Self::of(&images, format!("read from {}", names.join(" and ")), scene)
    }

    /// Takes one image or two halves, with the errors that they have themselves. Fails without a picture, or
    /// for a black one.
    pub(super) fn of(
        images: &[(PathBuf, Image)],
        description: String,
        scene: &Scene,
    ) -> Result<Self> {
        let rgb = |index: usize| {
            let (path, image) = &images[index];
            image.rgb(path)
        };
        let last = images.len() - 1;
        let (first, second) = (rgb(0)?, rgb(last)?);
        let average = |picture: &RgbImage| {
            let sum: f64 = picture.pixels.iter().flatten().map(|value| f64::from(*value)).sum();
            sum / (3.0 * picture.pixels.len() as f64)
        };
        let mean = 0.5 * (average(&first) + average(&second));
        if mean <= 0.0 {
            return Err(Error::comparison(format!(
                "the reference {} is black: no error can be put in relation to it",
                images[0].0.display()
            )));
        }
        let metadata: Vec<Metadata> =
            images.iter().filter_map(|(path, image)| Metadata::load(image, path).ok()).collect();
        let whole = metadata.len() == images.len();
        let mut own = OwnErrors {
            description,
            spp: whole.then(|| metadata.iter().map(Metadata::sample_count).sum()),
            seconds: whole.then(|| metadata.iter().map(|metadata| metadata.seconds).sum()),
            mean,
            ..OwnErrors::default()
        };
        let variances: Option<Vec<Vec<[f32; 3]>>> = images
            .iter()
            .map(|(_, image)| image.triple(["Variance.R", "Variance.G", "Variance.B"]))
            .collect();
        if let Some(variances) = &variances {
            let error = |variances: &Vec<[f32; 3]>| {
                mean_standard_error(
                    variances.iter().map(|v| v.map(|value| f64::from(value).max(0.0).sqrt())),
                    scene.film.filter,
                )
            };
            let errors: Vec<f64> = variances.iter().map(error).collect();
            let squares: f64 = errors.iter().map(|error| error * error).sum();
            own.mean_standard_error = Some(squares.sqrt() / errors.len() as f64);
        }
        if last > 0 {
            let halves = Metrics::of_halves(&first, &second, &second)?;
            own.mse = Some(0.25 * halves.errors.mse);
            own.relmse = Some(0.25 * halves.errors.relmse);
            own.relmse_trimmed = Some(0.25 * halves.errors.relmse_trimmed);
        } else if let Some(variances) = &variances {
            let sum: f64 = variances[0].iter().flatten().map(|value| f64::from(*value)).sum();
            own.mse = Some(sum / (3.0 * variances[0].len() as f64));
        }
        let sampler = metadata.first().map(|metadata| metadata.sampler.clone());
        Ok(Self { first, second, sampler: sampler.filter(|_| whole), own })
    }

    pub(crate) fn mean(&self) -> RgbImage {
        mean(&self.first, &self.second)
    }
}

/// Refuses a picture of another size or scene or with values that are not finite.
fn check(image: &Image, path: &Path, scene: &Scene) -> Result<()> {
    let refuse = |message: String| Err(Error::comparison(message));
    let (width, height) = (scene.film.width, scene.film.height);
    if (image.width, image.height) != (width, height) || image.origin != [0, 0] {
        let size = format!("{}x{}", image.width, image.height);
        let [x, y] = image.origin;
        return refuse(format!(
            "the reference {} shows {size} pixels at {x},{y}; the film of {} has {width}x{height}: give \
             --size {size} or another reference",
            path.display(),
            scene.name
        ));
    }
    match image.attributes.get("fenestra.scene_hash") {
        Some(Attribute::Text(hash)) if *hash != scene.hash => {
            return refuse(format!(
                "the reference {} shows another scene than {} (hashes {hash} and {})",
                path.display(),
                scene.path.display(),
                scene.hash
            ));
        }
        Some(_) => {}
        None => log::warn!(
            "{} does not say which scene it shows; taken as {}",
            path.display(),
            scene.name
        ),
    }
    match not_finite(&image.rgb(path)?) {
        None => Ok(()),
        Some((count, first)) => refuse(format!(
            "the reference {} has {count} pixels that are not finite, {first}",
            path.display()
        )),
    }
}

/// A reference's own errors, as far as they are known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OwnErrors {
    /// Origin of the reference.
    pub description: String,
    /// Samples per pixel of both halves, if known.
    pub spp: Option<u64>,
    /// Wall time of the passes of both halves, seconds, if known.
    pub seconds: Option<f64>,
    /// Mean squared error of the mean of the halves; absent for one image without variances.
    pub mse: Option<f64>,
    /// Mean relative squared error of the same.
    pub relmse: Option<f64>,
    /// The same without the worst 0.1% of the pixels.
    pub relmse_trimmed: Option<f64>,
    /// Mean over pixels and channels.
    pub mean: f64,
    /// Standard error of that mean, an upper estimate; absent if the files have no variances.
    pub mean_standard_error: Option<f64>,
}

impl OwnErrors {
    /// Tests whether both relative errors stand out of the reference's own.
    pub(crate) fn judges_relative(&self, errors: &Errors) -> bool {
        is_judged(errors.relmse, self.relmse)
            && is_judged(errors.relmse_trimmed, self.relmse_trimmed)
    }
}

/// A reference's own errors over lit surfaces and over the environment seen directly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OwnParts {
    /// Share of the pixels that see surfaces alone.
    pub surface_share: f64,
    /// Over those pixels.
    pub surfaces: Option<PartErrors>,
    /// Over the others.
    pub environment: Option<PartErrors>,
}

impl OwnParts {
    /// Tests whether errors over the surfaces stand out of the reference's own.
    pub(crate) fn judges(&self, part: &PartErrors) -> bool {
        is_judged(part.relmse, self.surfaces.map(|own| own.relmse))
            && is_judged(part.relmse_trimmed, self.surfaces.map(|own| own.relmse_trimmed))
    }
}

/// Tests whether an error is well above the reference's own, or positive if that is unknown.
pub(crate) fn is_judged(error: f64, own: Option<f64>) -> bool {
    error > 0.0 && own.is_none_or(|own| error >= JUDGED_FROM * own)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn most_pixels_are_below_white() {
        let pixels: Vec<[f32; 3]> = (1..=100u8).map(|value| [f32::from(value), 0.0, 1.0]).collect();
        let picture = RgbImage { width: 10, height: 10, pixels };
        assert!((exposure(&picture) + 85.0_f32.log2()).abs() < 1e-6);
        let black = RgbImage { width: 1, height: 1, pixels: vec![[0.0; 3]] };
        assert_eq!(exposure(&black), 0.0);
    }

    #[test]
    fn judged_is_what_stands_out_of_the_references_noise() {
        assert!(is_judged(4.0, Some(1.0)) && !is_judged(3.9, Some(1.0)));
        assert!(is_judged(1e-9, None) && !is_judged(0.0, None) && !is_judged(-1.0, None));
        assert!(!is_judged(f64::NAN, Some(1.0)));
        let errors = |relmse, relmse_trimmed| PartErrors { mse: 0.0, relmse, relmse_trimmed };
        let own = OwnParts { surfaces: Some(errors(1.0, 0.1)), ..OwnParts::default() };
        assert!(own.judges(&errors(4.0, 0.5)));
        assert!(!own.judges(&errors(4.0, 0.3)) && !own.judges(&errors(3.0, 0.5)));
    }
}
