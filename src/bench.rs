//! Ray rates: times the passes of a render, and obvhs's CPU traversal of the same tree with the same rays.
//!
//! One wave over the whole film goes through `camera`, `trace`, `sample`, `shadow`, `bounce` and
//! `trace`. The rays are read back and given to obvhs on every core. Device and CPU take turns, so
//! that both see the same state of the machine. A tree of two levels, which obvhs does not know, goes
//! through the Rust twin of the shader's traversal instead.

use std::{sync::Arc, time::Instant};

use obvhs::{
    cwbvh::{CwBvh, node::CwBvhNode},
    ray::RayHit,
    rt_triangle::RtTriangle,
};
use rayon::{ThreadPool, ThreadPoolBuilder, prelude::*};
use serde::Serialize;

use crate::{
    accel::Accel,
    error::{Error, Result},
    gpu::{Buffer, DescriptorSet, Device},
    math::median,
    pass::{
        Domain, Kernel, Pass, PathDemand, Recording, SceneBuffers, Schedule, Steps, WaveBuffers,
    },
    sampler::{Parameters, basic::Basic},
    shader::{
        bindings::{FILM, film, wave},
        constants::NO_MATERIAL,
        structs::{Counters, Hit, Ray, ShadowRay, Wave},
    },
};

/// Least number of rays that a CPU thread takes at a time.
const CHUNK: usize = 4096;

/// Parameters of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayPlan {
    /// Sampler that chooses the directions of shadow rays; not `ris`.
    pub sampler: Basic,
    /// Shadow rays per hit.
    pub shadow_rays: u32,
    /// Most paths in the wave: pixels of the film in film order.
    pub paths: u32,
    /// Number of measurements of each kind of ray.
    pub repetitions: usize,
    /// Number of threads of the CPU traversal.
    pub threads: usize,
}

/// Median and extremes of repeated measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RateSpread {
    /// Median.
    pub median: f64,
    /// Smallest value.
    pub least: f64,
    /// Largest value.
    pub most: f64,
}

impl RateSpread {
    /// Median and extremes of `values`; zeros if there are none.
    pub(crate) fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let end = |value: Option<&f64>| value.copied().unwrap_or(0.0);
        Self { median: median(&values), least: end(values.first()), most: end(values.last()) }
    }
}

/// Rates of one kind of ray.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RayRate {
    /// `camera`, `shadow` or `bounce`.
    pub kind: &'static str,
    /// Number of rays traced in one measurement, without those that need no tracing.
    pub rays: usize,
    /// Share of them that met a surface.
    pub hit_share: f64,
    /// Million rays per second on the device, from timestamps.
    pub device_mrays: RateSpread,
    /// Million rays per second of obvhs's traversal on the CPU.
    pub obvhs_mrays: RateSpread,
    /// Ratio of device to obvhs in neighbouring measurements.
    pub ratio: RateSpread,
    /// Number of rays for which the two disagree on whether a surface is met.
    pub disagreements: usize,
}

type CpuRay = obvhs::ray::Ray;

/// obvhs's own traversal of the arrays of an [`Accel`], or the twin's of a tree of two levels.
struct Yardstick<'a> {
    two_levels: Option<&'a Accel>,
    bvh: CwBvh,
    triangles: Vec<RtTriangle>,
    threads: ThreadPool,
}

impl<'a> Yardstick<'a> {
    fn new(accel: &'a Accel, threads: usize) -> Result<Self> {
        let threads = ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| Error::usage(format!("{threads} threads of the CPU: {error}")))?;
        if accel.is_instanced() {
            let (bvh, triangles) = (CwBvh::default(), Vec::new());
            return Ok(Self { two_levels: Some(accel), bvh, triangles, threads });
        }
        let nodes = bytemuck::cast_slice::<_, CwBvhNode>(&accel.nodes).to_vec();
        let triangle = |index: u32| {
            let [a, b, c] = accel.triangle(index).vertices.map(|v| v.position.into());
            RtTriangle::new(a, b, c)
        };
        Ok(Self {
            two_levels: None,
            bvh: CwBvh { nodes, ..CwBvh::default() },
            triangles: (0..accel.triangle_count() as u32).map(triangle).collect(),
            threads,
        })
    }

    fn meets(&self, ray: &CpuRay, any_hit: bool) -> bool {
        if let Some(accel) = self.two_levels {
            let (origin, direction) = (ray.origin.into(), ray.direction.into());
            return if any_hit {
                accel.is_occluded(origin, direction)
            } else {
                accel.closest(origin, direction).is_some()
            };
        }
        let test = |ray: &CpuRay, triangle: usize| self.triangles[triangle].intersect(ray);
        if any_hit {
            !self.bvh.ray_traverse_miss(*ray, test)
        } else {
            self.bvh.ray_traverse(*ray, &mut RayHit::none(), test)
        }
    }

    /// Traces all rays. Returns wall time in seconds, and for each ray whether it meets a surface.
    fn trace(&self, rays: &[CpuRay], any_hit: bool) -> (f64, Vec<bool>) {
        let start = Instant::now();
        let rays = rays.par_iter().with_min_len(CHUNK);
        let met = self.threads.install(|| rays.map(|ray| self.meets(ray, any_hit)).collect());
        (start.elapsed().as_secs_f64(), met)
    }
}

