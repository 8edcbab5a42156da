//! Copies between host and device: uploads and downloads of [`Buffer`]s.

use std::sync::{
    Arc,
    atomic::{AtomicU32, Ordering},
};

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use rayon::prelude::*;

use super::{buffer::Buffer, commands::Commands, device::Device};
use crate::error::Result;

/// Maximum size of one staging copy between host and device, bytes.
const STAGING_BYTES: usize = 16 << 20;
/// Size of one copy out of memory that host and device share, bytes: it stays in the processors' caches.
const SHARED_BYTES: usize = 1 << 20;
/// Words that one thread copies at a time.
const WORDS_TOGETHER: usize = 1 << 14;

impl Buffer {
    /// Creates a buffer that holds `data`, or one element of zeros, and is read only as a uniform texel
    /// buffer: no limit on storage buffers applies. The descriptor set checks the number of texels. Fails
    /// with [`crate::Error::Vulkan`] if memory runs out.
    pub(crate) fn texels_from_slice<T: Pod>(
        device: &Arc<Device>,
        name: &str,
        data: &[T],
    ) -> Result<Self> {
        let usage = vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let create = |size| Self::with_location(device, name, size, MemoryLocation::GpuOnly, usage);
        Self::holding(data, create)
    }

    fn holding<T: Pod>(data: &[T], create: impl FnOnce(u64) -> Result<Self>) -> Result<Self> {
        let none = [T::zeroed()];
        let bytes: &[u8] = bytemuck::cast_slice(if data.is_empty() { &none } else { data });
        let buffer = create(bytes.len() as u64)?;
        buffer.upload(bytes)?;
        Ok(buffer)
    }

    /// Creates a storage buffer that holds `data`, or one element of zeros.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn from_slice<T: Pod>(device: &Arc<Device>, name: &str, data: &[T]) -> Result<Self> {
        Self::holding(data, |size| Self::new(device, name, size))
    }

    /// Creates a storage buffer filled with zeros.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn zeroed(device: &Arc<Device>, name: &str, size: u64) -> Result<Self> {
        let buffer = Self::new(device, name, size)?;
        buffer.clear()?;
        Ok(buffer)
    }

    /// Sets everything to zero. Fails if the device does.
    pub(crate) fn clear(&self) -> Result<()> {
        let mut commands = Commands::begin(self.device())?;
        commands.fill(self, 0);
        commands.submit_and_wait().map(drop)
    }

    /// Copies `bytes` into the buffer, from its start.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if a call fails.
    ///
    /// # Panics
    /// If `bytes` does not fit, which is a bug in the caller.
    pub fn upload(&self, bytes: &[u8]) -> Result<()> {
        assert!(bytes.len() as u64 <= self.size(), "upload into {} is too long", self.name());
        if bytes.is_empty() {
            return Ok(());
        }
        if self.device().capabilities().is_software() {
            store(bytes, self.words()?);
            return Ok(());
        }
        let mut staging = Self::with_location(
            self.device(),
            "staging (upload)",
            bytes.len().min(STAGING_BYTES) as u64,
            MemoryLocation::CpuToGpu,
            vk::BufferUsageFlags::TRANSFER_SRC,
        )?;
        for (index, piece) in bytes.chunks(STAGING_BYTES).enumerate() {
            staging.mapped()?[..piece.len()].copy_from_slice(piece);
            let mut commands = Commands::begin(self.device())?;
            commands.copy(
                &staging,
                0,
                self,
                (index * STAGING_BYTES) as u64,
                piece.len().next_multiple_of(4) as u64,
            );
            commands.submit_and_wait()?;
        }
        Ok(())
    }

    /// Downloads the first `length` elements.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if a call fails.
    ///
    /// # Panics
    /// If the buffer is shorter, which is a bug in the caller.
    pub fn download<T: Pod>(&self, length: usize) -> Result<Vec<T>> {
        let mut result = Vec::with_capacity(length);
        self.download_pieces(length, |piece| result.extend_from_slice(piece))?;
        Ok(result)
    }

    /// Downloads the first `length` elements and passes them to `take` in order, piece by piece. Panics if
    /// the buffer is shorter, which is a bug in the caller.
    pub(crate) fn download_pieces<T: Pod>(
        &self,
        length: usize,
        mut take: impl FnMut(&[T]),
    ) -> Result<()> {
        let bytes = length * size_of::<T>();
        assert!(bytes as u64 <= self.size(), "download from {} is too long", self.name());
        if bytes == 0 {
            return Ok(());
        }
        if self.device().capabilities().is_software() && size_of::<T>().is_multiple_of(4) {
            let mut piece = vec![T::zeroed(); length.min((SHARED_BYTES / size_of::<T>()).max(1))];
            let words = &self.words()?[..bytes / 4];
            for words in words.chunks(size_of_val(&piece[..]) / 4) {
                load(words, &mut bytemuck::cast_slice_mut(&mut piece)[..words.len()]);
                take(&piece[..size_of_val(words) / size_of::<T>()]);
            }
            return Ok(());
        }
        let longest = STAGING_BYTES / size_of::<T>() * size_of::<T>();
        let mut staging = Self::with_location(
            self.device(),
            "staging (download)",
            bytes.min(longest) as u64,
            MemoryLocation::GpuToCpu,
            vk::BufferUsageFlags::TRANSFER_DST,
        )?;
        for first in (0..bytes).step_by(longest) {
            let piece = longest.min(bytes - first);
            let mut commands = Commands::begin(self.device())?;
            let copied = piece.next_multiple_of(4) as u64;
            commands.copy(self, first as u64, &staging, 0, copied);
            commands.make_visible_to_host();
            commands.submit_and_wait()?;
            take(bytemuck::cast_slice(&staging.mapped()?[..piece]));
        }
        Ok(())
    }
}

/// Copies words out of memory that host and device share.
fn load(words: &[AtomicU32], copies: &mut [u32]) {
    let pieces = copies.par_chunks_mut(WORDS_TOGETHER).zip(words.par_chunks(WORDS_TOGETHER));
    pieces.for_each(|(copies, words)| {
        for (copy, word) in copies.iter_mut().zip(words) {
            *copy = word.load(Ordering::Relaxed);
        }
    });
}

/// Copies bytes into such memory, with zeros up to a whole word.
fn store(bytes: &[u8], words: &[AtomicU32]) {
    let pieces = bytes.par_chunks(4 * WORDS_TOGETHER).zip(words.par_chunks(WORDS_TOGETHER));
    pieces.for_each(|(bytes, words)| {
        let whole = bytes.chunks_exact(4);
        let rest = whole.remainder();
        let mut last = [0; 4];
        last[..rest.len()].copy_from_slice(rest);
        let last = (!rest.is_empty()).then_some(&last[..]);
        for (bytes, word) in whole.chain(last).zip(words) {
            word.store(bytemuck::pod_read_unaligned(bytes), Ordering::Relaxed);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_hold_all_bytes_and_end_with_zeros() {
        let count = WORDS_TOGETHER + 3;
        let words: Vec<AtomicU32> = (0..=count).map(|_| AtomicU32::new(u32::MAX)).collect();
        let mut bytes: Vec<u8> = (0..4 * count).map(|place| (place % 251) as u8).collect();
        store(&bytes[..4 * count - 1], &words);
        let mut found = vec![0; count + 1];
        load(&words, &mut found);
        bytes[4 * count - 1] = 0;
        assert_eq!(bytemuck::cast_slice::<u32, u8>(&found[..count]), bytes);
        assert_eq!(found[count], u32::MAX);
    }
}
