//! `guided` in one render: its training, rebuilds, choice of an arm, and reports.

use std::collections::BTreeMap;

use serde_json::json;

use super::{
    arm::{Arm, Arms, first_candidates},
    buffers::{GuideBuffers, GuideSize, SPLIT_AFTER, guide_schedule},
    cost::ArmCost,
    epoch::{TRAINING_SEED, with_arm, with_epoch},
    parameters::AUTO_COHORT_EDGE,
    race::{Race, race_due},
    state::GuideState,
};
use crate::{
    error::{Error, Result},
    film::Aov,
    gpu::DescriptorSet,
    pass::{
        Explanation, Passes, Progress, Report, Runner, SHADOW_RAYS_PER_GROUP, Saved, Steps,
        Technique,
    },
    sampler::{Context, Parameters, Room, knob::Knobs},
    shader::{constants::TRAINING_WAVE, structs::Wave},
};

/// Training sweeps before the first sample. Together they cover the film, or so many pixels of a larger one.
const TRAINING_SWEEPS: u32 = 8;
const MOST_TRAINING_PIXELS: u32 = 1 << 19;
/// Share of visible rays above which a scene is open and rendered as by `mis`: learning would not pay.
const OPEN_SHARE: f64 = 0.5;

pub(in crate::sampler) struct GuidedRoom;

impl Room for GuidedRoom {
    fn check(&self, parameters: &Parameters, _depth: u32) -> Result<()> {
        first_candidates(parameters).map(drop)
    }

    fn aovs(&self) -> &[Aov] {
        &[Aov::GuideCell]
    }

    /// More than others: `docs/experiments.md`, shadow_rays_by_worth.
    fn shadow_rays(&self) -> u32 {
        8
    }

    fn auto_cohort_edge(&self) -> u32 {
        AUTO_COHORT_EDGE
    }

    fn has_guide(&self) -> bool {
        true
    }

    fn describe(&self, parameters: &Parameters) -> BTreeMap<String, String> {
        let mut named = parameters.guided.describe();
        named.extend([parameters.shared("candidates"), parameters.shared("compensation")]);
        named
    }

    fn create(&self, context: Context<'_>) -> Result<Box<dyn Technique>> {
        let Context { scene, parameters, runner } = context;
        let settings = &runner.settings;
        let own = parameters.guided;
        let size = GuideSize {
            pixels: runner.film.padded_pixels(),
            paths: runner.waves.capacity,
            shadow_rays: settings.shadow_rays.clamp(1, SHADOW_RAYS_PER_GROUP),
            has_bounces: own.guides_bounces(settings.depth),
        };
        let arms = Arms::new(parameters, settings, runner.device.capabilities())?;
        let arm = arms.first(false);
        Ok(Box::new(Guided {
            buffers: GuideBuffers::new(&runner.device, scene, &own, size)?,
            steps: arms.steps(&arm),
            arms,
            choice: Choice::of(arm),
            open_choice: None,
            is_trained: false,
            is_open: false,
            rebuilt_at: 0,
            tag: 0,
        }))
    }
}

/// The arm in use, and why.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    pub(super) arm: Arm,
    /// Samples per pixel from which it is in use.
    since: u32,
    races: u32,
    costs: Vec<ArmCost>,
    ms: f64,
}

/// `guided` in one render.
pub struct Guided {
    pub(super) buffers: GuideBuffers,
    arms: Arms,
    pub(super) choice: Choice,
    /// Passes of the arm in use.
    steps: Box<dyn Steps>,
    /// The choice in the open scene that another camera saw.
    open_choice: Option<Choice>,
    is_trained: bool,
    /// True if too little is blocked to learn anything.
    is_open: bool,
    /// Samples per pixel at the last rebuild of the guide.
    pub(super) rebuilt_at: u32,
    /// Tag of the guides that this one went on from; 0 for none.
    pub(super) tag: u32,
}

impl Guided {
    /// Continues from what an earlier render learned, without training: bit for bit, if the film
    /// holds as many samples as it did when the state was taken. Takes its arm too, as far as the settings
    /// leave a choice. Returns true if the geometry differs, so that most was forgotten.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if environment or regions differ; [`crate::Error::Vulkan`] if the
    /// device fails.
    pub fn restore(
        &mut self,
        runner: &mut Runner,
        progress: &Progress,
        state: &GuideState,
    ) -> Result<bool> {
        let samples = progress.sample_count;
        let has_moved = self.buffers.restore(state)?;
        self.is_open = state.is_open && !has_moved;
        if state.samples == samples {
            self.rebuilt_at = state.rebuilt_at;
            self.tag = state.tag;
        } else {
            self.buffers.rebuild(false)?;
            self.rebuilt_at = samples;
            self.tag = state.epoch_tag();
        }
        self.is_trained = true;
        if let Some(arm) = state.arm.filter(|_| state.is_open == self.is_open) {
            self.start_with(self.arms.conform(arm, self.is_open));
            (self.choice.since, self.choice.races) = (state.arm_since, state.races);
        } else {
            self.start_with(self.arms.first(self.is_open));
        }
        runner.warm_up(self)?;
        Ok(has_moved)
    }

