//! Files of a render: checkpoints on its way, and the image with all others at its end.

use std::path::Path;

use super::{RenderJob, StopReason, arguments::denoised_path, display};
use crate::{
    command::denoise::{Denoised, denoise},
    error::Result,
    files::write_json,
    film::{
        Attribute, Image,
        checkpoint::{checkpoint_path, remove_checkpoint},
        picture::write_preview,
    },
    gpu::Denoiser,
    session::Session,
    terminal::say,
};

/// Pixels of the largest picture that is denoised after an interrupt. It takes two cores a second, and who
/// interrupts may not wait.
const MOST_DENOISED_IN_HASTE: u64 = 1 << 19;

impl RenderJob<'_> {
    /// Writes the image, then what it continues from, then all other files asked for, each of them even
    /// if another fails. Returns the first failure; others are logged.
    pub(super) fn finish(&self, session: &mut Session, reason: StopReason) -> Result<()> {
        let sums = session.sums()?;
        let warnings = session.warnings(self.scene);
        warnings.iter().for_each(|warning| log::warn!("{warning}"));
        if let Some(choice) = session.renderer.report().choice.filter(|_| !self.arguments.quiet) {
            say!("{choice}");
        }
        let mut image = session.image_of(&sums, &self.aovs);
        if let Some(time) = self.time {
            image.attributes.insert("fenestra.time".to_owned(), Attribute::Double(time));
        }
        let mut written = Vec::new();
        let mut failure = None;
        let mut note = |path: &Path, result: Result<()>| match (result, &failure) {
            (Ok(()), _) => written.push(display(path)),
            (Err(error), None) => failure = Some(error),
            (Err(error), Some(_)) => log::error!("{error}"),
        };
        let is_interrupted = reason == StopReason::Interrupt;
        // Compression takes seconds of a large film, and noise is hardly smaller for it.
        let (image, output) = (&image, self.output.as_path());
        let write_picture = || match is_interrupted {
            true => image.write_exr_uncompressed(output),
            false => image.write_exr(output),
        };
        let checkpoint = checkpoint_path(&self.output);
        let writes_checkpoints = self.arguments.writes_checkpoints(&self.output);
        let is_to_continue = is_interrupted || self.arguments.checkpoint_interval.is_some();
        if writes_checkpoints && is_to_continue {
            let (picture, written) =
                session.write_checkpoint_beside(&checkpoint, sums, write_picture);
            note(&self.output, picture);
            note(&checkpoint, written.and_then(|written| written));
        } else {
            drop(sums);
            let picture = write_picture();
            let has_picture = picture.is_ok();
            note(&self.output, picture);
            if has_picture && writes_checkpoints && session.has_checkpoint {
                remove_checkpoint(&checkpoint).unwrap_or_else(|error| log::warn!("{error}"));
            }
        }
        if self.arguments.writes_png() {
            let path = self.output.with_extension("png");
            let preview = |rgb| write_preview(&path, &rgb, self.arguments.exposure);
            note(&path, image.rgb(&self.output).and_then(preview));
        }
        let pixels = u64::from(image.width) * u64::from(image.height);
        if let Some(denoiser) = self.denoiser {
            if is_interrupted && pixels > MOST_DENOISED_IN_HASTE {
                let denoised = denoised_path(&self.output, "exr");
                let [film, denoised] = [&self.output, &denoised].map(|path| display(path));
                log::warn!(
                    "interrupted, so not denoised: fenestra convert {film} {denoised} --denoise"
                );
            } else {
                self.write_denoised(denoiser, image, &mut note);
            }
        } else if self.arguments.shows() && !self.arguments.quiet {
            say!("not denoised: Open Image Denoise is not found; ./setup brings it where it can");
        }
        if let Some(path) = &self.arguments.stats {
            let mut statistics = session.statistics(self.scene, reason);
            statistics.warnings.extend(warnings);
            statistics.host_ms.insert("load".into(), self.load_ms);
            note(path, write_json(path, &statistics));
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
            say!("{line}, {} stays as rendered", display(&self.output));
        }
        note(&path, image.write_exr(&path));
        if self.arguments.writes_png() {
            let shown = denoised_path(&self.output, "png");
            let preview = |rgb| write_preview(&shown, &rgb, self.arguments.exposure);
            note(&shown, image.rgb(&path).and_then(preview));
        }
    }
}
