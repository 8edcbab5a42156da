//! Passes by which the pixels of a cohort share the second vertices of their paths: Bekaert, Sbert &
//! Halton 2002, "Accelerating path tracing by re-using paths" (`docs/shading.md`).

use std::sync::Arc;

use super::{
    geometry::{Schedule, Traversal},
    kernel::{Dispatch, Domain, Kernel},
    steps::{PathDemand, SHADOW_RAYS_PER_GROUP},
    surfaces::Surfaces,
};
use crate::{
    error::Result,
    gpu::{Buffer, DescriptorSet, Device},
    shader::{
        bindings::{SHARING, sharing},
        constants::{
            CONSTANT_COHORT_EDGE, MATERIAL_DIFFUSE, MATERIAL_DIFFUSE_TRANSMISSION, SPECULAR_KINDS,
        },
        structs::{Connection, FirstVertex, Offer, SecondLight, SecondVertex, Wave},
    },
};

/// Bits of the kinds of material whose light looks the same from all sides, or is not shared.
const SAME_OR_ALONE: u32 =
    SPECULAR_KINDS | 1 << MATERIAL_DIFFUSE | 1 << MATERIAL_DIFFUSE_TRANSMISSION;

/// Moments of a vertex at which sharing may add a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Moment {
    /// Surfaces are known, and no light is gathered.
    Met,
    /// The light of a group of shadow rays is gathered.
    Gathered,
    /// All light is gathered, and paths are about to go on.
    Leaving,
    /// Paths have gone on or ended.
    Left,
}

/// Passes by which cohorts share paths.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sharing {
    /// Edge of the cohorts, pixels: 2, 4 or 8, so that they lie in blocks of the film.
    pub cohort_edge: u32,
    /// Specialization by the surfaces of the scene.
    pub surfaces: Surfaces,
    /// Specialization of the passes that traverse.
    pub traversal: Traversal,
    pub schedule: Schedule,
}

impl Sharing {
    fn over_surfaces(&self, shader: &'static str) -> Kernel {
        Kernel::new(shader, Domain::Paths, &self.surfaces.constants())
    }

    /// The pass at a moment of a vertex, if there is one.
    pub(crate) fn at(&self, moment: Moment, vertex: u32) -> Option<Kernel> {
        let is_glossy = self.surfaces.material_kinds & !SAME_OR_ALONE != 0;
        let shader = match (vertex, moment) {
            (0, Moment::Leaving) => "keep_first",
            (1, Moment::Met) => "keep_second",
            // Chooses light to offer, where it does not look the same from all sides.
            (1, Moment::Gathered) if is_glossy => "gather_shared",
            // Parts the light of the second vertices.
            (1, Moment::Left) => "keep_third",
            _ => return None,
        };
        Some(self.over_surfaces(shader))
    }

    /// Connects the vertices of a finished `wave` in groups of shadow rays, and shares the light.
    pub(crate) fn connect_and_share(&self, wave: &Wave) -> Vec<Dispatch> {
        let edge = (CONSTANT_COHORT_EDGE, self.cohort_edge);
        let constants = [&self.surfaces.constants()[..], &[edge]].concat();
        let pixels = self.cohort_edge * self.cohort_edge;
        let mut wave = Wave { to_lamps: 1, total_shadow_rays: pixels, ..*wave };
        let mut order = vec![Dispatch { kernel: self.over_surfaces("offer"), wave }];
        for first in (0..pixels).step_by(SHADOW_RAYS_PER_GROUP as usize) {
            wave.first_shadow_ray = first;
            wave.shadow_ray_count = SHADOW_RAYS_PER_GROUP.min(pixels - first);
            for kernel in [
                Kernel::new("connect", Domain::Paths, &constants),
                self.traversal.shadow(self.schedule, self.surfaces),
                Kernel::new("admit", Domain::Paths, &[]),
            ] {
                order.push(Dispatch { kernel, wave });
            }
        }
        for shader in ["weigh", "share"] {
            order.push(Dispatch { kernel: Kernel::new(shader, Domain::Paths, &[edge]), wave });
        }
        order
    }
}

/// Adds what cohorts of so many pixels take for a path to `demand`.
pub(crate) fn sharing_demand(demand: PathDemand, cohort_pixels: u32) -> PathDemand {
    if cohort_pixels == 1 {
        return demand;
    }
    let connections = u64::from(cohort_pixels);
    let vertex = size_of::<SecondVertex>();
    let texels = vertex / size_of::<[u32; 4]>();
    PathDemand {
        bytes: demand.bytes.max(vertex as u64).max(connections * size_of::<Connection>() as u64),
        texels: demand.texels.max(texels as u64).max(connections),
        ..demand
    }
}

/// Allocates descriptor set 1 of the passes of sharing: first and second vertices of one wave of up to
/// `paths` paths, and the connections between them in cohorts of `cohort_pixels`. Fails if the device does.
pub(crate) fn sharing_set(
    device: &Arc<Device>,
    paths: u32,
    cohort_pixels: u32,
) -> Result<DescriptorSet> {
    let paths = u64::from(paths);
    let make = |name, count: u64, size: usize| Buffer::new(device, name, count * size as u64);
    let connections = paths * u64::from(cohort_pixels);
    let bound = [
        (sharing::FIRST_VERTICES, make("first vertices", paths, size_of::<FirstVertex>())?),
        (sharing::SECOND_VERTICES, make("second vertices", paths, size_of::<SecondVertex>())?),
        (sharing::SECOND_LIGHTS, make("second lights", paths, size_of::<SecondLight>())?),
        (sharing::OFFERS, make("offers", paths, size_of::<Offer>())?),
        (sharing::OFFER_WEIGHTS, make("offer weights", paths, size_of::<f32>())?),
        (sharing::CONNECTIONS, make("connections", connections, size_of::<Connection>())?),
        (sharing::SEEN, make("seen offers", paths, size_of::<[u32; 2]>())?),
    ];
    DescriptorSet::new(device, &SHARING, &bound)
}