/// The passes of a render with the buffers of one wave.
struct Bench<'a> {
    device: &'a Arc<Device>,
    scene: &'a SceneBuffers,
    waves: WaveBuffers,
    film_set: DescriptorSet,
    wave: Wave,
}

impl<'a> Bench<'a> {
    fn new(device: &'a Arc<Device>, scene: &'a SceneBuffers, plan: &RayPlan) -> Result<Self> {
        let (paths, rays, demand) = (plan.paths, plan.shadow_rays, PathDemand::default());
        let waves = WaveBuffers::new(device, paths, paths, rays, demand, scene.surfaces)?;
        let counters = Buffer::zeroed(device, "counters", size_of::<Counters>() as u64)?;
        let film_set = DescriptorSet::new(device, &FILM, &[(film::COUNTERS, counters)])?;
        let wave = Wave {
            pixel_count: paths.min(waves.capacity),
            sample_count: 1,
            shadow_ray_count: rays,
            total_shadow_rays: rays,
            ..Wave::default()
        };
        Ok(Self { device, scene, waves, film_set, wave })
    }

    /// Runs one pass; seconds of the device, and of the host where it traces.
    fn run(&self, pass: &Pass) -> Result<f64> {
        let host = self.scene.geometry.host_tracer.as_ref();
        let mut recording = Recording::begin(self.device, 1, host, false)?;
        let sets = [&self.scene.set, &self.waves.set, &self.film_set];
        recording.add(pass, &sets, &self.wave)?;
        Ok(recording.finish()?.values().sum::<f64>() * 1e-3)
    }

    fn run_once(&self, kernel: Kernel) -> Result<()> {
        self.run(&Pass::new(self.device, kernel)?).map(drop)
    }

    /// Downloads the rays that `trace` would follow.
    fn active_rays(&self) -> Result<Vec<Option<CpuRay>>> {
        let rays: Vec<Ray> =
            self.waves.set.buffer(wave::RAYS).download(self.wave.pixel_count as usize)?;
        let cpu_ray = |ray: &Ray| CpuRay::new_inf(ray.origin.into(), ray.direction.into());
        Ok(rays.iter().map(|ray| (ray.is_active != 0).then(|| cpu_ray(ray))).collect())
    }

    /// Downloads the rays that `shadow` would follow.
    fn active_shadow_rays(&self, accel: &Accel) -> Result<Vec<Option<CpuRay>>> {
        let paths = self.wave.pixel_count as usize;
        let hits: Vec<Hit> = self.waves.set.buffer(wave::HITS).download(paths)?;
        let count = paths * self.wave.shadow_ray_count as usize;
        let shadow_rays: Vec<ShadowRay> =
            self.waves.set.buffer(wave::SHADOW_RAYS).download(count)?;
        Ok(shadow_rays
            .iter()
            .zip(hits.iter().cycle())
            .map(|(ray, hit)| {
                (hit.material != NO_MATERIAL && ray.contribution != [0.0; 3]).then(|| {
                    let origin = accel.offset_ray_origin(
                        hit.position.into(),
                        hit.geometric_normal.into(),
                        ray.direction.into(),
                    );
                    CpuRay::new_inf(origin.into(), ray.direction.into())
                })
            })
            .collect())
    }

