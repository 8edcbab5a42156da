//! Plan of a study: layers of options → a complete plan.
//!
//! Options come from the study file's `[settings]`, its `[quick]` table and the command line; later
//! layers override earlier ones. [`Plan::new`] fills in defaults and rejects impossible plans.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    time::Duration,
};

use serde::{Deserialize, Serialize};

use super::contender::Contender;
use crate::{
    error::{Error, Result},
    files::extension,
    sampler::{Parameters, Sampler},
    session::DEFAULT_DEPTH,
};

/// A run is judged if its mean squared error is at least this many times the reference's own.
pub(crate) const JUDGED_FROM: f64 = 4.0;
/// Samples per pixel if neither samples nor time are given.
const DEFAULT_SPP: u32 = 64;
/// Ratio of the reference's samples to the largest number of samples compared.
const REFERENCE_FACTOR: u32 = 16;
/// Least samples of a reference by default.
const LEAST_REFERENCE_SPP: u32 = 1024;

/// Options of one layer; absent ones are left to the layers below.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Contenders compared; ratios are to the first.
    pub samplers: Option<Vec<Contender>>,
    /// Samples per pixel at which the samplers are compared; empty for none.
    pub spp: Option<Vec<u32>>,
    /// Wall time of passes at which the samplers are compared.
    pub time: Option<Duration>,
    /// Runs of each sampler, with seeds 1, 2, ….
    pub seeds: Option<u32>,
    /// Film size instead of the scenes' own.
    pub size: Option<[u32; 2]>,
    /// Directions traced at every vertex.
    pub shadow_rays: Option<u32>,
    /// Path vertices at which environment light is gathered.
    pub depth: Option<u32>,
    /// Sampler of the reference.
    pub reference_sampler: Option<Contender>,
    /// Samples per pixel of the reference, both halves together.
    pub reference_spp: Option<u32>,
    /// Independent picture that checks the reference.
    pub reference_check: Option<CheckPlan>,
    /// True to measure overhead.
    pub overhead: Option<bool>,
    /// Sampler that overhead is measured against.
    pub overhead_baseline: Option<Contender>,
    /// Samples per pixel of one overhead measurement.
    pub overhead_spp: Option<u32>,
    /// Overhead measurements of each sampler, interleaved.
    pub overhead_repetitions: Option<u32>,
}

impl Options {
    /// Returns these options, with those of `below` where one is absent.
    #[must_use]
    pub fn over(self, below: Self) -> Self {
        macro_rules! layered {
            ($($option:ident)*) => { Self { $($option: self.$option.or(below.$option)),* } };
        }
        layered!(samplers spp time seeds size shadow_rays depth reference_sampler reference_spp
            reference_check overhead overhead_baseline overhead_spp overhead_repetitions)
    }
}

/// Errors that a publication reports for one scene and one number of samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedErrors {
    /// Scene by name.
    pub scene: String,
    /// Place of the figures, such as "Table 6.1".
    pub source: String,
    /// Samples per pixel.
    pub spp: u32,
    /// Figure by sampler, in the publication's own units.
    pub values: BTreeMap<String, f64>,
}

/// A ratio of times that a publication reports.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedOverhead {
    /// Subject of the ratio.
    pub label: String,
    /// Least ratio.
    pub low: f64,
    /// Largest ratio.
    pub high: f64,
}

/// Texts and published figures of a study file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Description {
    /// Heading of the report.
    pub title: Option<String>,
    /// Paragraphs under the heading.
    pub notes: Vec<String>,
    /// Published figures to set beside the study's.
    pub published_errors: Vec<PublishedErrors>,
    /// Published overheads.
    pub published_overheads: Vec<PublishedOverhead>,
}

/// Plan of the overhead measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct OverheadPlan {
    /// Sampler in the denominator.
    pub baseline: Contender,
    /// Samplers in the numerator, without the baseline.
    pub contenders: Vec<Contender>,
    /// Samples per pixel of one measurement.
    pub spp: u32,
    /// Rounds; each measures every sampler once.
    pub repetitions: u32,
}

/// Source of the reference.
#[derive(Clone, Debug, PartialEq)]
pub enum ReferencePlan {
    /// Rendered in two halves.
    Render {
        /// Its sampler.
        contender: Contender,
        /// Samples per pixel of each half.
        half_spp: u32,
    },
    /// Read from one image, or from two independent halves, of the only scene.
    Files(Vec<PathBuf>),
    /// Read from another study's folder.
    Study(PathBuf),
}

