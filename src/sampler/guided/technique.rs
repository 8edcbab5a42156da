//! `guided` in one render: its training, rebuilds, choice of candidates, and reports.

use super::{
    buffers::{GuideBuffers, GuideSize, SPLIT_AFTER, guide_schedule},
    choice::{Choice, Trial},
    cost::GUIDED_CANDIDATES,
    epoch::{TRAINING_SEED, with_epoch},
    parameters::GuidedParameters,
    state::GuideState,
    steps::GuidedSteps,
    ways::{ChosenWay, Way},
};
use crate::{
    error::Result,
    film::{Aov, statistics::RayCost},
    gpu::DescriptorSet,
    pass::{Passes, Progress, Report, Runner, SHADOW_RAYS_PER_GROUP, Steps, Technique},
    sampler::{
        Context, Parameters, Room,
        basic::{self, BasicSteps},
        knob,
    },
    shader::structs::Wave,
};
use std::collections::BTreeMap;

/// Training sweeps before the first sample; each covers one pixel in this many.
const TRAINING_SWEEPS: u32 = 8;
/// Share of visible rays above which a scene is open and rendered as by `mis`: learning would not pay.
const OPEN_SHARE: f64 = 0.5;
/// The same where a measurement decides below it.
const CLEARLY_OPEN_SHARE: f64 = 0.9;

pub(in crate::sampler) struct GuidedRoom;

impl Room for GuidedRoom {
    fn check(&self, parameters: &Parameters, _depth: u32) -> Result<()> {
        first_candidates(parameters).map(drop)
    }

    fn aovs(&self) -> &[Aov] {
        &[Aov::GuideCell]
    }

    fn describe(&self, parameters: &Parameters) -> BTreeMap<String, String> {
        let mut named = knob::describe(GuidedParameters::KNOBS, &parameters.guided);
        named.insert("candidates".to_owned(), knob::text_or_auto(parameters.candidates));
        named.extend(basic::MIS.describe(parameters));
        named
    }

    fn create(&self, context: Context<'_>) -> Result<Box<dyn Technique>> {
        let Context { scene, parameters, runner } = context;
        let settings = runner.settings();
        let own = parameters.guided;
        let size = GuideSize {
            pixels: runner.film().padded_pixels(),
            paths: runner.waves().capacity(),
            shadow_rays: settings.shadow_rays.clamp(1, SHADOW_RAYS_PER_GROUP),
            has_bounces: own.guides_bounces(settings.depth),
        };
        let open_steps = basic::MIS.steps(parameters, settings.surfaces)?;
        let rays_in_the_open = own.rays_in_the_open(settings.shadow_rays);
        let mut guided = Guided {
            buffers: GuideBuffers::new(runner.device(), scene, &own, size)?,
            steps: GuidedSteps::new(first_candidates(parameters)?, own, settings),
            open_steps: open_steps.with_rays(Some(rays_in_the_open)),
            rays_in_the_open,
            given_candidates: parameters.candidates,
            parameters: own,
            choice: Choice::default(),
            way: None,
            ray_costs: Vec::new(),
            way_ms: 0.0,
            may_be_open: false,
            is_trained: false,
            is_open: false,
            rebuilt_at: 0,
            tag: 0,
        };
        guided.forget_choice();
        Ok(Box::new(guided))
    }
}

/// Returns the candidates per shadow ray until the choice is made.
fn first_candidates(parameters: &Parameters) -> Result<u32> {
    parameters.candidates_among("guided", &GUIDED_CANDIDATES, GUIDED_CANDIDATES[0])
}

/// `guided` in one render.
pub struct Guided {
    pub(super) buffers: GuideBuffers,
    steps: GuidedSteps,
    /// Steps of `mis`, for open scenes.
    open_steps: BasicSteps,
    /// Their shadow rays unless others are chosen.
    rays_in_the_open: [u32; 2],
    /// Number of candidates that the user asked for; `None` for `auto`.
    given_candidates: Option<u32>,
    parameters: GuidedParameters,
    choice: Choice,
    /// Chosen sampler and shadow rays; `None` while undecided and where they are given.
    way: Option<Way>,
    ray_costs: Vec<RayCost>,
    way_ms: f64,
    /// True if so much is visible that `mis` may be better: measured after the training.
    may_be_open: bool,
    is_trained: bool,
    /// True if too little is blocked to learn anything.
    pub(super) is_open: bool,
    /// Samples per pixel at the last rebuild of the guide.
    pub(super) rebuilt_at: u32,
    /// Tag of the guides that this one went on from; 0 for none.
    pub(super) tag: u32,
}

