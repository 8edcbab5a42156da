//! `--denoise` of `render` and `convert`: the picture of a film, filtered by Open Image Denoise.

use std::{path::Path, time::Instant};

use crate::{
    error::Result,
    film::{
        Image,
        denoised::{Guides, check_film, image_of, repair},
    },
    gpu::{Denoiser, denoiser::Noisy},
};

/// A denoised picture, and a line about it.
pub(crate) struct Denoised {
    /// Picture, window and attributes, with the mark of the denoiser.
    pub image: Image,
    /// Denoiser, layers and time, for the terminal.
    pub line: String,
}

/// Denoises the picture of `film`, read from or meant for `path`, which stays as it is. Fails without a
/// picture, if it is denoised already, or if the library does.
pub(super) fn denoise(denoiser: &Denoiser, film: &Image, path: &Path) -> Result<Denoised> {
    check_film(film, path)?;
    let start = Instant::now();
    let mut picture = film.rgb(path)?;
    let mut guides = Guides::of(film);
    if let Some(unfiltered) = guides.unfiltered.take() {
        picture.pixels = unfiltered;
    }
    let repaired = repair(&mut picture.pixels, picture.width);
    for layer in [&mut guides.albedo, &mut guides.normal].into_iter().flatten() {
        repair(layer, picture.width);
    }
    if repaired > 0 {
        log::warn!(
            "{}: {repaired} pixels are not finite; the denoiser gets the mean of their neighbours",
            path.display()
        );
    }
    if guides.normal.is_none() {
        log::warn!(
            "{}: denoised without its surfaces, since it lacks the layer{}; `fenestra render --denoise` or \
             `--aov unfiltered,albedo,normal` stores them",
            path.display(),
            if guides.albedo.is_none() { "s Albedo and N" } else { " N" }
        );
    }
    let pixels = denoiser.denoise(&Noisy {
        width: picture.width,
        height: picture.height,
        color: &picture.pixels,
        albedo: guides.albedo.as_deref(),
        normal: guides.normal.as_deref(),
    })?;
    let mut name = format!("Open Image Denoise {}", denoiser.version);
    if guides.albedo.is_some() {
        name = format!("{name} with {}", guides.names());
    }
    let seconds = start.elapsed().as_secs_f64();
    Ok(Denoised {
        line: format!("{name} in {seconds:.1} s; the denoised picture is biased"),
        image: image_of(film, &pixels, name),
    })
}
