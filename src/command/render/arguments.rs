//! Options of `fenestra render`.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use super::{
    super::options::{
        CAMERA, DeviceOptions, FILES, MACHINE, OUTPUT, SAMPLING, STOPPING, SceneOptions,
        parse_crop, parse_pixel,
    },
    QUICK_SPP,
    frames::{Frames, numbered, parse_frames},
};
use crate::{
    error::{Error, Result},
    files::{check_replaces_nothing, check_writable, extension, is_special_file},
    film::{Aov, Window, checkpoint::checkpoint_path},
    pass::Roulette,
    sampler::{Parameters, Sampler},
    scene::{Asked, FilmSettings, Scene, load::scene_name},
    session::{DEFAULT_DEPTH, Quality, Rules, Settings, parse_duration, parse_size},
};

/// Arguments of `render`.
#[derive(Clone, Debug, clap::Args)]
pub struct Arguments {
    /// Scene file (.toml, .gltf, .glb, .obj, .pbrt, .xml).
    pub scene: PathBuf,
    /// Environment, camera, strictness.
    #[command(flatten)]
    pub scene_options: SceneOptions,

    /// Film size in pixels, overriding the scene's.
    #[arg(long, value_name = "WxH", value_parser = parse_size, help_heading = CAMERA)]
    pub size: Option<[u32; 2]>,
    /// Render only pixels x0 ≤ x < x1, y0 ≤ y < y1.
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = parse_crop, help_heading = CAMERA)]
    #[arg(hide_short_help = true)]
    pub crop: Option<Window>,

    /// Render frames of an animation: 7, 0-47, or every second one, 0-47x2.
    ///
    /// Each stops by the same rule. Its number stands in place of #### in the names of files.
    #[arg(long, value_name = "A-B", value_parser = parse_frames, help_heading = CAMERA)]
    #[arg(conflicts_with = "pixel", hide_short_help = true)]
    pub frames: Option<Frames>,
    /// Frames per second: frame F shows the scene at F / N seconds.
    #[arg(long, value_name = "N", default_value_t = 24.0, requires = "frames")]
    #[arg(help_heading = CAMERA, hide_short_help = true)]
    pub fps: f64,

    /// Sampler that chooses directions at a hit.
    #[arg(long, value_enum, default_value = "guided", help_heading = SAMPLING)]
    pub sampler: Sampler,
    /// Number of path vertices lit by the environment; 1 is direct light. Default: that of a pbrt or
    /// Mitsuba file, else 8.
    #[arg(long, value_name = "D", help_heading = SAMPLING)]
    pub depth: Option<u32>,
    /// Shadow rays traced at every vertex of a camera path.
    ///
    /// 8 for `guided`, which traces a quarter of them at later vertices (`--set later-rays=N`), else 5
    /// unless given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    #[arg(help_heading = SAMPLING, hide_short_help = true)]
    pub shadow_rays: Option<u32>,
    /// First path vertex, from 0 on, at which Russian roulette may end a path. Default: that of a Mitsuba
    /// file, else 2.
    #[arg(long, value_name = "D", help_heading = SAMPLING, hide_short_help = true)]
    pub roulette_depth: Option<u32>,
    /// Share of the camera's light that a path still carries, below which Russian roulette may end it; 0 for
    /// never.
    #[arg(long, value_name = "T", default_value_t = 0.1, help_heading = SAMPLING, hide_short_help = true)]
    pub roulette_throughput: f32,
    /// Random seed.
    #[arg(long, default_value_t = 0, help_heading = SAMPLING, hide_short_help = true)]
    pub seed: u32,
    /// Index of each pixel's first sample, to render disjoint parts for `merge`.
    #[arg(long, value_name = "K", default_value_t = 0, help_heading = SAMPLING, hide_short_help = true)]
    pub sample_offset: u32,
    /// Sampler parameter, such as candidates=4; `--set help` lists them. May be repeated.
    #[arg(long, value_name = "KEY=VALUE", help_heading = SAMPLING)]
    pub set: Vec<String>,

    /// Make a picture to show, in 10 s, 50 s or 10 min.
    ///
    /// Beside the image comes a PNG, which grows on disk, and where the library Open Image Denoise is found,
    /// the picture denoised, as by --denoise. Default: good, if nothing else says when to stop.
    #[arg(long, value_enum, conflicts_with_all = ["spp", "time", "error", "quick"])]
    #[arg(help_heading = STOPPING)]
    pub quality: Option<Quality>,
    /// Stop after this many camera paths per pixel.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    #[arg(help_heading = STOPPING)]
    pub spp: Option<u32>,
    /// Stop after rendering for this much wall time: 500ms, 30s, 5m, 1h.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration, help_heading = STOPPING)]
    pub time: Option<Duration>,
    /// Stop when the mean relative standard error falls below this.
    ///
    /// Slightly biased, since the data decide when to stop.
    #[arg(long, value_name = "E", help_heading = STOPPING)]
    pub error: Option<f64>,
    /// Render a small, fast version: at most 240 pixels wide, 16 samples.
    #[arg(long, help_heading = STOPPING, hide_short_help = true)]
    pub quick: bool,

    /// Image to write. Default: the scene's name in the working folder.
    #[arg(short, long, value_name = "FILE.exr", visible_alias = "outfile", help_heading = OUTPUT)]
    pub output: Option<PathBuf>,
    /// Also write a PNG preview beside the image.
    #[arg(long, help_heading = OUTPUT)]
    pub png: bool,
    /// Write the preview at this interval too, and by that ask for it. Default with --quality: 5s.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    #[arg(help_heading = OUTPUT, hide_short_help = true)]
    pub png_every: Option<Duration>,
    /// Exposure of the preview, in stops.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_hyphen_values = true)]
    #[arg(help_heading = OUTPUT)]
    pub exposure: f32,
    /// Also write the picture denoised, as FILE.denoised.exr (and .png).
    ///
    /// By the library Open Image Denoise. Biased: the image itself stays as rendered. Adds the layers albedo
    /// and normal, and leaves `share-paths` off unless set.
    #[arg(long, help_heading = OUTPUT)]
    pub denoise: bool,
    /// Extra layers to store in the image.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "LIST")]
    #[arg(help_heading = OUTPUT, hide_short_help = true)]
    pub aov: Vec<Aov>,
    /// Show the image as it renders in the viewer tev, listening at this address.
    #[arg(long, value_name = "HOST:PORT", help_heading = OUTPUT, hide_short_help = true)]
    pub display_server: Option<String>,
    /// Write a picture that explains what the sampler did at this pixel's first hit.
    #[arg(long, value_name = "X,Y", value_parser = parse_pixel)]
    #[arg(help_heading = OUTPUT, hide_short_help = true)]
    pub pixel: Option<[u32; 2]>,
    /// Print errors only.
    #[arg(short, long, help_heading = OUTPUT)]
    pub quiet: bool,

    /// Skip images that are there; go on with those that have a checkpoint beside them.
    #[arg(long, help_heading = FILES, hide_short_help = true)]
    pub skip_existing: bool,
    /// Continue from the output's checkpoint, if there is one.
    #[arg(long, help_heading = FILES)]
    pub resume: bool,
    /// Write a checkpoint at this interval and at the end. Without it, one is written every minute and
    /// removed when the render is done.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration, help_heading = FILES)]
    #[arg(hide_short_help = true)]
    pub checkpoint_interval: Option<Duration>,
    /// Write no checkpoint, not even when interrupted.
    #[arg(long, conflicts_with = "checkpoint_interval", help_heading = FILES)]
    #[arg(hide_short_help = true)]
    pub no_checkpoint: bool,
    /// Save the guide that the sampler `guided` has learned.
    #[arg(long, value_name = "FILE.guide", help_heading = FILES, hide_short_help = true)]
    pub save_guide: Option<PathBuf>,
    /// Start from a guide saved under the same environment, instead of training.
    #[arg(long, value_name = "FILE.guide", help_heading = FILES, hide_short_help = true)]
    pub load_guide: Option<PathBuf>,
    /// Write statistics as JSON.
    #[arg(long, value_name = "FILE.json", help_heading = FILES, hide_short_help = true)]
    pub stats: Option<PathBuf>,

    /// Device and tracer.
    #[command(flatten)]
    pub device: DeviceOptions,
    /// Run with the Vulkan validation layers; any message fails the command.
    #[arg(long, help_heading = MACHINE, hide_short_help = true)]
    pub validate: bool,
}

