//! Runs a plan: in each scene the reference, the runs, interleaved over seeds and samplers, and the
//! overhead rounds. Finished runs are written at once, and those of an earlier study reused.

use std::{
    collections::{BTreeMap, btree_map::Entry},
    path::PathBuf,
    sync::Arc,
};

use super::{
    contender::Contender,
    folder::Folder,
    metrics::flip::mean_flip,
    plan::{Plan, ReferencePlan, Rule},
    reference::{Reference, exposure},
    runs::{Measurement, Round, Run, StudiedScene, run_stem},
    surfaces::Surfaces,
    watch::Watch,
};
use crate::{
    error::{Error, Result},
    files::write_json,
    film::{
        Aov, Image,
        picture::{preview, write_preview},
    },
    gpu::Device,
    pass::SceneBuffers,
    sampler::Sampler,
    scene::Scene,
    session::{Figures, Observer, Renderer, Rules, Session, Settings, traced_window},
};

/// Seed whose pictures are also written as PNG.
const SHOWN_SEED: u32 = 1;

/// Everything a study has measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Results {
    pub scenes: Vec<StudiedScene>,
    pub runs: Vec<Run>,
    pub rounds: Vec<Round>,
}

/// Carries out `plan` in `folder`.
///
/// `redo` removes finished runs made under other conditions; without it they are an error. The
/// second value is the error that ended the study early; the results hold what was finished. Fails if it
/// cannot start: an unusable scene or reference, runs made under other conditions.
pub(crate) fn run(
    plan: &Plan,
    folder: &Folder,
    device: &Arc<Device>,
    observer: &mut dyn Observer,
    redo: bool,
) -> Result<(Results, Option<Error>)> {
    let mut study = Study { plan, folder, device, watch: Watch::new(observer), buffers: None };
    let scenes = study.load_scenes()?;
    let inputs = scenes.iter().flat_map(|scene| &scene.inputs).map(PathBuf::as_path);
    folder.check_replaces_nothing(&inputs.collect::<Vec<_>>())?;
    study.check_finished(&scenes, redo)?;
    let mut results = Results::default();
    for scene in &scenes {
        study.expect(scene);
    }
    let done = scenes.iter().try_for_each(|scene| study.run_scene(scene, &mut results));
    Ok((results, done.err()))
}

pub(super) struct Study<'a> {
    pub(super) plan: &'a Plan,
    pub(super) folder: &'a Folder,
    pub(super) device: &'a Arc<Device>,
    pub(super) watch: Watch<'a>,
    /// Device buffers of the scene at work, created when its first session needs them.
    buffers: Option<Arc<SceneBuffers>>,
}

