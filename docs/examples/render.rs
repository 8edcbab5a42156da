//! Renders a scene until its error is below 2% or a minute has passed. A checkpoint every ten seconds lets
//! the next start continue: `cargo run --release --example render -- [SCENE]`.

use std::{env, path::Path, time::Duration};

use fenestra::{
    Result, film,
    gpu::Device,
    sampler::Sampler,
    scene::Scene,
    session::{Event, Rules, Session, Settings},
};

fn main() -> Result<()> {
    let path = env::args().nth(1).unwrap_or("scenes/meeting_room.toml".into());
    let (scene, device) = (Scene::load(Path::new(&path))?, Device::open(None, false)?);
    let settings = Settings { sampler: Sampler::Guided, depth: 2, ..Settings::default() };
    let mut session = Session::new(&device, &scene, settings)?;
    let output = Path::new("render.exr");
    let checkpoint = film::checkpoint::checkpoint_path(output);
    if checkpoint.exists() {
        session.resume(&checkpoint)?;
    }
    let checkpoints = Some((checkpoint, Duration::from_secs(10)));
    let (error, seconds) = (Some(0.02), Some(60.0));
    let rules = Rules { error, seconds, checkpoints, ..Rules::default() };
    let reason = session.run(&rules, &mut |event: &Event<'_>| eprintln!("{event}"))?;
    eprintln!("stopped by {}", reason.name());
    session.image(&[film::Aov::Variance])?.write_exr(output)
}
