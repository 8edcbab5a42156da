//! `fenestra bench`: measures ray rates, and the time and memory of a render's passes and buffers.

use std::{collections::BTreeMap, path::PathBuf, sync::Arc, time::Instant};

use serde::Serialize;

use super::{options::DeviceOptions, print_line};
use crate::{
    accel::Accel,
    bench::{RateSpread, RayPlan, RayRate, measure},
    error::{Error, Result},
    gpu::PassTimes,
    pass::{SceneBuffers, geometry::triangle_page_bytes},
    sampler::{Sampler, basic},
    scene::Scene,
    session::{Renderer, Settings, parse_size, window_of},
    shader::constants::FILM_BLOCK,
};

/// Maximum number of paths in a measurement; larger films are scaled down.
const MOST_PATHS: u32 = 1 << 19;

/// Arguments of `bench`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file (.toml).
    pub scene: PathBuf,
    /// Sampler that chooses the directions of shadow rays; any but `ris`.
    #[arg(long, value_enum, default_value = "mis")]
    pub sampler: Sampler,
    /// Shadow rays traced at every hit.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=8))]
    pub shadow_rays: u32,
    /// Path vertices at which light is gathered; 1 is direct light.
    #[arg(long, value_name = "D", default_value_t = 1)]
    pub depth: u32,
    /// Film size in pixels, overriding the scene's.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Measurements of each kind of ray; the median is reported.
    #[arg(
        long, value_name = "N", default_value_t = 7,
        value_parser = clap::value_parser!(u32).range(1..=1000)
    )]
    pub repetitions: u32,
    /// Place every instance, for a tree of one level: what the second one costs.
    #[arg(long)]
    pub placed: bool,
    /// Threads of the CPU traversal that serves as the yardstick. Default: all cores.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// Device and tracer.
    #[command(flatten)]
    pub device: DeviceOptions,
    /// Print JSON to standard output.
    #[arg(long)]
    pub json: bool,
}

/// Output of `bench --json`.
#[derive(Debug, Serialize)]
struct Report {
    version: &'static str,
    scene: String,
    triangles: u64,
    /// Instances, with the placed triangles as one; 0 for a tree of one level.
    instances: usize,
    bvh_nodes: usize,
    film: [u32; 2],
    device: String,
    driver: String,
    tracer: String,
    sampler: &'static str,
    shadow_rays_per_hit: u32,
    depth: u32,
    /// CPU traversal that the device is compared with.
    yardstick: String,
    rays: Vec<RayRate>,
    /// Million shadow rays per second of device time, over all passes.
    all_passes_mrays: RateSpread,
    /// That rate relative to the shadow pass's own, which is its share of the device time.
    shadow_pass_share: RateSpread,
    /// Device milliseconds per pass, for one sample per pixel of `depth` vertices.
    pass_ms: PassTimes,
    /// Milliseconds of each pass's first use, when drivers compile, and of creating all pipelines.
    compile_ms: PassTimes,
    host_ms: BTreeMap<String, f64>,
    buffer_bytes: BTreeMap<String, u64>,
}

/// Measures a scene.
///
/// # Errors
/// An unusable scene, no device, or one that fails.
pub fn run(arguments: &Arguments) -> Result<()> {
    if arguments.sampler == Sampler::Ris {
        return Err(Error::usage(
            "--sampler ris: expected one that draws one candidate per shadow ray, such as mis",
        ));
    }
    let start = Instant::now();
    let mut scene = Scene::load(&arguments.scene)?;
    let ignored = arguments.sampler.portal_warning(&scene);
    scene.warnings.iter().chain(&ignored).for_each(|warning| log::warn!("{warning}"));
    let load_ms = start.elapsed().as_secs_f64() * 1e3;
    if arguments.placed {
        let message = "--placed: the scene has too many triangles to place every instance";
        scene.geometry = scene.geometry.flattened().ok_or_else(|| Error::usage(message))?;
    }
    if let Some([width, height]) = arguments.size {
        (scene.film.width, scene.film.height) = (width, height);
    }
    let film = bounded([scene.film.width, scene.film.height]);
    if film != [scene.film.width, scene.film.height] {
        log::warn!("measuring at {}x{} instead of the film's size", film[0], film[1]);
        [scene.film.width, scene.film.height] = film;
    }
    let device = arguments.device.open(false)?;
    let settings = Settings {
        sampler: arguments.sampler,
        shadow_rays: arguments.shadow_rays,
        depth: arguments.depth,
        ..Settings::default()
    };
    let start = Instant::now();
    let accel = Accel::build(&scene.geometry, triangle_page_bytes(device.capabilities()))?;
    let bvh_ms = start.elapsed().as_secs_f64() * 1e3;
    let window = window_of(&settings, &scene);
    let buffers = Arc::new(SceneBuffers::from_accel(&device, &scene, window, &accel)?);

    let plan = RayPlan {
        sampler: arguments.sampler.room().basic().unwrap_or(basic::MIS),
        shadow_rays: arguments.shadow_rays,
        paths: padded_pixels(film),
        repetitions: arguments.repetitions as usize,
        threads: arguments.threads.map_or_else(
            || std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            |threads| threads as usize,
        ),
    };
    let rays = measure(&device, &buffers, &accel, &plan)?;

    let mut renderer = Renderer::with_scene_buffers(&device, buffers, &scene, settings)?;
    let (mut mrays, mut shares, mut pass_ms) = (Vec::new(), Vec::new(), PassTimes::new());
    // Warm up until the wave size has settled and candidates have been measured.
    renderer.render_pass(2)?;
    for repetition in 0..arguments.repetitions {
        renderer.restart(repetition)?;
        renderer.render_pass(1)?;
        let totals = renderer.totals();
        let all: f64 = totals.gpu_ms.values().sum();
        mrays.push(totals.shadow_rays_traced as f64 * 1e-3 / all.max(1e-9));
        shares.push(totals.gpu_ms.get("shadow").copied().unwrap_or_default() / all.max(1e-9));
        for (pass, ms) in &totals.gpu_ms {
            *pass_ms.entry(pass.clone()).or_default() += ms / f64::from(arguments.repetitions);
        }
    }
    device.save_pipeline_cache();

    let capabilities = device.capabilities();
    let mut host_ms = renderer.host_ms();
    host_ms.insert("load".into(), load_ms);
    host_ms.insert("bvh".into(), bvh_ms);
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        scene: scene.name.clone(),
        triangles: scene.geometry.triangle_count(),
        instances: accel.instances.len(),
        bvh_nodes: accel.nodes.len(),
        film,
        device: capabilities.name.clone(),
        driver: capabilities.driver.clone(),
        tracer: renderer.tracer(),
        sampler: arguments.sampler.name(),
        shadow_rays_per_hit: arguments.shadow_rays,
        depth: arguments.depth,
        yardstick: format!(
            "{} traversal on the CPU, same tree, same rays, {} threads",
            if accel.is_instanced() { "two-level" } else { "obvhs CWBVH" },
            plan.threads
        ),
        rays,
        all_passes_mrays: RateSpread::of(mrays),
        shadow_pass_share: RateSpread::of(shares),
        pass_ms,
        compile_ms: renderer.runner.compile_ms.clone(),
        host_ms,
        buffer_bytes: renderer.buffer_bytes(),
    };
    if arguments.json {
        print_line(&format!("{:#}", serde_json::json!(report)))
    } else {
        print_line(&text(&report))
    }
}

