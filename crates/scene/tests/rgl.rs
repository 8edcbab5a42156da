//! RGL files: their interpolation against Mitsuba's and against the surfaces in them, the table made of
//! it, the scenes around it, and the messages that refuse bad ones.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::{
    f64::consts::{FRAC_PI_2, PI, TAU},
    fs,
    sync::Arc,
};

use fenestra_scene::{
    Scene,
    export::{Settings, mitsuba::export},
    material::MaterialKind,
    measured::{
        MeasuredTable, RglTraits,
        lookup::{half_difference_angles, measured_turn},
        rgl::AdaptiveBrdf,
    },
};
use glam::{DQuat, DVec3, Vec2, Vec3, dvec3};

use crate::support::{
    assert_contains,
    folder::Folder,
    tensor::{Field, brushed, direction, encode, floats, isotropic, measured},
};

/// Reads the interpolation of a file.
fn read(fields: &[Field]) -> AdaptiveBrdf {
    let folder = Folder::new();
    AdaptiveBrdf::read(&folder.write("a.bsdf", encode(fields))).unwrap()
}

/// Message that refuses a file of these bytes.
#[track_caller]
fn message(bytes: &[u8]) -> String {
    let folder = Folder::new();
    let path = folder.write("a.bsdf", bytes);
    let message = MeasuredTable::load(&path).unwrap_err().to_string();
    assert!(message.contains("a.bsdf"), "{message}");
    message
}

/// Pairs of directions: θ_i, φ_i, θ_o and φ_o in degrees.
const PAIRS: [[f64; 4]; 6] = [
    [10.0, 20.0, 12.0, -165.0],
    [30.0, 40.0, 45.0, -120.0],
    [60.0, -100.0, 50.0, 70.0],
    [45.0, 170.0, 20.0, 30.0],
    [80.0, 85.0, 75.0, -100.0],
    [5.0, -30.0, 80.0, -20.0],
];

fn pair([theta_i, phi_i, theta_o, phi_o]: [f64; 4]) -> [DVec3; 2] {
    [[theta_i, phi_i], [theta_o, phi_o]]
        .map(|angles| direction(angles[0].to_radians(), angles[1].to_radians()))
}

/// `bsdf.eval` of Mitsuba 3.9.1's `measured` on the files of [`isotropic`] at 0.4 and of [`brushed`],
/// computed with its variant `scalar_rgb`.
const OF_MITSUBA: [[[f64; 3]; 6]; 2] = [
    [
        [0.3318899, 0.2626508, 0.1934117],
        [0.2596095, 0.2031535, 0.1466974],
        [0.4305749, 0.3145314, 0.198488],
        [0.2255412, 0.1902157, 0.1548902],
        [0.5616963, 0.3859247, 0.210153],
        [0.01955326, 0.02026836, 0.02098346],
    ],
    [
        [0.2977894, 0.2399455, 0.1821016],
        [0.2725046, 0.2117009, 0.1508972],
        [0.3415653, 0.2551592, 0.1687531],
        [0.1726535, 0.1550724, 0.1374914],
        [0.2847834, 0.2011948, 0.1176063],
        [0.01131072, 0.01473145, 0.01815217],
    ],
];

#[test]
fn values_are_those_of_mitsuba_and_near_the_surface_itself() {
    for ((ggx, fields), expected) in [isotropic(0.4), brushed()].into_iter().zip(OF_MITSUBA) {
        let brdf = read(&fields);
        for (angles, expected) in PAIRS.into_iter().zip(expected) {
            let [wi, wo] = pair(angles);
            let found = brdf.reflected(wi, wo);
            let error = (found / DVec3::from(expected) - 1.0).abs().max_element();
            assert!(error < 1e-4, "{angles:?}: {found}, expected {expected:?}");
            let error = (found / ggx.reflected(wi, wo) - 1.0).abs().max_element();
            assert!(error < 0.1, "{angles:?}: {found}, the surface {}", ggx.reflected(wi, wo));
        }
        let [wi, wo] = pair(PAIRS[0]);
        assert_eq!(brdf.reflected(-wi, wo) + brdf.reflected(wi, -wo), DVec3::ZERO);
    }
}

