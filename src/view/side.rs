//! One of the films in the window: a sampler, its renderer, and its share of the time.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use super::keys::LAYERS;
use crate::{
    error::Result,
    film::Aov,
    gpu::Device,
    pass::{Saved, SceneBuffers},
    sampler::Sampler,
    scene::Scene,
    session::{Renderer, Settings},
    shader::constants::{SHOW_CELLS, SHOW_LEVELS, SHOW_PICTURE},
};

/// Aim for the time between two pictures: passes take more samples below, and fewer above.
const PICTURE_TIME: Duration = Duration::from_millis(60);
/// Most samples in a pass.
const MOST_SAMPLES: u32 = 64;

/// A film and what renders it.
pub struct Side {
    pub(super) renderer: Renderer,
    pub(super) sampler: Sampler,
    /// Time in passes since the camera came to rest.
    pub(super) time: Duration,
    samples: u32,
}

impl Side {
    /// Makes a renderer over buffers of the scene, or the first one without, with what another renderer
    /// has learned. Fails if an option is out of range or the device fails.
    pub fn new(
        device: &Arc<Device>,
        scene: &Scene,
        buffers: Option<Arc<SceneBuffers>>,
        settings: &Settings,
        guide: Option<&[u8]>,
    ) -> Result<Self> {
        let sampler = settings.sampler;
        let mut aovs = vec![Aov::Albedo, Aov::Normal, Aov::Visible];
        if sampler == Sampler::Guided {
            aovs.push(Aov::GuideCell);
        }
        let settings = Settings { aovs, ..settings.clone() };
        let mut renderer = match buffers {
            Some(buffers) => Renderer::with_scene_buffers(device, buffers, scene, settings)?,
            None => Renderer::new(device, scene, settings)?,
        };
        if let Some(bytes) = guide.filter(|_| sampler.has_guide()) {
            let path = "guide".as_ref();
            renderer.take_guide(Saved { path, bytes, continues: false })?;
        }
        Ok(Self { renderer, sampler, time: Duration::ZERO, samples: 1 })
    }

    /// Renders a pass of at most `most` samples. Fails if the device does.
    pub fn render(&mut self, most: u32) -> Result<Duration> {
        let start = Instant::now();
        let samples = self.samples.min(most);
        self.renderer.render_pass(samples)?;
        let took = start.elapsed();
        self.time += took;
        if took < PICTURE_TIME / 2 && samples == self.samples {
            self.samples = (2 * self.samples).min(MOST_SAMPLES);
        } else if took > 2 * PICTURE_TIME {
            self.samples = (self.samples / 2).max(1);
        }
        Ok(took)
    }

    /// Starts the film again. Fails if the device does.
    pub fn look(
        &mut self,
        camera: &crate::scene::Camera,
        size: [u32; 2],
        seed: u32,
        learns: bool,
    ) -> Result<()> {
        self.time = Duration::ZERO;
        self.samples = 1;
        self.renderer.look(camera, size, seed, learns)
    }

    /// Returns `layer`, or the picture where the sampler has no such layer.
    pub fn layer(&self, layer: u32) -> u32 {
        let is_known = LAYERS.iter().any(|(known, _)| *known == layer);
        let is_of_guide = layer == SHOW_CELLS || layer == SHOW_LEVELS;
        if is_known && (self.sampler == Sampler::Guided || !is_of_guide) {
            layer
        } else {
            SHOW_PICTURE
        }
    }
}