/// Interval of the preview of a picture to show.
pub(super) const PNG_INTERVAL: Duration = Duration::from_secs(5);
const QUICK_WIDTH: u32 = 240;

/// `out.exr` → `out.denoised.exr`, or with another ending.
pub(super) fn denoised_path(output: &Path, ending: &str) -> PathBuf {
    output.with_extension(format!("denoised.{ending}"))
}

impl Arguments {
    /// Lists the frames asked for; one that is none without `--frames`. Fails for several frames with a name
    /// that they would share.
    pub(super) fn frame_list(&self) -> Result<Vec<Option<u32>>> {
        let Some(frames) = self.frames else { return Ok(vec![None]) };
        if !(self.fps.is_finite() && self.fps > 0.0) {
            return Err(Error::usage(format!("--fps {}: expected a number above 0", self.fps)));
        }
        for (option, path) in [
            ("--output", &self.output),
            ("--stats", &self.stats),
            ("--save-guide", &self.save_guide),
        ] {
            if let Some(path) = path
                .as_ref()
                .filter(|path| frames.numbers().count() > 1 && numbered(path, 0) == **path)
            {
                return Err(Error::usage(format!(
                    "{option} {}: every frame would have this name; expected #### in it for the number",
                    path.display()
                )));
            }
        }
        Ok(frames.numbers().map(Some).collect())
    }

