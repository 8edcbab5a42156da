//! Every parser on mutated files: an error or a result, soon, in little memory, and no panic.
//!
//! `FENESTRA_FUZZ_MILLISECONDS` is the time for each target, `FENESTRA_FUZZ_TARGET` one target,
//! `FENESTRA_FUZZ_SEED` the seed and `FENESTRA_FUZZ_FIRST` the first case. The input of a case
//! depends on target, seed and case alone: see `docs/reliability.md`.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use crate::support::fuzz;
use crate::support::gltf;
use crate::support::seeds;
use std::{env, fs, path::Path};

use crate::support::fuzz::Target;
use fenestra::{
    command::options::{parse_duration, parse_size},
    files::hexadecimal,
    film::{Checkpoint, Image},
    fit::read_fit,
    sampler::{Parameters, guided::GuideState},
    scene::{
        EnvironmentMap, Scene,
        measured::{MeasuredTable, cornell},
        mesh::Mesh,
    },
    study::{
        contender::Contender,
        file::{StudyFile, ValueParsers, is_study},
    },
    texture::Texture,
};
use image::ImageFormat;
use sha2::{Digest, Sha256};

fn scene(path: &Path, _: &[u8]) -> bool {
    Scene::load(path).is_ok()
}

fn mesh(path: &Path, _: &[u8]) -> bool {
    Mesh::read(path, &mut Vec::new()).is_ok()
}

fn map(path: &Path, bytes: &[u8]) -> bool {
    let texture = Texture::decode("map", bytes);
    EnvironmentMap::load(path, 1.0, 0.0, &mut Vec::new()).is_ok() || texture.is_ok()
}

fn picture(_: &Path, bytes: &[u8]) -> bool {
    Texture::decode("picture", bytes).is_ok()
}

fn study(path: &Path, _: &[u8]) -> bool {
    let parsers = ValueParsers { duration: parse_duration, size: parse_size };
    is_study(path).is_ok() & StudyFile::load(path, Parameters::default(), parsers).is_ok()
}

fn options(_: &Path, bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    parse_duration(&text).is_ok()
        | parse_size(&text).is_ok()
        | Contender::parse(&text, Parameters::default()).is_ok()
}

fn checkpoint(path: &Path, _: &[u8]) -> bool {
    Checkpoint::read(path).is_ok()
}

