//! Explains a pixel: records its first hit on the device, and writes a picture with its numbers.
//!
//! Wave buffers hold only the last group of shadow rays and the final lobe weights. The pixel is
//! therefore rendered with one ray, then two, and so on: the random numbers of a ray do not depend
//! on how many follow, so each round repeats the one before and adds a ray.
//!
//! The picture shows skies, darkened below the hit's horizon (blue): the environment with the samples
//! taken, then what the technique chose by, as in figures 4.3 to 4.8 of Wu & Shih 2009.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use bytemuck::Pod;

use super::{Renderer, Settings};
use crate::{
    error::{Error, Result},
    files::{check_writable, write_text},
    film::{Window, picture::write_png},
    gpu::{Buffer, Device},
    pass::{
        BLOCK_PIXELS, Explanation, PixelReadback, Progress, RayReadback, SceneBuffers,
        explanation::draw_rays,
    },
    scene::Scene,
    shader::{
        bindings::wave,
        constants::NO_MATERIAL,
        structs::{Hit, ShadowRay},
    },
};

/// Rays of an explanation by a renderer that has learned from its picture.
const LEARNED_RAYS: u32 = 64;
/// Tells the random numbers of [`Renderer::inspect_pixel`] from those of the picture.
const INSPECTION_SEED: u32 = 0x3d4e_91c7;
const INSPECTION_RAYS: u32 = 40;
/// Width of a sky, pixels.
const WIDTH: usize = 512;
/// Height of the white line between skies, pixels.
const GAP: usize = 4;

/// `out.exr` → `out.pixel_x_y.png`.
fn picture_path(output: &Path, [x, y]: [u32; 2]) -> PathBuf {
    output.with_extension(format!("pixel_{x}_{y}.png"))
}

/// Checks that film pixel `at` can be explained beside `output`, before any work.
///
/// # Errors
/// [`Error::Usage`] for a pixel outside the window; [`Error::Io`] if the picture cannot be written.
pub fn check(settings: &Settings, scene: &Scene, output: &Path, at: [u32; 2]) -> Result<()> {
    let [x, y] = at;
    let window = super::window_of(settings, scene);
    let is_inside = |at: u32, start: u32, length: u32| at >= start && at - start < length;
    if !is_inside(x, window.x, window.width) || !is_inside(y, window.y, window.height) {
        return Err(Error::usage(format!(
            "--pixel {x},{y}: expected {} ≤ x < {} and {} ≤ y < {}, the part of the film that is \
             rendered",
            window.x,
            u64::from(window.x) + u64::from(window.width),
            window.y,
            u64::from(window.y) + u64::from(window.height)
        )));
    }
    check_writable(&picture_path(output, at))
}

/// Writes the picture of `explanation` beside `output`, and its numbers as JSON. Returns both files.
///
/// # Errors
/// A failing disk.
pub fn write(
    explanation: &dyn Explanation,
    scene: &Scene,
    output: &Path,
    at: [u32; 2],
) -> Result<[PathBuf; 2]> {
    let path = picture_path(output, at);
    let mut rows: Vec<[u8; 3]> = draw_rays(scene, explanation, WIDTH).pixels;
    for sky in explanation.skies(scene, WIDTH) {
        rows.extend(std::iter::repeat_n([255; 3], GAP * WIDTH));
        rows.extend(&sky.pixels);
    }
    write_png(&path, WIDTH as u32, &rows)?;
    let numbers = path.with_extension("json");
    write_text(&numbers, &explanation.numbers().to_string())?;
    Ok([path, numbers])
}

impl Renderer {
    /// Explains film pixel `at`: with what was learned, where choices depend on the whole picture, else by
    /// rendering its first sample again on a film of its own. `None` if the pixel sees the environment.
    /// Fails if the device does.
    ///
    /// # Panics
    /// If the pixel is outside the window.
    pub fn explain_pixel(
        mut self,
        device: &Arc<Device>,
        scene: &Scene,
        at: [u32; 2],
    ) -> Result<Option<Box<dyn Explanation>>> {
        if self.settings.sampler.room().has_guide() {
            return self.explain_learned(self.settings.seed, at, LEARNED_RAYS);
        }
        let [x, y] = at;
        let settings = Settings {
            window: Some(Window { x, y, width: 1, height: 1 }),
            aovs: Vec::new(),
            depth: 1,
            first_sample: 0,
            ..self.settings.clone()
        };
        drop(self);
        // The pixel alone: its numbers come first in the buffers.
        let window = super::window_of(&settings, scene);
        let buffers = Arc::new(SceneBuffers::new(device, scene, window)?);
        let mut renderer = Self::with_scene_buffers(device, buffers, scene, settings)?;
        let recorded = renderer.read_pixel()?;
        Ok(recorded.map(|recorded| Box::new(recorded) as Box<dyn Explanation>))
    }

    /// Explains film pixel `at` by a few shadow rays, with numbers of their own, which teach the guide as
    /// those of a training do: the renderer may continue. `None` for samplers without a guide and if no
    /// camera ray hits anything. Fails if the device does.
    ///
    /// # Panics
    /// If the pixel is outside the window.
    pub fn inspect_pixel(&mut self, at: [u32; 2]) -> Result<Option<Box<dyn Explanation>>> {
        self.explain_learned(self.settings.seed ^ INSPECTION_SEED, at, INSPECTION_RAYS)
    }

    /// As [`Technique::explain_learned`](crate::pass::Technique::explain_learned), with numbers of `seed`.
    /// With the seed of the picture, the renderer should not continue afterwards.
    pub fn explain_learned(
        &mut self,
        seed: u32,
        at: [u32; 2],
        rays: u32,
    ) -> Result<Option<Box<dyn Explanation>>> {
        let progress = Progress { seed, ..self.progress() };
        self.technique.explain_learned(&mut self.runner, &progress, at, rays)
    }

    /// Renders one sample of the only pixel and reads it back; `None` if the camera ray leaves the scene.
    fn read_pixel(&mut self) -> Result<Option<PixelReadback>> {
        let most = self.settings.shadow_rays;
        let mut recorded: Option<PixelReadback> = None;
        for count in 1..=most.max(1) {
            self.runner.limit_shadow_rays(count.min(most));
            self.restart(self.settings.seed)?;
            self.render_pass(1)?;
            let buffer = |binding| self.runner.waves.set.buffer(binding);
            let hit: Hit = element(buffer(wave::HITS), 0)?;
            if hit.material == NO_MATERIAL {
                return Ok(None);
            }
            let pixel = recorded.get_or_insert_with(|| PixelReadback {
                position: hit.position.into(),
                normal: hit.shading_normal.into(),
                rays: Vec::new(),
                lobes: Vec::new(),
                cached: None,
            });
            let in_group = self.runner.last_group_rays(self.technique.steps());
            let Some(last) = in_group.checked_sub(1) else { break };
            let last = (last * BLOCK_PIXELS) as usize;
            let ray: ShadowRay = element(buffer(wave::SHADOW_RAYS), last)?;
            let visible: u32 = element(buffer(wave::VISIBILITY), last)?;
            pixel.rays.push(RayReadback {
                direction: ray.direction.into(),
                contribution: ray.contribution.into(),
                is_visible: visible != 0,
            });
            self.technique.explain(pixel)?;
        }
        Ok(recorded)
    }
}

fn element<T: Pod>(buffer: &Buffer, index: usize) -> Result<T> {
    let values: Vec<T> = buffer.download(index + 1)?;
    Ok(values[index])
}
