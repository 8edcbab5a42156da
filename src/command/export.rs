//! `fenestra export`: writes a scene for another renderer.

use std::path::{Path, PathBuf};

use crate::{
    error::{Error, Result},
    export::{Settings, gltf, mitsuba, pbrt},
    files,
    scene::Scene,
    session::parse_size,
};

/// Arguments of `export`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file (.toml).
    pub scene: PathBuf,
    /// Folder, in which the scene is called `scene`, or file with the format's extension (.xml, .pbrt or
    /// .gltf). Meshes, images and the environment go into a folder of the same name beside it.
    pub output: PathBuf,
    /// Format to write.
    #[arg(long, value_enum)]
    pub format: Format,
    /// Number of path vertices lit by the environment; 1 is direct light.
    #[arg(long, value_name = "D", default_value_t = 8)]
    pub depth: u32,
    /// Film size in pixels, overriding the scene's.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Samples per pixel.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: u32,
    /// Write nothing if the format cannot express the scene exactly.
    #[arg(long)]
    pub strict: bool,
}

/// Formats that scenes can be written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// Mitsuba 3 XML.
    Mitsuba,
    /// A scene description of pbrt-v4.
    Pbrt,
    /// glTF 2.0, with the environment as an image beside it.
    Gltf,
}

impl Format {
    fn extension(self) -> &'static str {
        match self {
            Self::Mitsuba => "xml",
            Self::Pbrt => "pbrt",
            Self::Gltf => "gltf",
        }
    }
}

/// Writes the scene and warns, once for each material concerned, of what the format cannot express.
///
/// # Errors
/// An unusable scene, a failing disk; with `--strict`, the first difference.
pub fn run(arguments: &Arguments) -> Result<()> {
    let mut scene = Scene::load(&arguments.scene)?;
    if let Some([width, height]) = arguments.size {
        (scene.film.width, scene.film.height) = (width, height);
    }
    if !scene.geometry.instances.is_empty() {
        let message = "expected fewer triangles: the export places every instance";
        let flat = scene.geometry.flattened();
        scene.geometry = flat.ok_or_else(|| Error::scene(&arguments.scene, message))?;
    }
    let settings = Settings { depth: arguments.depth, samples: arguments.spp };
    let extension = arguments.format.extension();
    let output = if files::extension(&arguments.output) == extension {
        arguments.output.clone()
    } else {
        arguments.output.join("scene").with_extension(extension)
    };
    check_outputs(&scene, &output)?;
    let export = match arguments.format {
        Format::Mitsuba => mitsuba::export(&scene, &output, settings),
        Format::Pbrt => pbrt::export(&scene, &output, settings),
        Format::Gltf => gltf::export(&scene, &output),
    };
    if arguments.strict
        && let Some(difference) = export.warnings.first()
    {
        return Err(Error::scene(&arguments.scene, format!("{difference} (--strict)")));
    }
    scene.warnings.iter().chain(&export.summary()).for_each(|warning| log::warn!("{warning}"));
    export.write()?;
    super::print_line(&output.display().to_string())
}

/// Checks that neither the file nor the folder beside it would replace what the scene was read from.
fn check_outputs(scene: &Scene, output: &Path) -> Result<()> {
    let inputs: Vec<&Path> = scene.inputs.iter().map(PathBuf::as_path).collect();
    files::check_replaces_nothing(&[("the export", output)], &inputs)?;
    files::check_replaces_nothing_in("the export's folder", &output.with_extension(""), &inputs)
}
