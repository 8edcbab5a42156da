//! Renders a scene with `guided`, one sample per pixel at a time, and writes an OpenEXR file that
//! says how it was made.
//!
//! ```text
//! cargo run --release --example render -- [SCENE [SAMPLES]]
//! ```

use std::{env, path::PathBuf, time::Instant};

use fenestra::{
    Error, Result,
    film::{Aov, Metadata, SampleRange},
    gpu::Device,
    sampler::Sampler,
    scene::Scene,
    session::{Renderer, Settings},
};

fn main() -> Result<()> {
    let mut arguments = env::args().skip(1);
    let path = arguments.next().map_or_else(|| "scenes/meeting_room.toml".into(), PathBuf::from);
    let samples: u32 = arguments.next().map_or(Ok(16), |text| {
        text.parse().map_err(|_| Error::usage(format!("samples: expected a number, found {text}")))
    })?;

    let scene = Scene::load(&path)?;
    // Take the first suitable device, without validation layers.
    let device = Device::open(None, false)?;
    let settings = Settings { sampler: Sampler::Guided, depth: 2, ..Settings::default() };
    let mut renderer = Renderer::new(&device, &scene, settings.clone())?;

    let start = Instant::now();
    while renderer.sample_count() < samples {
        renderer.render_pass(1)?;
        eprint!("\r{}: {} of {samples} spp", scene.name, renderer.sample_count());
    }
    eprintln!(" in {:.1} s", start.elapsed().as_secs_f64());

    let sums = renderer.sums()?;
    let mut image = sums.to_image(&[Aov::Variance]);
    metadata(&renderer, &settings, &scene, &device, start).store(&mut image);
    let output = PathBuf::from(format!("{}.exr", scene.name));
    image.write_exr(&output)?;
    eprintln!(
        "wrote {}, mean relative standard error {:.3}",
        output.display(),
        sums.relative_standard_error()
    );
    Ok(())
}

/// Describes the render, so that `fenestra merge` and `fenestra compare` know what they read.
fn metadata(
    renderer: &Renderer,
    settings: &Settings,
    scene: &Scene,
    device: &Device,
    start: Instant,
) -> Metadata {
    let capabilities = device.capabilities();
    let report = renderer.report();
    Metadata {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        scene: scene.name.clone(),
        scene_hash: scene.hash.clone(),
        fit_hashes: report.fit_hashes,
        sampler: settings.sampler.name().to_owned(),
        sampler_parameters: settings.sampler.describe(&settings.parameters),
        candidates: report.candidates,
        shadow_rays: settings.shadow_rays,
        depth: settings.depth,
        sample_ranges: vec![SampleRange {
            seed: settings.seed,
            first: settings.first_sample,
            count: renderer.sample_count(),
        }],
        seconds: start.elapsed().as_secs_f64(),
        device: capabilities.name.clone(),
        driver: capabilities.driver.clone(),
        ..Metadata::default()
    }
}
