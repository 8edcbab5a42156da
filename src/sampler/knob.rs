//! Parameters that `--set key=value` sets, one table row each; `Parameters` goes through the tables.

use std::{collections::BTreeMap, fmt::Display, ops::RangeInclusive, str::FromStr};

use crate::error::{Error, Result};

/// Names of the values of switches.
pub const ON_OR_OFF: &[(&str, bool)] = &[("on", true), ("off", false)];

/// A parameter of `P`.
pub struct Knob<P> {
    /// Key of `--set`, also in metadata and statistics.
    pub key: &'static str,
    /// Sets the value, or fails with a description of the expected one.
    pub set: fn(&mut P, &str) -> Result<(), String>,
    /// Returns the value as text.
    pub get: fn(&P) -> String,
}

/// Sets a parameter; returns false for an unknown key, [`Error::Usage`] for a value out of range.
pub fn set<P>(knobs: &[Knob<P>], parameters: &mut P, key: &str, value: &str) -> Result<bool> {
    let Some(knob) = knobs.iter().find(|knob| knob.key == key) else { return Ok(false) };
    (knob.set)(parameters, value)
        .map_err(|expected| Error::usage(format!("--set {key}={value}: expected {expected}")))?;
    Ok(true)
}

/// Returns the parameters of a table by key.
pub fn describe<P>(knobs: &[Knob<P>], parameters: &P) -> BTreeMap<String, String> {
    knobs.iter().map(|knob| (knob.key.to_owned(), (knob.get)(parameters))).collect()
}

/// Parses a number within a range.
pub fn number<T: FromStr + PartialOrd + Display>(
    target: &mut T,
    value: &str,
    range: RangeInclusive<T>,
) -> Result<(), String> {
    let parsed = value.parse().ok().filter(|number| range.contains(number));
    *target = parsed.ok_or_else(|| format!("{} to {}", range.start(), range.end()))?;
    Ok(())
}

/// Parses `auto` as `None`, or a number within a range.
pub fn number_or_auto(
    target: &mut Option<u32>,
    value: &str,
    range: RangeInclusive<u32>,
) -> Result<(), String> {
    if value == "auto" {
        *target = None;
        return Ok(());
    }
    let mut count = 0;
    number(&mut count, value, range).map_err(|expected| format!("auto, or {expected}"))?;
    *target = Some(count);
    Ok(())
}

/// Returns `auto` for `None`, else the number.
pub fn text_or_auto(value: Option<u32>) -> String {
    value.map_or("auto".to_owned(), |number| number.to_string())
}

/// Parses one of the named values.
pub fn choice<T: Copy>(target: &mut T, value: &str, names: &[(&str, T)]) -> Result<(), String> {
    let found = names.iter().find(|(name, _)| *name == value);
    let known = || names.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(" or ");
    *target = found.map(|(_, choice)| *choice).ok_or_else(known)?;
    Ok(())
}

/// Returns the name of a value.
pub fn name_of<T: PartialEq>(value: &T, names: &[(&str, T)]) -> String {
    let found = names.iter().find(|(_, choice)| choice == value);
    found.map_or_else(String::new, |(name, _)| (*name).to_owned())
}
