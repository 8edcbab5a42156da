//! Buffers for what the pixels of a cohort share.

use std::sync::Arc;

use super::steps::PathDemand;
use crate::{
    error::Result,
    gpu::{Buffer, DescriptorSet, Device},
    shader::{
        bindings::{SHARING, sharing},
        structs::{Connection, FirstVertex, Offer, SecondVertex},
    },
};

/// Adds what cohorts of so many pixels take for a path to `demand`.
pub(crate) fn sharing_demand(demand: PathDemand, cohort_pixels: u32) -> PathDemand {
    if cohort_pixels == 1 {
        return demand;
    }
    let connections = u64::from(cohort_pixels);
    let vertex = size_of::<SecondVertex>().max(size_of::<Offer>());
    let texels = size_of::<Offer>().max(size_of::<FirstVertex>()) / size_of::<[u32; 4]>();
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
    let first_vertices = make("first vertices", paths, size_of::<FirstVertex>())?;
    let second_vertices = make("second vertices", paths, size_of::<SecondVertex>())?;
    let offers = make("offers", paths, size_of::<Offer>())?;
    let offer_weights = make("offer weights", paths, size_of::<f32>())?;
    let connections =
        make("connections", paths * u64::from(cohort_pixels), size_of::<Connection>())?;
    let seen = make("seen offers", paths, size_of::<[u32; 2]>())?;
    let bound = [
        (sharing::FIRST_VERTICES, &first_vertices),
        (sharing::FIRST_VERTEX_TEXELS, &first_vertices),
        (sharing::SECOND_VERTICES, &second_vertices),
        (sharing::OFFERS, &offers),
        (sharing::OFFER_TEXELS, &offers),
        (sharing::OFFER_WEIGHTS, &offer_weights),
        (sharing::OFFER_WEIGHT_TEXELS, &offer_weights),
        (sharing::CONNECTIONS, &connections),
        (sharing::CONNECTION_TEXELS, &connections),
        (sharing::SEEN, &seen),
        (sharing::SEEN_TEXELS, &seen),
    ];
    DescriptorSet::new(device, &SHARING, &bound)
}
