//! `fenestra convert`: an image of floats → a picture, or a part or layer of it.

use std::path::PathBuf;

use super::{denoise::denoise, options::parse_crop};
use crate::{
    error::{Error, Result},
    files::{check_replaces_nothing, check_writable, extension},
    film::{
        Curve, Image, Tone, Window,
        denoised::DENOISED,
        picture::{write_hdr, write_jpeg, write_png},
        tone::auto_exposure,
    },
    gpu::Denoiser,
    terminal::say,
};

/// Arguments of `convert`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Image to convert (EXR).
    pub image: PathBuf,
    /// File to write; its name ends in .png, .jpg, .hdr or .exr.
    pub output: PathBuf,
    /// Exposure in stops: values are scaled by 2 to this power.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_hyphen_values = true)]
    pub exposure: f32,
    /// Make the geometric mean of the luminance middle grey; `--exposure` comes on top.
    #[arg(long)]
    pub auto_exposure: bool,
    /// Tone curve of PNG and JPEG. Default: clip.
    #[arg(long, value_enum, value_name = "CURVE")]
    pub curve: Option<Curve>,
    /// Take only pixels x0 ≤ x < x1, y0 ≤ y < y1 of the film.
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = parse_crop)]
    pub crop: Option<Window>,
    /// Take this layer, such as Albedo, N or Variance, instead of the picture. PNG and JPEG show
    /// vectors from −1 to 1 as 0 to 1.
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
    /// Denoise the picture by the library Open Image Denoise. Biased: the image itself stays as it is.
    #[arg(long, conflicts_with = "layer")]
    pub denoise: bool,
}

/// Layers of unit vectors.
const NORMALS: &str = "N";

/// Converts an image.
///
/// # Errors
/// [`Error::Usage`] for options that do not suit the file; files that cannot be read or written.
pub fn run(arguments: &Arguments) -> Result<()> {
    let Arguments { image: path, output, .. } = arguments;
    let kind = extension(output);
    let is_picture = match kind.as_str() {
        "png" | "jpg" | "jpeg" => true,
        "hdr" | "exr" => false,
        _ => {
            return Err(Error::usage(format!(
                "{}: expected a name that ends in .png, .jpg, .hdr or .exr",
                output.display()
            )));
        }
    };
    if !arguments.exposure.is_finite() {
        return Err(Error::usage("--exposure: expected a finite number of stops"));
    }
    if arguments.curve.is_some() && !is_picture {
        return Err(Error::usage(format!(
            "--curve: {} holds linear values; a curve is for PNG and JPEG",
            output.display()
        )));
    }
    check_replaces_nothing(&[("the output", output)], &[path])?;
    check_writable(output)?;
    let denoiser = arguments.denoise.then(Denoiser::load).transpose()?;
    let mut image = Image::read_exr(path)?;
    if let Some(denoiser) = denoiser {
        let denoised = denoise(&denoiser, &image, path)?;
        say!("{}: {}", output.display(), denoised.line);
        image = denoised.image;
    }
    if let Some(window) = arguments.crop {
        image = image.cropped(window, path)?;
    }
    let mut picture = match &arguments.layer {
        Some(layer) => image.layer(layer, path)?,
        None => image.rgb(path)?,
    };
    let automatic = if arguments.auto_exposure { auto_exposure(&picture.pixels) } else { 0.0 };
    let exposure = arguments.exposure + automatic;
    if arguments.auto_exposure {
        log::info!("{}: exposure {exposure:+.2} stops", path.display());
    }
    if is_picture {
        if arguments.layer.as_deref() == Some(NORMALS) {
            let half = |value: f32| 0.5 + 0.5 * value;
            picture.pixels.iter_mut().for_each(|pixel| *pixel = pixel.map(half));
        }
        let tone = Tone { exposure, curve: arguments.curve.unwrap_or_default() };
        let write = if kind == "png" { write_png } else { write_jpeg };
        return write(output, picture.width, &tone.shown(&picture));
    }
    let scale = exposure.exp2();
    picture.pixels.iter_mut().for_each(|pixel| *pixel = pixel.map(|value| value * scale));
    if kind == "hdr" {
        return write_hdr(output, &picture);
    }
    if arguments.layer.is_some() || scale != 1.0 {
        // Attributes and other layers belong to the values of the render alone.
        let denoised = image.attributes.remove_entry(DENOISED);
        image.channels.clear();
        image.attributes.clear();
        image.attributes.extend(denoised);
        image.insert_triple(["R", "G", "B"], &picture.pixels);
    }
    image.write_exr(output)
}
