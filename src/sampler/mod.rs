//! The samplers by name, their parameters, and how `--set key=value` reaches them.

pub mod guided;
pub mod product;

use std::collections::BTreeMap;

use crate::{
    error::{Error, Result},
    shader::constants,
};

pub use guided::cost::{
    CandidateCost, GUIDED_CANDIDATES, Spread, choose, climb, is_most_a_clear_loss,
    relative_variances, upper_median,
};
pub use product::parameters::{CacheScope, Elevation, LobeOrder, LobeParameters, Threshold};

/// How directions are chosen at a hit. All are unbiased, but for [`Elevation::Metropolis`], and trace
/// one shadow ray per direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, clap::ValueEnum)]
pub enum Sampler {
    /// Uniform over the hemisphere.
    Uniform,
    /// Proportional to the cosine.
    Cosine,
    /// The BRDF's own sampling.
    Brdf,
    /// Proportional to the luminance of the environment map.
    Env,
    /// `brdf` and `env` by turns with the one-sample balance heuristic (Veach & Guibas 1995).
    Mis,
    /// Resampled importance sampling over candidates of `mis` (Burke et al. 2005; Talbot et al.
    /// 2005).
    Ris,
    /// Lobes of the product of environment and BRDF (Tsai et al. 2008).
    Product,
    /// `product`, with less weight on lobes near directions that turned out blocked (Wu & Shih 2009).
    Visibility,
    /// Regions of the environment by visibility that was learned in cells of the scene, across
    /// pixels and passes.
    Guided,
}

impl Sampler {
    /// Every sampler, simplest first.
    pub const ALL: [Self; 9] = [
        Self::Uniform,
        Self::Cosine,
        Self::Brdf,
        Self::Env,
        Self::Mis,
        Self::Ris,
        Self::Product,
        Self::Visibility,
        Self::Guided,
    ];

    /// Name on the command line, in files and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Cosine => "cosine",
            Self::Brdf => "brdf",
            Self::Env => "env",
            Self::Mis => "mis",
            Self::Ris => "ris",
            Self::Product => "product",
            Self::Visibility => "visibility",
            Self::Guided => "guided",
        }
    }

    /// Tag in the shaders.
    pub fn tag(self) -> u32 {
        match self {
            Self::Uniform => constants::SAMPLER_UNIFORM,
            Self::Cosine => constants::SAMPLER_COSINE,
            Self::Brdf => constants::SAMPLER_BRDF,
            Self::Env => constants::SAMPLER_ENV,
            Self::Mis => constants::SAMPLER_MIS,
            Self::Ris => constants::SAMPLER_RIS,
            Self::Product => constants::SAMPLER_PRODUCT,
            Self::Visibility => constants::SAMPLER_VISIBILITY,
            Self::Guided => constants::SAMPLER_GUIDED,
        }
    }

    /// Whether the sampler needs fits of environment and materials.
    pub fn uses_lobes(self) -> bool {
        matches!(self, Self::Product | Self::Visibility)
    }
}

/// What `guided` weights the regions of the environment with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weights {
    /// What the cell has learned: energy × visibility.
    Cell,
    /// That times BRDF × cosine at the hit, for the likeliest regions.
    Product,
}

/// Parameters of the samplers, set by `--set key=value`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// `bounce-candidates`: directions from the BRDF that each bounce of `guided` is chosen from by the light
    /// that cells have learned to arrive from there, 1 to 16; 1 learns and chooses nothing.
    pub bounce_candidates: u32,
    /// `candidates`: directions that each shadow ray is chosen from; `None` is `auto`. `ris` takes 2,
    /// 4, 6 or 8 (auto 4), half from the BRDF and half from the environment; `guided` takes 1, 4 or 8
    /// (auto by measured cost), a quarter from the BRDF.
    pub candidates: Option<u32>,
    /// `guide-memory`: most bytes for the cells of `guided`.
    pub guide_memory: u64,
    /// `hierarchy`: whether cells of `guided` that have seen little lean on larger ones; off for
    /// experiments.
    pub hierarchy: bool,
    /// `later-rays`: most shadow rays of `guided` at each vertex that the camera does not see; `None` is
    /// `auto`, half of `--shadow-rays`.
    pub later_rays: Option<u32>,
    /// `learned-response`: whether `guided` with `weights=cell` learns how the surfaces of a cell
    /// reflect each region; off for experiments.
    pub learned_response: bool,
    /// `learned-share`: whether `guided` with one candidate learns the share of rays from the BRDF; off
    /// for experiments.
    pub learned_share: bool,
    /// `regions`: most regions of the environment for `guided`, 16 to 1024; it starts with 256.
    pub regions: u32,
    /// `weights`: what `guided` weights the regions with.
    pub weights: Weights,
    /// Those of `product` and `visibility`.
    pub lobes: LobeParameters,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            bounce_candidates: 4,
            candidates: None,
            guide_memory: 128 << 20,
            hierarchy: true,
            later_rays: None,
            learned_response: true,
            learned_share: true,
            regions: 1024,
            weights: Weights::Cell,
            lobes: LobeParameters::default(),
        }
    }
}