/// Returns the film size, scaled down to at most [`MOST_PATHS`] pixels.
fn bounded([width, height]: [u32; 2]) -> [u32; 2] {
    if padded_pixels([width, height]) <= MOST_PATHS {
        return [width, height];
    }
    let pixels = f64::from(width) * f64::from(height);
    let scale = (0.95 * f64::from(MOST_PATHS) / pixels).sqrt();
    let shrunk = |side: u32| ((f64::from(side) * scale) as u32 / FILM_BLOCK * FILM_BLOCK).max(1);
    let [width, height] = [shrunk(width), shrunk(height)];
    // In a thin strip, rounding up to blocks outweighs the scale.
    let longest = MOST_PATHS / FILM_BLOCK;
    [width.min(longest), height.min(longest)]
}

/// Counts the pixels of the film, with blocks at its edges counted whole.
fn padded_pixels([width, height]: [u32; 2]) -> u32 {
    width.next_multiple_of(FILM_BLOCK).saturating_mul(height.next_multiple_of(FILM_BLOCK))
}

fn text(report: &Report) -> String {
    let mut lines = vec![
        format!(
            "{}: {} triangles, {} instances, {} BVH nodes, film {}x{}, sampler {}, {} shadow rays per hit",
            report.scene,
            report.triangles,
            report.instances,
            report.bvh_nodes,
            report.film[0],
            report.film[1],
            report.sampler,
            report.shadow_rays_per_hit
        ),
        format!("device     {} ({})", report.device, report.driver),
        format!("tracer     {}", report.tracer),
        format!("yardstick  {}", report.yardstick),
        String::new(),
        "rays         traced   hits   device Mrays/s          obvhs Mrays/s           ratio".into(),
    ];
    let spread = |spread: &RateSpread| {
        format!("{:6.2} ({:.2}..{:.2})", spread.median, spread.least, spread.most)
    };
    for rate in &report.rays {
        lines.push(format!(
            "{:8} {:>10} {:5.1}%   {:<23} {:<23} {}",
            rate.kind,
            rate.rays,
            100.0 * rate.hit_share,
            spread(&rate.device_mrays),
            spread(&rate.obvhs_mrays),
            spread(&rate.ratio),
        ));
    }
    lines.push(String::new());
    lines.push(format!(
        "{} vertices: {} million shadow rays a second over all passes; the shadow pass takes {} of \
         the time",
        report.depth,
        spread(&report.all_passes_mrays),
        spread(&report.shadow_pass_share)
    ));
    let times = |title: &str, times: &BTreeMap<String, f64>| {
        let list: Vec<_> = times.iter().map(|(name, ms)| format!("{name} {ms:.1}")).collect();
        let sum: f64 = times.values().sum();
        format!("{title} {} = {sum:.1}", list.join(", "))
    };
    lines.push(times("ms per pass, one sample per pixel:", &report.pass_ms));
    lines.push(times("ms to compile, at first use:", &report.compile_ms));
    lines.push(times("ms on the host:", &report.host_ms));
    lines.push("memory per buffer:".into());
    for (name, bytes) in &report.buffer_bytes {
        lines.push(format!("  {name:22} {:10.2} MiB", *bytes as f64 / f64::from(1 << 20)));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_films_are_measured_smaller() {
        assert_eq!(bounded([640, 480]), [640, 480]);
        for size in [[3840, 2160], [16384, 16384], [16384, 1], [3, 16384], [725, 725]] {
            let film = bounded(size);
            assert!(padded_pixels(film) <= MOST_PATHS, "{size:?} {film:?}");
            assert!(film[0] >= 1 && film[1] >= 1);
        }
    }
}
