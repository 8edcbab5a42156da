//! glTF files that other programs have compressed hold the meshes that they were made of: a grid of 5 × 5
//! vertices over the unit square with the heights x² − xy/2.
//!
//! `draco.glb`, `meshopt.glb` and `strip.glb`, the lowest row as a strip, are from glTF Transform 4.5 with
//! Draco 1.5 and meshoptimizer 1.2, `exponential.glb` is from gltfpack 1.3.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use fenestra_scene::mesh::Mesh;
use glam::Vec3;

use crate::support::folder::Folder;

const DRACO: &[u8] = include_bytes!("data/draco.glb");
const MESHOPT: &[u8] = include_bytes!("data/meshopt.glb");
const EXPONENTIAL: &[u8] = include_bytes!("data/exponential.glb");
const STRIP: &[u8] = include_bytes!("data/strip.glb");

fn read(bytes: &[u8]) -> Mesh {
    let mut warnings = Vec::new();
    let mesh = Mesh::read(&Folder::new().write("a.glb", bytes), &mut warnings).unwrap();
    assert_eq!(warnings, [""; 0]);
    mesh
}

#[test]
fn compressed_meshes_are_what_they_were() {
    for (bytes, rows, has_uvs) in
        [(DRACO, 4, true), (MESHOPT, 4, true), (EXPONENTIAL, 4, false), (STRIP, 1, true)]
    {
        let mesh = read(bytes);
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (5 * (rows + 1), 8 * rows));
        assert_eq!(mesh.materials[0].material.name, "leaf");
        for (vertex, (&[x, y, z], normal)) in mesh.positions.iter().zip(&mesh.normals).enumerate() {
            assert!((z - x * (x - 0.5 * y)).abs() < 1e-3, "{x} {y} {z}");
            let expected = Vec3::new(0.5 * y - 2.0 * x, 0.5 * x, 1.0).normalize();
            assert!(expected.distance(Vec3::from(*normal)) < 0.02, "{expected} {normal:?}");
            if has_uvs {
                let [u, v] = mesh.uvs[0][vertex];
                assert!((u - x).abs().max((1.0 - v - y).abs()) < 1e-3, "{x} {y}: {u} {v}");
            }
        }
        let areas = mesh.triangles.iter().map(|corners| {
            let [a, b, c] = corners.map(|at| Vec3::from(mesh.positions[at as usize]).truncate());
            0.5 * (b - a).perp_dot(c - a)
        });
        let areas: Vec<f32> = areas.collect();
        assert!(areas.iter().all(|area| (area - 1.0 / 32.0).abs() < 1e-3), "{areas:?}");
    }
}

/// Bytes of a file with another text in its document.
fn changed(whole: &[u8], from: &str, to: &str) -> Vec<u8> {
    let json = 20 + u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize;
    let text = std::str::from_utf8(&whole[20..json]).unwrap();
    assert!(text.contains(from), "{from}: {text}");
    let mut text = text.replace(from, to);
    text.extend(std::iter::repeat_n(' ', text.len().next_multiple_of(4) - text.len()));
    let mut changed = whole[..20].to_vec();
    changed[12..16].copy_from_slice(&(text.len() as u32).to_le_bytes());
    changed.extend(text.bytes());
    changed.extend(&whole[json..]);
    let length = changed.len() as u32;
    changed[8..12].copy_from_slice(&length.to_le_bytes());
    changed
}

/// Accessors of Draco's attributes may say where readers without it find the values.
#[test]
fn places_beside_compressed_values_do_not_count() {
    let placed = changed(DRACO, "\"count\":25", "\"count\":25,\"byteOffset\":12");
    assert_eq!(read(&placed).positions, read(DRACO).positions);
}

#[test]
fn damaged_meshes_are_refused_or_read() {
    let folder = Folder::new();
    for whole in [DRACO, MESHOPT, EXPONENTIAL, STRIP] {
        let json = u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize;
        for at in 28 + json..whole.len() {
            for mask in [0x01, 0x80, 0xff] {
                let mut damaged = whole.to_vec();
                damaged[at] ^= mask;
                let _ = Mesh::read(&folder.write("a.glb", damaged), &mut Vec::new());
            }
        }
    }
    let cases = [
        (
            DRACO,
            "\"NORMAL\":1,\"TEXCOORD_0\":2}",
            "\"NORMAL\":9,\"TEXCOORD_0\":2}",
            "it holds no NORMAL",
        ),
        (DRACO, "\"count\":25", "\"count\":24", "it holds 25 "),
        (DRACO, "\"bufferView\":0", "\"bufferView\":7", "names no buffer view"),
        (MESHOPT, "\"TRIANGLES\"", "\"TRIANGLED\"", "expected no mode `TRIANGLED` of 2 bytes"),
        (MESHOPT, "OCTAHEDRAL", "QUATERNION", "expected no filter `QUATERNION` of 4 bytes"),
        (MESHOPT, "\"byteLength\":49,", "\"byteLength\":48,", "cannot be decoded"),
        (MESHOPT, "\"byteLength\":49,", "\"byteLength\":4900,", "truncated: needs 4900 bytes"),
    ];
    for (whole, from, to, expected) in cases {
        let path = folder.write("a.glb", changed(whole, from, to));
        let found = Mesh::read(&path, &mut Vec::new()).unwrap_err();
        assert!(found.to_string().contains(expected), "{found}");
    }
}
