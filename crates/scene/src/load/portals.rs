//! `[[portal]]` → portals.

use super::{FINITE, Loader};
use crate::{
    error::Result,
    file::{Entry, PortalKeys},
    mesh::label,
    portal::{MAX_PORTALS, Portal},
};

/// Lengths of edges, metres: products of three of them stay far inside single precision.
const EDGES: (f32, f32) = (1e-6, 1e6);

/// Largest cosine between edges that counts as a right angle: a twentieth of a degree.
const RIGHT_ANGLE: f32 = 1e-3;

impl Loader<'_> {
    pub(super) fn portals(&self, entries: &[Entry<PortalKeys>]) -> Result<Vec<Portal>> {
        self.check(entries.len() <= MAX_PORTALS, || {
            format!(
                "expected at most {MAX_PORTALS} `[[portal]]`, found {}: join those of one wall",
                entries.len()
            )
        })?;
        entries.iter().enumerate().map(|(index, entry)| self.portal(index, entry)).collect()
    }

    fn portal(&self, index: usize, entry: &Entry<PortalKeys>) -> Result<Portal> {
        let keys = &entry.keys;
        let label = label("portal", index, keys.name.as_deref());
        let label = format!("{label} (line {})", entry.line);
        let corner = self.vector(&format!("{label}: corner"), keys.corner, (-1e6, 1e6))?;
        let edge = |key: &str, edge: [f32; 3]| {
            let edge = self.vector(&format!("{label}: {key}"), edge, FINITE)?;
            let (low, high) = EDGES;
            self.check((low..=high).contains(&edge.length()), || {
                format!(
                    "{label}: {key}: expected an edge of {low} to {high} m, found {edge}, {} m long",
                    edge.length()
                )
            })?;
            Ok((edge.normalize(), edge.length()))
        };
        let (first, width) = edge("first_edge", keys.first_edge)?;
        let (second, height) = edge("second_edge", keys.second_edge)?;
        let cosine = first.dot(second);
        self.check(cosine.abs() <= RIGHT_ANGLE, || {
            format!(
                "{label}: expected first_edge and second_edge at right angles, found {:.2} degrees: a \
                 portal is a rectangle",
                cosine.acos().to_degrees()
            )
        })?;
        let second = (second - cosine * first).normalize();
        Ok(Portal {
            name: keys.name.clone().unwrap_or_default(),
            corner,
            axes: [first, second],
            size: [width, height],
        })
    }
}
