//! Files of a render: checkpoints on its way, and the image with all others at its end.

use std::path::Path;

use super::{RenderJob, StopReason, arguments::denoised_path, display};
use crate::{
    command::denoise::{Denoised, denoise},
    error::Result,
    files::is_special_file,
    film::{
        Checkpoint, Image, Metadata, SampleRange, Sums, Window, checkpoint::checkpoint_path,
        metadata::seconds_of, png::write_preview,
    },
    gpu::Denoiser,
    session::Renderer,
};

impl RenderJob<'_> {
    /// Returns the metadata for the samples so far.
    pub(super) fn metadata(&self, renderer: &Renderer) -> Metadata {
        Metadata {
            sample_ranges: vec![SampleRange {
                seed: self.arguments.seed,
                first: self.arguments.sample_offset,
                count: renderer.sample_count(),
            }],
            candidates: renderer.report().candidates,
            seconds: self.seconds(),
            gpu_seconds: seconds_of(&renderer.totals().gpu_ms),
            ..self.metadata.clone()
        }
    }

    /// Writes a checkpoint. The outer error is the device's, the inner one the disk's.
    pub(super) fn write_checkpoint(&self, renderer: &Renderer, sums: Sums) -> Result<Result<()>> {
        let checkpoint = Checkpoint { sums, metadata: self.metadata(renderer) };
        let path = checkpoint_path(&self.output);
        Ok(checkpoint.write_with_guide(&path, renderer.guide()?.as_deref()))
    }

    /// Writes the image, then all other files asked for, each of them even if another fails.
    ///
    /// # Errors
    /// The first failure; others are logged.
    pub(super) fn finish(
        &mut self,
        renderer: &Renderer,
        reason: StopReason,
        load_ms: f64,
    ) -> Result<()> {
        let sums = renderer.sums()?;
        let totals = renderer.totals();
        self.warnings.clear();
        self.warn_of_darkness(": the image is black");
        if totals.dropped_samples > 0 {
            self.warn(format!(
                "{} samples were left out because their radiance was not finite",
                totals.dropped_samples
            ));
        }
        if let Some([left, top, right, bottom]) = totals.overrun_pixels {
            let Window { x, y, .. } = self.window;
            self.warn(format!(
                "{} rays were given up after too many steps of traversal, where many triangles meet in \
                 one place: pixels within --crop {},{},{},{} may be wrong",
                totals.traversal_overruns,
                left + x,
                top + y,
                right + x,
                bottom + y
            ));
        }
        let metadata = self.metadata(renderer);
        let mut image = sums.to_image(&self.aovs);
        metadata.store(&mut image);
        let mut written = Vec::new();
        let mut failure = None;
        let mut note = |path: &Path, result: Result<()>| match (result, &failure) {
            (Ok(()), _) => written.push(display(path)),
            (Err(error), None) => failure = Some(error),
            (Err(error), Some(_)) => log::error!("{error}"),
        };
        note(&self.output, image.write_exr(&self.output));
        if self.arguments.png {
            let path = self.output.with_extension("png");
            let preview = |rgb| write_preview(&path, &rgb, self.arguments.exposure);
            note(&path, image.rgb(&self.output).and_then(preview));
        }
        if let Some(denoiser) = &self.denoiser {
            self.write_denoised(denoiser, &image, &mut note);
        }
        drop(image);
        if let Some(path) = &self.arguments.stats {
            note(path, self.statistics(renderer, &metadata, reason, load_ms).write(path));
        }
        let is_interrupted = reason == StopReason::Interrupt && !is_special_file(&self.output);
        if is_interrupted || self.arguments.checkpoint_interval.is_some() {
            let path = checkpoint_path(&self.output);
            note(&path, self.write_checkpoint(renderer, sums).and_then(|written| written));
        }
        if let Some(path) = &self.arguments.save_guide {
            note(path, renderer.save_guide(path));
        }
        if !self.arguments.quiet && !written.is_empty() {
            eprintln!("wrote {}", written.join(", "));
        }
        failure.map_or(Ok(()), Err)
    }

    /// Writes the denoised picture, and its preview beside that of the image.
    fn write_denoised(
        &self,
        denoiser: &Denoiser,
        film: &Image,
        note: &mut impl FnMut(&Path, Result<()>),
    ) {
        let path = denoised_path(&self.output, "exr");
        let Denoised { image, line } = match denoise(denoiser, film, &self.output) {
            Ok(denoised) => denoised,
            Err(error) => return note(&path, Err(error)),
        };
        if !self.arguments.quiet {
            eprintln!("{line}");
        }
        note(&path, image.write_exr(&path));
        if self.arguments.png {
            let shown = denoised_path(&self.output, "png");
            let preview = |rgb| write_preview(&shown, &rgb, self.arguments.exposure);
            note(&shown, image.rgb(&path).and_then(preview));
        }
    }
}
