//! The inset: what the pixel under the pointer has learned of the sky.

use super::projector::Inset;
use crate::{film::sky::Sky, pass::Explanation, scene::Scene};

/// Width of the inset, pixels.
const WIDTH: usize = 256;
/// Height of the line between its pictures, pixels.
const GAP: usize = 2;

/// Width and height of an inset, pixels.
pub(super) const SIZE: [u32; 2] = [WIDTH as u32, (WIDTH + GAP) as u32];

/// Draws visibility above density; `None` where nothing was learned.
pub(super) fn draw(scene: &Scene, recorded: &dyn Explanation) -> Option<Inset> {
    let [visibility, density]: [Sky; 2] = recorded.skies(scene, WIDTH).try_into().ok()?;
    let opaque = |sky: &Sky| -> Vec<[u8; 4]> {
        sky.pixels.iter().map(|[red, green, blue]| [*red, *green, *blue, 255]).collect()
    };
    let gap = vec![[255; 4]; GAP * WIDTH];
    Some(Inset { size: SIZE, pixels: [opaque(&visibility), gap, opaque(&density)].concat() })
}
