//! The compute pipelines of a device, made once each.

use std::{
    collections::{HashMap, hash_map::Entry},
    sync::{Mutex, PoisonError},
};

use ash::vk;
use sha2::{Digest, Sha256};

use crate::error::Result;

/// The pipelines of a device. They live as long as it does, so that renderers that follow each other,
/// as in a window or a study, do not translate the same shaders again.
#[derive(Default)]
pub(super) struct Pipelines {
    made: Mutex<HashMap<Key, Made>>,
}

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
        match self.made.lock().unwrap_or_else(PoisonError::into_inner).entry(key) {
            Entry::Occupied(made) => Ok(*made.get()),
            Entry::Vacant(place) => Ok(*place.insert(make()?)),
        }
    }

    /// # Safety
    /// The device must be alive and idle, and nothing may use its pipelines any more.
    pub(crate) unsafe fn destroy(&self, device: &ash::Device) {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        for (_, made) in made.drain() {
            // SAFETY: promised by the caller.
            unsafe {
                device.destroy_pipeline(made.raw, None);
                device.destroy_pipeline_layout(made.layout, None);
            }
        }
    }
}
