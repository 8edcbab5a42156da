//! The preview that grows on disk while a render goes on.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use crate::film::{Sums, picture::write_preview};

/// Most of the time that previews may take: one in so many parts.
const SHARE: u32 = 20;

/// Writer of the preview at an interval.
pub(super) struct Preview {
    path: PathBuf,
    /// Exposure, stops.
    exposure: f32,
    interval: Duration,
    next: Instant,
}

impl Preview {
    /// Writes the first one after `interval`.
    pub(super) fn new(path: PathBuf, exposure: f32, interval: Duration) -> Self {
        Self { path, exposure, interval, next: Instant::now() + interval }
    }

    /// Writes the film if it is time. One that cannot be written is a warning: the next one, or that at the
    /// end, may find room again.
    pub(super) fn update(&mut self, sums: &Sums) {
        let start = Instant::now();
        if start < self.next {
            return;
        }
        let picture = sums.to_image(&[]).rgb(&self.path);
        let written = picture.and_then(|rgb| write_preview(&self.path, &rgb, self.exposure));
        if let Err(error) = written {
            log::warn!("{error}; the next preview tries again");
        }
        // A large picture takes long to compress.
        self.next = Instant::now() + self.interval.max(SHARE * start.elapsed());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_preview_is_written_when_it_is_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let sums = Sums { sample_count: 1, ..Sums::new([0, 0], 4, 2, [4, 2]) };
        Preview::new(path.clone(), 0.0, Duration::from_secs(60)).update(&sums);
        assert!(!path.exists());
        Preview::new(path.clone(), 0.0, Duration::ZERO).update(&sums);
        assert!(path.exists());
        // A folder in its place costs the preview, not the render.
        Preview::new(folder.path().to_owned(), 0.0, Duration::ZERO).update(&sums);
    }
}