/// Source of the independent picture that checks the reference.
#[derive(Clone, Debug, PartialEq)]
pub enum CheckPlan {
    /// No check.
    Off,
    /// By `mis`, or by `env` if the reference is by `mis`.
    Default,
    /// By this sampler.
    Sampler(Contender),
    /// A picture of another renderer.
    File(PathBuf),
}

impl CheckPlan {
    /// Parses `off`, `auto`, an EXR file (relative to `folder`) or a sampler with parameters.
    pub(crate) fn parse(text: &str, folder: &Path, defaults: Parameters) -> Result<Self> {
        Ok(match text.trim() {
            "off" => Self::Off,
            "auto" => Self::Default,
            path if extension(Path::new(path)) == "exr" => Self::File(folder.join(path)),
            sampler => Self::Sampler(Contender::parse(sampler, defaults)?),
        })
    }

    /// Sampler of the check of a reference by `sampler`, if the check is to be rendered.
    pub(crate) fn contender(&self, sampler: Option<&str>) -> Option<Contender> {
        let name = match self {
            Self::Off | Self::File(_) => return None,
            Self::Sampler(contender) => return Some(contender.clone()),
            Self::Default if sampler == Some(Sampler::Mis.name()) => Sampler::Env,
            Self::Default => Sampler::Mis,
        };
        Some(Contender::plain(name))
    }
}

/// Rule that ends a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rule {
    /// Samples per pixel.
    Spp(u32),
    /// Wall time of the passes, seconds.
    Seconds(f64),
}

impl Rule {
    pub(crate) fn time(time: Duration) -> Self {
        Self::Seconds(time.as_secs_f64())
    }

    /// Returns "400 spp" or "30 s".
    pub(crate) fn describe(self) -> String {
        match self {
            Self::Spp(spp) => format!("{spp} spp"),
            Self::Seconds(seconds) => format!("{seconds} s"),
        }
    }

    /// Returns "400spp" or "30s", for file names.
    pub(crate) fn file_stem(self) -> String {
        self.describe().replace(' ', "")
    }
}

/// Everything a study does.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Texts and published figures of the study file.
    pub description: Description,
    /// Scene files.
    pub scenes: Vec<PathBuf>,
    /// Film size instead of the scenes' own.
    pub size: Option<[u32; 2]>,
    /// Contenders compared.
    pub contenders: Vec<Contender>,
    /// Samples per pixel at which the samplers are compared, ascending; may be empty.
    pub spp: Vec<u32>,
    /// Wall time at which they are compared.
    pub time: Option<Duration>,
    /// Runs of each sampler.
    pub seeds: u32,
    /// Directions traced at every vertex; each sampler's own number if absent.
    pub shadow_rays: Option<u32>,
    /// Path vertices at which environment light is gathered.
    pub depth: u32,
    /// Source of the reference.
    pub reference: ReferencePlan,
    /// Independent picture that checks it.
    pub reference_check: CheckPlan,
    /// Overhead measurements, if any.
    pub overhead: Option<OverheadPlan>,
}

impl Plan {
    /// Directions that a contender traces at every vertex.
    pub(crate) fn shadow_rays_of(&self, contender: &Contender) -> u32 {
        self.shadow_rays.unwrap_or(contender.sampler.room().shadow_rays())
    }

    /// Files and folders of the given references.
    pub(crate) fn pictures(&self) -> impl Iterator<Item = &Path> {
        let references: &[PathBuf] = match &self.reference {
            ReferencePlan::Render { .. } => &[],
            ReferencePlan::Files(files) => files,
            ReferencePlan::Study(folder) => std::slice::from_ref(folder),
        };
        let check = match &self.reference_check {
            CheckPlan::File(path) => Some(path),
            _ => None,
        };
        references.iter().chain(check).map(PathBuf::as_path)
    }