    /// Arguments of one frame, with names and random numbers of its own.
    pub(super) fn of_frame(&self, frame: Option<u32>) -> Self {
        let mut own = self.clone();
        let Some(frame) = frame else { return own };
        let files = [&mut own.output, &mut own.stats, &mut own.save_guide, &mut own.load_guide];
        for path in files.into_iter().flatten() {
            *path = numbered(path, frame);
        }
        own.seed = Frames::seed(self.seed, frame);
        own
    }

    pub(super) fn image_path(&self, frame: Option<u32>) -> PathBuf {
        self.output.clone().unwrap_or_else(|| {
            let name = scene_name(&self.scene);
            match frame {
                None => PathBuf::from(format!("{name}.exr")),
                Some(frame) => numbered(Path::new(&format!("{name}.####.exr")), frame),
            }
        })
    }

    /// Quality of a picture to show; `None` where another rule stops the render.
    pub(super) fn quality(&self) -> Option<Quality> {
        let has_rule =
            self.spp.is_some() || self.time.is_some() || self.error.is_some() || self.quick;
        self.quality.or_else(|| (!has_rule).then_some(Quality::Good))
    }

    /// True if the render makes a picture to show by itself: one that has a quality, and files at all.
    pub(super) fn shows(&self) -> bool {
        self.quality().is_some() && !self.output.as_deref().is_some_and(is_special_file)
    }