/// Fails unless the table holds the measurement: in total within 0.5%, each pair within `most`, and turned
/// about the normal within half a degree.
fn assert_holds(table: &MeasuredTable, brdf: &AdaptiveBrdf, most: f64) {
    let (mut in_table, mut in_file) = (DVec3::ZERO, DVec3::ZERO);
    let mut turn = [0.0; 2];
    for index in 0..4000 {
        let part = |step: f64| (f64::from(index) * step).fract();
        let above = |u: f64, v: f64| direction(u * 1.4, v * TAU);
        let wi = above(part(0.819_172_5), part(0.671_043_6));
        let wo = above(part(0.549_700_5), part(0.350_284_7));
        let (out, into) = (wi.as_vec3(), wo.as_vec3());
        let mut found = table.evaluate(out, into).as_dvec3();
        if table.has_turns() {
            let angles = half_difference_angles(out, into);
            found *= measured_turn(table.words(), 0, angles, out + into, Vec2::X).as_dvec3();
        }
        let turned = |degrees: f64| {
            let turn = DQuat::from_rotation_z(degrees.to_radians());
            let (wi, wo) = (turn * wi, turn * wo);
            (brdf.reflected(wi, wo) + brdf.reflected(wo, wi)) / (wi.z + wo.z)
        };
        let expected = turned(0.0);
        if table.has_turns() {
            let slope = 0.5 * (turned(1.0) - turned(-1.0)) / expected;
            turn[0] += (found / expected - 1.0).dot(slope);
            turn[1] += slope.length_squared();
        }
        let error = (found / expected - 1.0).abs().max_element();
        assert!(error < most, "{wi}, {wo}: {found}, expected {expected}");
        in_table += found * wi.z * wo.z;
        in_file += expected * wi.z * wo.z;
    }
    let error = (in_table / in_file - 1.0).abs().max_element();
    assert!(error < 0.005, "{in_table}, expected {in_file}");
    let degrees = turn[0] / turn[1].max(f64::MIN_POSITIVE);
    assert!(degrees.abs() < 0.5, "turned by {degrees} degrees");
}

/// A brushed surface turns with its tangent, and without a turn is the mean over all. Its two ends differ, by
/// a factor that depends on one direction alone: toward the horizon few bins hold the mean of both.
#[test]
fn an_anisotropic_file_holds_in_every_turn() {
    let (ggx, _) = brushed();
    let azimuths: Vec<f64> = (0..25).map(|index| TAU * f64::from(index) / 24.0 - PI).collect();
    let mut lopsided = measured(ggx, &azimuths, None, |color| color.to_array().to_vec());
    for field in lopsided.iter_mut().filter(|field| field.0 == "rgb") {
        let slice = field.3.len() / azimuths.len();
        for (values, azimuth) in field.3.chunks_exact_mut(slice).zip(&azimuths) {
            for bytes in values.as_chunks_mut().0 {
                let value = f32::from_le_bytes(*bytes) * (1.0 + 0.2 * azimuth.cos() as f32);
                *bytes = value.to_le_bytes();
            }
        }
    }
    let folder = Folder::new();
    let path = folder.write("a.bsdf", encode(&lopsided));
    let (table, brdf) = (MeasuredTable::load(&path).unwrap(), AdaptiveBrdf::read(&path).unwrap());
    assert_eq!(table.warnings, [""; 0]);
    assert_holds(&table, &brdf, 0.25);
    for [theta_i, _, theta_o, phi] in PAIRS {
        let pair = |turn: f64| pair([theta_i, turn, theta_o, phi + turn]).map(|d| d.as_vec3());
        let value = |degree: i32| {
            let [out, into] = pair(f64::from(degree));
            brdf.value(out, into)
        };
        let mean = (0..360).map(value).sum::<Vec3>() / 360.0;
        let [out, into] = pair(77.0);
        let found = table.evaluate(out, into);
        let error = (found / mean - 1.0).abs().max_element();
        assert!(error < 0.02, "{theta_i}, {theta_o}: {found}, expected {mean}");
    }
}

