//! Contenders of a study: samplers with their parameters.

use std::collections::BTreeMap;

use crate::{
    error::{Error, Result},
    sampler::{Parameters, Sampler},
};

/// A sampler with parameters, written `ris` or `ris:candidates=8` (more parameters after further colons).
#[derive(Clone, Debug, PartialEq)]
pub struct Contender {
    /// Text it was parsed from; names it in tables and files.
    pub label: String,
    /// Sampler that chooses directions.
    pub sampler: Sampler,
    /// Its parameters.
    pub parameters: Parameters,
}

impl Contender {
    /// Returns `sampler` with default parameters.
    pub(crate) fn plain(sampler: Sampler) -> Self {
        Self { label: sampler.name().to_owned(), sampler, parameters: Parameters::default() }
    }

    /// Parses `name` or `name:key=value:…`; the parameters start from `defaults`.
    ///
    /// # Errors
    /// [`Error::Usage`] lists the known samplers or parameters.
    pub fn parse(text: &str, defaults: Parameters) -> Result<Self> {
        let label = text.trim();
        let mut parts = label.split(':');
        let name = parts.next().unwrap_or_default();
        let Some(&sampler) = Sampler::ALL.iter().find(|sampler| sampler.name() == name) else {
            let known: Vec<_> = Sampler::ALL.iter().map(|sampler| sampler.name()).collect();
            let known = known.join(", ");
            return Err(Error::usage(format!("there is no sampler {name:?}; known: {known}")));
        };
        let mut parameters = defaults;
        parts.try_for_each(|assignment| parameters.set(assignment))?;
        sampler.check(&parameters, 1, &[])?;
        Ok(Self { label: label.to_owned(), sampler, parameters })
    }

    /// Parses a list without repeated labels. Fails for labels that occur twice or would share file names.
    pub(crate) fn parse_all(texts: &[impl AsRef<str>], defaults: Parameters) -> Result<Vec<Self>> {
        let mut contenders: Vec<Self> = Vec::new();
        for text in texts {
            let contender = Self::parse(text.as_ref(), defaults)?;
            if contenders.iter().any(|other| other.file_stem() == contender.file_stem()) {
                return Err(Error::usage(format!("sampler {:?} is listed twice", contender.label)));
            }
            contenders.push(contender);
        }
        Ok(contenders)
    }

    /// Returns the label for file names; hyphens replace all but letters, digits and underscores.
    pub(crate) fn file_stem(&self) -> String {
        let keep = |character: char| character.is_ascii_alphanumeric() || character == '_';
        self.label.chars().map(|c| if keep(c) { c } else { '-' }).collect()
    }

    /// Returns the parameters that the sampler uses, by name.
    pub(crate) fn describe_parameters(&self) -> BTreeMap<String, String> {
        self.sampler.describe(&self.parameters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_follow_colons() {
        let contender = Contender::parse("ris:candidates=8", Parameters::default()).unwrap();
        assert_eq!((contender.sampler, contender.parameters.candidates), (Sampler::Ris, Some(8)));
        assert_eq!(contender.file_stem(), "ris-candidates-8");
        let plain = Contender::parse("ris", contender.parameters).unwrap();
        assert_eq!(plain.parameters.candidates, Some(8), "defaults are kept");
    }

    #[test]
    fn parameters_suit_their_sampler() {
        let refused = Contender::parse("ris:candidates=1", Parameters::default()).unwrap_err();
        assert!(refused.to_string().contains("candidates"), "{refused}");
    }
}
