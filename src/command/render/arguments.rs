//! Options of `fenestra render`.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use super::{
    super::options::{
        DeviceOptions, SceneOptions, parse_crop, parse_duration, parse_pixel, parse_size,
    },
    DEFAULT_SPP, QUICK_SPP,
};
use crate::{
    error::{Error, Result},
    files::{check_replaces_nothing, check_writable, is_special_file},
    film::{Aov, Window, checkpoint::checkpoint_path},
    pass::Roulette,
    sampler::{Parameters, Sampler},
    scene::{FilmSettings, Scene},
    session::{Rules, Settings},
};

/// Arguments of `render`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file (.toml, .gltf, .glb, .obj).
    pub scene: PathBuf,
    /// Image to write. Default: the scene's name in the working folder.
    #[arg(short, long, value_name = "FILE.exr", visible_alias = "outfile")]
    pub output: Option<PathBuf>,
    /// Sampler that chooses directions at a hit.
    #[arg(long, value_enum, default_value = "guided")]
    pub sampler: Sampler,
    /// Stop after this many camera paths per pixel (64 if no stop rule is given).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: Option<u32>,
    /// Stop after rendering for this much wall time: 500ms, 30s, 5m, 1h.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    pub time: Option<Duration>,
    /// Stop when the mean relative standard error falls below this. Slightly biased, since the data
    /// decide when to stop.
    #[arg(long, value_name = "E")]
    pub error: Option<f64>,
    /// Shadow rays traced at every vertex of a camera path: 8 for `guided`, which traces a quarter of
    /// them at later vertices (`--set later-rays=N`), else 5 unless given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub shadow_rays: Option<u32>,
    /// Number of path vertices lit by the environment; 1 is direct light.
    #[arg(long, value_name = "D", default_value_t = 8)]
    pub depth: u32,
    /// First path vertex, from 0 on, at which Russian roulette may end a path.
    #[arg(long, value_name = "D", default_value_t = 2)]
    pub roulette_depth: u32,
    /// Share of the camera's light that a path still carries, below which Russian roulette may end it; 0 for
    /// never.
    #[arg(long, value_name = "T", default_value_t = 0.02)]
    pub roulette_throughput: f32,
    /// Environment, camera, strictness.
    #[command(flatten)]
    pub scene_options: SceneOptions,
    /// Film size in pixels, overriding the scene's.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Render only pixels x0 ≤ x < x1, y0 ≤ y < y1.
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = parse_crop)]
    pub crop: Option<Window>,
    /// Random seed.
    #[arg(long, default_value_t = 0)]
    pub seed: u32,
    /// Index of each pixel's first sample, to render disjoint parts for `merge`.
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub sample_offset: u32,
    /// Continue from the output's checkpoint, if there is one.
    #[arg(long)]
    pub resume: bool,
    /// Write a checkpoint at this interval and at the end. Without it, one is written every minute and
    /// removed when the render is done.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    pub checkpoint_interval: Option<Duration>,
    /// Write no checkpoint, not even when interrupted.
    #[arg(long, conflicts_with = "checkpoint_interval")]
    pub no_checkpoint: bool,
    /// Device and tracer.
    #[command(flatten)]
    pub device: DeviceOptions,
    /// Run with the Vulkan validation layers; any message fails the command.
    #[arg(long)]
    pub validate: bool,
    /// Write statistics as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
    /// Also write a PNG preview beside the image.
    #[arg(long)]
    pub png: bool,
    /// Also write the picture denoised by the library Open Image Denoise, as FILE.denoised.exr (and .png).
    /// Biased: the image itself stays as rendered. Adds the layers albedo and normal, and leaves
    /// `share-paths` off unless set.
    #[arg(long)]
    pub denoise: bool,
    /// Exposure of the preview, in stops.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_hyphen_values = true)]
    pub exposure: f32,
    /// Show the image as it renders in the viewer tev, listening at this address.
    #[arg(long, value_name = "HOST:PORT")]
    pub display_server: Option<String>,
    /// Write a picture that explains what the sampler did at this pixel's first hit.
    #[arg(long, value_name = "X,Y", value_parser = parse_pixel)]
    pub pixel: Option<[u32; 2]>,
    /// Extra layers to store in the image.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "LIST")]
    pub aov: Vec<Aov>,
    /// Sampler parameter, such as candidates=4, lobes=64 or cache=pixel. May be repeated.
    /// (elevation=metropolis and every reading but mixture are biased.)
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Save the guide that the sampler `guided` has learned.
    #[arg(long, value_name = "FILE.guide")]
    pub save_guide: Option<PathBuf>,
    /// Start from a guide saved under the same environment, instead of training.
    #[arg(long, value_name = "FILE.guide")]
    pub load_guide: Option<PathBuf>,
    /// Render a small, fast version: at most 240 pixels wide, 16 samples.
    #[arg(long)]
    pub quick: bool,
    /// Print errors only.
    #[arg(short, long)]
    pub quiet: bool,
}

/// Maximum film width of `--quick`, pixels.
const QUICK_WIDTH: u32 = 240;

/// `out.exr` → `out.denoised.exr`, or with another ending.
pub(super) fn denoised_path(output: &Path, ending: &str) -> PathBuf {
    output.with_extension(format!("denoised.{ending}"))
}