/// Grey spectra are grey, those of one wavelength are beyond Rec.709, and a file may hold f·cosθ_o itself.
#[test]
fn spectra_become_colours() {
    let (ggx, fields) = isotropic(0.4);
    let nm: Vec<f64> = (0..65).map(|index| 360.0 + 10.0 * f64::from(index)).collect();
    let [wi, wo] = pair(PAIRS[1]);
    let grey = read(&measured(ggx, &[0.0], Some(&nm), |color| vec![color.x; 65]));
    let red = read(&fields).reflected(wi, wo).x;
    let found = grey.reflected(wi, wo);
    assert!((found / red - 1.0).abs().max_element() < 2e-3, "{found}, expected {red}");

    let green: Vec<f64> = nm.iter().map(|nm| f64::from(*nm == 520.0)).collect();
    let spectrum = |color: DVec3| green.iter().map(|share| share * color.y).collect();
    let saturated = read(&measured(ggx, &[0.0], Some(&nm), spectrum));
    assert!(saturated.warnings()[0].contains("beyond Rec.709"), "{:?}", saturated.warnings());
    assert_eq!(saturated.traits, RglTraits { is_spectral: true });
    let found = saturated.reflected(wi, wo);
    assert!(found.x == 0.0 && found.y > 0.0 && found.z >= 0.0, "{found}");

    let mut flat = replaced(&fields, ("jacobian", 1, vec![1], vec![0]));
    flat.retain(|field| !["ndf", "sigma", "rgb"].contains(&field.0));
    flat.push(floats("ndf", &[2, 2], &[0.0; 4]));
    flat.push(floats("sigma", &[2, 2], &[0.0; 4]));
    flat.push(floats("rgb", &[1, 12, 3, 2, 2], &[0.25; 144]));
    assert_eq!(read(&flat).reflected(wi, wo), DVec3::splat(0.25));
}

/// The fields with one in place of that of its name.
fn replaced(fields: &[Field], field: Field) -> Vec<Field> {
    let mut fields = fields.to_vec();
    fields.retain(|other| other.0 != field.0);
    fields.push(field);
    fields
}

#[test]
fn a_quarter_turn_is_mirrored() {
    let (ggx, _) = brushed();
    let azimuths = |last: f64| -> Vec<f64> {
        (0..13).map(|index| -PI + (last + PI) * f64::from(index) / 12.0).collect()
    };
    let rgb = |color: DVec3| color.to_array().to_vec();
    let quarter = measured(ggx, &azimuths(-FRAC_PI_2), None, rgb);
    let brdf = read(&quarter);
    for angles in PAIRS {
        let [wi, wo] = pair(angles);
        let value = brdf.reflected(wi, wo);
        for signs in [dvec3(-1.0, 1.0, 1.0), dvec3(1.0, -1.0, 1.0), dvec3(-1.0, -1.0, 1.0)] {
            let mirrored = brdf.reflected(signs * wi, signs * wo);
            assert!((mirrored / value - 1.0).abs().max_element() < 1e-9, "{mirrored}, {value}");
        }
        let error = (value / ggx.reflected(wi, wo) - 1.0).abs().max_element();
        assert!(error < 0.1, "{angles:?}: {value}, the surface {}", ggx.reflected(wi, wo));
    }
    let third = azimuths(-PI / 3.0);
    let refused = message(&encode(&replaced(&quarter, floats("phi_i", &[13], &third))));
    assert!(refused.contains("quarter turn, found 120.0°"), "{refused}");
}

/// Mitsuba's `measured` is read into the table and goes back with the same bytes; one file is loaded once,
/// and its first bytes tell the format.
#[test]
fn mitsuba_scenes_keep_their_measurements() {
    let (_, fields) = isotropic(0.2);
    let bytes = encode(&fields);
    let folder = Folder::new();
    folder.write("maps/gold leaf.tensor", &bytes);
    let model = r#"<bsdf type="measured">
        <string name="filename" value="maps/gold leaf.tensor"/></bsdf>"#;
    let xml = format!(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><emitter type=\"constant\"/>\
         <shape type=\"sphere\">{model}</shape>\
         <shape type=\"cube\"><bsdf type=\"twosided\">{model}</bsdf></shape></scene>"
    );
    let scene = Scene::load(&folder.write("a.xml", xml)).unwrap();
    let tables: Vec<&MeasuredTable> = scene
        .materials
        .iter()
        .filter_map(|material| match &material.kind {
            MaterialKind::Measured { table, .. } => Some(&**table),
            _ => None,
        })
        .collect();
    assert!(tables.len() == 2 && std::ptr::eq(tables[0], tables[1]));
    assert_eq!(tables[0].warnings, [""; 0]);
    assert_eq!(tables[0].rgl, Some(RglTraits { is_spectral: false }));
    assert_holds(tables[0], &read(&fields), 0.03);
    assert!(!scene.materials[0].surface.two_sided && scene.materials[1].surface.two_sided);
    assert!(scene.inputs.iter().any(|input| input.ends_with("gold leaf.tensor")));
    let path = folder.path().join("out.xml");
    let exported = export(&scene, &path, Settings { depth: 1, samples: 4 });
    assert!(!exported.warnings.join("\n").contains("measured"), "{:?}", exported.warnings);
    exported.write().unwrap();
    let xml = fs::read_to_string(&path).unwrap();
    let name = "name=\"filename\" value=\"out/f00_gold_leaf.bsdf\"";
    assert_eq!(xml.matches("type=\"measured\"").count(), 2, "{xml}");
    assert_eq!(xml.matches(name).count(), 2, "{xml}");
    assert!(fs::read(folder.path().join("out/f00_gold_leaf.bsdf")).unwrap() == bytes);
}