impl Parameters {
    const KEYS: [&'static str; 9] = [
        "bounce-candidates",
        "candidates",
        "guide-memory",
        "hierarchy",
        "later-rays",
        "learned-response",
        "learned-share",
        "regions",
        "weights",
    ];

    /// Sets one parameter from `key=value`.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown key, which lists the known ones, or a value out of range.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        let (key, value) = assignment.split_once('=').ok_or_else(|| {
            Error::usage(format!("--set {assignment}: expected key=value, found no '='"))
        })?;
        match key {
            "bounce-candidates" => {
                let count = value.parse().ok().filter(|count| (1..=16).contains(count));
                self.bounce_candidates = count.ok_or_else(|| {
                    Error::usage(format!("--set bounce-candidates={value}: expected 1 to 16"))
                })?;
            }
            "candidates" => {
                self.candidates = if value == "auto" {
                    None
                } else {
                    let count =
                        value.parse().ok().filter(|count| matches!(count, 1 | 2 | 4 | 6 | 8));
                    Some(count.ok_or_else(|| {
                        Error::usage(format!(
                            "--set candidates={value}: expected auto, 2, 4, 6 or 8 for ris, auto, 1, \
                             4 or 8 for guided"
                        ))
                    })?)
                };
            }
            "guide-memory" => {
                self.guide_memory = parse_bytes(value)
                    .filter(|bytes| (1 << 20..=1 << 40).contains(bytes))
                    .ok_or_else(|| {
                        Error::usage(format!(
                            "--set guide-memory={value}: expected 1MiB or more, as in 128MiB"
                        ))
                    })?;
            }
            "hierarchy" => self.hierarchy = parse_switch(key, value)?,
            "later-rays" => {
                self.later_rays = if value == "auto" {
                    None
                } else {
                    let count = value.parse().ok().filter(|count| (1..=4096).contains(count));
                    Some(count.ok_or_else(|| {
                        Error::usage(format!(
                            "--set later-rays={value}: expected auto, or 1 to 4096"
                        ))
                    })?)
                };
            }
            "learned-response" => self.learned_response = parse_switch(key, value)?,
            "learned-share" => self.learned_share = parse_switch(key, value)?,
            "regions" => {
                self.regions =
                    value.parse().ok().filter(|count| (16..=1024).contains(count)).ok_or_else(
                        || Error::usage(format!("--set regions={value}: expected 16 to 1024")),
                    )?;
            }
            "weights" => {
                self.weights = match value {
                    "cell" => Weights::Cell,
                    "product" => Weights::Product,
                    _ => {
                        return Err(Error::usage(format!(
                            "--set weights={value}: expected cell or product"
                        )));
                    }
                };
            }
            _ if self.lobes.set(key, value)? => {}
            _ => {
                let known: Vec<&str> =
                    Self::KEYS.iter().chain(&LobeParameters::KEYS).copied().collect();
                return Err(Error::usage(format!(
                    "--set {key}: unknown parameter; known: {}",
                    known.join(", ")
                )));
            }
        }
        Ok(())
    }

    /// Candidates per shadow ray that `sampler` begins with, 1 where it does not resample.
    ///
    /// # Errors
    /// [`Error::Usage`] where the sampler cannot take as many as were asked for.
    pub fn candidates_of(&self, sampler: Sampler) -> Result<u32> {
        let (allowed, auto): (&[u32], u32) = match sampler {
            Sampler::Ris => (&[2, 4, 6, 8], 4),
            // Until it is measured whether more are worth their time.
            Sampler::Guided => (&GUIDED_CANDIDATES, GUIDED_CANDIDATES[0]),
            _ => return Ok(1),
        };
        let count = self.candidates.unwrap_or(auto);
        if allowed.contains(&count) {
            return Ok(count);
        }
        Err(Error::usage(format!(
            "--set candidates={count}: {} takes auto or one of {allowed:?}",
            sampler.name()
        )))
    }

    /// Of `shadow_rays` at what the camera sees, how many `guided` traces at each later vertex, where less
    /// of the error comes from and every ray costs as much (docs/guided.md).
    pub fn later_rays_of(&self, shadow_rays: u32) -> u32 {
        self.later_rays.unwrap_or((shadow_rays / 2).max(1)).min(shadow_rays)
    }

    /// Whether `guided` guides the bounces of paths of `depth` vertices.
    pub fn guides_bounces(&self, depth: u32) -> bool {
        depth > 1 && self.bounce_candidates > 1
    }

    /// The parameters that matter to `sampler`, by name, for metadata and statistics.
    pub fn describe(&self, sampler: Sampler) -> BTreeMap<String, String> {
        match sampler {
            Sampler::Ris | Sampler::Guided => {
                let auto = if sampler == Sampler::Ris { "4" } else { "auto" };
                let count = self.candidates.map_or(auto.to_owned(), |count| count.to_string());
                let mut named = BTreeMap::from([("candidates".to_owned(), count)]);
                if sampler == Sampler::Guided {
                    let bounce = self.bounce_candidates.to_string();
                    named.insert("bounce-candidates".to_owned(), bounce);
                    named.insert("regions".to_owned(), self.regions.to_string());
                    let switch = |is_on: bool| if is_on { "on" } else { "off" }.to_owned();
                    named.insert("hierarchy".to_owned(), switch(self.hierarchy));
                    let later = self.later_rays.map_or("auto".to_owned(), |rays| rays.to_string());
                    named.insert("later-rays".to_owned(), later);
                    named.insert("learned-response".to_owned(), switch(self.learned_response));
                    named.insert("learned-share".to_owned(), switch(self.learned_share));
                    let weights = if self.weights == Weights::Cell { "cell" } else { "product" };
                    named.insert("weights".to_owned(), weights.to_owned());
                    named.insert("guide-memory".to_owned(), self.guide_memory.to_string());
                }
                named
            }
            Sampler::Product | Sampler::Visibility => {
                self.lobes.describe(sampler == Sampler::Visibility)
            }
            _ => BTreeMap::new(),
        }
    }
}