fn image(path: &Path, _: &[u8]) -> bool {
    let is_map = EnvironmentMap::load(path, 1.0, 0.0, &mut Vec::new()).is_ok();
    Image::read_exr(path).is_ok() | is_map
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
    let serialized = || {
        let mut bytes = seeds::serialized();
        seeds::pack_serialized(&mut bytes);
        bytes
    };
    let beside = || {
        vec![
            ("map.pfm", seeds::pfm()),
            ("image.png", seeds::picture(ImageFormat::Png, false)),
            ("mesh.ply", seeds::PLY.into()),
            ("mesh.serialized", serialized()),
        ]
    };
    let target = |name, file, seeds: Vec<Vec<u8>>, parse| Target {
        name,
        file,
        beside: Vec::new(),
        seeds,
        is_file: true,
        mend: |_| (),
        parse,
    };
    let document =
        gltf::gltf(seeds::GLTF_NODES, seeds::GLTF_MATERIALS, ", \"material\": 0", seeds::GLTF_REST);
    let texts =
        |texts: &[&str]| -> Vec<Vec<u8>> { texts.iter().map(|&text| text.into()).collect() };
    let merl = || {
        let counts = [90_i32, 90, 180].iter().flat_map(|count| count.to_le_bytes());
        counts.chain([0; 64]).collect::<Vec<u8>>()
    };
    let only_bytes = |target| Target { is_file: false, ..target };
    let formats = [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Tga];
    let [png, jpeg, tga] = formats.map(|format| {
        let opaque = seeds::picture(format, false);
        if format == ImageFormat::Jpeg {
            vec![opaque]
        } else {
            vec![opaque, seeds::picture(format, true)]
        }
    });
    vec![
        Target { beside: beside(), ..target("toml", "input.toml", texts(&[seeds::TOML]), scene) },
        target("sky", "input.toml", texts(&[seeds::SKY]), scene),
        target(
            "ply",
            "input.ply",
            vec![seeds::PLY.into(), seeds::binary_ply(false), seeds::binary_ply(true)],
            mesh,
        ),
        Target {
            beside: [beside(), vec![("input.mtl", seeds::MTL.into())]].concat(),
            ..target("obj", "input.obj", texts(&[seeds::OBJ]), mesh)
        },
        Target {
            beside: [beside(), vec![("mesh.obj", seeds::OBJ.into())]].concat(),
            ..target("mtl", "input.mtl", texts(&[seeds::MTL]), |path, bytes| {
                mesh(&path.with_file_name("mesh.obj"), bytes)
            })
        },
        Target {
            beside: beside(),
            ..target("gltf", "input.gltf", vec![document.clone().into()], scene)
        },
        Target {
            beside: beside(),
            mend: |bytes| seeds::mend_glb(bytes),
            ..target("glb", "input.glb", vec![seeds::glb(&document)], scene)
        },
        Target { beside: beside(), ..target("pbrt", "input.pbrt", texts(&[seeds::PBRT]), scene) },
        Target { beside: beside(), ..target("xml", "input.xml", texts(&[seeds::XML]), scene) },
        Target {
            beside: vec![("mesh.xml", seeds::SERIALIZED_XML.into())],
            mend: seeds::pack_serialized,
            ..target("serialized", "mesh.serialized", vec![seeds::serialized()], |path, bytes| {
                scene(&path.with_file_name("mesh.xml"), bytes)
            })
        },
        target("merl", "input.binary", vec![merl()], |path, _| MeasuredTable::load(path).is_ok()),
        target("cornell", "input.brdf", texts(&[seeds::CORNELL]), |path, _| {
            cornell::read(path).is_ok()
        }),
        target("cornell-table", "input.brdf", texts(&[seeds::CORNELL]), |path, _| {
            MeasuredTable::load(path).is_ok()
        }),
        target("hdr", "input.hdr", vec![seeds::hdr(false), seeds::hdr(true)], map),
        target("pfm", "input.pfm", vec![seeds::pfm()], map),
        target("exr", "input.exr", vec![seeds::exr(false), seeds::exr(true)], image),
        only_bytes(target("png", "input.png", png, picture)),
        only_bytes(target("jpeg", "input.jpg", jpeg, picture)),
        only_bytes(target("tga", "input.tga", tga, |path, bytes| {
            fs::write(path, bytes).unwrap();
            Texture::load(path).is_ok()
        })),
        target("checkpoint", "input.exr", vec![seeds::checkpoint()], checkpoint),
        only_bytes(Target {
            mend: mend_guide,
            ..target("guide", "input.guide", vec![seeds::guide()], |path, bytes| {
                GuideState::from_bytes(bytes, path).is_ok()
            })
        }),
        Target {
            mend: mend_fit,
            ..target("fit", "input.fit", vec![seeds::fit()], |path, _| read_fit(path).is_ok())
        },
        target("study", "input.toml", texts(&[seeds::STUDY]), study),
        only_bytes(target(
            "options",
            "input",
            texts(&[
                "30s",
                "1h",
                "500ms",
                "640x480",
                "guided:later-rays=2",
                "mis:compensation=off",
            ]),
            options,
        )),
    ]
}

/// Does the work of one target in a process that [`fuzz::run`] starts.
#[test]
fn worker() {
    let Ok(name) = env::var("FENESTRA_FUZZ_WORKER") else { return };
    let target = targets().into_iter().find(|target| target.name == name).unwrap();
    fuzz::work(Box::leak(Box::new(target)));
}

#[test]
fn every_seed_is_accepted() {
    let folder = tempfile::tempdir().unwrap();
    for target in targets() {
        let folder = folder.path().join(target.name);
        fs::create_dir(&folder).unwrap();
        for (name, bytes) in &target.beside {
            fs::write(folder.join(name), bytes).unwrap();
        }
        for seed in &target.seeds {
            let mut bytes = seed.clone();
            (target.mend)(&mut bytes);
            let path = folder.join(target.file);
            fs::write(&path, &bytes).unwrap();
            // A MERL file is too large to be a seed: its head is.
            let is_sound = (target.parse)(&path, &bytes);
            assert!(is_sound || target.name == "merl", "{}", target.name);
        }
    }
}

#[test]
fn mutated_files_neither_crash_nor_hang_nor_exhaust_memory() {
    let wanted = env::var("FENESTRA_FUZZ_TARGET").ok();
    let mut failures = String::new();
    println!("{:<12}{:>12}{:>12}{:>12}", "target", "executions", "accepted", "longest ms");
    for target in targets() {
        if wanted.as_ref().is_some_and(|name| name != target.name) {
            continue;
        }
        let outcome = fuzz::run(&target);
        println!(
            "{:<12}{:>12}{:>12}{:>12}",
            target.name, outcome.executions, outcome.accepted, outcome.slowest_ms
        );
        for failure in outcome.failures {
            failures += &format!("{}: {failure}\n", target.name);
        }
    }
    assert!(
        failures.is_empty(),
        "the inputs lie in {} by target, seed and case:\n{failures}",
        env!("CARGO_TARGET_TMPDIR")
    );
}
