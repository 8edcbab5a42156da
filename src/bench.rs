//! Ray rates: times the passes of a render, and obvhs's CPU traversal of the same tree with the
//! same rays.
//!
//! One wave over the whole film goes through `camera`, `trace`, `sample`, `shadow`, `bounce` and
//! `trace`. The rays are read back and given to obvhs on every core. Device and CPU take turns, so
//! that both see the same state of the machine. A tree of two levels, which obvhs does not know, goes
//! through the Rust twin of the shader's traversal instead.

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};

use obvhs::{
    cwbvh::{CwBvh, node::CwBvhNode},
    ray::RayHit,
    rt_triangle::RtTriangle,
};
use serde::Serialize;

use crate::{
    accel::Accel,
    error::Result,
    gpu::{Buffer, Commands, DescriptorSet, Device},
    pass::{Domain, Kernel, Pass, SceneBuffers, Schedule, Steps, wave_buffers::path_list_bytes},
    sampler::{Parameters, basic::Basic},
    shader::{
        bindings::{FILM, WAVE, film, wave as bindings},
        constants::NO_MATERIAL,
        structs::{Counters, Hit, PathState, Ray, ShadowRay, Wave},
    },
};

/// Number of rays that a CPU thread takes at a time.
const CHUNK: usize = 4096;

/// Parameters of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayPlan {
    /// Sampler that chooses the directions of shadow rays; not `ris`.
    pub sampler: Basic,
    /// Shadow rays per hit.
    pub shadow_rays: u32,
    /// Number of paths in the wave: pixels of the film in film order.
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
        let at = |index: usize| values.get(index).copied().unwrap_or(0.0);
        let last = values.len().saturating_sub(1);
        let median = 0.5 * (at(last / 2) + at(last.div_ceil(2)));
        Self { median, least: at(0), most: at(last) }
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

/// A ray of the CPU traversal.
type CpuRay = obvhs::ray::Ray;

/// obvhs's own traversal of the arrays of an [`Accel`], or the twin's of a tree of two levels.
struct Yardstick<'a> {
    two_levels: Option<&'a Accel>,
    bvh: CwBvh,
    triangles: Vec<RtTriangle>,
    threads: usize,
}

impl<'a> Yardstick<'a> {
    fn new(accel: &'a Accel, threads: usize) -> Self {
        if accel.is_instanced() {
            let (bvh, triangles) = (CwBvh::default(), Vec::new());
            return Self { two_levels: Some(accel), bvh, triangles, threads };
        }
        let count = accel.triangle_count() as u32;
        Self {
            two_levels: None,
            bvh: CwBvh {
                nodes: bytemuck::cast_slice::<_, CwBvhNode>(&accel.nodes).to_vec(),
                ..CwBvh::default()
            },
            triangles: (0..count)
                .map(|index| {
                    let [a, b, c] = accel.triangle(index).vertices.map(|v| v.position.into());
                    RtTriangle::new(a, b, c)
                })
                .collect(),
            threads,
        }
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
        let mut met = vec![false; rays.len()];
        let start = Instant::now();
        let next = AtomicUsize::new(0);
        let results: Vec<Vec<(usize, Vec<bool>)>> = std::thread::scope(|scope| {
            let work = || {
                let mut done = Vec::new();
                loop {
                    let first = next.fetch_add(CHUNK, Ordering::Relaxed);
                    let Some(rest) = rays.get(first..).filter(|rest| !rest.is_empty()) else {
                        return done;
                    };
                    let chunk = &rest[..rest.len().min(CHUNK)];
                    done.push((first, chunk.iter().map(|ray| self.meets(ray, any_hit)).collect()));
                }
            };
            let threads: Vec<_> = (0..self.threads.max(1)).map(|_| scope.spawn(work)).collect();
            // The scope passes on a panic in a thread.
            threads.into_iter().filter_map(|thread| thread.join().ok()).collect()
        });
        let seconds = start.elapsed().as_secs_f64();
        for (first, chunk) in results.into_iter().flatten() {
            met[first..first + chunk.len()].copy_from_slice(&chunk);
        }
        (seconds, met)
    }
}

