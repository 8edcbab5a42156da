//! Spectra mean the same in files of all formats.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests may panic")]

use fenestra_scene::{Scene, material::MaterialKind};
use glam::Vec3;

use crate::support::folder::Folder;

/// Reflectance and warnings of a diffuse material with a spectrum, in a pbrt and in a Mitsuba file.
fn loaded(samples: [(u32, f32); 4]) -> [(Vec3, Vec<String>); 2] {
    let joined = |between: &str, after: &str| {
        samples.map(|(nm, value)| format!("{nm}{between}{value}{after}")).concat()
    };
    let pbrt = format!(
        "Camera \"perspective\"\nWorldBegin\nLightSource \"infinite\"\nMaterial \"diffuse\" \
         \"spectrum reflectance\" [{}]\nShape \"sphere\"",
        joined(" ", " ")
    );
    let mitsuba = format!(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><emitter type=\"constant\"/>\
         <shape type=\"sphere\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"{}\"/>\
         </bsdf></shape></scene>",
        joined(":", ", ")
    );
    let folder = Folder::new();
    [("a.pbrt", pbrt), ("a.xml", mitsuba)].map(|(name, text)| {
        let scene = Scene::load(&folder.write(name, text)).unwrap();
        let MaterialKind::Diffuse { reflectance } = scene.materials[0].kind else { panic!() };
        let is_of_gamut = |warning: &String| warning.contains("beyond Rec.709");
        (reflectance, scene.warnings.into_iter().filter(is_of_gamut).collect())
    })
}

#[test]
fn a_saturated_spectrum_is_clipped_with_a_warning() {
    let [pbrt, mitsuba] = loaded([(499, 0.0), (500, 1.0), (600, 1.0), (601, 0.0)]);
    assert_eq!(pbrt.0, mitsuba.0);
    assert!(pbrt.0.abs_diff_eq(Vec3::new(0.22, 1.0, 0.0), 0.01), "{}", pbrt.0);
    for (file, (_, warnings)) in [("a.pbrt", pbrt), ("a.xml", mitsuba)] {
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(warnings[0].contains(file), "{warnings:?}");
        assert!(warnings[0].ends_with(": clipped"), "{warnings:?}");
    }
}

#[test]
fn a_constant_spectrum_is_grey() {
    for (color, warnings) in loaded([(300, 0.4), (500, 0.4), (600, 0.4), (900, 0.4)]) {
        assert!(color.abs_diff_eq(Vec3::splat(0.4), 1e-6), "{color}");
        assert_eq!(warnings, [""; 0]);
    }
}
