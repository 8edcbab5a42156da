//! The samplers by name, their parameters, and how `--set key=value` reaches them.

use std::collections::BTreeMap;

use crate::{
    error::{Error, Result},
    gpu::constants,
};

/// How directions are chosen at a hit. All are unbiased and trace one shadow ray per direction.
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
}

impl Sampler {
    /// Every sampler, simplest first.
    pub const ALL: [Self; 6] =
        [Self::Uniform, Self::Cosine, Self::Brdf, Self::Env, Self::Mis, Self::Ris];

    /// Name on the command line, in files and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Cosine => "cosine",
            Self::Brdf => "brdf",
            Self::Env => "env",
            Self::Mis => "mis",
            Self::Ris => "ris",
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
        }
    }
}

/// Parameters of the samplers, set by `--set key=value`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameters {
    /// `candidates`: directions that `ris` chooses each shadow ray from, half from the BRDF and half
    /// from the environment; 2, 4, 6 or 8.
    pub candidates: u32,
}

impl Default for Parameters {
    fn default() -> Self {
        Self { candidates: 4 }
    }
}

impl Parameters {
    const KEYS: [&'static str; 1] = ["candidates"];

    /// Sets one parameter from `key=value`.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown key, which lists the known ones, or a value out of range.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        let (key, value) = assignment.split_once('=').ok_or_else(|| {
            Error::usage(format!("--set {assignment}: expected key=value, found no '='"))
        })?;
        match key {
            "candidates" => {
                self.candidates = value
                    .parse()
                    .ok()
                    .filter(|count: &u32| (2..=8).contains(count) && count.is_multiple_of(2))
                    .ok_or_else(|| {
                        Error::usage(format!(
                            "--set candidates={value}: expected 2, 4, 6 or 8 (half from the BRDF, \
                             half from the environment)"
                        ))
                    })?;
            }
            _ => {
                return Err(Error::usage(format!(
                    "--set {key}: unknown parameter; known: {}",
                    Self::KEYS.join(", ")
                )));
            }
        }
        Ok(())
    }

    /// The parameters that matter to `sampler`, by name, for metadata and statistics.
    pub fn describe(&self, sampler: Sampler) -> BTreeMap<String, String> {
        match sampler {
            Sampler::Ris => {
                BTreeMap::from([("candidates".to_owned(), self.candidates.to_string())])
            }
            _ => BTreeMap::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    #[test]
    fn an_unknown_key_lists_the_known_ones() {
        let error = Parameters::default().set("candidate=4").unwrap_err().to_string();
        assert!(error.contains("candidate:") && error.contains("known: candidates"), "{error}");
    }

    #[test]
    fn values_out_of_range_are_refused() {
        for value in ["candidates=0", "candidates=3", "candidates=10", "candidates=x", "candidates"]
        {
            assert!(Parameters::default().set(value).is_err(), "{value}");
        }
        let mut parameters = Parameters::default();
        parameters.set("candidates=8").unwrap();
        assert_eq!(parameters.candidates, 8);
    }

    #[test]
    fn names_are_those_of_the_command_line() {
        for sampler in Sampler::ALL {
            let value = clap::ValueEnum::to_possible_value(&sampler).unwrap();
            assert_eq!(value.get_name(), sampler.name());
        }
    }
}
