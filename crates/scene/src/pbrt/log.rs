//! Report of the reader: parts left out, and files read.

use std::path::{Path, PathBuf};

use super::{parameters::Entity, tokens::Place};
use crate::features::{self, Feature, Ignored};

/// Parts of a scene that are left out, and files read.
pub(super) struct Log<'a> {
    pub main: &'a Path,
    pub ignored: Ignored,
    pub inputs: Vec<PathBuf>,
    /// Warnings of the readers of other files.
    pub warnings: Vec<String>,
}

impl Log<'_> {
    pub(super) fn ignore(&mut self, feature: Feature, place: &Place) {
        self.ignore_named(feature, feature.name, place);
    }

    pub(super) fn ignore_named(&mut self, feature: Feature, name: &str, place: &Place) {
        let main = self.main;
        self.ignored.add_named(feature, name, || place.describe(main));
    }

    /// Counts the parameters of a directive that nothing has asked for.
    pub(super) fn unused(&mut self, entity: &Entity) {
        for parameter in entity.unused() {
            let name = match entity.directive {
                // Their names are the author's own.
                "MakeNamedMaterial" => format!("parameter `{}` of materials", parameter.name),
                _ => format!("parameter `{}` of {}", parameter.name, entity.label()),
            };
            self.ignore_named(features::PBRT_PARAMETER, &name, &parameter.place);
        }
    }
}
