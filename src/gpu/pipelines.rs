//! The compute pipelines of a device, made once each, and the driver's cache of them on disk.

use std::{
    collections::HashMap,
    io::Write,
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
};

use ash::vk;
use sha2::{Digest, Sha256};

use super::capabilities::Capabilities;
use crate::{error::Result, files};

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

#[derive(Clone)]
pub(super) struct Made {
    pub raw: vk::Pipeline,
    pub layout: vk::PipelineLayout,
    /// Numbers of the buffers that the shader uses, for each descriptor set.
    pub used: [Arc<[u32]>; 4],
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
        match &*place {
            Some(made) => Ok(made.clone()),
            None => make().inspect(|made| *place = Some(made.clone())),
        }
    }

    /// # Safety
    /// The device must be alive and idle, and nothing may use its pipelines any more.
    pub(crate) unsafe fn destroy(&self, device: &ash::Device) {
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        for (_, place) in places.drain() {
            let place = place.lock().unwrap_or_else(PoisonError::into_inner);
            let Some(made) = &*place else { continue };
            // SAFETY: promised by the caller.
            unsafe {
                device.destroy_pipeline(made.raw, None);
                device.destroy_pipeline_layout(made.layout, None);
            }
        }
    }
}

/// Bytes of the SHA-256 of a cache file's content, at its start: drivers trust what they are given.
const CHECKSUM_BYTES: usize = 32;

/// The driver's pipeline cache, kept per device and driver in the user's cache folder.
pub(super) struct PipelineCache {
    pub(super) raw: vk::PipelineCache,
}

impl PipelineCache {
    /// Loads this device's cache, or an empty one if the file is unreadable, damaged or foreign.
    pub(super) fn load(device: &ash::Device, capabilities: &Capabilities) -> Self {
        let data = file(capabilities).and_then(|path| files::read(&path).ok()).unwrap_or_default();
        let whole = data.split_at_checked(CHECKSUM_BYTES);
        let whole = whole.filter(|(checksum, data)| Sha256::digest(data)[..] == **checksum);
        let data = whole.map_or(&[][..], |(_, data)| data);
        // The header holds length, version, vendor and device, then the driver's UUID.
        let is_ours = data.get(16..32) == Some(&capabilities.pipeline_cache_uuid[..]);
        let info =
            vk::PipelineCacheCreateInfo::default().initial_data(if is_ours { data } else { &[] });
        // SAFETY: drivers validate the header of the initial data, its UUID was compared, and the rest
        // is what a driver of this UUID has written.
        // Failure leaves a null cache, without which everything still works.
        let raw = unsafe { device.create_pipeline_cache(&info, None) }.unwrap_or_default();
        Self { raw }
    }

    /// Writes the cache. Failure only costs compile time in the next run.
    pub(super) fn save(&self, device: &ash::Device, capabilities: &Capabilities) {
        let (Some(path), false) = (file(capabilities), self.raw == vk::PipelineCache::null())
        else {
            return;
        };
        // SAFETY: the cache is alive.
        let data = unsafe { device.get_pipeline_cache_data(self.raw) }.unwrap_or_default();
        let write = files::write_atomically(&path, |file| {
            file.write_all(&Sha256::digest(&data))?;
            file.write_all(&data)
        });
        if let Err(error) = write {
            log::debug!("pipeline cache not written: {error}");
        }
    }

    /// # Safety
    /// The device must be alive and no pipeline creation in progress.
    pub(super) unsafe fn destroy(&self, device: &ash::Device) {
        // SAFETY: promised by the caller; destroying a null handle is allowed.
        unsafe { device.destroy_pipeline_cache(self.raw, None) };
    }
}

fn file(capabilities: &Capabilities) -> Option<PathBuf> {
    let identity = files::hexadecimal(&capabilities.pipeline_cache_uuid);
    Some(files::cache_folder("pipelines")?.join(format!("{identity}.bin")))
}
