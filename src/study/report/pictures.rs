//! Pictures of the page: PNGs as data URIs, error maps in false colour, parts worth magnifying.

use std::path::PathBuf;

use base64::prelude::{BASE64_STANDARD, Engine};
use half::f16;

use crate::{
    error::{Error, Result},
    film::{
        Image, RgbImage,
        picture::{encode_png, preview},
    },
    study::{
        falsecolour::{self, Scale},
        folder::Folder,
        metrics::squared_errors,
        plan::Rule,
        reference::{HALF_STEMS, exposure, mean},
        results::Report,
        runs::{Run, StudiedScene},
        surfaces::{self, mask},
    },
};

/// A picture of the page, stored once in its style sheet and shown wherever its class is used.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Contender's label; empty for the reference.
    pub sampler: String,
    /// Rule that ended the run; absent for the reference.
    pub rule: Option<Rule>,
    /// Display picture as a data URI.
    pub colour: String,
    /// Error map as a data URI; empty for the reference.
    pub error: String,
    /// Linear radiance as little-endian halves R, G, B in base64, row by row from the top.
    pub halves: String,
    /// EXR files, relative to the folder.
    pub files: Vec<String>,
}

/// A magnified part, in shares of the picture's width and height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crop {
    pub left: f64,
    pub top: f64,
    /// Share of width and height that is shown.
    pub size: f64,
}

/// Pictures of a scene: the reference first.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenePictures {
    /// All of one size.
    pub pictures: Vec<Picture>,
    /// Scale of every error map of the scene.
    pub scale: Scale,
    /// Exposure of the display pictures, stops.
    pub exposure: f32,
    /// Parts where samplers differ most on surfaces.
    pub crops: Vec<Crop>,
}

/// Share of width and height that a crop shows.
const CROP_SIZE: f64 = 0.2;
const CROP_COUNT: usize = 2;

/// Reads the pictures of a scene: those shown are of the first seed, errors are root mean squares over all
/// seeds. Also writes the error maps, with a legend, beside the pictures in the folder. Fails if a picture
/// cannot be read, or an error map cannot be written.
pub fn load(
    folder: &Folder,
    report: &Report,
    scene: &StudiedScene,
    rules: &[Rule],
) -> Result<ScenePictures> {
    let read = |stem: &str| {
        let path = folder.image(&scene.name, stem);
        Image::read_exr(&path)?.rgb(&path)
    };
    let (first, second) = (read(HALF_STEMS[0])?, read(HALF_STEMS[1])?);
    let mean = mean(&first, &second);
    let stops = exposure(&mean);
    let mut pictures = vec![Picture {
        sampler: String::new(),
        rule: None,
        colour: display_uri(&mean, stops)?,
        error: String::new(),
        halves: halves(&mean),
        files: HALF_STEMS.map(|stem| Folder::image_name(&scene.name, stem)).to_vec(),
    }];
    let mut maps: Vec<Vec<f64>> = Vec::new();
    let mut error_paths: Vec<PathBuf> = Vec::new();
    for rule in rules {
        for sampler in &report.order {
            let mut shown = None;
            let (mut sum, mut count) = (vec![0.0; mean.pixels.len()], 0.0);
            let is_own = |run: &&Run| run.scene == scene.name && run.sampler == *sampler;
            for run in report.runs.iter().filter(is_own) {
                let Some(name) = run.at(*rule).and_then(|m| m.image.as_ref()) else { continue };
                let path = folder.path.join(name);
                let picture = Image::read_exr(&path)?.rgb(&path)?;
                for (sum, error) in sum.iter_mut().zip(squared_errors(&picture, &first, &second)?) {
                    *sum += error;
                }
                count += 1.0;
                shown.get_or_insert((picture, path, name.clone()));
            }
            if let Some((shown, path, name)) = shown {
                let stem = path.file_stem().unwrap_or_default().to_string_lossy();
                let stem = stem.rsplit_once("-seed").map_or(&*stem, |(run, _)| run);
                error_paths.push(path.with_file_name(format!("{stem}-error.png")));
                pictures.push(Picture {
                    sampler: sampler.clone(),
                    rule: Some(*rule),
                    colour: display_uri(&shown, stops)?,
                    error: String::new(),
                    halves: halves(&shown),
                    files: vec![name],
                });
                maps.push(sum.into_iter().map(|sum| (sum / count).max(0.0).sqrt()).collect());
            }
        }
    }
    let is_surface = mask(&read(surfaces::STEM)?);
    // A picture of nothing but environment has no surface to look at.
    let is_shown: Vec<bool> = match is_surface.contains(&true) {
        true => is_surface,
        false => vec![true; is_surface.len()],
    };
    let on_surfaces = |map: &Vec<f64>| -> Vec<f64> {
        map.iter().zip(&is_shown).filter(|(_, shown)| **shown).map(|(error, _)| *error).collect()
    };
    let scale = Scale::of(&maps.iter().flat_map(on_surfaces).collect::<Vec<f64>>());
    for ((picture, map), path) in pictures[1..].iter_mut().zip(&maps).zip(&error_paths) {
        let colours: Vec<[u8; 3]> = map.iter().map(|error| scale.colour(*error)).collect();
        picture.error = data_uri(mean.width, &colours)?;
        falsecolour::picture(map, mean.width as usize, scale).write_png(path)?;
    }
    let worth = worth_seeing(&maps, report.order.len(), &is_shown);
    let crops = choose_crops(&worth, mean.width as usize, mean.height as usize);
    Ok(ScenePictures { pictures, scale, exposure: stops, crops })
}

