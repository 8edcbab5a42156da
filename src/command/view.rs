//! `fenestra view`: a scene in a window.

use std::path::PathBuf;

use super::{
    options::{CAMERA, DeviceOptions, MACHINE, OUTPUT, SAMPLING, STOPPING, SceneOptions},
    progress::Patience,
    self_test,
};
use crate::{
    error::{Error, Result},
    film::{Curve, Tone},
    sampler::{Parameters, Sampler},
    scene::Asked,
    session::{DEFAULT_DEPTH, Settings, parse_size},
    view::{Display, Options},
};

/// Arguments of `view`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file (.toml, .gltf, .glb, .obj, .pbrt, .xml).
    pub scene: PathBuf,
    /// Sampler at the start; a key changes it.
    #[arg(long, value_enum, default_value = "guided", help_heading = SAMPLING)]
    pub sampler: Sampler,
    /// Camera paths per pixel at which a picture is finished.
    #[arg(long, value_name = "N", default_value_t = 65536, help_heading = STOPPING)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: u32,
    /// Shadow rays traced at every vertex of a camera path: 8 for `guided`, else 5 unless given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    #[arg(help_heading = SAMPLING, hide_short_help = true)]
    pub shadow_rays: Option<u32>,
    /// Number of path vertices at the start; 1 is direct light. Default: that of a pbrt or Mitsuba file,
    /// else 8.
    #[arg(long, value_name = "D", help_heading = SAMPLING)]
    pub depth: Option<u32>,
    /// Environment, camera, strictness.
    #[command(flatten)]
    pub scene_options: SceneOptions,
    /// Film size in pixels, overriding the scene's. The window shows the film at any size.
    #[arg(long, value_name = "WxH", value_parser = parse_size, help_heading = CAMERA)]
    pub size: Option<[u32; 2]>,
    /// Random seed.
    #[arg(long, default_value_t = 0, help_heading = SAMPLING, hide_short_help = true)]
    pub seed: u32,
    /// Device and tracer.
    #[command(flatten)]
    pub device: DeviceOptions,
    /// Run with the Vulkan validation layers; any message fails the command.
    #[arg(long, help_heading = MACHINE, hide_short_help = true)]
    pub validate: bool,
    /// Exposure at the start, in stops.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_hyphen_values = true)]
    #[arg(help_heading = OUTPUT)]
    pub exposure: f32,
    /// Tone curve at the start.
    #[arg(long, value_enum, value_name = "CURVE", default_value = "clip", help_heading = OUTPUT)]
    pub curve: Curve,
    /// Sampler parameter, such as candidates=4; `--set help` lists them. May be repeated.
    #[arg(long, value_name = "KEY=VALUE", help_heading = SAMPLING)]
    pub set: Vec<String>,
}

/// Shows a scene until its window is closed.
///
/// # Errors
/// Wrong options, an unusable scene, no display, no device that can show pictures there.
pub fn run(arguments: &Arguments) -> Result<()> {
    if !arguments.exposure.is_finite() {
        return Err(Error::usage("--exposure: expected a finite number of stops"));
    }
    let mut parameters = Parameters::default();
    arguments.set.iter().try_for_each(|assignment| parameters.set(assignment))?;
    let mut settings = Settings {
        sampler: arguments.sampler,
        parameters,
        shadow_rays: arguments.shadow_rays.unwrap_or(arguments.sampler.room().shadow_rays()),
        seed: arguments.seed,
        ..Settings::default()
    };
    let display = Display::open()?;
    let patience = Patience::new(&format!("loading {}", arguments.scene.display()), false);
    let mut scene = arguments.scene_options.load(&arguments.scene)?;
    if let Some([width, height]) = arguments.size {
        (scene.film.width, scene.film.height) = (width, height);
    }
    let Asked { depth, roulette_depth, .. } = scene.asked;
    settings.depth = arguments.depth.or(depth).unwrap_or(DEFAULT_DEPTH);
    settings.roulette.vertex = roulette_depth.unwrap_or(settings.roulette.vertex);
    settings.check([scene.film.width, scene.film.height])?;
    drop(patience);
    let options = Options {
        device: arguments.device.device.clone(),
        tracer: arguments.device.tracer,
        validate: arguments.validate,
        check: self_test::check,
        settings,
        spp: arguments.spp,
        tone: Tone { exposure: arguments.exposure, curve: arguments.curve },
    };
    display.run(scene, options)
}
