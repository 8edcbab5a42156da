//! The files of a checkpoint: itself, and the guide of a sampler that learns.
//!
//! The guide lies in a file of its own, named by its content:
//! `image.checkpoint.<hash>.guide`. It is written before the checkpoint that holds its hash, and
//! the guide of the older checkpoint is removed after. The renaming of the checkpoint is the one
//! moment at which both change, so a killed process leaves the old pair or the new one.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};

use super::{Checkpoint, GUIDE_ATTRIBUTE};
use crate::{
    error::{Error, Result},
    files::{self, hexadecimal, write_atomically},
    film::{Attribute, Image},
};

/// Digits of that hash in the file's name.
const GUIDE_NAME_DIGITS: usize = 12;

/// Path of the guide with this hash: `image.checkpoint.exr` → `image.checkpoint.<hash>.guide`.
fn guide_path(checkpoint: &Path, hash: &str) -> PathBuf {
    let digits: String = hash.chars().take(GUIDE_NAME_DIGITS).collect();
    checkpoint.with_extension(format!("{digits}.guide"))
}

/// Lists the guides that lie beside a checkpoint.
///
/// # Errors
/// [`Error::Io`] for a folder that cannot be read.
pub fn guide_paths(checkpoint: &Path) -> Result<Vec<PathBuf>> {
    let folder = files::parent_of(checkpoint);
    let stem = checkpoint.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let prefix = stem.unwrap_or_default() + ".";
    let is_guide = |path: &PathBuf| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
        let name = name.unwrap_or_default();
        let hash = name.strip_prefix(&prefix).and_then(|rest| rest.strip_suffix(".guide"));
        hash.is_some_and(|hash| {
            hash.len() == GUIDE_NAME_DIGITS
                && hash.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
        })
    };
    let entries =
        fs::read_dir(folder).map_err(|source| Error::io(folder, "read folder", source))?;
    let mut paths: Vec<PathBuf> =
        entries.flatten().map(|entry| entry.path()).filter(is_guide).collect();
    paths.sort();
    Ok(paths)
}

/// Removes a checkpoint and its guides, where they exist.
///
/// # Errors
/// [`Error::Io`] with the cause.
pub fn remove_checkpoint(path: &Path) -> Result<()> {
    files::remove(path)?;
    guide_paths(path)?.iter().try_for_each(|guide| files::remove(guide))
}

/// Locks the folder of a checkpoint against other writers, where the system has such locks.
fn locked_folder(path: &Path) -> Option<fs::File> {
    let folder = fs::File::open(files::parent_of(path)).ok()?;
    folder.lock().ok()?;
    Some(folder)
}

pub(crate) type GuideFile = (PathBuf, Vec<u8>);

impl Checkpoint {
    /// Writes the checkpoint of a sampler that does not learn, atomically.
    ///
    /// # Errors
    /// [`Error::Io`] with the cause.
    pub fn write(&self, path: &Path) -> Result<()> {
        self.encode(None).write(path)
    }

    /// Reads a checkpoint and the path and bytes of its guide, if it has one.
    ///
    /// # Errors
    /// As [`Checkpoint::read`], for either file.
    pub fn read_with_guide(path: &Path) -> Result<(Self, Option<GuideFile>)> {
        // Another process may replace the pair between the two files.
        let _lock = locked_folder(path);
        let image = Image::read_exr(path)?;
        let checkpoint = Self::from_image(&image, path)?;
        let Some(Attribute::Text(hash)) = image.attributes.get(GUIDE_ATTRIBUTE) else {
            return Ok((checkpoint, None));
        };
        let guide_path = guide_path(path, hash);
        let guide = files::read(&guide_path)?;
        if hexadecimal(&Sha256::digest(&guide)) != *hash {
            return Err(Error::format(
                &guide_path,
                format!("damaged, or not the guide of {}", path.display()),
            ));
        }
        Ok((checkpoint, Some((guide_path, guide))))
    }
}

/// A checkpoint as the files that it is written to.
pub(crate) struct Encoded {
    pub(super) image: Image,
    pub(super) guide: Option<Vec<u8>>,
}

