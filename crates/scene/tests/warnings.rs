//! Warnings of files and exports, each kind once, and requests of memory.
#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::path::Path;

use fenestra_scene::{
    Scene,
    export::gltf,
    features::{Ignored, OBJ_POINTS, OBJ_STATEMENT},
    memory::{check, check_count, limit, parse_size, room, size},
};

use crate::support::folder::Folder;

#[test]
fn a_kind_is_one_warning_and_kinds_are_bounded() {
    let mut ignored = Ignored::default();
    for line in 1..=3 {
        ignored.add(OBJ_POINTS, || format!("line {line}"));
    }
    ignored.add_named(OBJ_STATEMENT, "`deg`", || "line\n4".to_owned());
    let path = Path::new("a.obj");
    assert_eq!(
        ignored.warnings(path)[0],
        "a.obj: ignored points and lines (3, first in line 1): `p`, `l`"
    );
    assert_eq!(ignored.warnings(path)[1], "a.obj: ignored `deg` (line?4)");
    for number in 0..1000 {
        ignored.add_named(OBJ_STATEMENT, &format!("`x{number}`"), || "line 5".to_owned());
    }
    let warnings = ignored.warnings(path);
    assert_eq!(warnings.len(), 65);
    assert!(warnings[64].contains("other statements, by name (938, first in line 5)"));
    let mut twice = ignored.clone();
    twice.merge(&ignored);
    assert!(twice.warnings(path)[0].contains("(6, first in line 1)"));
}

/// Two meshes of a Mitsuba file lose triangles.
#[test]
fn losses_of_many_meshes_are_one_warning() {
    let folder = Folder::new();
    let mut shapes = String::new();
    for (name, faces) in [("sail", "2 2 1\nf 1 1 2\nf 1 2 3"), ("mast", "1 2 2\nf 1 2 3")] {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {faces}\n");
        folder.write(&format!("{name}.obj"), text);
        shapes += &format!(
            "\n<shape type=\"obj\"><string name=\"filename\" value=\"{name}.obj\"/></shape>"
        );
    }
    let text = format!("<scene version=\"3.0.0\"><sensor type=\"perspective\"/>{shapes}</scene>");
    let scene = Scene::load(&folder.write("a.xml", text)).unwrap();
    let expected = "a.xml: shape of line 2 and 1 others: dropped 3 triangles of zero area of 5";
    assert!(scene.warnings.iter().any(|text| text.ends_with(expected)), "{:?}", scene.warnings);
}

#[test]
fn a_kind_of_difference_is_one_line() {
    let folder = Folder::new();
    let text = "[camera]\nposition = [0, 1, 5]\nlook_at = [0, 1, 0]\nvertical_fov_deg = 40\n\
                [[portal]]\ncorner = [0, 0, 0]\nfirst_edge = [1, 0, 0]\nsecond_edge = [0, 1, 0]\n";
    let scene = Scene::load(&folder.write("a.toml", text)).unwrap();
    let mut export = gltf::export(&scene, Path::new("a.gltf"));
    let portals = "portals: left out, 1 in all, `the first` among them";
    assert!(export.warnings.iter().any(|text| text.contains(portals)), "{:?}", export.warnings);
    let warnings = ["`a`: darker at alpha = 0.3", "`b`: darker at alpha = 0.25", "`b`: brighter"];
    export.warnings = warnings.map(|text| format!("material {text}")).to_vec();
    let first = format!("{} (1 others likewise)", export.warnings[0]);
    assert_eq!(export.summary(), [first, export.warnings[2].clone()]);
}

#[test]
fn sizes_have_units() {
    assert_eq!(parse_size("1000000"), Ok(1_000_000));
    assert_eq!(parse_size("512M"), Ok(512 << 20));
    assert_eq!(parse_size("2.5GiB"), Ok(5 << 29));
    assert_eq!(parse_size("3kb"), Ok(3 << 10));
    for wrong in ["", "M", "-1G", "0", "nan", "1e400", "12 parsecs"] {
        assert!(parse_size(wrong).is_err(), "{wrong}");
    }
    assert_eq!(size(512), "512 B");
    assert_eq!(size(5 << 29), "2.5 GiB");
}

#[test]
fn a_request_beyond_the_limit_says_who_asks_for_how_much() {
    assert_eq!(check("a map", 5), Ok(()));
    let refused = check("a map", u64::MAX).unwrap_err().to_string();
    assert!(refused.contains("a map asks for 16.0 EiB"), "{refused}");
    assert!(check_count("a map", usize::MAX, 12).is_err());
}

#[cfg(target_os = "linux")]
#[test]
fn the_limit_and_the_memory_in_use_are_known() {
    assert!((1 << 26..1 << 50).contains(&limit()), "{}", limit());
    assert!(room() + (1 << 20) < limit(), "{} of {}", room(), limit());
}
