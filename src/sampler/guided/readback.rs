//! Knowledge and choices of the sampler `guided` at one pixel, read back from the device.
//!
//! Its choices depend on what the whole picture taught it. The renderer of that picture therefore
//! traces the next samples of one pixel with its current tables and discards their light.

use glam::Vec3;
use serde_json::{Value, json};

use super::{cell_readback::CellReadback, epoch::with_epoch, technique::Guided};
use crate::{
    error::Result,
    film::sky::{Sky, white_of},
    pass::{
        Explanation, Passes, Progress, RayReadback, Runner, film_buffers::position_in_film_order,
    },
    sampler::regions::Partition,
    scene::Scene,
    shader::{
        bindings::wave,
        constants::NO_MATERIAL,
        rooms::guided::NOTHING_TO_LEARN,
        structs::{Hit, ShadowRay, Wave},
    },
};

/// Names of a cube's faces, in the guide's order.
const FACES: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];
/// Tint of regions that a cell has not counted itself, linear.
const UNCOUNTED: Vec3 = Vec3::new(0.35, 0.6, 1.0);

/// A shadow ray with its sample and region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuidedRay {
    /// The ray.
    pub ray: RayReadback,
    /// Index of its sample.
    pub sample: u32,
    /// Region of the environment; `None` for rays without a contribution.
    pub region: Option<usize>,
}

/// One pixel as the sampler `guided` saw it.
#[derive(Clone, Debug)]
pub struct GuideReadback {
    /// First hit of the first of the samples, metres.
    pub position: Vec3,
    /// Unit shading normal there.
    pub normal: Vec3,
    /// Rays of all samples with a hit, in sample order; of more than eight rays a hit, the last group.
    pub rays: Vec<GuidedRay>,
    /// Cell of the first sample with a ray to trace; `None` where samples are those of `mis`,
    /// or no ray contributed.
    pub cell: Option<CellReadback>,
    /// The regions of the environment.
    pub partition: Partition,
}

impl Guided {
    /// Traces `rays` shadow rays of film pixel `x`, `y`, in whole samples after those in the film
    /// and as far as a wave has room; `None` if no camera ray hits anything. Counts the rays for
    /// learning, so the render should not continue. Fails if the device does.
    ///
    /// # Panics
    /// If the pixel is outside the window.
    pub fn read_pixel(
        &self,
        runner: &mut Runner,
        progress: &Progress,
        [x, y]: [u32; 2],
        rays: u32,
    ) -> Result<Option<GuideReadback>> {
        let window = runner.film.window;
        let (column, row) = (x.wrapping_sub(window.x), y.wrapping_sub(window.y));
        assert!(column < window.width && row < window.height, "a pixel of the window");
        let per_group = runner.last_group_rays(self.steps());
        let samples = rays.div_ceil(per_group.max(1)).clamp(1, runner.waves.capacity);
        let first_sample = progress.next_sample();
        let wave = Wave {
            first_pixel: position_in_film_order(window, column, row),
            pixel_count: 1,
            first_sample,
            sample_count: samples,
            seed: progress.seed,
            pixel_stride: 1,
            ..Wave::default()
        };
        let epoch = progress.first_sample.wrapping_add(self.rebuilt_at);
        let wave = Wave { is_training: 1, ..with_epoch(wave, epoch, self.tag) };
        runner.run(self, wave, 1, false)?;
        runner.film.take_counters()?;

        let waves = &runner.waves.set;
        let hits: Vec<Hit> = waves.buffer(wave::HITS).download(samples as usize)?;
        let is_hit = |hit: &&Hit| hit.material != NO_MATERIAL;
        let Some(first_hit) = hits.iter().find(is_hit) else { return Ok(None) };
        let count = (samples * per_group) as usize;
        let shadow_rays: Vec<ShadowRay> = waves.buffer(wave::SHADOW_RAYS).download(count)?;
        let visible: Vec<u32> = waves.buffer(wave::VISIBILITY).download(count)?;
        let targets = if self.choice.arm.is_guided {
            self.buffers.targets(count)?
        } else {
            vec![NOTHING_TO_LEARN; count]
        };
        let partition = &self.buffers.partition;
        let region_count = partition.regions.len() as u32;
        let mut rays = Vec::new();
        let mut cell = None;
        for (sample, _) in (0..samples).zip(&hits).filter(|(_, hit)| is_hit(hit)) {
            for ray in 0..per_group {
                let index = (ray * samples + sample) as usize;
                let contribution = Vec3::from(shadow_rays[index].contribution);
                let is_counted = targets[index] != NOTHING_TO_LEARN;
                if is_counted && cell.is_none() {
                    cell = Some(self.buffers.cell((targets[index] / region_count) as usize)?);
                }
                rays.push(GuidedRay {
                    ray: RayReadback {
                        direction: shadow_rays[index].direction.into(),
                        contribution,
                        is_visible: visible[index] != 0,
                    },
                    sample: first_sample.wrapping_add(sample),
                    region: (is_counted && contribution != Vec3::ZERO)
                        .then_some((targets[index] % region_count) as usize),
                });
            }
        }
        Ok(Some(GuideReadback {
            position: first_hit.position.into(),
            normal: first_hit.shading_normal.into(),
            rays,
            cell,
            partition: partition.clone(),
        }))
    }
}