    /// Tests for each of `count` rays whether it met a surface, after `trace` or, for any hit, `shadow`.
    fn met(&self, any_hit: bool, count: usize) -> Result<Vec<bool>> {
        if any_hit {
            let visibility: Vec<u32> = self.waves.set.buffer(wave::VISIBILITY).download(count)?;
            return Ok(visibility.iter().map(|visible| *visible == 0).collect());
        }
        let hits: Vec<Hit> = self.waves.set.buffer(wave::HITS).download(count)?;
        Ok(hits.iter().map(|hit| hit.material != NO_MATERIAL).collect())
    }
}

/// Measures camera, shadow and bounce rays. `scene` must have been made from `accel`.
///
/// # Errors
/// [`crate::Error::Vulkan`] or [`crate::Error::Device`] if the device fails or memory runs out.
pub fn measure(
    device: &Arc<Device>,
    scene: &SceneBuffers,
    accel: &Accel,
    plan: &RayPlan,
) -> Result<Vec<RayRate>> {
    let mut bench = Bench::new(device, scene, plan)?;
    let yardstick = Yardstick::new(accel, plan.threads)?;
    let (traversal, surfaces) = (scene.geometry.traversal, scene.surfaces);
    let incoherent = Schedule::incoherent(device.capabilities());
    let compare = |bench: &_, kind, kernel, any_hit| {
        compare(kind, &yardstick, bench, &Pass::new(device, kernel)?, any_hit, plan.repetitions)
    };
    bench.run_once(Kernel::new("camera", Domain::Paths, &[]))?;
    let camera = compare(&bench, "camera", traversal.trace(Schedule::SINGLE, surfaces), None)?;
    let steps = plan.sampler.steps(&Parameters::default(), surfaces)?;
    for kernel in steps.sample(&bench.wave) {
        bench.run_once(kernel)?;
    }
    let shadow = compare(&bench, "shadow", traversal.shadow(incoherent, surfaces), Some(accel))?;
    bench.run_once(Kernel::new("bounce", Domain::Paths, &[]))?;
    bench.wave.vertex = 1;
    let bounce = compare(&bench, "bounce", traversal.trace(incoherent, surfaces), None)?;
    Ok(vec![camera, shadow, bounce])
}

/// Measures device and CPU in turns on the same rays: shadow rays off the surfaces of `shadows_of`, else
/// those that `trace` follows.
fn compare(
    kind: &'static str,
    yardstick: &Yardstick<'_>,
    bench: &Bench<'_>,
    pass: &Pass,
    shadows_of: Option<&Accel>,
    repetitions: usize,
) -> Result<RayRate> {
    let any_hit = shadows_of.is_some();
    let all =
        shadows_of.map_or_else(|| bench.active_rays(), |accel| bench.active_shadow_rays(accel))?;
    let rays: Vec<CpuRay> = all.iter().flatten().copied().collect();
    // Warm up: some drivers compile at first use.
    bench.run(pass)?;
    let (_, met) = yardstick.trace(&rays, any_hit);
    let (mut device, mut cpu, mut ratio) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..repetitions {
        let millions = rays.len() as f64 * 1e-6;
        let device_seconds = bench.run(pass)?.max(1e-9);
        let cpu_seconds = yardstick.trace(&rays, any_hit).0.max(1e-9);
        device.push(millions / device_seconds);
        cpu.push(millions / cpu_seconds);
        ratio.push(cpu_seconds / device_seconds);
    }
    let on_device = bench.met(any_hit, all.len())?;
    let on_device = all.iter().zip(on_device).filter_map(|(ray, met)| ray.is_some().then_some(met));
    let disagreements = on_device.zip(&met).filter(|(device, cpu)| device != *cpu).count();
    let hits = met.iter().filter(|met| **met).count();
    Ok(RayRate {
        kind,
        rays: rays.len(),
        hit_share: hits as f64 / rays.len().max(1) as f64,
        device_mrays: RateSpread::of(device),
        obvhs_mrays: RateSpread::of(cpu),
        ratio: RateSpread::of(ratio),
        disagreements,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_have_the_middle_value() {
        assert_eq!(
            RateSpread::of(vec![3.0, 1.0, 2.0]),
            RateSpread { median: 2.0, least: 1.0, most: 3.0 }
        );
        assert_eq!(
            RateSpread::of(vec![4.0, 1.0]),
            RateSpread { median: 2.5, least: 1.0, most: 4.0 }
        );
        assert_eq!(RateSpread::of(vec![]), RateSpread { median: 0.0, least: 0.0, most: 0.0 });
    }
}
