//! `--pixel x,y`: a picture that explains what the sampler did at one hit.
//!
//! Panels are lat-long, −Z in the middle and +Y on top, darkened below the hit's horizon (blue).
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
    film::{
        Window,
        png::{display_from_linear, write_rgb8},
    },
    gpu::Device,
    math::frame::{direction_from_lat_long, lat_long_from_direction},
    renderer::{RecordedPixel, Renderer, Settings, window_of},
    sampler::{
        guided::{CellLevel, GuidedRay, RecordedCell, RecordedGuide, RecordedRay},
        product::record::RecordedLobe,
    },
    scene::Scene,
    srbf::kernel_value,
};

/// Rays in the picture of `guided`, rounded up to whole samples.
const GUIDED_RAYS: u32 = 64;
/// Size of a panel, pixels.
const WIDTH: usize = 512;
const HEIGHT: usize = WIDTH / 2;
/// Height of the white line between panels, pixels.
const GAP: usize = 4;
/// Share of a panel's pixels that may be over-exposed.
const CLIPPED: f32 = 0.005;
/// Factor that darkens colours below the horizon.
const BELOW: f32 = 0.25;

const VISIBLE: [u8; 3] = [40, 220, 70];
const BLOCKED: [u8; 3] = [235, 40, 40];
const UNTRACED: [u8; 3] = [150, 150, 150];
const HORIZON: [u8; 3] = [90, 160, 255];
/// Names of a cube's faces, in the guide's order.
const FACES: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];
/// Tint of regions that a cell has not counted itself, linear.
const UNCOUNTED: Vec3 = Vec3::new(0.35, 0.6, 1.0);

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

fn write_files(path: &Path, panels: &[Panel], numbers: &serde_json::Value) -> Result<Vec<PathBuf>> {
    let mut rows: Vec<[u8; 3]> = Vec::new();
    for (index, panel) in panels.iter().enumerate() {
        if index > 0 {
            rows.extend(std::iter::repeat_n([255; 3], GAP * WIDTH));
        }
        rows.extend(&panel.0);
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
fn draw_rays<'a>(
    scene: &Scene,
    normal: Vec3,
    rays: impl Iterator<Item = &'a RecordedRay>,
) -> Panel {
    let environment = |direction| scene.environment.radiance(direction);
    let mut panel = Panel::new(normal, white_of(environment), environment);
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
fn draw_guided(scene: &Scene, recorded: &RecordedGuide) -> Vec<Panel> {
    let normal = recorded.normal;
    let mut panels = vec![draw_rays(scene, normal, recorded.rays.iter().map(|ray| &ray.ray))];
    if let Some(cell) = &recorded.cell {
        let region_of = |direction| recorded.partition.region_of(&scene.environment, direction);
        panels.push(Panel::new(normal, 1.0, |direction| {
            let region = cell.regions[region_of(direction)];
            let colour = if region.trials <= 0.0 { UNCOUNTED } else { Vec3::ONE };
            region.visibility as f32 * colour
        }));
        let density = |direction| {
            let index = region_of(direction);
            let solid_angle = recorded.partition.regions[index].solid_angle;
            Vec3::splat((cell.regions[index].probability / solid_angle) as f32)
        };
        panels.push(Panel::new(normal, white_of(density), density));
    }
    panels
}

/// Draws the panels, top to bottom.
fn draw(scene: &Scene, recorded: &RecordedPixel) -> Vec<Panel> {
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
    let white = white_of(before);
    panels.push(Panel::new(normal, white, before));
    if let Some(cached) = &recorded.cached {
        let mut after = Panel::new(normal, white, density(|lobe| lobe.after));
        for direction in cached {
            after.mark(*direction, BLOCKED);
        }
        panels.push(after);
    }
    panels
}

/// Returns the value that a share [`CLIPPED`] of a function's pixels exceeds.
fn white_of(value: impl Fn(Vec3) -> Vec3) -> f32 {
    let mut sorted: Vec<f32> =
        (0..WIDTH * HEIGHT).map(|i| value(direction_of(i)).max_element()).collect();
    sorted.sort_by(f32::total_cmp);
    let largest = sorted.last().copied().unwrap_or(0.0);
    let index = ((1.0 - CLIPPED) * sorted.len() as f32) as usize;
    sorted.get(index).copied().filter(|white| *white > 0.0).unwrap_or(largest)
}

/// A lat-long picture.
struct Panel(Vec<[u8; 3]>);

impl Panel {
    /// Draws a function of direction, with `white` shown as white.
    fn new(normal: Vec3, white: f32, value: impl Fn(Vec3) -> Vec3) -> Self {
        let values: Vec<Vec3> = (0..WIDTH * HEIGHT).map(|i| value(direction_of(i))).collect();
        let show = |(index, value): (usize, &Vec3)| {
            let cosine = direction_of(index).dot(normal);
            if cosine.abs() < 2.0 / HEIGHT as f32 {
                return HORIZON;
            }
            let scale = if cosine < 0.0 { BELOW } else { 1.0 } / white.max(f32::MIN_POSITIVE);
            (*value * scale).to_array().map(display_from_linear)
        };
        Self(values.iter().enumerate().map(show).collect())
    }

    /// Draws a dot with a black rim.
    fn mark(&mut self, direction: Vec3, colour: [u8; 3]) {
        let uv = lat_long_from_direction(direction);
        let centre = [(uv.x * WIDTH as f32) as i32, (uv.y * HEIGHT as f32) as i32];
        for dy in -4_i32..=4 {
            for dx in -4_i32..=4 {
                let squared = dx * dx + dy * dy;
                let row = centre[1] + dy;
                if squared > 18 || !(0..HEIGHT as i32).contains(&row) {
                    continue;
                }
                let column = (centre[0] + dx).rem_euclid(WIDTH as i32);
                let colour = if squared > 9 { [0; 3] } else { colour };
                self.0[row as usize * WIDTH + column as usize] = colour;
            }
        }
    }
}

fn direction_of(pixel: usize) -> Vec3 {
    let u = ((pixel % WIDTH) as f32 + 0.5) / WIDTH as f32;
    let v = ((pixel / WIDTH) as f32 + 0.5) / HEIGHT as f32;
    direction_from_lat_long(glam::Vec2::new(u, v))
}