    /// True if a preview is written beside the image.
    pub(super) fn writes_png(&self) -> bool {
        self.png || self.png_every.is_some() || self.shows()
    }

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
    /// that it started from. `denoises` says that there will be a denoised picture.
    pub(super) fn check_outputs(&self, scene: &Scene, output: &Path, denoises: bool) -> Result<()> {
        let has_png = self.writes_png();
        let preview = has_png.then(|| output.with_extension("png"));
        let denoised = denoises.then(|| denoised_path(output, "exr"));
        let shown = (denoises && has_png).then(|| denoised_path(output, "png"));
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

    /// Takes what the scene's file asks for where no option says otherwise; returns a line on that.
    pub(super) fn take_asked(&self, scene: &Scene, settings: &mut Settings) -> Option<String> {
        let Asked { depth, roulette_depth, .. } = scene.asked;
        let mut taken = Vec::new();
        if let (None, Some(depth)) = (self.depth, depth) {
            settings.depth = depth;
            taken.push(format!("depth {depth}"));
        }
        if let (None, Some(vertex)) = (self.roulette_depth, roulette_depth) {
            settings.roulette.vertex = vertex;
            taken.push(format!("roulette from vertex {vertex}"));
        }
        if let Some(samples) = self.asked_samples(scene.asked) {
            taken.push(format!("{samples} samples"));
        }
        let list = taken.join(", ");
        (!taken.is_empty()).then(|| format!("{} asks for {list}", scene.path.display()))
    }

    /// Says that a sampler which shares paths does not, for the groups of lights.
    pub(super) fn unshared(&self, settings: &Settings) -> Option<String> {
        let edges =
            [Parameters::default(), settings.parameters].map(|own| self.sampler.cohort_edge(&own));
        let is_off = edges[0] > 1 && edges[1] == 1 && settings.depth > 1;
        (is_off && self.aov.contains(&Aov::LightGroups)).then(|| {
            format!("--aov light-groups: {} shares no paths (share-paths=off)", self.sampler.name())
        })
    }

    /// Samples that the scene's file asks for, where no option says when to stop.
    pub(super) fn asked_samples(&self, asked: Asked) -> Option<u32> {
        asked.samples.filter(|_| self.quality.is_none() && self.quality().is_some())
    }

    /// Translates the options into stop rules. The samples that the file asks for replace those of a quality
    /// that nobody named.
    pub(super) fn rules(&self, asked: Asked) -> Rules {
        let rules = match self.asked_samples(asked) {
            None => self.quality().map(Quality::rules).unwrap_or_default(),
            samples => Rules { samples, ..Rules::default() },
        };
        let samples = self.spp.or(rules.samples);
        let is_quick = self.quick && self.time.is_none() && self.error.is_none();
        Rules {
            samples: samples.or_else(|| is_quick.then_some(QUICK_SPP)),
            seconds: self.time.map(|time| time.as_secs_f64()).or(rules.seconds),
            error: self.error,
            looks: true,
            checkpoints: None,
        }
    }

    /// Translates the options into renderer settings, with what a denoiser needs if it `denoises`. Fails if
    /// options contradict each other or are out of range.
    pub(super) fn settings(&self, denoises: bool) -> Result<Settings> {
        if let Some(output) = self.output.as_ref().filter(|output| !is_special_file(output)) {
            if extension(output) != "exr" {
                return Err(Error::usage(format!(
                    "--output {}: expected a name that ends in .exr; --png writes a preview beside it",
                    output.display()
                )));
            }
        } else if let Some(output) = &self.output {
            let beside = [
                ("--png", self.png),
                ("--png-every", self.png_every.is_some()),
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
            if let Some(path) = path.as_ref().filter(|_| !self.sampler.room().has_guide()) {
                return Err(Error::usage(format!(
                    "{name} {}: the sampler {} learns nothing; expected --sampler guided",
                    path.display(),
                    self.sampler.name()
                )));
            }
        }
        let mut parameters = Parameters::default();
        if denoises || self.aov.contains(&Aov::LightGroups) {
            // Noise that the pixels of a cohort have in common looks like a pattern to the denoiser. Shared
            // paths do not keep groups of lights apart.
            parameters.set("share-paths=off")?;
        }
        self.set.iter().try_for_each(|assignment| parameters.set(assignment))?;
        let mut aovs = self.aov.clone();
        if denoises {
            let wanted = [Aov::Unfiltered, Aov::Albedo, Aov::Normal];
            aovs.extend(wanted.iter().filter(|aov| !self.aov.contains(aov)));
        }
        if let Some(error) = self.error.filter(|error| !(error.is_finite() && *error > 0.0)) {
            return Err(Error::usage(format!("--error {error}: expected a finite number above 0")));
        }
        let spp = self.rules(Asked::default()).samples.unwrap_or(1);
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
            shadow_rays: self.shadow_rays.unwrap_or(self.sampler.room().shadow_rays()),
            depth: self.depth.unwrap_or(DEFAULT_DEPTH),
            seed: self.seed,
            first_sample: self.sample_offset,
            window: self.crop,
            aovs,
            roulette: Roulette {
                vertex: self.roulette_depth.unwrap_or(Roulette::default().vertex),
                throughput: self.roulette_throughput,
            },
            ..Settings::default()
        })
    }
}
