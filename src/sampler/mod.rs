//! The samplers: one room per technique, and the registry of their names.
//!
//! A room holds parameters, tables, buffers, passes, learning and figures of one technique. A new
//! sampler takes a room and a line in `registry.rs`.

pub mod basic;
pub mod control_variates;
pub mod guided;
pub mod haar;
mod knob;
mod parameters;
pub mod pilot;
pub mod portal;
pub mod product;
pub mod rays;
pub mod regions;
pub mod tiles;
pub mod visibility;

use std::collections::BTreeMap;

use clap::ValueEnum;
pub use parameters::Parameters;

use crate::{
    error::{Error, Result},
    film::Aov,
    pass::{PathDemand, Runner, Technique},
    scene::Scene,
    shader::{constants, rooms::registry},
};

/// Input for creating a technique.
pub struct Context<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Parameters of all samplers.
    pub parameters: &'a Parameters,
    /// Device, buffers and settings of the render; its waves meet the demand of the room.
    pub runner: &'a Runner,
}

/// Entry point to the code of a sampler.
pub trait Room: Sync {
    /// Returns [`Error::Usage`] for parameters that cannot be rendered, before anything is allocated.
    fn check(&self, _parameters: &Parameters, _depth: u32) -> Result<()> {
        Ok(())
    }

    /// Returns the sampler itself if it is one of [`basic`].
    fn basic(&self) -> Option<basic::Basic> {
        None
    }

    /// Shadow rays at every vertex that the camera sees, where nobody says otherwise: as in the thesis.
    fn shadow_rays(&self) -> u32 {
        5
    }

    /// Edge of the cohorts that may share paths under `share-paths=auto`, pixels; 1 for none.
    fn auto_cohort_edge(&self) -> u32 {
        1
    }

    /// Film layers that no other sampler has.
    fn aovs(&self) -> &[Aov] {
        &[]
    }

    /// True if the sampler draws directions through the portals of the scene.
    fn uses_portals(&self) -> bool {
        false
    }

    /// True if the sampler learns a guide from the whole picture, which outlives its render in a file.
    fn has_guide(&self) -> bool {
        false
    }

    /// Returns the parameters relevant to the sampler by key, for metadata and statistics.
    fn describe(&self, _parameters: &Parameters) -> BTreeMap<String, String> {
        BTreeMap::new()
    }

    /// Memory per path in flight.
    fn demand(&self, _parameters: &Parameters, _shadow_rays: u32) -> PathDemand {
        PathDemand::default()
    }

    /// Creates tables, buffers and passes for one render. Fails if the device does or its limits
    /// are exceeded.
    fn create(&self, context: Context<'_>) -> Result<Box<dyn Technique>>;
}

macro_rules! samplers {
    (basic {
        $($(#[$basic_doc:meta])* $basic:ident $basic_name:literal $basic_key:literal = $tag:ident;)*
    } rooms {
        $($(#[$doc:meta])* $sampler:ident $name:literal $key:literal = $room:ident $entry:ident
            $parameters:ident;)*
    }) => {
        /// Samplers of directions at a hit. All trace one shadow ray per direction, and all are
        /// unbiased except with [`Elevation::Metropolis`](product::Elevation::Metropolis).
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, ValueEnum)]
        pub enum Sampler {
            $($(#[$basic_doc])* #[value(name = $basic_name)] $basic,)*
            $($(#[$doc])* #[value(name = $name)] $sampler,)*
        }

        impl Sampler {
            /// Every sampler, simplest first.
            pub const ALL: &[Self] = &[$(Self::$basic,)* $(Self::$sampler),*];

            /// Name on the command line, in files and in tables.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$basic => $basic_name,)*
                    $(Self::$sampler => $name,)*
                }
            }

            /// Key that chooses the sampler in the window.
            pub fn key(self) -> &'static str {
                match self {
                    $(Self::$basic => $basic_key,)*
                    $(Self::$sampler => $key,)*
                }
            }

            /// The code of the sampler.
            pub fn room(self) -> &'static dyn Room {
                match self {
                    $(Self::$basic => &basic::Basic { tag: constants::$tag },)*
                    $(Self::$sampler => &$room::$entry,)*
                }
            }
        }
    };
}
registry!(samplers);

impl Sampler {
    /// Returns [`Error::Usage`] for parameters and layers that cannot be rendered.
    pub fn check(self, parameters: &Parameters, depth: u32, aovs: &[Aov]) -> Result<()> {
        for other in Self::ALL.iter().filter(|other| **other != self) {
            if let Some(layer) = other.room().aovs().iter().find(|layer| aovs.contains(layer)) {
                return Err(Error::usage(format!(
                    "--aov {}: the sampler {} has no such layer; expected --sampler {}",
                    layer.name(),
                    self.name(),
                    other.name()
                )));
            }
        }
        if aovs.contains(&Aov::LightGroups) && self.cohort_edge(parameters) > 1 {
            return Err(Error::usage(format!(
                "--aov light-groups with --set share-paths={}: paths that pixels share mix the light of \
                 all groups; expected --set share-paths=off",
                parameters.share_paths_text()
            )));
        }
        self.room().check(parameters, depth)
    }

    /// Returns a warning if the sampler and the portals of `scene` have no use for each other.
    pub fn portal_warning(self, scene: &Scene) -> Option<String> {
        let (name, path) = (self.name(), scene.path.display());
        let Some(first) = scene.portals.first() else {
            let message = "the scene has no [[portal]]; directions are those of mis";
            return self
                .room()
                .uses_portals()
                .then(|| format!("{path}: --sampler {name}: {message}"));
        };
        (!self.room().uses_portals()).then(|| {
            let first = if first.name.is_empty() {
                String::new()
            } else {
                format!(", `{}` first,", first.name)
            };
            let count = scene.portals.len();
            format!("{path}: --sampler {name} ignores the portals of the scene ({count}{first} in all); \
                     --sampler portal uses them")
        })
    }

    /// Returns the parameters relevant to the sampler by key, for metadata and statistics.
    pub fn describe(self, parameters: &Parameters) -> BTreeMap<String, String> {
        let mut named = self.room().describe(parameters);
        if self.cohort_edge(parameters) > 1 || self.room().auto_cohort_edge() > 1 {
            named.insert("share-paths".to_owned(), parameters.share_paths_text());
        }
        named
    }

    /// Edge of the cohorts that may share paths, pixels; 1 for none.
    pub fn cohort_edge(self, parameters: &Parameters) -> u32 {
        parameters.share_paths.unwrap_or(self.room().auto_cohort_edge())
    }

    /// True if no sampler or this one has the film layer for itself.
    pub fn has_layer(self, layer: Aov) -> bool {
        let owns = |sampler: &Self| sampler.room().aovs().contains(&layer);
        owns(&self) || !Self::ALL.iter().any(owns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_command_line() {
        for sampler in Sampler::ALL {
            let value = sampler.to_possible_value().unwrap();
            assert_eq!(value.get_name(), sampler.name());
        }
    }
}
