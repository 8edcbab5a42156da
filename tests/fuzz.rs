//! The parsers of the renderer on mutated files, as `crates/scene/tests/fuzz.rs` tries those of scenes: an
//! error or a result, soon, in little memory, and no panic.
//!
//! `FENESTRA_FUZZ_MILLISECONDS` is the time for each target, `FENESTRA_FUZZ_TARGET` one target,
//! `FENESTRA_FUZZ_SEED` the seed and `FENESTRA_FUZZ_FIRST` the first case. The input of a case
//! depends on target, seed and case alone: see `docs/reliability.md`.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{fs, path::Path};

use fenestra::{
    film::Checkpoint,
    fit::{EnvironmentOptions, Fit, Method, environment_lobes, read_fit, write_fit},
    sampler::{
        Parameters,
        guided::{ARRIVAL_DIRECTIONS, Arm, GuideState, Origin, SHARE_WORDS},
    },
    scene::{EnvironmentMap, files::hexadecimal},
    session::{parse_duration, parse_size},
    study::{
        contender::Contender,
        file::{StudyFile, is_study},
    },
};
use glam::Vec3;
use sha2::{Digest, Sha256};

use crate::support::{
    self,
    fuzz::{self, Target},
};

const STUDY: &str = r#"study = "What learning costs"
notes = ["one", "two"]
scenes = ["../courtyard.toml", "roofless.toml"]
[settings]
samplers = ["product", "visibility", "guided:later-rays=2"]
spp = [4, 16]
time = "30s"
seeds = 3
reference_sampler = "mis"
reference_spp = 64
overhead = true
overhead_baseline = "product"
overhead_spp = 16
overhead_repetitions = 15
size = "96x72"
shadow_rays = 5
depth = 1
[quick]
size = "80x60"
[[published.overheads]]
label = "thesis"
low = 1.02
high = 1.02
"#;

/// The bytes of a file that `write` makes.
fn written(name: &str, write: impl FnOnce(&Path)) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write(&path);
    fs::read(path).unwrap()
}

/// A guide of three cells and two regions.
fn guide() -> Vec<u8> {
    let origin = Origin { regions: 2, largest_edge: 0.3, ..Origin::default() };
    let state = GuideState {
        origin,
        samples: 5,
        rebuilt_at: 4,
        arm: Some(Arm {
            is_guided: true,
            guides_bounces: true,
            guides_later: true,
            shares_paths: false,
            candidates: 8,
            rays: [8, 2],
            roulette_throughput: 0.02,
        }),
        tag: 5,
        rectangles: vec![[0, 0, 5, 9, 0], [5, 0, 3, 9, 1]],
        keys: vec![u32::MAX, 7, 8],
        refined: vec![1],
        counts: vec![[3, 1, 7]; 6],
        shares: vec![1; 3 * SHARE_WORDS],
        pending: vec![[4, 4, 5]],
        missing: vec![9],
        arrivals: vec![[1; 2]; ARRIVAL_DIRECTIONS],
        ..GuideState::default()
    };
    state.to_bytes().unwrap()
}

/// A fit of a map by three lobes.
fn fit() -> Vec<u8> {
    let texels = (0..512).map(|index| Vec3::splat(0.5 + (index % 37) as f32)).collect();
    let map = EnvironmentMap {
        width: 32,
        height: 16,
        texels,
        ..EnvironmentMap::constant(Vec3::ONE, 1.0).unwrap()
    };
    let options = EnvironmentOptions { lobes: 3, method: Method::Em };
    let fit = environment_lobes(&map, options, None, &mut |_| ()).unwrap();
    written("a.fit", |path| write_fit(path, &Fit::Environment(fit)).unwrap())
}

fn study(path: &Path, _: &[u8]) -> bool {
    is_study(path).is_ok() & StudyFile::load(path, Parameters::default()).is_ok()
}

fn options(_: &Path, bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    parse_duration(&text).is_ok()
        | parse_size(&text).is_ok()
        | Contender::parse(&text, Parameters::default()).is_ok()
}

/// Writes the checksum of the header without it, and of what follows, into the header of a guide.
fn mend_guide(bytes: &mut Vec<u8>) {
    const KEY: &[u8] = b"\"checksum\":\"";
    let at = bytes.windows(KEY.len()).position(|window| window == KEY);
    let Some(start) = at.map(|at| at + KEY.len()) else { return };
    let Some(length) = bytes[start..].iter().position(|byte| *byte == b'"') else { return };
    let mut bare = bytes.clone();
    bare.drain(start..start + length);
    let line = bare.iter().position(|byte| *byte == b'\n').map(|line| bare.remove(line));
    let checksum = hexadecimal(&Sha256::digest(&bare));
    if line.is_some() {
        bytes.splice(start..start + length, checksum.into_bytes());
    }
}

/// Writes the checksum of the second line into the first line of a fit file.
fn mend_fit(bytes: &mut Vec<u8>) {
    const KEY: &[u8] = b"\"checksum\":\"";
    let split = bytes.iter().position(|byte| *byte == b'\n');
    let at = bytes.windows(KEY.len()).position(|window| window == KEY);
    let (Some(split), Some(at)) = (split, at) else { return };
    let Some(content) = bytes[split + 1..].strip_suffix(b"\n") else { return };
    let length = (content.len() as u64).to_le_bytes();
    let checksum =
        hexadecimal(&Sha256::new().chain_update(length).chain_update(content).finalize());
    let start = at + KEY.len();
    if let Some(length) = bytes[start..].iter().position(|byte| *byte == b'"') {
        bytes.splice(start..start + length, checksum.into_bytes());
    }
}

fn targets() -> Vec<Target> {
    let only_bytes = |target| Target { is_file: false, ..target };
    let checkpoint = written("a.exr", |path| support::checkpoint().write(path).unwrap());
    vec![
        Target::new("checkpoint", "input.exr", vec![checkpoint], |path, _| {
            Checkpoint::read(path).is_ok()
        }),
        only_bytes(Target {
            mend: mend_guide,
            ..Target::new("guide", "input.guide", vec![guide()], |path, bytes| {
                GuideState::from_bytes(bytes, path).is_ok()
            })
        }),
        Target {
            mend: mend_fit,
            ..Target::new("fit", "input.fit", vec![fit()], |path, _| read_fit(path).is_ok())
        },
        Target::new("study", "input.toml", vec![STUDY.into()], study),
        only_bytes(Target::new(
            "options",
            "input",
            ["30s", "1h", "500ms", "640x480", "guided:later-rays=2", "mis:compensation=off"]
                .map(Vec::from)
                .into(),
            options,
        )),
    ]
}

#[test]
fn worker() {
    fuzz::work_if_asked(targets());
}

#[test]
fn every_seed_is_accepted() {
    fuzz::check_seeds(targets());
}

#[test]
fn mutated_files_neither_crash_nor_hang_nor_exhaust_memory() {
    fuzz::check(targets());
}
