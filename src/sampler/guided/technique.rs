//! `guided` in one render: its training, rebuilds, choice of candidates, and reports.

use std::collections::BTreeMap;

use serde_json::json;

use super::{
    buffers::{GuideBuffers, GuideSize, SPLIT_AFTER, guide_schedule},
    choice::{Choice, Trial},
    cost::GUIDED_CANDIDATES,
    epoch::{TRAINING_SEED, with_epoch},
    parameters::AUTO_COHORT_EDGE,
    sharing::SharingChoice,
    state::GuideState,
    steps::GuidedSteps,
};
use crate::{
    error::{Error, Result},
    film::Aov,
    gpu::DescriptorSet,
    pass::{
        Explanation, Passes, Progress, Report, Runner, SHADOW_RAYS_PER_GROUP, Saved, Steps,
        Technique,
    },
    sampler::{Context, Parameters, Room, basic, knob::Knobs, rays::RaySteps},
    shader::{constants::TRAINING_WAVE, structs::Wave},
};

/// Training sweeps before the first sample; each covers one pixel in this many.
const TRAINING_SWEEPS: u32 = 8;
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
        let settings = runner.settings();
        let own = parameters.guided;
        let size = GuideSize {
            pixels: runner.film().padded_pixels(),
            paths: runner.waves().capacity(),
            shadow_rays: settings.shadow_rays.clamp(1, SHADOW_RAYS_PER_GROUP),
            has_bounces: own.guides_bounces(settings.depth),
        };
        let open_steps = basic::MIS.steps(parameters, settings.surfaces)?;
        let rays_in_the_open = own.rays_in_the_open(settings.shadow_rays, settings.depth);
        let mut guided = Guided {
            buffers: GuideBuffers::new(runner.device(), scene, &own, size)?,
            steps: GuidedSteps::new(first_candidates(parameters)?, own, settings),
            open_steps: open_steps
                .with_rays(rays_in_the_open)
                .with_sharing(parameters.share_paths.is_some()),
            given_candidates: parameters.candidates,
            choice: Choice::default(),
            chooses_sharing: parameters.share_paths.is_none() && settings.cohort_edge > 1,
            sharing: SharingChoice::default(),
            is_trained: false,
            is_open: false,
            rebuilt_at: 0,
            tag: 0,
        };
        guided.forget_choice();
        guided.forget_sharing();
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
    open_steps: RaySteps,
    /// Number of candidates that the user asked for; `None` for `auto`.
    given_candidates: Option<u32>,
    choice: Choice,
    /// True under `share-paths=auto`, where there is anything to share.
    chooses_sharing: bool,
    sharing: SharingChoice,
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
            share_paths: self.share_paths(),
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
        if self.chooses_sharing && state.share_paths.is_some() {
            self.take_sharing(SharingChoice {
                edge: state.share_paths,
                ..SharingChoice::default()
            });
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

    /// Undoes the choice of cohorts, unless the user made it.
    fn forget_sharing(&mut self) {
        self.sharing = SharingChoice::default();
        self.steps = self.steps.with_sharing(!self.chooses_sharing);
    }

    /// Takes the edge of cohorts measured here or by an earlier render.
    fn take_sharing(&mut self, sharing: SharingChoice) {
        self.steps = self.steps.with_sharing(sharing.edge == Some(AUTO_COHORT_EDGE));
        self.sharing = sharing;
    }

    fn trial(&self) -> Trial<'_> {
        Trial { buffers: &self.buffers, steps: self.steps, tag: self.tag }
    }

    /// Returns the candidates per shadow ray; `None` while `auto` is undecided, and in open scenes.
    fn candidates(&self) -> Option<u32> {
        self.choice.candidates.filter(|_| !self.is_open)
    }

    /// Returns the chosen edge of cohorts; `None` where it was given or is undecided, and in open scenes.
    fn share_paths(&self) -> Option<u32> {
        self.sharing.edge.filter(|_| !self.is_open)
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
                is_training: TRAINING_WAVE,
                ..Wave::default()
            };
            let wave = with_epoch(wave, wave.first_sample, self.tag);
            let before = runner.totals().clone();
            runner.sweep(self, wave, runner.film().padded_pixels() / TRAINING_SWEEPS)?;
            runner.take_counters()?;
            if runner.is_stopped() {
                return Ok(());
            }
            // The first sweep samples only environment and BRDF: nothing is known yet. It is not in
            // the picture, so the picture does not depend on its own samples here.
            let visible = runner.totals().shadow_rays_visible - before.shadow_rays_visible;
            let traced = runner.totals().shadow_rays_traced - before.shadow_rays_traced;
            if sweep == 0 && visible as f64 > OPEN_SHARE * traced as f64 {
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
        let mut others: Vec<Box<dyn Steps>> = vec![Box::new(self.open_steps.clone())];
        if self.chooses_sharing {
            others.push(Box::new(self.steps.with_sharing(true)));
        }
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
            if runner.is_stopped() {
                return Ok(u32::MAX);
            }
        } else if self.rebuilt_at != samples && guide_schedule(samples) == samples && !self.is_open
        {
            self.rebuild(samples == SPLIT_AFTER, samples)?;
        }
        if self.is_open {
            return Ok(u32::MAX);
        }
        if self.choice.candidates.is_none() {
            let choice = self.trial().choose(runner, progress)?;
            self.take_choice(choice);
        }
        if self.chooses_sharing && self.sharing.edge.is_none() {
            let sharing = self.trial().choose_sharing(runner, progress)?;
            self.take_sharing(sharing);
        }
        Ok(guide_schedule(samples + 1) - samples)
    }

    fn restart(&mut self, _runner: &mut Runner) -> Result<()> {
        self.buffers.forget()?;
        self.is_trained = false;
        self.is_open = false;
        self.rebuilt_at = 0;
        self.tag = 0;
        self.forget_choice();
        self.forget_sharing();
        Ok(())
    }

    /// Keeps the guide, whose cells lie in the scene and not in the film. An open scene may have blocked
    /// places elsewhere, so it is looked at again.
    fn look(&mut self, _runner: &mut Runner, learns: bool) -> Result<()> {
        if self.is_open || !self.is_trained {
            self.buffers.forget()?;
            self.is_open = false;
            self.is_trained = false;
        } else if learns {
            self.buffers.rebuild(false)?;
        }
        self.rebuilt_at = 0;
        Ok(())
    }

    fn save(&self, samples: u32) -> Result<Option<Vec<u8>>> {
        let bytes = self.state(samples)?.to_bytes();
        bytes.map(Some).map_err(|source| Error::io("guide".as_ref(), "encode", source))
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
                ("guide rebuilds".to_owned(), self.buffers.rebuild_ms()),
                ("choice of candidates".to_owned(), self.choice.ms),
                ("choice of sharing".to_owned(), self.sharing.ms),
            ]
            .into(),
            candidates: self.candidates(),
            figures: [
                ("candidate_costs".to_owned(), json!(self.choice.costs)),
                ("share_paths".to_owned(), json!(self.share_paths())),
                ("sharing_gain".to_owned(), json!(self.sharing.gain)),
            ]
            .into(),
            ..Report::default()
        }
    }
}
