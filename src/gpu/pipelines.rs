//! The compute pipelines of a device, made once each.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError},
};

use ash::vk;
use sha2::{Digest, Sha256};

use crate::error::Result;

/// The pipelines of a device. They live as long as it does, so that renderers that follow each other,
/// as in a window or a study, do not translate the same shaders again.
#[derive(Default)]
pub(super) struct Pipelines {
    places: Mutex<HashMap<Key, Place>>,
}

/// Place of a pipeline, locked while a thread makes it: others make other pipelines meanwhile.
type Place = Arc<Mutex<Option<Made>>>;

/// Name, SHA-256 of the SPIR-V and constants that a pipeline is made from.
type Key = (String, [u8; 32], Vec<(u32, u32)>);

#[derive(Clone, Copy)]
pub(super) struct Made {
    pub raw: vk::Pipeline,
    pub layout: vk::PipelineLayout,
    /// Number of a buffer that the shader uses, for each descriptor set.
    pub used: [Option<u32>; 4],
}

impl Pipelines {
    /// Returns the pipeline of a shader and its constants, which `make` makes the first time.
    pub(crate) fn get_or_make(
        &self,
        (name, spirv, constants): (&str, &[u8], &[(u32, u32)]),
        make: impl FnOnce() -> Result<Made>,
    ) -> Result<Made> {
        let key = (name.to_owned(), Sha256::digest(spirv).into(), constants.to_vec());
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        let place = Arc::clone(places.entry(key).or_default());
        drop(places);
        let mut place = place.lock().unwrap_or_else(PoisonError::into_inner);
        match *place {
            Some(made) => Ok(made),
            None => make().inspect(|made| *place = Some(*made)),
        }
    }

    /// # Safety
    /// The device must be alive and idle, and nothing may use its pipelines any more.
    pub(crate) unsafe fn destroy(&self, device: &ash::Device) {
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        for (_, place) in places.drain() {
            let place = place.lock().unwrap_or_else(PoisonError::into_inner);
            let Some(made) = *place else { continue };
            // SAFETY: promised by the caller.
            unsafe {
                device.destroy_pipeline(made.raw, None);
                device.destroy_pipeline_layout(made.layout, None);
            }
        }
    }
}
