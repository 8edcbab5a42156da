//! Sums of the layers of groups of lights.

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
