//! One of the films in the window: a session, and its share of the time.

use std::{sync::Arc, time::Duration};

use glam::Vec3;

use super::keys::LAYERS;
use crate::{
    error::Result,
    film::Aov,
    gpu::Device,
    pass::{Saved, SceneBuffers},
    sampler::Sampler,
    scene::Scene,
    session::{Renderer, Session, Settings},
    shader::constants::SHOW_PICTURE,
};

/// Aim for the time between two pictures.
const PICTURE_TIME: Duration = Duration::from_millis(60);

/// A film and what renders it.
pub(super) struct Side {
    pub(super) session: Session,
    pub(super) sampler: Sampler,
}

impl Side {
    /// Makes a session over buffers of the scene, or the first one without, with what another has
    /// learned. Fails if an option is out of range or the device fails.
    pub(crate) fn new(
        device: &Arc<Device>,
        scene: &Scene,
        buffers: Option<Arc<SceneBuffers>>,
        settings: &Settings,
        guide: Option<&[u8]>,
    ) -> Result<Self> {
        let sampler = settings.sampler;
        let mut aovs: Vec<Aov> = LAYERS.iter().filter_map(|(.., layer)| *layer).collect();
        aovs.retain(|layer| sampler.has_layer(*layer));
        aovs.dedup();
        aovs.push(Aov::Position);
        let settings = Settings { aovs, ..settings.clone() };
        let renderer = match buffers {
            Some(buffers) => Renderer::with_scene_buffers(device, buffers, scene, settings)?,
            None => Renderer::new(device, scene, settings)?,
        };
        let mut session = Session::of(renderer, device, scene);
        session.pace = PICTURE_TIME;
        if let Some(bytes) = guide.filter(|_| sampler.room().has_guide()) {
            let path = "guide".as_ref();
            session.renderer.take_guide(Saved { path, bytes, continues: false })?;
        }
        Ok(Self { session, sampler })
    }

    /// Returns `layer`, or the picture where the sampler has no such layer.
    pub(crate) fn layer(&self, layer: u32) -> u32 {
        let is_known = LAYERS.iter().any(|(known, _, of_film)| {
            *known == layer && of_film.is_none_or(|of_film| self.sampler.has_layer(of_film))
        });
        if is_known { layer } else { SHOW_PICTURE }
    }

    /// Means of the points that its pixels have met, metres, row by row; `None` for a pixel that met none.
    /// Fails if the device does.
    pub(crate) fn points(&self) -> Result<Vec<Option<Vec3>>> {
        let sums = self.session.renderer.sums()?;
        let mean = |(pixel, sum): (usize, &[f32; 3])| {
            (*sum != [0.0; 3]).then(|| Vec3::from(*sum) / sums.samples(pixel).max(1) as f32)
        };
        Ok(sums.position.iter().enumerate().map(mean).collect())
    }

    pub(crate) fn sample_count(&self) -> u32 {
        self.session.renderer.sample_count()
    }
}