    /// Forgets what was measured, and renders by `arm`.
    fn start_with(&mut self, arm: Arm) {
        self.choice = Choice::of(arm);
        self.steps = self.arms.steps(&arm);
    }

    /// Returns the candidates per shadow ray; `None` while nothing is measured, and where it is not guided.
    fn candidates(&self) -> Option<u32> {
        let Choice { arm, races, .. } = &self.choice;
        (arm.is_guided && *races > 0).then_some(arm.candidates)
    }

    /// Races the arms if it is time. The guide must have been rebuilt just before, if it learns.
    fn choose(&mut self, runner: &mut Runner, progress: &Progress) -> Result<()> {
        let samples = progress.sample_count;
        let pixels = runner.film.padded_pixels();
        while race_due(self.choice.races, pixels) <= samples {
            let is_first = self.choice.races == 0;
            self.choice.races += 1;
            let contenders = self.arms.contenders(is_first, self.choice.arm, self.is_open);
            if contenders.len() < 2 || !Race::fits(runner) {
                continue;
            }
            let race = Race { buffers: &self.buffers, arms: &self.arms, tag: self.tag };
            let (arm, costs, ms) = race.run(runner, progress, &contenders)?;
            self.choice.ms += ms;
            self.choice.costs.extend(costs);
            if arm != self.choice.arm {
                (self.choice.arm, self.choice.since) = (arm, samples);
                self.steps = self.arms.steps(&arm);
            }
        }
        Ok(())
    }

    fn rebuild(&mut self, splits: bool, samples: u32) -> Result<()> {
        self.rebuilt_at = samples;
        self.buffers.rebuild(splits)
    }

    /// Renders as `mis` from here on: there is nothing to learn.
    fn open(&mut self) {
        self.is_open = true;
        self.start_with(self.arms.first(true));
        if let Some(choice) = self.open_choice.take() {
            self.steps = self.arms.steps(&choice.arm);
            self.choice = choice;
        }
    }

    /// Trains on sweeps over parts of the film and finds out whether the scene is open. One that lamps alone
    /// light is as good as open.
    fn train(&mut self, runner: &mut Runner, progress: &Progress) -> Result<()> {
        if runner.settings.surfaces.has_black_environment {
            self.open();
            return Ok(());
        }
        let pixels = runner.film.padded_pixels();
        let apart = pixels.div_ceil(MOST_TRAINING_PIXELS);
        let pixel_stride = TRAINING_SWEEPS * apart;
        for sweep in 0..TRAINING_SWEEPS {
            let wave = Wave {
                first_pixel: sweep * apart,
                first_sample: progress.next_sample(),
                sample_count: 1,
                seed: progress.seed ^ TRAINING_SEED,
                pixel_stride,
                is_training: TRAINING_WAVE,
                ..Wave::default()
            };
            let wave = with_epoch(wave, wave.first_sample, self.tag);
            let before = runner.totals.clone();
            runner.sweep(self, wave, pixels / pixel_stride)?;
            runner.take_counters()?;
            if runner.is_stopped {
                return Ok(());
            }
            // The first sweep samples only environment and BRDF: nothing is known yet. It is not in
            // the picture, so the picture does not depend on its own samples here.
            let visible = runner.totals.shadow_rays_visible - before.shadow_rays_visible;
            let traced = runner.totals.shadow_rays_traced - before.shadow_rays_traced;
            if sweep == 0 && visible as f64 > OPEN_SHARE * traced as f64 {
                log::info!("{visible} of {traced} rays of the first sweep are visible: as mis");
                self.open();
                return Ok(());
            }
            // Rebuild only after 1, 2, 4 and 8 sweeps: every rebuild costs time.
            if (sweep + 1).is_power_of_two() {
                self.rebuild(sweep + 1 == TRAINING_SWEEPS, progress.sample_count)?;
            }
        }
        self.is_trained = true;
        Ok(())
    }
}

impl Choice {
    fn of(arm: Arm) -> Self {
        Self { arm, since: 0, races: 0, costs: Vec::new(), ms: 0.0 }
    }

    /// Says in one sentence which arm is in use and why; `None` before any measurement.
    fn sentence(&self) -> Option<String> {
        let chosen = self.costs.iter().rev().find(|cost| cost.is_chosen)?;
        let seconds = 1e-3 * self.ms;
        let rivals = self.costs.iter().rev().filter(|cost| cost.arm != chosen.arm);
        let last = rivals.clone().map(|cost| cost.at_samples).next()?;
        let rivals = rivals.filter(|cost| cost.at_samples == last);
        let second = rivals.min_by(|a, b| a.relative_cost.total_cmp(&b.relative_cost))?;
        Some(format!(
            "chose {} in {seconds:.1} s of measuring; next best {}, with {:.2} times the variance × time",
            chosen.arm,
            second.arm,
            second.relative_cost / chosen.relative_cost
        ))
    }
}