/// The passes of a render with the buffers of one wave.
struct Bench<'a> {
    device: &'a Arc<Device>,
    scene: &'a SceneBuffers,
    wave_set: DescriptorSet,
    film_set: DescriptorSet,
    rays: Buffer,
    hits: Buffer,
    shadow_rays: Buffer,
    visibility: Buffer,
    // Kept alive for the sets.
    _paths: Buffer,
    _instances: Buffer,
    _path_lists: Buffer,
    _counters: Buffer,
    wave: Wave,
}

impl<'a> Bench<'a> {
    fn new(device: &'a Arc<Device>, scene: &'a SceneBuffers, plan: &RayPlan) -> Result<Self> {
        let paths = u64::from(plan.paths);
        let make = |name, count: u64, size: usize| Buffer::new(device, name, count * size as u64);
        let rays = make("rays", paths, size_of::<Ray>())?;
        let hits = make("hits", paths, size_of::<Hit>())?;
        let shadow_ray_count = paths * u64::from(plan.shadow_rays);
        let shadow_rays = make("shadow rays", shadow_ray_count, size_of::<ShadowRay>())?;
        let visibility = make("visibility", shadow_ray_count, size_of::<u32>())?;
        let path_states = make("paths", paths, size_of::<PathState>())?;
        let instances = make("hit instances", paths, size_of::<u32>())?;
        let path_lists = Buffer::new(device, "path lists", path_list_bytes(paths))?;
        let counters = Buffer::zeroed(device, "counters", size_of::<Counters>() as u64)?;
        let bound = [
            (bindings::RAYS, &rays),
            (bindings::RAY_TEXELS, &rays),
            (bindings::HITS, &hits),
            (bindings::HIT_TEXELS, &hits),
            (bindings::SHADOW_RAYS, &shadow_rays),
            (bindings::SHADOW_RAY_TEXELS, &shadow_rays),
            (bindings::VISIBILITY, &visibility),
            (bindings::PATHS, &path_states),
            (bindings::HIT_INSTANCES, &instances),
            (bindings::PATH_LISTS, &path_lists),
            (bindings::PATH_LIST_TEXELS, &path_lists),
        ];
        let wave_set = DescriptorSet::new(device, &WAVE, &bound)?;
        let film_set = DescriptorSet::new(device, &FILM, &[(film::COUNTERS, &counters)])?;
        let wave = Wave {
            pixel_count: plan.paths,
            sample_count: 1,
            shadow_ray_count: plan.shadow_rays,
            total_shadow_rays: plan.shadow_rays,
            ..Wave::default()
        };
        Ok(Self {
            device,
            scene,
            wave_set,
            film_set,
            rays,
            hits,
            shadow_rays,
            visibility,
            _paths: path_states,
            _instances: instances,
            _path_lists: path_lists,
            _counters: counters,
            wave,
        })
    }

    fn sets(&self) -> [&DescriptorSet; 3] {
        [self.scene.set(), &self.wave_set, &self.film_set]
    }

    /// Runs one pass; device seconds.
    fn run(&self, pass: &Pass) -> Result<f64> {
        let mut commands = Commands::begin_timed(self.device, 1)?;
        pass.record(&mut commands, &self.sets(), &self.wave);
        Ok(commands.submit_and_wait()?.values().sum::<f64>() * 1e-3)
    }

    /// Compiles a kernel and runs it once.
    fn run_once(&self, kernel: Kernel) -> Result<()> {
        self.run(&Pass::new(self.device, kernel)?).map(drop)
    }

    /// Downloads the rays that `trace` would follow.
    fn active_rays(&self) -> Result<Vec<Option<CpuRay>>> {
        let rays: Vec<Ray> = self.rays.download(self.wave.pixel_count as usize)?;
        Ok(rays
            .iter()
            .map(|ray| {
                (ray.is_active != 0)
                    .then(|| CpuRay::new_inf(ray.origin.into(), ray.direction.into()))
            })
            .collect())
    }