impl Encoded {
    /// Writes the checkpoint and the file of its guide. Both replace older ones at one moment: at
    /// every other, and after every failure, the older pair or the newer one is complete. Fails with
    /// [`Error::Io`] and the cause.
    pub(crate) fn write(&self, path: &Path) -> Result<()> {
        // Others that write this checkpoint would remove the guide before its checkpoint is there.
        let _lock = locked_folder(path);
        let Self { image, guide } = self;
        let mut kept = None;
        let mut added = None;
        if let (Some(guide), Some(Attribute::Text(hash))) =
            (guide, image.attributes.get(GUIDE_ATTRIBUTE))
        {
            let guide_path = guide_path(path, hash);
            let is_new = !guide_path.exists();
            write_atomically(&guide_path, |file| file.write_all(guide))?;
            kept = guide_path.file_name().map(ToOwned::to_owned);
            added = is_new.then_some(guide_path);
        }
        if let Err(error) = image.write_exr_uncompressed(path) {
            // Without its checkpoint a guide only takes space, but the disk may fail after the renaming.
            let guide_of = |image: &Image| image.attributes.get(GUIDE_ATTRIBUTE).cloned();
            let is_named =
                Image::read_exr(path).is_ok_and(|found| guide_of(&found) == guide_of(image));
            for guide in added.iter().filter(|_| !is_named) {
                files::remove(guide).unwrap_or_else(|error| log::warn!("{error}"));
            }
            return Err(error);
        }
        // The checkpoint is safe: a guide that stays behind does no harm.
        let remove_others = || {
            let others = guide_paths(path)?;
            let others = others.iter().filter(|other| other.file_name() != kept.as_deref());
            others.into_iter().try_for_each(|other| files::remove(other))
        };
        if let Err(error) = remove_others() {
            log::warn!("{error}");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{SampleRange, Sums, metadata::Metadata};

    fn checkpoint(samples: u32) -> Checkpoint {
        let mut sums = Sums::new([0, 0], 2, 1, [2, 1]);
        sums.sum = vec![[samples as f32; 3]; 2];
        sums.sample_count = samples;
        let range = SampleRange { seed: 1, first: 0, count: samples };
        Checkpoint {
            sums,
            metadata: Metadata { sample_ranges: vec![range], ..Metadata::default() },
        }
    }

    fn with_guide(samples: u32, guide: &[u8]) -> Encoded {
        checkpoint(samples).encode(Some(guide.to_vec()))
    }

    /// The second writer comes while the first has the folder.
    #[test]
    fn two_writers_leave_a_complete_pair() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.checkpoint.exr");
        with_guide(4, b"first").write(&path).unwrap();
        let first = locked_folder(&path).unwrap();
        std::thread::scope(|scope| {
            let second = scope.spawn(|| with_guide(8, b"second").write(&path).unwrap());
            std::thread::sleep(std::time::Duration::from_millis(100));
            assert!(!second.is_finished());
            assert_eq!(guide_paths(&path).unwrap().len(), 1);
            drop(first);
        });
        assert_eq!(Checkpoint::read_with_guide(&path).unwrap().1.unwrap().1, b"second");
        assert_eq!(guide_paths(&path).unwrap().len(), 1, "the older guide is removed");
        remove_checkpoint(&path).unwrap();
        assert!(!path.exists() && guide_paths(&path).unwrap().is_empty());
    }

    #[test]
    fn obstacles_leave_the_older_pair() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.checkpoint.exr");
        with_guide(4, b"older").write(&path).unwrap();
        // A folder where the guide should go
        let obstacle = guide_path(&path, &hexadecimal(&Sha256::digest(b"newer")));
        fs::create_dir(&obstacle).unwrap();
        assert!(with_guide(8, b"newer").write(&path).is_err());
        let (read, guide) = Checkpoint::read_with_guide(&path).unwrap();
        assert_eq!((read, guide.unwrap().1), (checkpoint(4), b"older".to_vec()));
        // A folder where the checkpoint should go
        fs::remove_dir(&obstacle).unwrap();
        let kept = folder.path().join("kept");
        fs::rename(&path, &kept).unwrap();
        fs::create_dir(&path).unwrap();
        assert!(with_guide(8, b"newer").write(&path).is_err());
        assert_eq!(guide_paths(&path).unwrap().len(), 1, "the try leaves nothing");
        fs::remove_dir(&path).unwrap();
        fs::rename(&kept, &path).unwrap();
        let (read, guide) = Checkpoint::read_with_guide(&path).unwrap();
        assert_eq!((read, guide.unwrap().1), (checkpoint(4), b"older".to_vec()));
    }

    #[test]
    fn a_sampler_that_does_not_learn_removes_guides_of_older_checkpoints() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.checkpoint.exr");
        with_guide(4, b"learned").write(&path).unwrap();
        checkpoint(8).write(&path).unwrap();
        assert_eq!(guide_paths(&path).unwrap(), Vec::<PathBuf>::new());
        assert!(Checkpoint::read_with_guide(&path).unwrap().1.is_none());
    }
}
