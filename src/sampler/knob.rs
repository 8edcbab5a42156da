//! Parameters that `--set key=value` sets: a room declares each in one place, by `parameters!`.

use std::{collections::BTreeMap, fmt::Display, ops::RangeInclusive, str::FromStr};

use crate::error::{Error, Result};

/// Names of the values of switches.
pub const ON_OR_OFF: &[(&str, bool)] = &[("on", true), ("off", false)];

pub struct Knob<P> {
    /// Key of `--set`, also in metadata and statistics.
    pub key: &'static str,
    /// Meaning, as its documentation tells it after the key.
    pub about: &'static str,
    /// Sets the value, or fails with a description of the expected one.
    pub set: fn(&mut P, &str) -> Result<(), String>,
    pub get: fn(&P) -> String,
}

/// Parameters that a table of knobs sets.
pub trait Knobs: Clone + Sized + 'static {
    const KNOBS: &'static [Knob<Self>];

    /// Sets a parameter; returns false for an unknown key, [`Error::Usage`] for a value out of range.
    fn set_knob(&mut self, key: &str, value: &str) -> Result<bool> {
        let Some(knob) = Self::KNOBS.iter().find(|knob| knob.key == key) else { return Ok(false) };
        let refused = |expected| Error::usage(format!("--set {key}={value}: expected {expected}"));
        (knob.set)(self, value).map_err(refused)?;
        Ok(true)
    }

    /// Lists key, expected values, default and meaning of every parameter for `--set help`.
    fn help(&self) -> String {
        // A value that none takes makes each say what it expects.
        let expected =
            |knob: &Knob<Self>| (knob.set)(&mut self.clone(), "?").err().unwrap_or_default();
        let entry = |knob: &Knob<Self>| {
            let (_, about) = knob.about.split_once("`: ").unwrap_or_default();
            let default = match (knob.get)(self).as_str() {
                "" => String::new(),
                default => format!("; default {default}"),
            };
            format!("  {}={}{default}\n      {about}\n", knob.key, expected(knob))
        };
        Self::KNOBS.iter().map(entry).collect()
    }

    fn describe(&self) -> BTreeMap<String, String> {
        Self::KNOBS.iter().map(|knob| (knob.key.to_owned(), (knob.get)(self))).collect()
    }
}

/// Values that a parameter may have, as text: a range, a table of names, [`Auto`].
pub trait Values<T> {
    /// Parses a value, or returns a description of the expected ones.
    fn parse(&self, text: &str) -> Result<T, String>;
    fn text(&self, value: &T) -> String;
}

impl<T: FromStr + PartialOrd + Display> Values<T> for RangeInclusive<T> {
    fn parse(&self, text: &str) -> Result<T, String> {
        let parsed = text.parse().ok().filter(|number| self.contains(number));
        parsed.ok_or_else(|| format!("{} to {}", self.start(), self.end()))
    }

    fn text(&self, value: &T) -> String {
        value.to_string()
    }
}

impl<T: Copy + PartialEq> Values<T> for &[(&str, T)] {
    fn parse(&self, text: &str) -> Result<T, String> {
        let found = self.iter().find(|(name, _)| *name == text);
        let known = || self.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(" or ");
        found.map(|(_, value)| *value).ok_or_else(known)
    }

    fn text(&self, value: &T) -> String {
        let found = self.iter().find(|(_, named)| named == value);
        found.map_or_else(String::new, |(name, _)| (*name).to_owned())
    }
}

/// A number within the range, or `auto` for `None`.
pub struct Auto(pub RangeInclusive<u32>);

impl Values<Option<u32>> for Auto {
    fn parse(&self, text: &str) -> Result<Option<u32>, String> {
        if text == "auto" {
            return Ok(None);
        }
        self.0.parse(text).map(Some).map_err(|expected| format!("auto, or {expected}"))
    }

    fn text(&self, value: &Option<u32>) -> String {
        value.map_or("auto".to_owned(), |number| number.to_string())
    }
}

/// Declares a struct of parameters with their keys, defaults and [`Values`].
macro_rules! parameters {
    ($(#[$doc:meta])* pub struct $name:ident {
        $($(#[doc = $about:literal])* $key:literal $field:ident: $kind:ty = $default:expr, $values:expr;)*
    }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name {
            $($(#[doc = $about])* pub $field: $kind,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl $crate::sampler::knob::Knobs for $name {
            const KNOBS: &'static [$crate::sampler::knob::Knob<Self>] = &[
                $($crate::sampler::knob::Knob {
                    key: $key,
                    about: concat!($($about),*),
                    set: |own, text| {
                        own.$field = $crate::sampler::knob::Values::parse(&$values, text)?;
                        Ok(())
                    },
                    get: |own| $crate::sampler::knob::Values::text(&$values, &own.$field),
                },)*
            ];
        }
    };
}
pub(super) use parameters;
