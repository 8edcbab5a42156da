//! Parameters of all samplers, set by `--set key=value`.

use super::{
    knob::{Auto, Knob, Knobs, ON_OR_OFF, Values},
    product::ProductParameters,
    visibility::VisibilityParameters,
};
use crate::{
    error::{Error, Result},
    shader::rooms::registry,
};

macro_rules! parameters {
    (basic { $($basic:tt)* } rooms {
        $($(#[$doc:meta])* $sampler:ident $name:literal $key:literal = $room:ident $entry:ident
            $parameters:ident;)*
    }) => {
        /// Parameters of the samplers.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Parameters {
            /// `share-paths`: edge of the cohorts whose pixels share second vertices, 1 for `off`. `None` is
            /// `auto`: `guided` measures what it gains, the other samplers do not share.
            pub share_paths: Option<u32>,
            /// `candidates`: directions to choose each shadow ray of `ris`, `control-variates` or `guided`
            /// from; `None` is `auto`.
            pub candidates: Option<u32>,
            /// `compensation`: true if `mis`, `portal` and what `guided` falls back to draw directions of the
            /// environment by its compensated density, and `tiles` compensates what it has learned.
            pub compensation: bool,
            $(#[doc = concat!("Parameters of `", $name, "`.")]
            pub $room: super::$room::$parameters,)*
        }

        impl Default for Parameters {
            fn default() -> Self {
                Self {
                    share_paths: None,
                    candidates: None,
                    compensation: true,
                    $($room: super::$room::$parameters::default(),)*
                }
            }
        }

        impl Parameters {
            /// Sets a parameter; returns false for an unknown key.
            fn set_any(&mut self, key: &str, value: &str) -> Result<bool> {
                Ok(self.set_knob(key, value)?
                    $(|| self.$room.set_knob(key, value)?)*)
            }

            /// Lists every parameter by the sampler that reads it, with values, default and meaning.
            pub fn help() -> String {
                let defaults = Self::default();
                let mut text = format!("several samplers\n{}", Knobs::help(&defaults));
                $(
                    let own = Knobs::help(&defaults.$room);
                    if !own.is_empty() {
                        text += &format!("\n{}\n{own}", $name);
                    }
                )*
                text
            }

            /// Every key, sorted.
            pub fn keys() -> Vec<&'static str> {
                let mut keys: Vec<_> = Self::KNOBS.iter().map(|knob| knob.key).collect();
                $(keys.extend(super::$room::$parameters::KNOBS.iter().map(|knob| knob.key));)*
                keys.sort_unstable();
                keys
            }
        }
    };
}
registry!(parameters);

/// Parameters shared by several rooms.
impl Knobs for Parameters {
    const KNOBS: &'static [Knob<Self>] = &[
        Knob {
            key: "candidates",
            about: "`candidates`: directions to choose each shadow ray of ris, control-variates or \
                    guided from",
            set: |parameters, value| {
                let expected =
                    "auto, 2, 4, 6 or 8 for ris and control-variates, auto, 1, 4 or 8 for guided";
                let is_known =
                    |count: &Option<u32>| matches!(count, None | Some(1 | 2 | 4 | 6 | 8));
                let candidates = Auto(1..=8).parse(value).ok().filter(is_known);
                parameters.candidates = candidates.ok_or(expected)?;
                Ok(())
            },
            get: |parameters| Auto(1..=8).text(&parameters.candidates),
        },
        Knob {
            key: "compensation",
            about: "`compensation`: on if mis, portal and guided in the open leave the dim part of \
                    the environment to the BRDF",
            set: |parameters, value| {
                parameters.compensation = ON_OR_OFF.parse(value)?;
                Ok(())
            },
            get: |parameters| ON_OR_OFF.text(&parameters.compensation),
        },
        Knob {
            key: "preset",
            about: "`preset`: strict sets all parameters of product and visibility as in the thesis",
            set: |parameters, value| {
                let presets: &[_] = &[
                    ("default", ProductParameters::default()),
                    ("strict", ProductParameters::strict()),
                ];
                let product = presets.parse(value)?;
                let is_preset = presets.iter().any(|(_, preset)| parameters.product == *preset)
                    && parameters.visibility == VisibilityParameters::default();
                if !is_preset {
                    return Err("it ahead of other parameters of product and visibility, all of \
                                which it sets"
                        .into());
                }
                parameters.product = product;
                Ok(())
            },
            get: |_| String::new(),
        },
        Knob {
            key: "share-paths",
            about: "`share-paths`: edge of the squares whose pixels share second vertices; auto \
                    measures what it gains under guided",
            set: |parameters, value| {
                parameters.share_paths = SHARE_PATHS.parse(value)?;
                Ok(())
            },
            get: Self::share_paths_text,
        },
    ];
}