impl Passes for Guided {
    fn steps(&self) -> &dyn Steps {
        self.steps.as_ref()
    }

    /// The arms of the first race; later ones warm up theirs.
    fn other_steps(&self) -> Vec<Box<dyn Steps>> {
        let arms = self.arms.contenders(true, self.arms.first(false), false);
        arms.iter().chain(&[self.arms.first(true)]).map(|arm| self.arms.steps(arm)).collect()
    }

    fn set(&self) -> Option<&DescriptorSet> {
        Some(&self.buffers.set)
    }
}

impl Technique for Guided {
    fn complete(&self, wave: Wave, progress: &Progress) -> Wave {
        let wave = with_arm(wave, self.choice.since);
        with_epoch(wave, progress.first_sample.wrapping_add(self.rebuilt_at), self.tag)
    }

    fn learn(&mut self, runner: &mut Runner, progress: &Progress) -> Result<u32> {
        let samples = progress.sample_count;
        if !self.is_trained && !self.is_open {
            self.train(runner, progress)?;
            if runner.is_stopped {
                return Ok(u32::MAX);
            }
        } else if self.choice.arm.is_guided
            && self.rebuilt_at != samples
            && guide_schedule(samples) == samples
        {
            self.rebuild(samples == SPLIT_AFTER, samples)?;
        }
        if !self.choice.arm.is_guided || self.rebuilt_at == samples {
            self.choose(runner, progress)?;
        }
        let pixels = runner.film.padded_pixels();
        let next = race_due(self.choice.races, pixels).max(samples + 1) - samples;
        let is_guided = self.choice.arm.is_guided;
        Ok(if is_guided { next.min(guide_schedule(samples + 1) - samples) } else { next })
    }

    fn restart(&mut self, _runner: &mut Runner) -> Result<()> {
        self.buffers.forget()?;
        self.is_trained = false;
        self.is_open = false;
        self.rebuilt_at = 0;
        self.tag = 0;
        self.start_with(self.arms.first(false));
        self.open_choice = None;
        Ok(())
    }

    /// Keeps the guide, whose cells lie in the scene and not in the film. An open scene may have blocked
    /// places elsewhere, so it is looked at again.
    fn look(&mut self, _runner: &mut Runner, learns: bool) -> Result<()> {
        if self.is_open || !self.is_trained {
            self.open_choice = self.is_open.then(|| self.choice.clone());
            self.start_with(self.arms.first(false));
            self.buffers.forget()?;
            self.is_open = false;
            self.is_trained = false;
        } else if learns && self.choice.arm.is_guided {
            self.buffers.rebuild(false)?;
        }
        self.rebuilt_at = 0;
        self.choice.since = 0;
        Ok(())
    }

    fn save(&self, samples: u32) -> Result<Option<Vec<u8>>> {
        let state = GuideState {
            samples,
            rebuilt_at: self.rebuilt_at,
            is_open: self.is_open,
            arm: (self.choice.races > 0).then_some(self.choice.arm),
            arm_since: self.choice.since,
            races: self.choice.races,
            tag: self.tag,
            ..self.buffers.state()?
        };
        state.to_bytes().map(Some).map_err(|source| Error::io("guide".as_ref(), "encode", source))
    }

    fn load(&mut self, runner: &mut Runner, progress: &Progress, saved: Saved<'_>) -> Result<bool> {
        let Saved { path, bytes, continues } = saved;
        let state = GuideState::from_bytes(bytes, path)?;
        if !continues {
            return self.restore(runner, progress, &GuideState { samples: u32::MAX, ..state });
        }
        if state.samples != progress.sample_count {
            return Err(Error::format(
                path,
                format!(
                    "what was learned belongs to {} samples per pixel, the checkpoint holds {}",
                    state.samples, progress.sample_count
                ),
            ));
        }
        if self.restore(runner, progress, &state)? {
            return Err(Error::format(path, "it was learned in another geometry"));
        }
        Ok(false)
    }

    fn explain_learned(
        &self,
        runner: &mut Runner,
        progress: &Progress,
        at: [u32; 2],
        rays: u32,
    ) -> Result<Option<Box<dyn Explanation>>> {
        let recorded = self.read_pixel(runner, progress, at, rays)?;
        Ok(recorded.map(|recorded| Box::new(recorded) as Box<dyn Explanation>))
    }

    fn report(&self) -> Report {
        Report {
            host_ms: [
                ("guide rebuilds".to_owned(), self.buffers.rebuild_ms),
                ("choice of an arm".to_owned(), self.choice.ms),
            ]
            .into(),
            candidates: self.candidates(),
            choice: self.choice.sentence(),
            figures: [
                ("arm".to_owned(), json!(self.choice.arm.to_string())),
                ("arms".to_owned(), json!(self.choice.costs)),
            ]
            .into(),
            ..Report::default()
        }
    }
}
