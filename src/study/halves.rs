//! The two halves of a reference and those of its check: rendered, or found finished in the folder.

use std::{path::Path, time::Duration};

use super::{
    contender::Contender,
    engine::{Study, pixels},
    plan::{CheckPlan, ReferencePlan},
    reference::{HALF_STEMS, Reference, SEEDS, exposure, read_images},
    reference_check::{self, ReferenceCheck, TIME_SHARE, Verdict},
};
use crate::{
    error::{Error, Result},
    files,
    film::{
        Aov, Image, Metadata, SampleRange,
        checkpoint::{checkpoint_path, remove_checkpoint},
        picture::write_preview,
    },
    scene::Scene,
    session::{Rules, Session, describe},
};

/// Time between checkpoints of a reference's half: even a killed program loses only the passes since the
/// last.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(60);
const CHECK_STEMS: [&str; 2] = ["reference_check_1", "reference_check_2"];
/// Seeds of the check's halves; those of the reference lie above, those of runs count up from 1.
const CHECK_SEEDS: [u32; 2] = [u32::MAX - 3, u32::MAX - 2];
/// Samples per pixel of both halves of a check where the reference's time is not known.
const SPP_WITHOUT_TIME: u32 = 256;
/// Samples per pixel of both halves below which a check by a sampler finds no disagreement: a light
/// that it has not found yet leaves no trace in its noise either.
const LEAST_SPP: u64 = 32;