    /// Completes `options`; `references` are images, or the folder of another study.
    ///
    /// # Errors
    /// [`Error::Usage`] names the option, what was expected and what was found.
    pub fn new(
        scenes: Vec<PathBuf>,
        description: Description,
        options: Options,
        references: Vec<PathBuf>,
    ) -> Result<Self> {
        if scenes.is_empty() {
            return Err(Error::usage("no scene: name scene files (.toml) or a study file"));
        }
        let contenders = options.samplers.unwrap_or_else(default_contenders);
        if contenders.is_empty() {
            return Err(Error::usage("--samplers: expected at least one sampler"));
        }
        let overhead = options.overhead.unwrap_or(false);
        let mut spp = options.spp.unwrap_or_else(|| {
            if options.time.is_none() && !overhead { vec![DEFAULT_SPP] } else { Vec::new() }
        });
        spp.sort_unstable();
        spp.dedup();
        let range = |what: &str, value: u32, low: u32, high: u32| {
            if (low..=high).contains(&value) {
                return Ok(value);
            }
            Err(Error::usage(format!("{what}: expected {low} to {high}, found {value}")))
        };
        for &count in &spp {
            range("--spp", count, 1, 1 << 24)?;
        }
        let seeds = range("--seeds", options.seeds.unwrap_or(3), 1, 1000)?;
        let rays = options.shadow_rays.map(|rays| range("--shadow-rays", rays, 1, 4096));
        let shadow_rays = rays.transpose()?;
        let depth = range("--depth", options.depth.unwrap_or(DEFAULT_DEPTH), 1, 64)?;
        let largest = spp.last().copied().unwrap_or(0);
        let reference_spp = options.reference_spp.unwrap_or_else(|| {
            largest.saturating_mul(REFERENCE_FACTOR).clamp(LEAST_REFERENCE_SPP, 1 << 26)
        });
        range("--reference-spp", reference_spp, 2, 1 << 26)?;
        let reference = match &references[..] {
            [] => ReferencePlan::Render {
                contender: options
                    .reference_sampler
                    .unwrap_or_else(|| Contender::plain(Sampler::Mis)),
                half_spp: reference_spp.div_ceil(2),
            },
            [folder] if folder.is_dir() => ReferencePlan::Study(folder.clone()),
            [_] | [_, _] if scenes.len() == 1 => ReferencePlan::Files(references),
            [_] | [_, _] => {
                return Err(Error::usage(format!(
                    "--reference {}: an image serves one scene, found {} scenes; give the report \
                     folder of another study instead",
                    references[0].display(),
                    scenes.len()
                )));
            }
            _ => {
                return Err(Error::usage(format!(
                    "--reference: expected one image, two independent halves or a report folder, \
                     found {} paths",
                    references.len()
                )));
            }
        };
        let reference_check = options.reference_check.unwrap_or(CheckPlan::Default);
        if let (CheckPlan::File(path), true) = (&reference_check, scenes.len() > 1) {
            return Err(Error::usage(format!(
                "--reference-check {}: an image serves one scene, found {} scenes; name a sampler",
                path.display(),
                scenes.len()
            )));
        }
        let overhead = if overhead {
            let baseline = options.overhead_baseline.unwrap_or_else(|| contenders[0].clone());
            let others: Vec<Contender> =
                contenders.iter().filter(|other| other.label != baseline.label).cloned().collect();
            if others.is_empty() {
                return Err(Error::usage(format!(
                    "--overhead: expected a sampler besides the baseline {}; name more with \
                     --samplers",
                    baseline.label
                )));
            }
            Some(OverheadPlan {
                baseline,
                contenders: others,
                spp: range("overhead spp", options.overhead_spp.unwrap_or(16), 1, 1 << 16)?,
                repetitions: range(
                    "--repetitions",
                    options.overhead_repetitions.unwrap_or(15),
                    2,
                    1000,
                )?,
            })
        } else {
            None
        };
        let plan = Self {
            description,
            scenes,
            size: options.size,
            contenders,
            spp,
            time: options.time,
            seeds,
            shadow_rays,
            depth,
            reference,
            reference_check,
            overhead,
        };
        if !plan.compares() && plan.overhead.is_none() {
            return Err(Error::usage(
                "nothing to do: give --spp, --time or --overhead, here or in the study file",
            ));
        }
        Ok(plan)
    }

    /// Rules that samplers are compared by: the numbers of samples, ascending, then the time.
    pub(crate) fn rules(&self) -> Vec<Rule> {
        self.spp.iter().copied().map(Rule::Spp).chain(self.time.map(Rule::time)).collect()
    }

    /// True if errors are compared, which needs a reference.
    pub(crate) fn compares(&self) -> bool {
        !self.spp.is_empty() || self.time.is_some()
    }

    /// Says before the work that verdicts will be missing. After n samples a sampler as good as that of the
    /// reference, which has N, has √(N/n) times its error, and what is too close to it is not judged. `None`
    /// where verdicts will come out, and where nothing is known of the reference.
    pub(crate) fn missing_verdicts(&self) -> Option<String> {
        let ReferencePlan::Render { contender, half_spp } = &self.reference else { return None };
        let largest = *self.spp.last()?;
        let needed = (JUDGED_FROM * f64::from(largest)).ceil();
        let given = 2.0 * f64::from(*half_spp);
        (given < needed).then(|| {
            format!(
                "--reference-spp {given}: no sampler as good as {} will be judged at {largest} samples; \
                 expected {needed} or more",
                contender.label
            )
        })
    }

