//! `--pixel x,y`: a picture that explains what the sampler did at one hit.
//!
//! Skys are lat-long, −Z in the middle and +Y on top, darkened below the hit's horizon (blue).
//! They show the environment with the samples taken (green reached it, red were blocked, grey
//! brought nothing and were not traced); the density of the product's lobes for the first ray; and
//! that density for the last ray, at the same exposure, with the blocked directions in the visibility
//! cache (red), as in figures 4.3 to 4.8 of Wu & Shih 2009. `product` has the
//! first two panels, samplers without lobes only the first.
//!
//! `guided` shows the environment with the pixel's next samples, then the state of the hit's cell:
//! V̂ of every region, white where all is visible and blue where only its surroundings have
//! counted, and the probability of the regions per steradian.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::Vec3;
use serde_json::json;

use crate::{
    error::{Error, Result},
    files::{check_writable, write_text},
    film::{Window, png::write_rgb8},
    gpu::Device,
    sampler::{
        guided::{CellLevel, GuidedRay, RecordedCell, RecordedGuide, RecordedRay},
        product::record::RecordedLobe,
    },
    scene::Scene,
    session::{RecordedPixel, Renderer, Settings, window_of},
    srbf::kernel_value,
    view::sky::{Sky, learned_skies, white_of},
};

/// Rays in the picture of `guided`, rounded up to whole samples.
const GUIDED_RAYS: u32 = 64;
/// Size of a panel, pixels.
const WIDTH: usize = 512;
/// Height of the white line between panels, pixels.
const GAP: usize = 4;

const VISIBLE: [u8; 3] = [40, 220, 70];
const BLOCKED: [u8; 3] = [235, 40, 40];
const UNTRACED: [u8; 3] = [150, 150, 150];
/// Names of a cube's faces, in the guide's order.
const FACES: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];

/// `out.exr` → `out.pixel_x_y.png`.
pub fn picture_path(output: &Path, [x, y]: [u32; 2]) -> PathBuf {
    output.with_extension(format!("pixel_{x}_{y}.png"))
}

/// Checks that the picture can be made, before any work.
///
/// # Errors
/// [`Error::Usage`] for a pixel outside the window; [`Error::Io`] if the picture cannot be written.
pub fn check(settings: &Settings, scene: &Scene, output: &Path, pixel: [u32; 2]) -> Result<()> {
    let [x, y] = pixel;
    let window = window_of(settings, scene);
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
    check_writable(&picture_path(output, pixel))
}

/// Renders the first sample of `pixel` again, and writes the picture with its numbers as JSON
/// beside it. Returns the files written. Warns and writes none if the pixel sees the environment.
///
/// # Errors
/// A failing device or disk.
pub fn write(
    device: &Arc<Device>,
    scene: &Scene,
    settings: &Settings,
    output: &Path,
    pixel: [u32; 2],
) -> Result<Vec<PathBuf>> {
    let [x, y] = pixel;
    let window = Some(Window { x, y, width: 1, height: 1 });
    let settings =
        Settings { window, aovs: Vec::new(), depth: 1, first_sample: 0, ..settings.clone() };
    let Some(recorded) = Renderer::new(device, scene, settings)?.record_pixel()? else {
        warn_of_no_hit(pixel);
        return Ok(Vec::new());
    };
    write_files(&picture_path(output, pixel), &draw(scene, &recorded), &numbers_of(&recorded))
}

/// As [`write`], for the sampler `guided` and the renderer that has made the image.
///
/// # Errors
/// A failing device or disk.
pub fn write_guided(
    renderer: &mut Renderer,
    scene: &Scene,
    output: &Path,
    pixel: [u32; 2],
) -> Result<Vec<PathBuf>> {
    let Some(recorded) = renderer.record_guided_pixel(pixel, GUIDED_RAYS)? else {
        warn_of_no_hit(pixel);
        return Ok(Vec::new());
    };
    let panels = draw_guided(scene, &recorded);
    write_files(&picture_path(output, pixel), &panels, &guided_numbers_of(&recorded))
}

fn warn_of_no_hit([x, y]: [u32; 2]) {
    log::warn!("--pixel {x},{y}: the pixel sees the environment; there is no hit to explain");
}

fn write_files(path: &Path, panels: &[Sky], numbers: &serde_json::Value) -> Result<Vec<PathBuf>> {
    let mut rows: Vec<[u8; 3]> = Vec::new();
    for (index, panel) in panels.iter().enumerate() {
        if index > 0 {
            rows.extend(std::iter::repeat_n([255; 3], GAP * WIDTH));
        }
        rows.extend(panel.pixels());
    }
    write_rgb8(path, WIDTH as u32, (rows.len() / WIDTH) as u32, &rows)?;
    let numbers_path = path.with_extension("json");
    write_text(&numbers_path, &numbers.to_string())?;
    Ok(vec![path.to_owned(), numbers_path])
}

