//! Directions through portals that a user has placed: `mis` with a third technique.
//!
//! A vertex chooses a portal in proportion to its solid angle, not at all if it lies below the horizon,
//! and a direction uniform in that solid angle \[Ureña, Fajardo & King 2013\]. BRDF and environment reach
//! every direction outside the portals, so that the picture does not depend on where they are.

use std::{collections::BTreeMap, sync::Arc};

use super::{
    Context, Parameters, Room,
    knob::{Knobs, parameters},
    rays::{RaySteps, Unlearned},
};
use crate::{
    error::Result,
    gpu::{Buffer, DescriptorSet, Device},
    pass::{Surfaces, Technique},
    scene::Portal,
    shader::{
        constants::CONSTANT_COMPENSATION,
        rooms::portal::{self, CONSTANT_PORTAL_SHARE, CONSTANT_PORTALS},
    },
};

parameters! {
    /// Parameters of `portal`.
    pub struct PortalParameters {
        /// `portal-share`: share of the portals among directions that are not from the BRDF; the rest is the
        /// environment's.
        "portal-share" portal_share: f32 = 0.5, 0.0..=1.0;
    }
}

pub(super) struct PortalRoom;

impl Room for PortalRoom {
    fn uses_portals(&self) -> bool {
        true
    }

    fn describe(&self, parameters: &Parameters) -> BTreeMap<String, String> {
        let mut named = parameters.portal.describe();
        named.extend([parameters.shared("compensation")]);
        named
    }

    fn create(&self, context: Context<'_>) -> Result<Box<dyn Technique>> {
        let Context { scene, parameters, runner } = context;
        let count = scene.portals.len() as u32;
        let steps = steps(parameters, count, runner.settings.surfaces);
        let set = Some(upload(&runner.device, &scene.portals)?);
        Ok(Box::new(Unlearned { steps, set, host_ms: BTreeMap::new() }))
    }
}

/// Returns the passes for `count` portals.
pub fn steps(parameters: &Parameters, count: u32, surfaces: Surfaces) -> RaySteps {
    let own = [
        (CONSTANT_PORTALS, count),
        (CONSTANT_PORTAL_SHARE, parameters.portal.portal_share.to_bits()),
        (CONSTANT_COMPENSATION, u32::from(parameters.compensation)),
    ];
    RaySteps::new("sample_portals", &own, surfaces)
}

fn upload(device: &Arc<Device>, portals: &[Portal]) -> Result<DescriptorSet> {
    let texels = |portal: &Portal| {
        let ([first, second], [width, height]) = (portal.axes, portal.size);
        [portal.corner.extend(width), first.extend(height), second.extend(0.0)]
            .map(|texel| texel.to_array())
    };
    let words: Vec<[f32; 4]> = portals.iter().flat_map(texels).collect();
    let buffer = Buffer::texels_from_slice(device, "portals", &words)?;
    DescriptorSet::new(device, &portal::TABLE, &[(portal::PORTALS, &buffer)])
}