/// pbrt's `measured` is the same table, read once and shown on both sides.
#[test]
fn pbrt_scenes_keep_their_measurements() {
    let (_, fields) = isotropic(0.2);
    let folder = Folder::new();
    folder.write("maps/gold.bsdf", encode(&fields));
    let material = r#"Material "measured" "string filename" "maps/gold.bsdf" Shape "sphere""#;
    let text = format!("Camera \"perspective\" WorldBegin {material} {material}");
    let scene = Scene::load(&folder.write("a.pbrt", text)).unwrap();
    let [first, second] = [0, 1].map(|index| match &scene.materials[index].kind {
        MaterialKind::Measured { table, .. } => table,
        other => panic!("{other:?}"),
    });
    assert!(Arc::ptr_eq(first, second) && scene.materials[0].surface.two_sided);
    assert_holds(first, &read(&fields), 0.03);
    assert_eq!(scene.inputs.iter().filter(|input| input.ends_with("gold.bsdf")).count(), 1);
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
}

#[test]
fn bad_files_end_in_one_message() {
    let (_, fields) = isotropic(0.4);
    let bytes = encode(&fields);
    let contains = |message: String, parts: &[&str]| assert_contains(&message, parts);
    contains(message(b"Zemax"), &["expected a tensor file", "tensor_file"]);
    contains(message(b"tensor_file\0\x02\0\0\0\0\0"), &["version 1", "found 2.0"]);
    contains(message(b"tensor_file\0\x01\0\0\0\0\0"), &["`theta_i`", "found none"]);
    for length in (12..400).chain([bytes.len() - 1]) {
        contains(message(&bytes[..length]), &["truncated"]);
    }
    for name in ["theta_i", "phi_i", "ndf", "sigma", "vndf", "rgb", "jacobian"] {
        let mut fields = fields.clone();
        fields.retain(|field| field.0 != name);
        let name = if name == "rgb" { "spectra" } else { name };
        contains(
            message(&encode(&fields)),
            &[&format!("expected the field `{name}`"), "description"],
        );
    }
    let with = |field: Field| message(&encode(&replaced(&fields, field)));
    let huge = vec![1 << 40, 1 << 40];
    contains(with(("ndf", 10, huge, Vec::new())), &["`ndf`", "larger than any file"]);
    contains(with(("ndf", 10, vec![1 << 30], Vec::new())), &["`ndf`", "truncated or damaged"]);
    contains(with(("ndf", 1, vec![2, 2], vec![1; 4])), &["`ndf`", "32-bit floats", "type 1"]);
    contains(with(floats("ndf", &[4], &[1.0; 4])), &["`ndf`", "2 dimensions", "[4]"]);
    contains(with(floats("ndf", &[1, 4], &[1.0; 4])), &["`ndf`", "2 × 2 or more, found 4 × 1"]);
    contains(
        with(floats("ndf", &[2, 2], &[1.0, f64::NAN, 1.0, 1.0])),
        &["`ndf`", "NaN at index 1"],
    );
    contains(with(floats("sigma", &[2, 2], &[1.0, 1.0, -2.0, 1.0])), &["`sigma`", "found -2"]);
    contains(with(floats("theta_i", &[0], &[])), &["`theta_i`", "empty"]);
    contains(with(floats("theta_i", &[2], &[1.0, 1.0])), &["`theta_i`", "rising", "1 after 1"]);
    contains(with(floats("theta_i", &[2], &[0.0, 1.0])), &["`vndf`", "1 × 2", "found 1 × 12"]);
    let dark = floats("vndf", &[1, 12, 2, 2], &[0.0; 48]);
    contains(with(dark), &["`vndf`", "above 0"]);
    let two = floats("rgb", &[1, 12, 2, 2, 2], &[0.0; 96]);
    contains(with(two), &["`rgb`", "expected 3 colours", "found 2"]);
    contains(with(("jacobian", 1, vec![2], vec![1, 1])), &["`jacobian`", "one byte"]);
    let mut spectral = replaced(&fields, floats("wavelengths", &[3], &[1e4, 2e4, 3e4]));
    spectral.iter_mut().filter(|field| field.0 == "rgb").for_each(|field| field.0 = "spectra");
    contains(message(&encode(&spectral)), &["`wavelengths`", "visible"]);
}
