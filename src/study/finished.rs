//! Finds the finished runs that a plan can reuse and those made under other conditions.

use std::{collections::BTreeMap, fs, path::PathBuf};

use super::{
    contender::Contender,
    engine::Study,
    overhead,
    plan::Rule,
    reference,
    runs::{Conditions, Round, Run, run_stem},
};
use crate::{
    error::{Error, Result},
    scene::Scene,
};

impl Study<'_> {
    /// Returns the conditions of a contender's runs, or with `None` those of overhead rounds, which
    /// have no reference and several contenders.
    pub(super) fn conditions(
        &self,
        scene: &Scene,
        contender: Option<&Contender>,
    ) -> Result<Conditions> {
        let capabilities = self.device.capabilities();
        let (reference, parameters) = match (contender, &self.plan.overhead) {
            (Some(contender), _) => (
                reference::identity(&self.plan.reference, &scene.name)?,
                contender.describe_parameters(),
            ),
            (None, Some(overhead)) => ("none".to_owned(), overhead::describe_parameters(overhead)),
            (None, None) => ("none".to_owned(), BTreeMap::new()),
        };
        let baseline = self.plan.overhead.as_ref().map(|overhead| &overhead.baseline);
        let of = contender.or(baseline);
        Ok(Conditions {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene_hash: scene.hash.clone(),
            film: [scene.film.width, scene.film.height],
            device: capabilities.name.clone(),
            driver: self.device.driver_and_tracer(),
            shadow_rays: of.map_or(0, |contender| self.plan.shadow_rays_of(contender)),
            depth: self.plan.depth,
            reference,
            parameters,
        })
    }

    pub(super) fn run_path(
        &self,
        scene: &Scene,
        (rule, seed, contender): (Rule, u32, &Contender),
    ) -> PathBuf {
        self.folder.run(&scene.name, &run_stem(contender, rule, seed))
    }

    /// Reads a run that is finished and holds everything the plan asks for.
    pub(super) fn finished_run(
        &self,
        scene: &Scene,
        task: (Rule, u32, &Contender),
    ) -> Result<Option<Run>> {
        let path = self.run_path(scene, task);
        Ok(self.folder.read_json::<Run>(&path)?.filter(|run| {
            let has_image =
                |spp: &u32| run.at(Rule::Spp(*spp)).is_some_and(|level| level.image.is_some());
            matches!(task.0, Rule::Seconds(_)) || self.plan.spp.iter().all(has_image)
        }))
    }

    /// Reads a finished overhead round with the plan's number of samples.
    pub(super) fn finished_round(&self, scene: &Scene, repetition: u32) -> Result<Option<Round>> {
        let round = self.folder.read_json::<Round>(&self.folder.round(&scene.name, repetition))?;
        Ok(round.filter(|round| Some(round.spp) == self.plan.overhead.as_ref().map(|o| o.spp)))
    }

    /// Refuses finished runs that were made under other conditions, or removes them with `redo`.
    pub(super) fn check_finished(&self, scenes: &[Scene], redo: bool) -> Result<()> {
        let mut stale: Vec<(PathBuf, String)> = Vec::new();
        let mut compare = |path: PathBuf, found: &Conditions, asked: &Conditions| {
            let difference = found.differences(asked).into_iter().next();
            stale.extend(difference.map(|difference| (path, difference)));
        };
        for scene in scenes {
            for task in self.plan.tasks() {
                if let Some(run) = self.finished_run(scene, task)? {
                    let asked = self.conditions(scene, Some(task.2))?;
                    compare(self.run_path(scene, task), &run.conditions, &asked);
                }
            }
            let rounds = self.plan.overhead.as_ref().map_or(0, |overhead| overhead.repetitions);
            for repetition in 1..=rounds {
                if let Some(round) = self.finished_round(scene, repetition)? {
                    let asked = self.conditions(scene, None)?;
                    compare(self.folder.round(&scene.name, repetition), &round.conditions, &asked);
                }
            }
        }
        let Some((path, first)) = stale.first() else { return Ok(()) };
        if redo {
            return stale.iter().try_for_each(|(path, _)| {
                fs::remove_file(path).map_err(|source| Error::io(path, "remove", source))
            });
        }
        let message = format!(
            "made under other conditions than those asked for ({first}), one of {} such runs in the folder; \
             choose another folder with -o, or give --redo to remove them and make them again",
            stale.len()
        );
        Err(Error::format(path, message))
    }
}
