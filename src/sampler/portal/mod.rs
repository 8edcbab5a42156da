//! Directions through portals that a user has placed: `mis` with a third technique.
//!
//! A vertex chooses a portal in proportion to its solid angle, not at all if it lies below the horizon,
//! and a direction uniform in that solid angle \[Ureña, Fajardo & King 2013\]. BRDF and environment reach
//! every direction outside the portals, so that the picture does not depend on where they are.

mod parameters;

use std::{collections::BTreeMap, sync::Arc};

pub use parameters::PortalParameters;

use super::{Context, Parameters, Room, knob::Knobs};
use crate::{
    error::Result,
    gpu::{Buffer, DescriptorSet, Device},
    pass::{Domain, Kernel, Passes, Report, Steps, Surfaces, Technique},
    scene::Portal,
    shader::{
        constants::CONSTANT_COMPENSATION,
        rooms::portal::{self, CONSTANT_PORTAL_SHARE, CONSTANT_PORTALS},
        structs::Wave,
    },
};

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
        let surfaces = runner.settings().surfaces;
        let steps = PortalSteps::new(parameters, scene.portals.len() as u32, surfaces);
        let (set, buffer) = upload(runner.device(), &scene.portals)?;
        Ok(Box::new(PortalTechnique { steps, set, buffer }))
    }
}

/// Makes descriptor set 1 of the portals.
fn upload(device: &Arc<Device>, portals: &[Portal]) -> Result<(DescriptorSet, Buffer)> {
    let texels = |portal: &Portal| {
        let ([first, second], [width, height]) = (portal.axes, portal.size);
        [portal.corner.extend(width), first.extend(height), second.extend(0.0)]
            .map(|texel| texel.to_array())
    };
    let mut words: Vec<[f32; 4]> = portals.iter().flat_map(texels).collect();
    // A buffer has at least one element.
    words.resize(words.len().max(1), [0.0; 4]);
    let buffer = Buffer::texels_from_slice(device, "portals", &words)?;
    let set = DescriptorSet::new(device, &portal::TABLE, &[(portal::PORTALS, &buffer)])?;
    Ok((set, buffer))
}

/// The pass `sample_portals`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PortalSteps {
    count: u32,
    share: f32,
    compensates: bool,
    surfaces: Surfaces,
}

impl PortalSteps {
    /// Returns the passes for `count` portals.
    pub fn new(parameters: &Parameters, count: u32, surfaces: Surfaces) -> Self {
        let share = parameters.portal.portal_share;
        Self { count, share, compensates: parameters.compensation, surfaces }
    }
}

impl Steps for PortalSteps {
    fn walks_lists(&self) -> bool {
        true
    }

    fn sample(&self, _wave: &Wave) -> Vec<Kernel> {
        let own = [
            (CONSTANT_PORTALS, self.count),
            (CONSTANT_PORTAL_SHARE, self.share.to_bits()),
            (CONSTANT_COMPENSATION, u32::from(self.compensates)),
        ];
        let constants = [&own[..], &self.surfaces.constants()].concat();
        vec![Kernel::new("sample_portals", Domain::Surfaces, &constants)]
    }
}

struct PortalTechnique {
    steps: PortalSteps,
    set: DescriptorSet,
    buffer: Buffer,
}

impl Passes for PortalTechnique {
    fn steps(&self) -> &dyn Steps {
        &self.steps
    }

    fn set(&self) -> Option<&DescriptorSet> {
        Some(&self.set)
    }
}

impl Technique for PortalTechnique {
    fn report(&self) -> Report {
        let bytes = (self.buffer.name().to_owned(), self.buffer.size());
        Report { buffer_bytes: BTreeMap::from([bytes]), ..Report::default() }
    }
}