/// Weighs pixels for the choice of crops: the spread of the samplers' errors in the last rule's maps
/// (the error itself if there is one sampler, or no spread), and 0 where the mask is false.
fn worth_seeing(maps: &[Vec<f64>], sampler_count: usize, is_shown: &[bool]) -> Vec<f64> {
    let last = &maps[maps.len().saturating_sub(sampler_count)..];
    let at = |index: usize| last.iter().map(move |map| map[index]);
    let largest = |index| at(index).fold(0.0, f64::max);
    let spread = |index| largest(index) - at(index).fold(f64::INFINITY, f64::min).min(1e300);
    let masked = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
        is_shown.iter().enumerate().map(|(i, shown)| if *shown { value(i) } else { 0.0 }).collect()
    };
    let spreads = masked(&spread);
    if last.len() > 1 && spreads.iter().any(|spread| *spread > 0.0) {
        spreads
    } else {
        masked(&largest)
    }
}

/// Packs linear radiance as halves in base 64; values beyond the largest half become it.
fn halves(picture: &RgbImage) -> String {
    let clamp = |value: &f32| f16::from_f32(value.clamp(-65504.0, 65504.0));
    let bytes: Vec<u8> =
        picture.pixels.iter().flatten().flat_map(|value| clamp(value).to_le_bytes()).collect();
    BASE64_STANDARD.encode(&bytes)
}

fn display_uri(picture: &RgbImage, stops: f32) -> Result<String> {
    data_uri(picture.width, &preview(picture, stops))
}

fn data_uri(width: u32, pixels: &[[u8; 3]]) -> Result<String> {
    let mut bytes = Vec::new();
    encode_png(&mut bytes, width, pixels)
        .map_err(|error| Error::comparison(format!("a picture of the page: {error}")))?;
    Ok(format!("data:image/png;base64,{}", BASE64_STANDARD.encode(&bytes)))
}

/// Chooses the parts with the largest mean error that do not overlap.
fn choose_crops(errors: &[f64], width: usize, height: usize) -> Vec<Crop> {
    let side = |length: usize| ((length as f64 * CROP_SIZE).round() as usize).clamp(1, length);
    let (crop_width, crop_height) = (side(width), side(height));
    let mut candidates = Vec::new();
    for top in (0..=height - crop_height).step_by((crop_height / 4).max(1)) {
        for left in (0..=width - crop_width).step_by((crop_width / 4).max(1)) {
            let rows = (top..top + crop_height)
                .map(|y| &errors[y * width + left..y * width + left + crop_width]);
            candidates.push((rows.flatten().sum::<f64>(), left, top));
        }
    }
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<(usize, usize)> = Vec::new();
    for (_, left, top) in candidates {
        let is_free = chosen
            .iter()
            .all(|(x, y)| x.abs_diff(left) >= crop_width || y.abs_diff(top) >= crop_height);
        if is_free && chosen.len() < CROP_COUNT {
            chosen.push((left, top));
        }
    }
    chosen
        .into_iter()
        .map(|(left, top)| Crop {
            left: left as f64 / width as f64,
            top: top as f64 / height as f64,
            size: CROP_SIZE,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_lie_where_the_errors_are() {
        let mut errors = vec![0.0; 40 * 20];
        errors[3 * 40 + 5] = 2.0;
        errors[17 * 40 + 33] = 1.0;
        let crops = choose_crops(&errors, 40, 20);
        let holds = |crop: &Crop, x: f64, y: f64| {
            (crop.left..crop.left + crop.size).contains(&(x / 40.0))
                && (crop.top..crop.top + crop.size).contains(&(y / 20.0))
        };
        assert!(holds(&crops[0], 5.5, 3.5) && holds(&crops[1], 33.5, 17.5), "{crops:?}");
    }

    #[test]
    fn details_lie_where_samplers_differ_on_surfaces() {
        // Both samplers err most in pixel 0; they differ in 1, and in 2, which is no surface.
        let maps = [vec![9.0, 1.0, 0.0], vec![9.0, 3.0, 8.0]];
        assert_eq!(worth_seeing(&maps, 2, &[true, true, false]), [0.0, 2.0, 0.0]);
        assert_eq!(worth_seeing(&maps[..1], 1, &[true, true, false]), [9.0, 1.0, 0.0]);
        let same = [maps[0].clone(), maps[0].clone()];
        assert_eq!(worth_seeing(&same, 2, &[true; 3]), [9.0, 1.0, 0.0]);
    }

    #[test]
    fn radiance_is_packed_as_halves() {
        let picture = RgbImage { width: 1, height: 1, pixels: vec![[1.0, 0.5, 1e9]] };
        // 0x3c00, 0x3800, 0x7bff, low bytes first.
        assert_eq!(halves(&picture), BASE64_STANDARD.encode([0x00, 0x3c, 0x00, 0x38, 0xff, 0x7b]));
    }

    #[test]
    fn pictures_of_one_pixel_have_a_crop() {
        assert_eq!(choose_crops(&[1.0], 1, 1).len(), 1);
    }
}