fn parse_switch(key: &str, value: &str) -> Result<bool> {
    match value {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err(Error::usage(format!("--set {key}={value}: expected on or off"))),
    }
}

/// Bytes from a number with an optional unit: B, KiB, MiB, GiB.
fn parse_bytes(text: &str) -> Option<u64> {
    let digits = text.len() - text.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let number: u64 = text[..digits].parse().ok()?;
    let shift = match &text[digits..] {
        "" | "B" => 0,
        "KiB" => 10,
        "MiB" => 20,
        "GiB" => 30,
        _ => return None,
    };
    number.checked_mul(1 << shift)
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    #[test]
    fn an_unknown_key_lists_the_known_ones() {
        let error = Parameters::default().set("candidate=4").unwrap_err().to_string();
        assert!(
            error.contains("candidate:") && error.contains("known: bounce-candidates"),
            "{error}"
        );
    }

    #[test]
    fn values_out_of_range_are_refused() {
        for value in ["candidates=0", "candidates=3", "candidates=10", "candidates=x", "candidates"]
        {
            assert!(Parameters::default().set(value).is_err(), "{value}");
        }
        let mut parameters = Parameters::default();
        parameters.set("candidates=8").unwrap();
        assert_eq!(parameters.candidates, Some(8));
        assert_eq!(parameters.candidates_of(Sampler::Ris).unwrap(), 8);
        assert_eq!(parameters.candidates_of(Sampler::Mis).unwrap(), 1);
        parameters.set("candidates=1").unwrap();
        let error = parameters.candidates_of(Sampler::Ris).unwrap_err().to_string();
        assert!(error.contains("[2, 4, 6, 8]"), "{error}");
        parameters.set("candidates=auto").unwrap();
        assert_eq!(parameters.candidates_of(Sampler::Guided).unwrap(), 1);
        parameters.set("guide-memory=16MiB").unwrap();
        assert_eq!(parameters.guide_memory, 16 << 20);
        for wrong in [
            "guide-memory=1",
            "guide-memory=x",
            "guide-memory=4TB",
            "regions=2000",
            "hierarchy=1",
            "bounce-candidates=0",
            "bounce-candidates=17",
            "later-rays=0",
            "later-rays=x",
            "weights=brdf",
        ] {
            assert!(parameters.set(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn later_vertices_have_half_of_the_rays_unless_told_otherwise() {
        let mut parameters = Parameters::default();
        assert_eq!([0, 1, 2, 5, 16].map(|rays| parameters.later_rays_of(rays)), [0, 1, 1, 2, 8]);
        parameters.set("later-rays=3").unwrap();
        assert_eq!([0, 2, 5].map(|rays| parameters.later_rays_of(rays)), [0, 2, 3]);
        assert_eq!(parameters.describe(Sampler::Guided)["later-rays"], "3");
        parameters.set("later-rays=auto").unwrap();
        assert_eq!(parameters.later_rays_of(5), 2);
        assert!(parameters.guides_bounces(2) && !parameters.guides_bounces(1));
        parameters.set("bounce-candidates=1").unwrap();
        assert!(!parameters.guides_bounces(2));
        assert_eq!(parameters.describe(Sampler::Guided)["bounce-candidates"], "1");
    }

    #[test]
    fn names_are_those_of_the_command_line() {
        for sampler in Sampler::ALL {
            let value = clap::ValueEnum::to_possible_value(&sampler).unwrap();
            assert_eq!(value.get_name(), sampler.name());
        }
    }
}
