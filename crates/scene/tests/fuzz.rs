//! Every parser on mutated files: an error or a result, soon, in little memory, and no panic.
//!
//! `FENESTRA_FUZZ_MILLISECONDS` is the time for each target, `FENESTRA_FUZZ_TARGET` one target,
//! `FENESTRA_FUZZ_SEED` the seed and `FENESTRA_FUZZ_FIRST` the first case. The input of a case
//! depends on target, seed and case alone: see `docs/reliability.md`.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{fs, path::Path};

use fenestra_scene::{
    EnvironmentMap, Scene,
    measured::{MeasuredTable, cornell, rgl::AdaptiveBrdf},
    mesh::Mesh,
    picture::Image,
    texture::Texture,
};
use image::ImageFormat;

use crate::support::{
    fuzz::{self, Target},
    gltf, seeds, tensor,
};

fn scene(path: &Path, _: &[u8]) -> bool {
    Scene::load(path).is_ok()
}

fn mesh(path: &Path, _: &[u8]) -> bool {
    Mesh::read(path, &mut Vec::new()).is_ok()
}

fn map(path: &Path, bytes: &[u8]) -> bool {
    let texture = Texture::decode("map", bytes, &mut Vec::new());
    EnvironmentMap::load(path, 1.0, &mut Vec::new()).is_ok() || texture.is_ok()
}

fn picture(_: &Path, bytes: &[u8]) -> bool {
    Texture::decode("picture", bytes, &mut Vec::new()).is_ok()
}

fn image(path: &Path, _: &[u8]) -> bool {
    let is_map = EnvironmentMap::load(path, 1.0, &mut Vec::new()).is_ok();
    Image::read_exr(path).is_ok() | is_map
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
    let target = Target::new;
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
            ..target("glb", "input.glb", vec![seeds::glb(&document, &[])], scene)
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
        target("rgl", "input.bsdf", vec![tensor::encode(&tensor::isotropic(0.4).1)], |path, _| {
            AdaptiveBrdf::read(path).is_ok()
        }),
        target("hdr", "input.hdr", vec![seeds::hdr(false), seeds::hdr(true)], map),
        target("pfm", "input.pfm", vec![seeds::pfm()], map),
        target("exr", "input.exr", vec![seeds::exr(false), seeds::exr(true)], image),
        only_bytes(target("png", "input.png", png, picture)),
        only_bytes(target("jpeg", "input.jpg", jpeg, picture)),
        only_bytes(target("tga", "input.tga", tga, |path, bytes| {
            fs::write(path, bytes).unwrap();
            Texture::load(path, &mut Vec::new()).is_ok()
        })),
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
