//! `--frames`: which moments of an animation are rendered, and how their files are called.

use std::path::{Path, PathBuf};

use crate::{film::checkpoint::checkpoint_path, math::random::hash_4d};

/// Tells the seeds of frames from other hashes.
const FRAME_TAG: u32 = 0x2f6e_2b1d;
/// Frames from `first` to `last`, every `step`th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    first: u32,
    last: u32,
    step: usize,
}

pub(super) fn parse_frames(text: &str) -> Result<Frames, String> {
    let (range, step) = text.split_once('x').unwrap_or((text, "1"));
    let (first, last) = range.split_once('-').unwrap_or((range, range));
    let frames = first.parse().ok().zip(last.parse().ok()).zip(step.parse().ok());
    frames
        .map(|((first, last), step)| Frames { first, last, step })
        .filter(|frames| frames.first <= frames.last && frames.step > 0)
        .ok_or_else(|| format!("expected frames such as 7, 0-47 or 0-47x2, found {text:?}"))
}

/// Puts a frame's number in place of the last run of `#` in a file's name, with as many digits at least.
pub(super) fn numbered(path: &Path, frame: u32) -> PathBuf {
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
        return path.to_path_buf();
    };
    let kept = name.rfind('#').map_or(name.len(), |at| at + 1);
    let before = name[..kept].trim_end_matches('#');
    match kept - before.len() {
        0 => path.to_path_buf(),
        width => path.with_file_name(format!("{before}{frame:0width$}{}", &name[kept..])),
    }
}

impl Frames {
    pub(super) fn numbers(self) -> impl Iterator<Item = u32> {
        (self.first..=self.last).step_by(self.step)
    }

    /// Random seed of a frame, which no other frame has.
    pub(super) fn seed(seed: u32, frame: u32) -> u32 {
        hash_4d([seed, frame, FRAME_TAG, 0])[0]
    }
}

/// True if the image is there and finished: an interrupted render leaves a checkpoint beside it.
pub(super) fn is_finished(image: &Path) -> bool {
    image.exists() && !checkpoint_path(image).exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_ranges_and_number_the_last_hashes() {
        assert_eq!(parse_frames("7"), Ok(Frames { first: 7, last: 7, step: 1 }));
        assert_eq!(parse_frames("0-47x2"), Ok(Frames { first: 0, last: 47, step: 2 }));
        assert_ne!(Frames::seed(0, 1), Frames::seed(0, 2));
        for wrong in ["", "-1", "5-4", "0-4x0", "a", "1-2-3", "1x"] {
            assert!(parse_frames(wrong).is_err(), "{wrong}");
        }
        for (name, expected) in [
            ("a/s#1.####.exr", "a/s#1.0012.exr"),
            ("a##/b.#.exr", "a##/b.12.exr"),
            ("b.exr", "b.exr"),
        ] {
            assert_eq!(numbered(Path::new(name), 12), Path::new(expected));
        }
    }
}
