//! Compares two samplers at equal samples on one scene: trimmed relMSE for several seeds, and the ratio
//! of the two with its spread. `fenestra study` does this at full length, with a report.
//!
//! ```text
//! cargo run --release --example study -- [SCENE]
//! ```

use std::{env, ops::RangeInclusive, path::PathBuf};

use fenestra::{
    Result,
    film::RgbImage,
    gpu::Device,
    sampler::Sampler,
    scene::Scene,
    session::{Event, Rules, Session, Settings},
    study::{metrics::Metrics, statistics::geometric_interval},
};

/// The ratio is the error of the first over that of the second.
const SAMPLERS: [Sampler; 2] = [Sampler::Mis, Sampler::Guided];
/// Width and height of the film in pixels.
const SIZE: [u32; 2] = [96, 72];
/// Samples per pixel of every picture.
const SPP: u32 = 16;
/// Seeds of the pictures.
const SEEDS: RangeInclusive<u32> = 1..=5;
/// Samples per pixel of each half of the reference.
const HALF_SPP: u32 = 256;
/// Seeds of the halves, which share no samples with the pictures.
const HALF_SEEDS: [u32; 2] = [1001, 1002];

fn main() -> Result<()> {
    let path =
        env::args_os().nth(1).map_or_else(|| "scenes/meeting_room.toml".into(), PathBuf::from);
    let mut scene = Scene::load(&path)?;
    [scene.film.width, scene.film.height] = SIZE;
    let device = Device::open(None, false)?;
    let make = |sampler| Session::new(&device, &scene, Settings { sampler, ..Settings::default() });
    let [mut first, mut second] = [make(SAMPLERS[0])?, make(SAMPLERS[1])?];

    // Two independent halves keep the reference's own noise out of the errors.
    eprintln!("rendering the reference, 2 x {HALF_SPP} spp");
    let mut half = |seed| render(&mut first, seed, HALF_SPP);
    let halves = [half(HALF_SEEDS[0])?, half(HALF_SEEDS[1])?];

    let [name, other] = SAMPLERS.map(Sampler::name);
    println!("{}, {}x{} pixels, {SPP} spp, trimmed relMSE", scene.name, SIZE[0], SIZE[1]);
    println!("seed  {name:>10}  {other:>10}  ratio");
    let mut ratios = Vec::new();
    for seed in SEEDS {
        let relmse = |session: &mut Session| -> Result<f64> {
            let picture = render(session, seed, SPP)?;
            // Without the worst 0.1% of the pixels: a single bright one can outweigh all others.
            Ok(Metrics::of_halves(&picture, &halves[0], &halves[1])?.errors.relmse_trimmed)
        };
        let errors = [relmse(&mut first)?, relmse(&mut second)?];
        let ratio = errors[0] / errors[1];
        println!("{seed:4}  {:10.3e}  {:10.3e}  {ratio:5.2}", errors[0], errors[1]);
        ratios.push(ratio);
    }
    match geometric_interval(&ratios) {
        Some(mean) => println!(
            "geometric mean of the ratio {:.2}, 95% interval {:.2} to {:.2}",
            mean.middle, mean.low, mean.high
        ),
        None => println!("the reference is too noisy to judge these pictures"),
    }
    Ok(())
}

/// Renders from nothing with `seed`: a sampler that learns starts again.
fn render(session: &mut Session, seed: u32, spp: u32) -> Result<RgbImage> {
    session.restart(seed)?;
    let rules = Rules { samples: Some(spp), ..Rules::default() };
    session.run(&rules, &mut |_: &Event<'_>| ())?;
    session.image(&[])?.rgb("rendered picture".as_ref())
}