const SHARE_PATHS: &[(&str, Option<u32>)] =
    &[("auto", None), ("off", Some(1)), ("2", Some(2)), ("4", Some(4)), ("8", Some(8))];

impl Parameters {
    /// Returns `share-paths` as text.
    pub fn share_paths_text(&self) -> String {
        SHARE_PATHS.text(&self.share_paths)
    }

    /// Sets one parameter from `key=value`. Returns [`Error::Usage`] for a value out of range, or
    /// for an unknown key, listing the known ones.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        let (key, value) = assignment.split_once('=').ok_or_else(|| {
            Error::usage(format!("--set {assignment}: expected key=value, found no '='"))
        })?;
        if self.set_any(key, value)? {
            return Ok(());
        }
        Err(Error::usage(format!(
            "--set {key}: unknown parameter; known: {}; `--set help` explains them",
            Self::keys().join(", ")
        )))
    }

    /// Returns one of the parameters shared by several rooms as text, by its key.
    pub(super) fn shared(&self, key: &str) -> (String, String) {
        let knob = Self::KNOBS.iter().find(|knob| knob.key == key);
        (key.to_owned(), knob.map_or_else(String::new, |knob| (knob.get)(self)))
    }

    /// Returns the number of candidates; [`Error::Usage`] if one outside `allowed` was requested.
    pub fn candidates_among(&self, sampler: &str, allowed: &[u32], auto: u32) -> Result<u32> {
        let count = self.candidates.unwrap_or(auto);
        if allowed.contains(&count) {
            return Ok(count);
        }
        Err(Error::usage(format!(
            "--set candidates={count}: {sampler} takes auto or one of {allowed:?}"
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::Sampler;

    #[test]
    fn help_explains_every_key() {
        let help = Parameters::help();
        for key in Parameters::keys() {
            let entry = help.split_once(&format!("  {key}=")).map(|(_, rest)| rest);
            let mut lines = entry.map(str::lines).unwrap();
            let (values, about) = (lines.next().unwrap(), lines.next().unwrap().trim());
            assert!(!values.is_empty() && about.len() > 10, "{key}={values}: {about}");
        }
        let regions = "  regions=16 to 1024; default 1024\n      most regions of the environment";
        assert!(help.contains(regions), "{help}");
    }

    #[test]
    fn keys_have_one_spelling() {
        let keys = Parameters::keys();
        assert!(keys.windows(2).all(|pair| pair[0] < pair[1]), "{keys:?}");
        assert!(keys.iter().all(|key| !key.contains('_')), "{keys:?}");
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
        assert_eq!(Sampler::Ris.describe(&parameters)["candidates"], "8");
        Sampler::Ris.check(&parameters, 1, &[]).unwrap();
        Sampler::Mis.check(&parameters, 1, &[]).unwrap();
        parameters.set("candidates=1").unwrap();
        let error = Sampler::Ris.check(&parameters, 1, &[]).unwrap_err().to_string();
        assert!(error.contains("[2, 4, 6, 8]"), "{error}");
        parameters.set("candidates=auto").unwrap();
        assert_eq!(parameters.candidates_among("guided", &[1, 4], 1).unwrap(), 1);
        parameters.set("guide-memory=16MiB").unwrap();
        assert_eq!(parameters.guided.guide_memory, 16 << 20);
    }

    #[test]
    fn a_preset_replaces_no_parameter_that_was_set() {
        let mut parameters = Parameters::default();
        parameters.set("preset=strict").unwrap();
        assert_eq!(parameters.product, ProductParameters::strict());
        parameters.set("preset=default").unwrap();
        assert_eq!(parameters, Parameters::default());
        for assignment in ["order=coefficient", "k=1", "cache=pixel"] {
            let mut parameters = Parameters::default();
            parameters.set(assignment).unwrap();
            let before = parameters;
            let error = parameters.set("preset=strict").unwrap_err().to_string();
            assert!(error.contains("--set preset=strict: expected it ahead of"), "{error}");
            assert_eq!(parameters, before);
        }
    }
}