fn numbers_of(recorded: &RecordedPixel) -> serde_json::Value {
    json!({
        "position": recorded.position.to_array(),
        "normal": recorded.normal.to_array(),
        "rays": recorded.rays.iter().map(numbers_of_ray).collect::<Vec<_>>(),
        "lobes": recorded.lobes.iter().map(|lobe| json!({
            "axis": lobe.axis.to_array(),
            "bandwidth": lobe.bandwidth,
            "before": lobe.before,
            "after": lobe.after,
        })).collect::<Vec<_>>(),
        "cached": recorded.cached.iter().flatten().map(|direction| json!({
            "direction": direction.to_array(),
        })).collect::<Vec<_>>(),
    })
}

fn numbers_of_ray(ray: &RecordedRay) -> serde_json::Value {
    json!({
        "direction": ray.direction.to_array(),
        "contribution": ray.contribution.to_array(),
        "visible": ray.is_visible,
    })
}

fn guided_numbers_of(recorded: &RecordedGuide) -> serde_json::Value {
    let ray = |ray: &GuidedRay| {
        let mut numbers = numbers_of_ray(&ray.ray);
        numbers["sample"] = json!(ray.sample);
        numbers["region"] = json!(ray.region);
        numbers
    };
    let cell = |cell: &RecordedCell| {
        let (level, key) = match cell.level {
            CellLevel::Face(_) => ("face", None),
            CellLevel::Coarse(key) => ("coarse", Some(key)),
            CellLevel::Fine(key) => ("fine", Some(key)),
        };
        let face = match cell.level {
            CellLevel::Face(face) => face,
            CellLevel::Coarse(key) | CellLevel::Fine(key) => key.face(),
        };
        json!({
            "level": level,
            "key": key.map(|key| key.0),
            "face": FACES.get(face),
            "trials": cell.regions.iter().map(|region| region.trials).sum::<f64>(),
            "hits": cell.regions.iter().map(|region| region.hits).sum::<f64>(),
        })
    };
    let known = recorded.cell.iter().flat_map(|cell| &cell.regions);
    let regions = known.zip(&recorded.partition.regions).map(|(known, region)| {
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
        "position": recorded.position.to_array(),
        "normal": recorded.normal.to_array(),
        "rays": recorded.rays.iter().map(ray).collect::<Vec<_>>(),
        "cell": recorded.cell.as_ref().map(cell),
        "regions": regions.collect::<Vec<_>>(),
    })
}

/// Draws the environment with rays: green reached it, red were blocked, grey brought nothing.
fn draw_rays<'a>(scene: &Scene, normal: Vec3, rays: impl Iterator<Item = &'a RecordedRay>) -> Sky {
    let environment = |direction| scene.environment.radiance(direction);
    let mut panel = Sky::new(WIDTH, normal, white_of(WIDTH, environment), environment);
    for ray in rays {
        let colour = match (ray.contribution == Vec3::ZERO, ray.is_visible) {
            (true, _) => UNTRACED,
            (false, true) => VISIBLE,
            (false, false) => BLOCKED,
        };
        panel.mark(ray.direction, colour);
    }
    panel
}

/// Draws the panels of `guided`, top to bottom: three, or one if nothing was learned.
fn draw_guided(scene: &Scene, recorded: &RecordedGuide) -> Vec<Sky> {
    let normal = recorded.normal;
    let mut panels = vec![draw_rays(scene, normal, recorded.rays.iter().map(|ray| &ray.ray))];
    panels.extend(learned_skies(scene, recorded, WIDTH).into_iter().flatten());
    panels
}

/// Draws the panels, top to bottom.
fn draw(scene: &Scene, recorded: &RecordedPixel) -> Vec<Sky> {
    let normal = recorded.normal;
    let mut panels = vec![draw_rays(scene, normal, recorded.rays.iter())];
    if recorded.lobes.is_empty() {
        return panels;
    }
    let density = |probability: fn(&RecordedLobe) -> f64| {
        move |direction| {
            let part = |lobe: &RecordedLobe| {
                let integral = crate::srbf::kernel_integral(lobe.bandwidth);
                let kernel = kernel_value(lobe.axis, lobe.bandwidth, direction);
                probability(lobe) as f32 * kernel / integral
            };
            Vec3::splat(recorded.lobes.iter().map(part).sum::<f32>())
        }
    };
    let before = density(|lobe| lobe.before);
    let white = white_of(WIDTH, before);
    panels.push(Sky::new(WIDTH, normal, white, before));
    if let Some(cached) = &recorded.cached {
        let mut after = Sky::new(WIDTH, normal, white, density(|lobe| lobe.after));
        for direction in cached {
            after.mark(*direction, BLOCKED);
        }
        panels.push(after);
    }
    panels
}
