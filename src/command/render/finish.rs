//! Files of a render: checkpoints on its way, and the image with all others at its end.

use std::path::Path;

use super::{RenderJob, StopReason, arguments::denoised_path, display};
use crate::{
    command::denoise::{Denoised, denoise},
    error::Result,
    files::{is_special_file, write_json},
    film::{Image, checkpoint::checkpoint_path, png::write_preview},
    gpu::Denoiser,
    session::Session,
    terminal::say,
};

impl RenderJob<'_> {
    /// Writes the image, then all other files asked for, each of them even if another fails.
    ///
    /// # Errors
    /// The first failure; others are logged.
    pub(super) fn finish(&self, session: &Session, reason: StopReason) -> Result<()> {
        let warnings = session.warnings(self.scene);
        warnings.iter().for_each(|warning| log::warn!("{warning}"));
        let image = session.image(&self.aovs)?;
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
            let mut statistics = session.statistics(self.scene, reason);
            statistics.warnings.extend(warnings);
            statistics.host_ms.insert("load".into(), self.load_ms);
            note(path, write_json(path, &statistics));
        }
        let is_interrupted = reason == StopReason::Interrupt && !is_special_file(&self.output);
        if is_interrupted || self.arguments.checkpoint_interval.is_some() {
            let path = checkpoint_path(&self.output);
            note(&path, session.write_checkpoint(&path).and_then(|written| written));
        }
        if let Some(path) = &self.arguments.save_guide {
            note(path, session.renderer.save_guide(path));
        }
        if !self.arguments.quiet && !written.is_empty() {
            say!("wrote {}", written.join(", "));
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
            say!("{line}");
        }
        note(&path, image.write_exr(&path));
        if self.arguments.png {
            let shown = denoised_path(&self.output, "png");
            let preview = |rgb| write_preview(&shown, &rgb, self.arguments.exposure);
            note(&shown, image.rgb(&path).and_then(preview));
        }
    }
}
