//! `[[portal]]`.

use serde::Deserialize;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PortalKeys {
    /// Name, for messages.
    pub name: Option<String>,
    /// One corner of the rectangle, metres.
    pub corner: [f32; 3],
    /// Edge from that corner, metres.
    pub first_edge: [f32; 3],
    /// Other edge from that corner, metres, perpendicular to the first.
    pub second_edge: [f32; 3],
}
