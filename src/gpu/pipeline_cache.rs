//! The driver's pipeline cache on disk.

use std::{io::Write, path::PathBuf};

use ash::vk;
use sha2::{Digest, Sha256};

use super::capabilities::Capabilities;
use crate::files;

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
