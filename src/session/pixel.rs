//! Records everything that happens at the first hit of one pixel, read back from the device.
//!
//! Wave buffers hold only the last group of shadow rays and the final lobe weights. The pixel is
//! therefore rendered with one ray, then two, and so on: the random numbers of a ray do not depend
//! on how many follow, so each round repeats the one before and adds a ray.

use bytemuck::Pod;
use glam::Vec3;

use super::Renderer;
use crate::{
    error::{Error, Result},
    gpu::Buffer,
    pass::{BLOCK_PIXELS, Progress},
    sampler::{
        Sampler,
        guided::{Guided, RecordedGuide, RecordedRay},
        product::{
            Product,
            record::{RecordedLobe, lobe_count, read_lobes},
        },
        visibility::Visibility,
    },
    shader::{
        constants::NO_MATERIAL,
        structs::{Hit, ShadowRay},
    },
};

/// Tells the random numbers of [`Renderer::inspect_guided_pixel`] from those of the picture.
const INSPECTION_SEED: u32 = 0x3d4e_91c7;
const INSPECTION_RAYS: u32 = 40;

/// First hit of a pixel's first sample, with all its shadow rays.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedPixel {
    /// Position, metres.
    pub position: Vec3,
    /// Unit shading normal.
    pub normal: Vec3,
    /// Shadow rays in the order of tracing.
    pub rays: Vec<RecordedRay>,
    /// Lobes of the product; empty for samplers without lobes.
    pub lobes: Vec<RecordedLobe>,
    /// Unit directions in the cache when the last ray was drawn, oldest first; `None` without a cache.
    pub cached: Option<Vec<Vec3>>,
}

impl Renderer {
    /// Renders one sample of a renderer's only pixel and reads it back; `None` if the camera ray
    /// leaves the scene. Empties the film.
    ///
    /// # Errors
    /// [`Error::Usage`] for `guided`, whose choices depend on the whole picture: see
    /// [`Renderer::record_guided_pixel`]; [`Error::Vulkan`] if the device fails.
    ///
    /// # Panics
    /// If the window is larger than one pixel.
    pub fn record_pixel(&mut self) -> Result<Option<RecordedPixel>> {
        let window = self.runner.scene().window();
        assert!(window.width == 1 && window.height == 1, "a window of one pixel");
        if self.settings.sampler == Sampler::Guided {
            return Err(Error::usage(
                "guided learns from the whole picture: one pixel alone has nothing to record",
            ));
        }
        let most = self.settings.shadow_rays;
        let mut recorded: Option<RecordedPixel> = None;
        for count in 1..=most.max(1) {
            self.runner.limit_shadow_rays(count.min(most));
            self.restart(self.settings.seed)?;
            self.render_pass(1)?;
            let hit: Hit = element(self.runner.waves().hits(), 0)?;
            if hit.material == NO_MATERIAL {
                recorded = None;
                break;
            }
            let pixel = recorded.get_or_insert_with(|| RecordedPixel {
                position: hit.position.into(),
                normal: hit.shading_normal.into(),
                rays: Vec::new(),
                lobes: Vec::new(),
                cached: None,
            });
            if most == 0 {
                break;
            }
            let in_group = self.runner.last_group_rays(self.technique.steps()) - 1;
            let last = (in_group * BLOCK_PIXELS) as usize;
            let ray: ShadowRay = element(self.runner.waves().shadow_rays(), last)?;
            let visible: u32 = element(self.runner.waves().visibility(), last)?;
            pixel.rays.push(RecordedRay {
                direction: ray.direction.into(),
                contribution: ray.contribution.into(),
                is_visible: visible != 0,
            });
            if let Some(product) = self.technique::<Product>() {
                let lobes = product.lobes();
                read_lobes(lobes, &vec![1.0; lobe_count(lobes)?], &mut pixel.lobes)?;
            }
            if let Some(visibility) = self.technique::<Visibility>() {
                let lobes = visibility.lobes();
                let factors = visibility.visibility_weights(lobe_count(lobes)?)?;
                read_lobes(lobes, &factors, &mut pixel.lobes)?;
                pixel.cached = Some(visibility.cached_directions()?);
            }
        }
        self.runner.limit_shadow_rays(most);
        Ok(recorded)
    }
}

impl Renderer {
    /// Traces `rays` shadow rays of film pixel `at` with what `guided` has learned, in whole
    /// samples after those in the film; `None` if no camera ray hits anything, or for other
    /// samplers. The renderer should not continue afterwards. Fails if the device does.
    ///
    /// # Panics
    /// If the pixel is outside the window.
    pub fn record_guided_pixel(
        &mut self,
        at: [u32; 2],
        rays: u32,
    ) -> Result<Option<RecordedGuide>> {
        let record = |guided: &mut Guided, runner: &mut _, progress: &_| {
            guided.record_pixel(runner, progress, at, rays)
        };
        self.with_technique(record).unwrap_or(Ok(None))
    }

    /// Finds the cell of film pixel `at` by a few shadow rays, with numbers of their own, which teach the
    /// guide as those of a training do: the renderer may continue. `None` as for
    /// [`Renderer::record_guided_pixel`]. Fails if the device does.
    ///
    /// # Panics
    /// If the pixel is outside the window.
    pub fn inspect_guided_pixel(&mut self, at: [u32; 2]) -> Result<Option<RecordedGuide>> {
        let inspect = |guided: &mut Guided, runner: &mut _, progress: &Progress| {
            let progress = Progress { seed: progress.seed ^ INSPECTION_SEED, ..*progress };
            guided.record_pixel(runner, &progress, at, INSPECTION_RAYS)
        };
        self.with_technique(inspect).unwrap_or(Ok(None))
    }
}

fn element<T: Pod>(buffer: &Buffer, index: usize) -> Result<T> {
    let values: Vec<T> = buffer.download(index + 1)?;
    Ok(values[index])
}