impl Explanation for GuideReadback {
    fn normal(&self) -> Vec3 {
        self.normal
    }

    fn rays(&self) -> Vec<RayReadback> {
        self.rays.iter().map(|ray| ray.ray).collect()
    }

    /// Draws what the cell of the pixel has learned: V̂ of every region, white where all is visible and blue
    /// where only its surroundings have counted, and the density of the shadow rays. Nothing if it has
    /// learned nothing.
    fn skies(&self, scene: &Scene, width: usize) -> Vec<Sky> {
        let Some(cell) = &self.cell else { return Vec::new() };
        let region_of = |direction| self.partition.region_of(&scene.environment, direction);
        let visibility = Sky::new(width, self.normal, 1.0, |direction| {
            let region = cell.regions[region_of(direction)];
            let colour = if region.trials <= 0.0 { UNCOUNTED } else { Vec3::ONE };
            region.visibility as f32 * colour
        });
        let density = |direction| {
            let index = region_of(direction);
            let solid_angle = self.partition.regions[index].solid_angle;
            Vec3::splat((cell.regions[index].probability / solid_angle) as f32)
        };
        let white = white_of(width, density);
        vec![visibility, Sky::new(width, self.normal, white, density)]
    }

    fn numbers(&self) -> Value {
        let known = self.cell.iter().flat_map(|cell| &cell.regions);
        let regions = known.zip(&self.partition.regions).map(|(known, region)| {
            json!({
                "direction": region.direction.to_array(),
                "share": region.share,
                "solid_angle": 4.0 * std::f64::consts::PI * region.solid_angle,
                "trials": known.trials,
                "hits": known.hits,
                "visibility": known.visibility,
                "probability": known.probability,
            })
        });
        json!({
            "position": self.position.to_array(),
            "normal": self.normal.to_array(),
            "rays": self.rays.iter().map(ray_numbers).collect::<Vec<_>>(),
            "cell": self.cell.as_ref().map(cell_numbers),
            "regions": regions.collect::<Vec<_>>(),
        })
    }
}

fn ray_numbers(ray: &GuidedRay) -> Value {
    let mut numbers = ray.ray.numbers();
    numbers["sample"] = json!(ray.sample);
    numbers["region"] = json!(ray.region);
    numbers
}

fn cell_numbers(cell: &CellReadback) -> Value {
    let level = match cell.key {
        None => "face",
        Some(key) if key.is_coarse() => "coarse",
        Some(_) => "fine",
    };
    json!({
        "level": level,
        "key": cell.key.map(|key| key.0),
        "face": FACES.get(cell.face),
        "trials": cell.regions.iter().map(|region| region.trials).sum::<f64>(),
        "hits": cell.regions.iter().map(|region| region.hits).sum::<f64>(),
    })
}
