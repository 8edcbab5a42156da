//! `--frames`: which moments of an animation are rendered, and how their files are called.

use std::path::{Path, PathBuf};

use super::Arguments;
use crate::{
    error::{Error, Result},
    film::checkpoint::checkpoint_path,
    math::random::hash_4d,
    scene::load::scene_name,
};

/// Tells the seeds of frames from other hashes.
const FRAME_TAG: u32 = 0x2f6e_2b1d;
/// Digits of a frame's number in the default name.
const NUMBER: &str = "####";

/// Frames from `first` to `last`, every `step`th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    first: u32,
    last: u32,
    step: usize,
}

/// Parses `7`, `0-47` or `0-47x2`.
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
fn numbered(path: &Path, frame: u32) -> PathBuf {
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

impl Arguments {
    /// Lists the frames asked for; one that is none without `--frames`.
    ///
    /// # Errors
    /// [`Error::Usage`] for several frames with a name that they would share.
    pub(super) fn frame_list(&self) -> Result<Vec<Option<u32>>> {
        let Some(Frames { first, last, step }) = self.frames else { return Ok(vec![None]) };
        if !(self.fps.is_finite() && self.fps > 0.0) {
            return Err(Error::usage(format!("--fps {}: expected a number above 0", self.fps)));
        }
        for (option, path) in [
            ("--output", &self.output),
            ("--stats", &self.stats),
            ("--save-guide", &self.save_guide),
        ] {
            if let Some(path) =
                path.as_ref().filter(|path| first < last && numbered(path, 0) == **path)
            {
                return Err(Error::usage(format!(
                    "{option} {}: every frame would have this name; expected #### in it for the number",
                    path.display()
                )));
            }
        }
        Ok((first..=last).step_by(step).map(Some).collect())
    }

    /// Time of a frame, seconds.
    pub(super) fn time_of(&self, frame: u32) -> f64 {
        f64::from(frame) / self.fps
    }

    /// Arguments of one frame, with names and random numbers of its own.
    pub(super) fn of_frame(&self, frame: Option<u32>) -> Self {
        let mut own = self.clone();
        let Some(frame) = frame else { return own };
        let files = [&mut own.output, &mut own.stats, &mut own.save_guide, &mut own.load_guide];
        for path in files.into_iter().flatten() {
            *path = numbered(path, frame);
        }
        [own.seed, ..] = hash_4d([self.seed, frame, FRAME_TAG, 0]);
        own
    }

    /// Image of a frame.
    pub(super) fn image_path(&self, frame: Option<u32>) -> PathBuf {
        self.output.clone().unwrap_or_else(|| {
            let name = scene_name(&self.scene);
            match frame {
                None => PathBuf::from(format!("{name}.exr")),
                Some(frame) => numbered(Path::new(&format!("{name}.{NUMBER}.exr")), frame),
            }
        })
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