    /// Lists every run of a scene in order of execution: by rule (the largest number of samples, then the
    /// time), seed and sampler. The samplers rotate by one from seed to seed, so that none is always first.
    pub(crate) fn tasks(&self) -> Vec<(Rule, u32, &Contender)> {
        let samples = self.spp.last().copied().map(Rule::Spp);
        let contenders = &self.contenders;
        let mut tasks = Vec::new();
        for rule in samples.into_iter().chain(self.time.map(Rule::time)) {
            for seed in 1..=self.seeds {
                let (last, first) = contenders.split_at((seed as usize - 1) % contenders.len());
                tasks.extend(first.iter().chain(last).map(|contender| (rule, seed, contender)));
            }
        }
        tasks
    }
}

/// Every sampler that combines BRDF and environment; `portal` needs scenes made for it.
fn default_contenders() -> Vec<Contender> {
    let left_out =
        [Sampler::Uniform, Sampler::Cosine, Sampler::Brdf, Sampler::Env, Sampler::Portal];
    let others = Sampler::ALL.iter().filter(|sampler| !left_out.contains(sampler));
    others.copied().map(Contender::plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(options: Options) -> Result<Plan> {
        Plan::new(vec!["room.toml".into()], Description::default(), options, Vec::new())
    }

    #[test]
    fn defaults_make_a_whole_plan() {
        let plan = plan(Options::default()).unwrap();
        assert_eq!(
            (&plan.spp[..], plan.seeds, plan.shadow_rays, plan.depth),
            (&[64][..], 3, None, 8)
        );
        assert!(plan.contenders.iter().any(|contender| contender.label == "mis"));
        assert!(plan.compares() && plan.overhead.is_none());
        let ReferencePlan::Render { contender, half_spp } = plan.reference else { unreachable!() };
        assert_eq!((contender.label.as_str(), half_spp), ("mis", 512));
    }

    #[test]
    fn levels_are_sorted() {
        let options = Options { spp: Some(vec![400, 200, 400]), ..Options::default() };
        let plan = plan(options).unwrap();
        assert_eq!(plan.spp, [200, 400]);
        assert!(matches!(plan.reference, ReferencePlan::Render { half_spp: 3200, .. }));
    }

    #[test]
    fn halves_hold_the_samples_asked_for() {
        let plan = plan(Options { reference_spp: Some(2049), ..Options::default() }).unwrap();
        assert!(matches!(plan.reference, ReferencePlan::Render { half_spp: 1025, .. }));
    }

    #[test]
    fn a_reference_too_short_for_verdicts_is_named() {
        let missing = |reference_spp, spp| {
            let spp = Some(vec![8, spp]);
            plan(Options { reference_spp, spp, ..Options::default() }).unwrap().missing_verdicts()
        };
        assert_eq!(
            (missing(None, 64), missing(Some(256), 64), missing(Some(96), 24)),
            (None, None, None)
        );
        let expected = "--reference-spp 96: no sampler as good as mis will be judged at 64 samples; \
                        expected 256 or more";
        assert_eq!(missing(Some(96), 64).as_deref(), Some(expected));
    }

    #[test]
    fn what_cannot_be_done_is_refused() {
        let none = Options { spp: Some(Vec::new()), ..Options::default() };
        assert!(plan(none).unwrap_err().to_string().contains("nothing to do"));
        let reference_check = Some(CheckPlan::File("a.exr".into()));
        let options = Options { reference_check, ..Options::default() };
        for (options, references, part) in [
            (Options::default(), vec!["a.exr".into()], "an image serves one scene"),
            (options, Vec::new(), "name a sampler"),
        ] {
            let scenes = vec!["a.toml".into(), "b.toml".into()];
            let error = Plan::new(scenes, Description::default(), options, references).unwrap_err();
            assert!(error.to_string().contains(part), "{error}");
        }
    }

    #[test]
    fn a_check_shares_little_with_the_reference() {
        let label = |plan: &CheckPlan, sampler| plan.contender(sampler).map(|other| other.label);
        assert_eq!(label(&CheckPlan::Default, Some("guided")).as_deref(), Some("mis"));
        assert_eq!(label(&CheckPlan::Default, Some("mis")).as_deref(), Some("env"));
        assert_eq!(label(&CheckPlan::Default, None).as_deref(), Some("mis"));
        assert_eq!(label(&CheckPlan::Off, Some("mis")), None);
        let parse = |text| CheckPlan::parse(text, Path::new("studies"), Parameters::default());
        assert_eq!(parse("a.exr").unwrap(), CheckPlan::File("studies/a.exr".into()));
        assert_eq!(label(&parse("cosine").unwrap(), None).as_deref(), Some("cosine"));
        assert!(parse("best").is_err());
    }
}