impl Arguments {
    /// Applies `--size` or `--quick` to the film.
    pub(super) fn resize(&self, film: &mut FilmSettings) {
        if let Some([width, height]) = self.size {
            (film.width, film.height) = (width, height);
        } else if self.quick && film.width > QUICK_WIDTH {
            let scaled = u64::from(film.height) * u64::from(QUICK_WIDTH) / u64::from(film.width);
            film.height = u32::try_from(scaled).unwrap_or(1).max(1);
            film.width = QUICK_WIDTH;
        }
    }

    /// Checks, before the work, that every file asked for can be written and that none replaces a
    /// file that the scene was read from, or another of them. `--save-guide` may replace the guide
    /// that it started from.
    ///
    /// # Errors
    /// [`Error::Usage`] for an output that is an input, [`Error::Io`] for one that cannot be written.
    pub(super) fn check_outputs(&self, scene: &Scene, output: &Path) -> Result<()> {
        let preview = self.png.then(|| output.with_extension("png"));
        let denoised = self.denoise.then(|| denoised_path(output, "exr"));
        let shown = (self.denoise && self.png).then(|| denoised_path(output, "png"));
        let asked = [
            ("--output", Some(output)),
            ("--png", preview.as_deref()),
            ("--denoise", denoised.as_deref()),
            ("--denoise with --png", shown.as_deref()),
            ("--stats", self.stats.as_deref()),
            ("--save-guide", self.save_guide.as_deref()),
        ];
        let given = asked.into_iter().filter_map(|(name, path)| Some((name, path?)));
        // An interrupt writes a checkpoint without being asked to.
        let checkpoint = checkpoint_path(output);
        let mut outputs: Vec<(&str, &Path)> =
            given.chain([("the checkpoint", &*checkpoint)]).collect();
        let inputs: Vec<&Path> = scene.inputs.iter().map(PathBuf::as_path).collect();
        check_replaces_nothing(&outputs, &inputs)?;
        outputs.retain(|(name, _)| *name != "--save-guide");
        check_replaces_nothing(&outputs, self.load_guide.as_deref().as_slice())?;
        asked.into_iter().filter_map(|(_, path)| path).try_for_each(check_writable)
    }

    /// True if checkpoints may be written beside the image.
    pub(super) fn writes_checkpoints(&self, output: &Path) -> bool {
        !self.no_checkpoint && !is_special_file(output)
    }

    /// Translates the options into stop rules; the default number of samples holds where there is none.
    pub(super) fn rules(&self) -> Rules {
        let none = self.time.is_none() && self.error.is_none();
        let default = if self.quick { QUICK_SPP } else { DEFAULT_SPP };
        Rules {
            samples: self.spp.or_else(|| none.then_some(default)),
            seconds: self.time.map(|time| time.as_secs_f64()),
            error: self.error,
            looks: true,
            checkpoints: None,
        }
    }

    /// Translates the options into renderer settings.
    ///
    /// # Errors
    /// [`Error::Usage`] for options that contradict each other or are out of range.
    pub(super) fn settings(&self) -> Result<Settings> {
        if let Some(output) = &self.output
            && output.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("exr"))
            && !is_special_file(output)
        {
            return Err(Error::usage(format!(
                "--output {}: expected a name that ends in .exr; --png writes a preview beside it",
                output.display()
            )));
        }
        if let Some(output) = &self.output
            && is_special_file(output)
        {
            let beside = [
                ("--png", self.png),
                ("--denoise", self.denoise),
                ("--resume", self.resume),
                ("--checkpoint-interval", self.checkpoint_interval.is_some()),
                ("--pixel", self.pixel.is_some()),
            ];
            if let Some((option, _)) = beside.iter().find(|(_, is_given)| *is_given) {
                return Err(Error::usage(format!(
                    "{option} needs a file beside --output, which is no file: {}",
                    output.display()
                )));
            }
        }
        for (name, path) in [("--save-guide", &self.save_guide), ("--load-guide", &self.load_guide)]
        {
            if let Some(path) = path.as_ref().filter(|_| !self.sampler.has_guide()) {
                return Err(Error::usage(format!(
                    "{name} {}: the sampler {} learns nothing; expected --sampler guided",
                    path.display(),
                    self.sampler.name()
                )));
            }
        }
        let mut parameters = Parameters::default();
        if self.denoise {
            // Noise that the pixels of a cohort have in common looks like a pattern to the denoiser.
            parameters.set("share-paths=off")?;
        }
        for assignment in &self.set {
            parameters.set(assignment)?;
        }
        let mut aovs = self.aov.clone();
        if self.denoise {
            aovs.extend([Aov::Albedo, Aov::Normal].iter().filter(|aov| !self.aov.contains(aov)));
        }
        if let Some(error) = self.error
            && !(error.is_finite() && error > 0.0)
        {
            let message = format!("--error {error}: expected a finite number above 0");
            return Err(Error::usage(message));
        }
        let spp = self.spp.unwrap_or(DEFAULT_SPP);
        if self.sample_offset.checked_add(spp).is_none() {
            return Err(Error::usage(format!(
                "--sample-offset {} and {spp} samples per pixel: the last sample must be below {}",
                self.sample_offset,
                u32::MAX
            )));
        }
        if !self.exposure.is_finite() {
            return Err(Error::usage("--exposure: expected a finite number of stops"));
        }
        Ok(Settings {
            sampler: self.sampler,
            parameters,
            shadow_rays: self.shadow_rays.unwrap_or(self.sampler.shadow_rays()),
            depth: self.depth,
            seed: self.seed,
            first_sample: self.sample_offset,
            window: self.crop,
            aovs,
            roulette: Roulette {
                vertex: self.roulette_depth,
                throughput: self.roulette_throughput,
            },
            ..Settings::default()
        })
    }
}