impl Guided {
    /// Returns what was learned in a film of `samples` samples per pixel. Fails if the device does.
    pub fn state(&self, samples: u32) -> Result<GuideState> {
        Ok(GuideState {
            samples,
            rebuilt_at: self.rebuilt_at,
            is_open: self.is_open,
            candidates: self.candidates(),
            rays: self.way.map(|way| way.rays),
            tag: self.tag,
            ..self.buffers.state()?
        })
    }

    /// Continues from what an earlier render learned, without training: bit for bit, if the film
    /// holds as many samples as it did when the state was taken. Under `candidates=auto` takes its
    /// choice too. Returns true if the geometry differs, so that most was forgotten.
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
        self.may_be_open = false;
        if let Some(rays) = state.rays.filter(|_| self.parameters.chooses_rays && !has_moved) {
            self.take_way(Way { is_mis: self.is_open, rays });
        }
        if let Some(candidates) = state.candidates {
            self.take_choice(Choice { candidates: Some(candidates), ..Choice::default() });
            runner.warm_up(self)?;
        }
        Ok(has_moved)
    }

    /// Undoes the choice, unless the user made it.
    fn forget_choice(&mut self) {
        self.choice = Choice { candidates: self.given_candidates, ..Choice::default() };
        self.steps.candidates = self.given_candidates.unwrap_or(GUIDED_CANDIDATES[0]);
    }

    /// Takes a choice measured here or by an earlier render, unless the user made it.
    fn take_choice(&mut self, choice: Choice) {
        if self.given_candidates.is_none() {
            self.steps.candidates = choice.candidates.unwrap_or(self.steps.candidates);
            self.choice = choice;
        }
    }

    /// Takes sampler and shadow rays measured here or by an earlier render.
    fn take_way(&mut self, way: Way) {
        self.is_open = way.is_mis;
        self.steps = self.steps.with_rays(Some(way.rays));
        self.open_steps = self.open_steps.with_rays(Some(way.rays));
        self.way = Some(way);
    }

    /// Chooses sampler and shadow rays by measurement: `mis` or `guided` where either may be better,
    /// then fewer rays.
    fn choose_way(&mut self, runner: &mut Runner, progress: &Progress) -> Result<()> {
        let most = runner.settings().shadow_rays;
        let later = self.parameters.later_rays;
        let guided = Way { is_mis: false, rays: [most, self.parameters.later_rays_of(most)] };
        let mis = Way { is_mis: true, rays: self.rays_in_the_open };
        let (first, other) = match (self.is_open, self.may_be_open) {
            (true, _) => (mis, None),
            (false, true) => (mis, Some(guided)),
            (false, false) => (guided, None),
        };
        let ChosenWay { way, costs, ms } = if most == 0 {
            ChosenWay { way: first, costs: Vec::new(), ms: 0.0 }
        } else {
            self.trial().choose_way(runner, progress, first, other, later)?
        };
        self.ray_costs = costs;
        self.way_ms = ms;
        self.take_way(way);
        Ok(())
    }

    fn trial(&self) -> Trial<'_> {
        Trial {
            buffers: &self.buffers,
            steps: self.steps,
            open_steps: self.open_steps,
            is_mis: false,
            tag: self.tag,
        }
    }

    /// Returns the candidates per shadow ray; `None` while `auto` is undecided, and in open scenes.
    fn candidates(&self) -> Option<u32> {
        self.choice.candidates.filter(|_| !self.is_open)
    }

    fn rebuild(&mut self, splits: bool, samples: u32) -> Result<()> {
        self.rebuilt_at = samples;
        self.buffers.rebuild(splits)
    }

    /// Trains on sweeps over parts of the film and finds out whether the scene is open.
    fn train(&mut self, runner: &mut Runner, progress: &Progress) -> Result<()> {
        for sweep in 0..TRAINING_SWEEPS {
            let wave = Wave {
                first_pixel: sweep,
                first_sample: progress.next_sample(),
                sample_count: 1,
                seed: progress.seed ^ TRAINING_SEED,
                pixel_stride: TRAINING_SWEEPS,
                is_training: 1,
                ..Wave::default()
            };
            let wave = with_epoch(wave, wave.first_sample, self.tag);
            let before = runner.totals().clone();
            runner.sweep(self, wave, runner.film().padded_pixels() / TRAINING_SWEEPS)?;
            runner.take_counters()?;
            // The first sweep samples only environment and BRDF: nothing is known yet. It is not in
            // the picture, so the picture does not depend on its own samples here.
            let visible = runner.totals().shadow_rays_visible - before.shadow_rays_visible;
            let traced = runner.totals().shadow_rays_traced - before.shadow_rays_traced;
            let is_above = |share: f64| visible as f64 > share * traced as f64;
            if sweep == 0 && self.parameters.chooses_rays {
                self.may_be_open = is_above(OPEN_SHARE);
            }
            let limit = if self.may_be_open { CLEARLY_OPEN_SHARE } else { OPEN_SHARE };
            if sweep == 0 && is_above(limit) {
                log::info!("{visible} of {traced} rays of the first sweep are visible: as mis");
                self.is_open = true;
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

impl Passes for Guided {
    fn steps(&self) -> &dyn Steps {
        if self.is_open { &self.open_steps } else { &self.steps }
    }

    fn other_steps(&self) -> Vec<Box<dyn Steps>> {
        let mut others: Vec<Box<dyn Steps>> = vec![Box::new(self.open_steps)];
        if self.given_candidates.is_none() {
            for candidates in &GUIDED_CANDIDATES[..2] {
                others.push(Box::new(self.steps.with_candidates(*candidates)));
            }
        }
        others
    }

    fn set(&self) -> Option<&DescriptorSet> {
        Some(self.buffers.set())
    }
}

impl Technique for Guided {
    fn complete(&self, wave: Wave, progress: &Progress) -> Wave {
        with_epoch(wave, progress.first_sample.wrapping_add(self.rebuilt_at), self.tag)
    }

    fn learn(&mut self, runner: &mut Runner, progress: &Progress) -> Result<u32> {
        let samples = progress.sample_count;
        if !self.is_trained && !self.is_open {
            self.train(runner, progress)?;
        } else if self.rebuilt_at != samples && guide_schedule(samples) == samples && !self.is_open
        {
            self.rebuild(samples == SPLIT_AFTER, samples)?;
        }
        if self.parameters.chooses_rays && self.way.is_none() {
            self.choose_way(runner, progress)?;
        }
        if self.is_open {
            return Ok(u32::MAX);
        }
        if self.choice.candidates.is_none() {
            let choice = self.trial().choose(runner, progress)?;
            self.take_choice(choice);
        }
        Ok(guide_schedule(samples + 1) - samples)
    }

    fn restart(&mut self, _runner: &mut Runner) -> Result<()> {
        self.buffers.forget()?;
        self.is_trained = false;
        self.is_open = false;
        self.may_be_open = false;
        self.way = None;
        self.ray_costs = Vec::new();
        self.way_ms = 0.0;
        self.steps = self.steps.with_rays(None);
        self.open_steps = self.open_steps.with_rays(Some(self.rays_in_the_open));
        self.rebuilt_at = 0;
        self.tag = 0;
        self.forget_choice();
        Ok(())
    }

    fn report(&self) -> Report {
        Report {
            host_ms: [
                ("guide rebuilds".to_owned(), self.buffers.rebuild_ms()),
                ("choice of candidates".to_owned(), self.choice.ms),
                ("choice of shadow rays".to_owned(), self.way_ms),
            ]
            .into(),
            buffer_bytes: self.buffers.buffer_bytes(),
            candidates: self.candidates(),
            candidate_costs: self.choice.costs.clone(),
            chosen_rays: self.way.as_ref().map(Way::described),
            ray_costs: self.ray_costs.clone(),
            ..Report::default()
        }
    }
}
