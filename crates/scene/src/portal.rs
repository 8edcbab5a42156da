//! Openings that a user has placed for samplers.

use glam::Vec3;

/// Most portals of a scene: every shadow ray goes through all of them.
pub(crate) const MAX_PORTALS: usize = 256;

/// Rectangle that light of the environment comes through. It serves sampling alone: neither the picture
/// nor what rays meet depends on it. Both sides count.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// Name in the file; may be empty.
    pub name: String,
    /// One corner, metres.
    pub corner: Vec3,
    /// Unit vectors along the edges from there, perpendicular to each other.
    pub axes: [Vec3; 2],
    /// Lengths of these edges, metres.
    pub size: [f32; 2],
}