    /// Downloads the rays that `shadow` would follow.
    fn active_shadow_rays(&self, accel: &Accel) -> Result<Vec<Option<CpuRay>>> {
        let paths = self.wave.pixel_count as usize;
        let hits: Vec<Hit> = self.hits.download(paths)?;
        let count = paths * self.wave.shadow_ray_count as usize;
        let shadow_rays: Vec<ShadowRay> = self.shadow_rays.download(count)?;
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

    /// Tests for each ray whether it met a surface, after `trace`.
    fn hits_met(&self) -> Result<Vec<bool>> {
        let hits: Vec<Hit> = self.hits.download(self.wave.pixel_count as usize)?;
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
    let bench = Bench::new(device, scene, plan)?;
    let yardstick = Yardstick::new(accel, plan.threads);
    let incoherent = Schedule::incoherent(device.capabilities());
    let trace =
        Pass::new(device, scene.geometry().traversal().trace(Schedule::SINGLE, scene.surfaces()))?;
    let trace_bounce =
        Pass::new(device, scene.geometry().traversal().trace(incoherent, scene.surfaces()))?;
    let shadow =
        Pass::new(device, scene.geometry().traversal().shadow(incoherent, scene.surfaces()))?;
    let compare = |kind, rays: &[Option<CpuRay>], any_hit, run: &dyn Fn() -> Result<f64>| {
        compare(kind, &yardstick, rays, any_hit, plan.repetitions, run)
    };
    let mut rates = Vec::new();
    let disagreements = |rays: &[Option<CpuRay>], device: &[bool], cpu: &[bool]| {
        let device = rays.iter().zip(device).filter_map(|(ray, met)| ray.is_some().then_some(met));
        device.zip(cpu).filter(|(device, cpu)| device != cpu).count()
    };

    bench.run_once(Kernel::new("camera", Domain::Paths, &[]))?;
    let rays = bench.active_rays()?;
    let (mut rate, met) = compare("camera", &rays, false, &|| bench.run(&trace))?;
    rate.disagreements = disagreements(&rays, &bench.hits_met()?, &met);
    rates.push(rate);

    let steps = plan.sampler.steps(&Parameters::default(), scene.surfaces())?;
    for kernel in steps.sample(&bench.wave) {
        bench.run_once(kernel)?;
    }
    let rays = bench.active_shadow_rays(accel)?;
    let (mut rate, met) = compare("shadow", &rays, true, &|| bench.run(&shadow))?;
    let visibility: Vec<u32> = bench.visibility.download(rays.len())?;
    let blocked: Vec<bool> = visibility.iter().map(|visible| *visible == 0).collect();
    rate.disagreements = disagreements(&rays, &blocked, &met);
    rates.push(rate);

    bench.run_once(Kernel::new("bounce", Domain::Paths, &[]))?;
    let rays = bench.active_rays()?;
    let (mut rate, met) = compare("bounce", &rays, false, &|| bench.run(&trace_bounce))?;
    rate.disagreements = disagreements(&rays, &bench.hits_met()?, &met);
    rates.push(rate);
    Ok(rates)
}

/// Measures device and CPU in turns on the same rays; `run` returns device seconds.
fn compare(
    kind: &'static str,
    yardstick: &Yardstick<'_>,
    rays: &[Option<CpuRay>],
    any_hit: bool,
    repetitions: usize,
    run: &dyn Fn() -> Result<f64>,
) -> Result<(RayRate, Vec<bool>)> {
    let rays: Vec<CpuRay> = rays.iter().flatten().copied().collect();
    // Warm up: some drivers compile at first use.
    run()?;
    let (_, met) = yardstick.trace(&rays, any_hit);
    let (mut device, mut cpu, mut ratio) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..repetitions {
        let millions = rays.len() as f64 * 1e-6;
        let device_seconds = run()?.max(1e-9);
        let cpu_seconds = yardstick.trace(&rays, any_hit).0.max(1e-9);
        device.push(millions / device_seconds);
        cpu.push(millions / cpu_seconds);
        ratio.push(cpu_seconds / device_seconds);
    }
    let hits = met.iter().filter(|met| **met).count();
    let rate = RayRate {
        kind,
        rays: rays.len(),
        hit_share: hits as f64 / rays.len().max(1) as f64,
        device_mrays: RateSpread::of(device),
        obvhs_mrays: RateSpread::of(cpu),
        ratio: RateSpread::of(ratio),
        disagreements: 0,
    };
    Ok((rate, met))
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
