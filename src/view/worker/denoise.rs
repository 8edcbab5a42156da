//! Denoised pictures for the window: Open Image Denoise filters what is shown, never the film.

use std::time::{Duration, Instant};

use super::{Motion, Worker};
use crate::{
    error::Result,
    film::denoised::repair,
    gpu::{Denoiser, denoiser::Noisy},
    view::{message::Denoise, projector::Place, side::Side},
};

/// Longest filtering that the pictures of a moving camera wait for.
const MOVING_TIME: Duration = Duration::from_millis(25);
/// Least interval between filterings at rest, and its least multiple of the time of one.
const REST_INTERVAL: Duration = Duration::from_secs(1);
const REST_SHARE: u32 = 4;

pub(super) enum Filtered {
    /// Linear pixels of the film as it is.
    Now(Vec<[f32; 3]>),
    /// The picture that is shown is filtered, and recent enough.
    Before,
}

/// The filter, and when it is used.
pub(super) struct Denoising {
    pub(super) choice: Denoise,
    denoiser: Option<Denoiser>,
    /// Time that the last filtering took.
    took: Duration,
    /// End of the last filtering of each side, since the film started again at rest.
    filtered: [Option<Instant>; 2],
}

impl Default for Denoising {
    fn default() -> Self {
        let choice = Denoise::Moving;
        Self { choice, denoiser: None, took: Duration::ZERO, filtered: [None; 2] }
    }
}

impl Denoising {
    /// Gives the filter another chance to be quick enough.
    pub(super) fn start_moving(&mut self) {
        self.took = Duration::ZERO;
    }

    /// Lets the next picture be filtered, however recent the last is.
    pub(super) fn start_again(&mut self) {
        self.filtered = [None; 2];
    }

    /// Filters the film of a side, unless this was done just before and the film has not ended. Fails if
    /// the device or the filter does.
    pub(super) fn filter(
        &mut self,
        side: &Side,
        place: Place,
        has_ended: bool,
    ) -> Result<Option<Filtered>> {
        let Some(denoiser) = &self.denoiser else { return Ok(None) };
        let filtered = &mut self.filtered[place as usize];
        let pause = REST_INTERVAL.max(REST_SHARE * self.took);
        if !has_ended && filtered.is_some_and(|at| at.elapsed() < pause) {
            return Ok(Some(Filtered::Before));
        }
        let sums = side.session.renderer.sums()?;
        let start = Instant::now();
        let mean = |of: &[[f32; 3]]| -> Vec<[f32; 3]> {
            let share = |pixel: usize| 1.0 / sums.samples(pixel).max(1) as f32;
            let mut pixels: Vec<[f32; 3]> = of
                .iter()
                .enumerate()
                .map(|(pixel, sum)| sum.map(|sum| sum * share(pixel)))
                .collect();
            repair(&mut pixels, sums.width);
            pixels
        };
        let (color, albedo, normal) = (mean(&sums.sum), mean(&sums.albedo), mean(&sums.normal));
        let (width, height) = (sums.width, sums.height);
        let (albedo, normal) = (Some(&albedo[..]), Some(&normal[..]));
        let pixels = denoiser.denoise(&Noisy { width, height, color: &color, albedo, normal })?;
        self.took = start.elapsed();
        *filtered = Some(Instant::now());
        Ok(Some(Filtered::Now(pixels)))
    }
}

impl Worker {
    /// True if pictures are to be denoised now; without the library none ever is, and the panel says so.
    pub(super) fn denoises(&mut self) -> bool {
        let Denoising { choice, took, .. } = self.denoising;
        let is_moving = self.motion != Motion::Rest;
        if is_moving {
            self.denoising.start_again();
        }
        let wanted = match choice {
            Denoise::Never => false,
            Denoise::Moving => is_moving && took <= MOVING_TIME,
            Denoise::Always => !is_moving || took <= MOVING_TIME,
        };
        if wanted && self.denoising.denoiser.is_none() {
            match Denoiser::load() {
                Ok(denoiser) => self.denoising.denoiser = Some(denoiser),
                Err(error) => {
                    self.denoising.choice = Denoise::Never;
                    self.notice = error.to_string();
                    log::info!("{error}");
                }
            }
        }
        wanted
    }
}