impl Study<'_> {
    fn load_scenes(&mut self) -> Result<Vec<Scene>> {
        let mut scenes: Vec<Scene> = Vec::new();
        for path in &self.plan.scenes {
            let mut scene = Scene::load(path)?;
            let samplers = || self.plan.contenders.iter().map(|contender| contender.sampler);
            // Beside `portal`, samplers that ignore portals are there to compare.
            let heeded = samplers().find(|sampler| *sampler == Sampler::Portal);
            let ignored = heeded.or(samplers().next());
            let ignored = ignored.and_then(|sampler| sampler.portal_warning(&scene));
            scene.warnings.iter().chain(&ignored).for_each(|warning| log::warn!("{warning}"));
            if let Some([width, height]) = self.plan.size {
                (scene.film.width, scene.film.height) = (width, height);
            }
            if let Some(other) = scenes.iter().find(|other| other.name == scene.name) {
                return Err(Error::usage(format!(
                    "{} and {} are both named {:?}: scenes of one study need names of their own",
                    other.path.display(),
                    path.display(),
                    scene.name
                )));
            }
            self.watch.check()?;
            scenes.push(scene);
        }
        Ok(scenes)
    }

    fn expect(&mut self, scene: &Scene) {
        let pixels = pixels(scene);
        if let (true, ReferencePlan::Render { half_spp, .. }) =
            (self.plan.compares(), &self.plan.reference)
        {
            self.watch.expect(2.0 * pixels * f64::from(*half_spp), 0.0);
        }
        for (rule, ..) in self.plan.tasks() {
            expect_run(&mut self.watch, rule, pixels, 1.0);
        }
        if let Some(overhead) = &self.plan.overhead {
            let runs = (overhead.repetitions + 1) * (overhead.contenders.len() as u32 + 1);
            self.watch.expect(pixels * f64::from(runs) * f64::from(overhead.spp), 0.0);
        }
    }

    fn run_scene(&mut self, scene: &Scene, results: &mut Results) -> Result<()> {
        self.buffers = None;
        results.scenes.push(StudiedScene {
            name: scene.name.clone(),
            path: scene.path.display().to_string(),
            hash: scene.hash.clone(),
            width: scene.film.width,
            height: scene.film.height,
            triangles: scene.geometry.triangle_count(),
            ..StudiedScene::default()
        });
        if self.plan.compares() {
            let studied = results.scenes.len() - 1;
            let reference = self.reference(scene)?;
            results.scenes[studied].reference = Some(reference.own.clone());
            let check = self.check_reference(scene, &reference)?;
            results.scenes[studied].reference_check = check;
            let folder = self.folder;
            let make = || self.session(scene, mask_settings());
            let surfaces = Surfaces::of(folder, scene, &reference, make)?;
            results.scenes[studied].parts = Some(surfaces.own);
            self.compare(scene, (&reference, &surfaces), results)?;
        }
        if let Some(overhead) = &self.plan.overhead {
            self.measure_overhead(overhead, scene, &mut results.rounds)?;
        }
        self.device.save_pipeline_cache();
        Ok(())
    }

    pub(super) fn session(&mut self, scene: &Scene, settings: Settings) -> Result<Session> {
        let buffers = match &mut self.buffers {
            Some(buffers) => buffers,
            none => {
                let window = traced_window(&settings, scene);
                none.insert(Arc::new(SceneBuffers::new(self.device, scene, window)?))
            }
        };
        let buffers = Arc::clone(buffers);
        let renderer = Renderer::with_scene_buffers(self.device, buffers, scene, settings)?;
        Ok(Session::of(renderer, self.device, scene))
    }

    pub(super) fn settings(&self, contender: &Contender) -> Settings {
        Settings {
            sampler: contender.sampler,
            parameters: contender.parameters,
            shadow_rays: self.plan.shadow_rays_of(contender),
            depth: self.plan.depth,
            ..Settings::default()
        }
    }

    /// Renders every run and compares it with the reference.
    fn compare(
        &mut self,
        scene: &Scene,
        compared: (&Reference, &Surfaces),
        results: &mut Results,
    ) -> Result<()> {
        let mut sessions: BTreeMap<&str, Session> = BTreeMap::new();
        for task in self.plan.tasks() {
            let (rule, seed, contender) = task;
            if let Some(run) = self.finished_run(scene, task)? {
                expect_run(&mut self.watch, rule, pixels(scene), -1.0);
                results.runs.push(run);
                continue;
            }
            self.watch.check()?;
            let session = match sessions.entry(&contender.label) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(entry) => {
                    entry.insert(self.session(scene, self.settings(contender))?)
                }
            };
            let run = self.render_run(scene, compared, task, session)?;
            write_json(&self.run_path(scene, task), &run)?;
            if let Some(last) = run.last() {
                self.watch.note(&format!(
                    "{}: {}, {}, seed {seed}: {} spp in {:.2} s, RMSE {:.4e}",
                    scene.name,
                    contender.label,
                    rule.describe(),
                    last.spp,
                    last.seconds,
                    last.errors.rmse
                ));
            }
            results.runs.push(run);
        }
        Ok(())
    }

    /// Renders a run and compares the film at powers of two of samples and at the levels. Reading and
    /// comparing it does not count as time of the passes.
    fn render_run(
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

/// Settings of the renders that tell surfaces and environment apart.
fn mask_settings() -> Settings {
    let sampler = Sampler::Cosine;
    Settings { sampler, shadow_rays: 1, depth: 1, aovs: vec![Aov::Position], ..Settings::default() }
}

pub(super) fn pixels(scene: &Scene) -> f64 {
    f64::from(scene.film.width) * f64::from(scene.film.height)
}

/// Adds `count` runs ended by `rule` to the forecast.
fn expect_run(watch: &mut Watch<'_>, rule: Rule, pixels: f64, count: f64) {
    match rule {
        Rule::Spp(spp) => watch.expect(count * pixels * f64::from(spp), 0.0),
        Rule::Seconds(seconds) => watch.expect(0.0, count * seconds),
    }
}
