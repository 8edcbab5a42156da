//! Layers of a film: those that an image file may ask for, and the sums that they need.

use clap::ValueEnum;

use crate::shader::constants::MATTE_SLOTS;

/// Extra layers of an image file, with pbrt's names and meaning where pbrt has them. The command
/// line also accepts a layer's name in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, ValueEnum)]
pub enum Aov {
    /// `Variance.R/G/B`: variance of the pixel mean.
    #[value(aliases = ["Variance"])]
    Variance,
    /// `SampleCount.Y`: camera paths per pixel.
    #[value(aliases = ["samplecount", "SampleCount"])]
    SampleCount,
    /// `Unfiltered.R/G/B`: mean radiance of the samples in the pixel itself, whose noise no neighbour
    /// shares: what denoisers expect.
    #[value(aliases = ["Unfiltered"])]
    Unfiltered,
    /// `Albedo.R/G/B`: share of light that a surface reflects, 0…1: the first one that is no perfect
    /// mirror, smooth glass or pane, times what those on the way let through.
    #[value(aliases = ["Albedo"])]
    Albedo,
    /// `N.X/Y/Z`: shading normal of that surface, world space.
    #[value(aliases = ["N"])]
    Normal,
    /// `P.X/Y/Z`: position of the first hit, world space, metres.
    #[value(aliases = ["P"])]
    Position,
    /// `Visible.Y`: share of shadow rays that reached the environment, and `ShadowRays.Y`: how many
    /// were traced for the pixel.
    #[value(aliases = ["Visible"])]
    Visible,
    /// Sampler `visibility`: `CacheEntries.Y`: directions in the visibility cache after the last
    /// ray of a hit, mean over the pixel's hits, and `Hits.Y`: how many hits those are.
    #[value(aliases = ["CacheEntries"])]
    CacheEntries,
    /// Sampler `guided`, first hits: `GuideCell.R/G/B`: colour of the cell of learned visibility,
    /// one for each; `GuideLevel.R/G/B`: share of samples that found only the cell of their face
    /// (R), a coarse cell (G), a fine one (B).
    #[value(aliases = ["GuideCell"])]
    GuideCell,
    /// `CryptoObject00…02.R/G/B/A`: Cryptomatte of the objects that camera rays meet first, by the
    /// pixel's own samples: six of them.
    #[value(aliases = ["CryptoObject"])]
    CryptoObject,
    /// `CryptoMaterial00…02.R/G/B/A`: the same of materials.
    #[value(aliases = ["CryptoMaterial"])]
    CryptoMaterial,
    /// `Combined_GROUP.R/G/B`: light of each group of lights, which add up to the picture: `environment`,
    /// `lamps`, and those that `light_group` names in the scene file, eight at most. Leaves `share-paths`
    /// off.
    #[value(aliases = ["LightGroups"])]
    LightGroups,
}

impl Aov {
    /// Name on the command line.
    pub(crate) fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }
}

/// Layer of [`Sums`](super::Sums): the layer of an image file that needs it, none for those that every film
/// has, and the channels that hold it in a checkpoint.
pub(crate) struct Layer<const N: usize> {
    pub aov: Option<Aov>,
    pub channels: [&'static str; N],
}

macro_rules! layer {
    ($aov:expr, $name:literal: $($channel:ident)*) => {
        Layer { aov: $aov, channels: [$(concat!($name, ".", stringify!($channel))),*] }
    };
}

/// Layers of three numbers.
pub(crate) const TRIPLES: [Layer<3>; 10] = [
    layer!(None, "Sum": R G B),
    layer!(None, "SumCompensation": R G B),
    layer!(None, "Squares": R G B),
    layer!(None, "SquaresCompensation": R G B),
    layer!(Some(Aov::Unfiltered), "UnfilteredSum": R G B),
    layer!(Some(Aov::Albedo), "AlbedoSum": R G B),
    layer!(Some(Aov::Normal), "NSum": X Y Z),
    layer!(Some(Aov::Position), "PSum": X Y Z),
    layer!(Some(Aov::GuideCell), "GuideCellSum": R G B),
    layer!(Some(Aov::GuideCell), "GuideLevelSum": R G B),
];

/// Layers of two counts; leading part and rest of each.
pub(crate) const COUNTS: [Layer<4>; 2] = [
    layer!(Some(Aov::Visible), "ShadowRays": Visible VisibleCompensation Traced TracedCompensation),
    layer!(Some(Aov::CacheEntries), "CacheEntries": Entries EntriesCompensation Hits HitsCompensation),
];

/// Identifiers of objects or materials and the samples that meet them, in the order of their discovery; no
/// samples where there is none.
pub type Coverage = [[u32; 2]; MATTE_SLOTS as usize];

/// Layers of coverages, with the channels of each slot.
pub(crate) const COVERAGES: [(Aov, &str); 2] =
    [(Aov::CryptoObject, "ObjectCounts"), (Aov::CryptoMaterial, "MaterialCounts")];

/// Sums over the samples of every pixel of the light of one group, as those of [`Sums`](super::Sums).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GroupSums {
    /// Name of the group.
    pub name: String,
    /// Leading part of Σ radiance.
    pub sum: Vec<[f32; 3]>,
    /// Rest of Σ radiance.
    pub compensation: Vec<[f32; 3]>,
    /// Radiance of the sample of a stopped sweep, as [`Sums::pending`](super::Sums::pending).
    pub pending: Vec<[f32; 3]>,
}

impl GroupSums {
    /// Layers of [`GroupSums::parts`] in a checkpoint.
    pub(crate) const PARTS: [&str; 3] = ["GroupSum", "GroupCompensation", "GroupPending"];

    pub(crate) fn parts(&self) -> [&Vec<[f32; 3]>; 3] {
        [&self.sum, &self.compensation, &self.pending]
    }

    /// Channels of the group's layer, or of one of its sums.
    pub(crate) fn channels(layer: &str, name: &str) -> [String; 3] {
        ["R", "G", "B"].map(|channel| format!("{layer}_{name}.{channel}"))
    }
}