impl Study<'_> {
    /// Renders or reads the reference of a scene and writes the pictures of it that the page needs.
    pub(super) fn reference(&mut self, scene: &Scene) -> Result<Reference> {
        let reference = match &self.plan.reference {
            ReferencePlan::Render { contender, half_spp } => {
                self.render_reference(scene, (contender, *half_spp))?
            }
            plan => {
                let reference = Reference::read(plan, scene)?;
                // Copy the halves into the folder, so that it holds everything the page needs.
                for (stem, half) in HALF_STEMS.iter().zip([&reference.first, &reference.second]) {
                    let image = Image::of_rgb(half.width, half.height, &half.pixels);
                    image.write_exr(&self.folder.image(&scene.name, stem))?;
                }
                reference
            }
        };
        let path = self.folder.image(&scene.name, "reference");
        let mean = reference.mean();
        write_preview(&path.with_extension("png"), &mean, exposure(&mean))?;
        Ok(reference)
    }

    /// Renders what the folder lacks of the two halves and reads both. An interrupted half continues
    /// from its checkpoint. Fails with [`Error::Interrupted`] after the checkpoint has been written.
    fn render_reference(
        &mut self,
        scene: &Scene,
        (contender, half_spp): (&Contender, u32),
    ) -> Result<Reference> {
        let settings = self.settings(contender);
        let asked = describe(self.device, scene, &settings);
        let mut session = None;
        let paths = HALF_STEMS.map(|stem| self.folder.image(&scene.name, stem));
        for (path, seed) in paths.iter().zip(SEEDS) {
            let range = SampleRange { seed, first: 0, count: half_spp };
            let is_finished = finished(path, &asked)?.is_some_and(|(_, found)| {
                found.sample_ranges == [range]
                    && (&found.device, &found.driver) == (&asked.device, &asked.driver)
            });
            if is_finished {
                self.watch.expect(-pixels(scene) * f64::from(half_spp), 0.0);
                continue;
            }
            let session = match &mut session {
                Some(session) => session,
                none => none.insert(self.session(scene, settings.clone())?),
            };
            self.watch.note(&format!(
                "{}: reference {} of 2 by {}, {half_spp} spp",
                scene.name,
                seed - SEEDS[0] + 1,
                contender.label
            ));
            self.render_half(session, path, range)?;
        }
        let description = format!("{}, two halves of {half_spp} spp", contender.label);
        Reference::of(&read_images(paths.to_vec(), scene)?, description, scene)
    }

    /// Renders one half, from its checkpoint if there is one of the same render; else, or if that is
    /// damaged, from its first sample.
    fn render_half(
        &mut self,
        session: &mut Session,
        path: &Path,
        SampleRange { seed, count, .. }: SampleRange,
    ) -> Result<()> {
        let checkpoint = checkpoint_path(path);
        files::sweep_leftovers(path);
        session.restart(seed)?;
        if checkpoint.exists() {
            let resumed = session.resume(&checkpoint);
            let is_usable = resumed.is_ok() && session.renderer.sample_count() <= count;
            match resumed {
                Err(error @ Error::Vulkan { .. }) => return Err(error),
                Err(error) => log::warn!("{error}; starting this half again"),
                Ok(()) => {}
            }
            if !is_usable {
                session.restart(seed)?;
            }
        }
        let [width, height] = session.renderer.film_size.map(f64::from);
        self.watch.expect(-width * height * f64::from(session.renderer.sample_count()), 0.0);
        let checkpoints = Some((checkpoint.clone(), CHECKPOINT_INTERVAL));
        let rules = Rules { samples: Some(count), checkpoints, ..Rules::default() };
        let result = self.watch.run(session, &rules, false);
        if matches!(result, Err(Error::Interrupted)) && session.renderer.sample_count() > 0 {
            let written = session.write_checkpoint(&checkpoint, session.renderer.sums()?)?;
            written.unwrap_or_else(|error| log::warn!("{error}"));
        }
        result?;
        session.image(&[Aov::Variance])?.write_exr(path)?;
        remove_checkpoint(&checkpoint)
    }

    /// Compares the reference with an independent picture, if the plan has one.
    pub(super) fn check_reference(
        &mut self,
        scene: &Scene,
        reference: &Reference,
    ) -> Result<Option<ReferenceCheck>> {
        let plan = &self.plan.reference_check;
        let check = if let CheckPlan::File(path) = plan {
            reference_check::read(path, scene, reference)?
        } else {
            let Some(contender) = plan.contender(reference.sampler.as_deref()) else {
                return Ok(None);
            };
            self.render_check(scene, reference, &contender)?
        };
        let text = format!("{}: {}", scene.name, check.describe());
        if check.verdict == Verdict::Disagrees {
            log::warn!("{text}");
        } else {
            self.watch.note(&text);
        }
        Ok(Some(check))
    }

    /// Renders both halves of the check unless the folder holds them, and compares.
    fn render_check(
        &mut self,
        scene: &Scene,
        reference: &Reference,
        contender: &Contender,
    ) -> Result<ReferenceCheck> {
        let settings = self.settings(contender);
        let asked = describe(self.device, scene, &settings);
        let paths = CHECK_STEMS.map(|stem| self.folder.image(&scene.name, stem));
        let size = [scene.film.width, scene.film.height];
        let find = |half: usize| -> Result<Option<(Image, Metadata)>> {
            let is_whole = |(image, found): &(Image, Metadata)| {
                let count = found.sample_ranges.first().map_or(0, |range| range.count);
                found.sample_ranges == [SampleRange { seed: CHECK_SEEDS[half], first: 0, count }]
                    && [image.width, image.height] == size
            };
            Ok(finished(&paths[half], &asked)?.filter(is_whole))
        };
        let halves = if let [Some(first), Some(second)] = [find(0)?, find(1)?] {
            [first, second]
        } else {
            self.watch
                .note(&format!("{}: check of the reference by {}", scene.name, contender.label));
            let mut session = self.session(scene, settings)?;
            let limit = reference.own.seconds.map(|seconds| 0.5 * TIME_SHARE * seconds);
            self.watch.expect(0.0, 2.0 * limit.unwrap_or(0.0));
            let mut render = |half: usize, samples: Option<u32>, seconds: Option<f64>| {
                session.restart(CHECK_SEEDS[half])?;
                let rules = Rules { samples, seconds, ..Rules::default() };
                self.watch.run(&mut session, &rules, true)?;
                let image = session.image(&[])?;
                image.write_exr(&paths[half])?;
                Ok::<_, Error>((image, session.metadata()))
            };
            let first = render(0, limit.is_none().then_some(SPP_WITHOUT_TIME / 2), limit)?;
            // The second half has as many samples as the first.
            let samples = first.1.sample_ranges.first().map(|range| range.count);
            [first, render(1, samples, None)?]
        };
        let [(first, ours), (second, theirs)] = &halves;
        let spp = ours.sample_count() + theirs.sample_count();
        let description = format!("{}, two halves of {} spp,", contender.label, spp / 2);
        let pictures = [first.rgb(&paths[0])?, second.rgb(&paths[1])?];
        let halves = [&reference.first, &reference.second];
        let mut check = ReferenceCheck::of(halves, pictures.each_ref(), description)?;
        if spp < LEAST_SPP {
            check.verdict = Verdict::TooNoisy;
        }
        let seconds = Some(ours.seconds + theirs.seconds);
        Ok(ReferenceCheck { spp: Some(spp), seconds, ..check })
    }
}

/// Reads a finished half that agrees with `asked`, whatever device, seed and samples it is of.
fn finished(path: &Path, asked: &Metadata) -> Result<Option<(Image, Metadata)>> {
    if !path.exists() {
        return Ok(None);
    }
    let image = Image::read_exr(path)?;
    // Fits are known only to the renderer, and follow from the rest.
    let fit_hashes = asked.fit_hashes.clone();
    let found = Metadata { fit_hashes, ..Metadata::load(&image, path)? };
    let is_same = found.differences(asked).is_empty() && found.version == asked.version;
    Ok(is_same.then_some((image, found)))
}
