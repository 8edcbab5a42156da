//! One run: a sampler with one seed, rendered to its end and compared with the reference.

use super::{
    contender::Contender,
    engine::Study,
    folder::Folder,
    metrics::flip::mean_flip,
    plan::Rule,
    reference::{Reference, exposure},
    runs::{Measurement, Run, run_stem},
    surfaces::Surfaces,
};
use crate::{
    error::Result,
    film::{
        Image,
        picture::{preview, write_preview},
    },
    scene::Scene,
    session::{Figures, Rules, Session},
};

/// Seed whose pictures are also written as PNG.
const SHOWN_SEED: u32 = 1;

impl Study<'_> {
    /// Renders a run and compares the film at powers of two of samples and at the levels. Reading and
    /// comparing it does not count as time of the passes.
    pub(super) fn render_run(
        &mut self,
        scene: &Scene,
        (reference, surfaces): (&Reference, &Surfaces),
        (rule, seed, contender): (Rule, u32, &Contender),
        session: &mut Session,
    ) -> Result<Run> {
        let conditions = self.conditions(scene, Some(contender))?;
        let mean = reference.mean();
        let stops = exposure(&mean);
        session.restart(seed)?;
        let limit = match rule {
            Rule::Spp(_) => None,
            Rule::Seconds(seconds) => Some(seconds),
        };
        let by_time = Rules { seconds: limit, ..Rules::default() };
        let mut measurements: Vec<Measurement> = Vec::new();
        loop {
            let samples = Some(self.next_stop(rule, session.renderer.sample_count()));
            let rules = Rules { samples, ..by_time.clone() };
            self.watch.run(session, &rules, limit.is_some())?;
            let (mut measurement, picture) = Measurement::of(session, reference, surfaces)?;
            let spp = measurement.spp;
            let (level, is_level) = match rule {
                Rule::Spp(_) => (Rule::Spp(spp), self.plan.spp.contains(&spp)),
                Rule::Seconds(_) => (rule, session.met(&by_time).is_some()),
            };
            if is_level {
                let shown = [&picture, &mean].map(|picture| preview(picture, stops));
                measurement.flip = Some(mean_flip(&shown[0], &shown[1], picture.width as usize));
                let stem = run_stem(contender, level, seed);
                let path = self.folder.image(&scene.name, &stem);
                let mut image = Image::of_rgb(picture.width, picture.height, &picture.pixels);
                session.metadata().store(&mut image);
                image.write_exr(&path)?;
                if seed == SHOWN_SEED {
                    write_preview(&path.with_extension("png"), &picture, stops)?;
                }
                measurement.image = Some(Folder::image_name(&scene.name, &stem));
            }
            measurements.push(measurement);
            if is_level && level == rule {
                break;
            }
        }
        Ok(Run {
            scene: scene.name.clone(),
            sampler: contender.label.clone(),
            rule,
            seed,
            conditions,
            measurements,
            figures: Figures::of(&session.renderer, session.seconds()),
        })
    }

    /// Samples at the next comparison: the next power of two or level.
    fn next_stop(&self, rule: Rule, samples: u32) -> u32 {
        let power = samples.checked_add(1).and_then(u32::checked_next_power_of_two);
        let power = power.unwrap_or(u32::MAX);
        match rule {
            Rule::Spp(end) => {
                let level = self.plan.spp.iter().copied().find(|level| *level > samples);
                power.min(level.unwrap_or(end)).min(end)
            }
            Rule::Seconds(_) => power,
        }
    }
}
