//! Mitsuba files as people write them, beyond what its own exporters do: text that only a lenient reader
//! takes, and elements in places and of kinds that files of papers have.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests may panic")]

use std::collections::HashSet;

use fenestra_scene::{
    Scene,
    material::{ConductorFresnel, MaterialKind},
};
use glam::{DVec3, Vec3};

use crate::support::folder::Folder;

/// Sensor and light of a scene of version 3 with `content`.
fn document(content: &str) -> String {
    format!(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><emitter type=\"constant\"/>\n\
         {content}</scene>"
    )
}

#[track_caller]
fn load(content: &str) -> Scene {
    let folder = Folder::new();
    Scene::load(&folder.write("a.xml", document(content))).unwrap()
}

#[test]
fn text_that_mitsuba_takes_is_taken() {
    let folder = Folder::new();
    let text = document(
        "<!---- Wände -- and\nmore ------>\n<bsdf type=\"diffuse\" id=\"salt & pepper\"/>\
         <shape type=\"Rectangle\"><ref id=\"salt &amp; pepper\"/>\
         <boolean name=\"flip_normals\" value=\"TRUE\"/></shape>\
         <shape type=\"sphere\"><float name=\"radius\" value=\"2f\"/>\n<fog/></shape>",
    );
    let kind = "<!DOCTYPE scene SYSTEM \"scene.dtd\">";
    let text = format!("\n<?xml version=\"1.0\" encoding=\"latin1\"?>{kind}\n{text}");
    let latin_1: Vec<u8> = text.chars().map(|c| c as u32 as u8).collect();
    let scene = Scene::load(&folder.write("a.xml", latin_1)).unwrap();
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    assert!(scene.warnings[0].contains("`fog` in `sphere` (line 7)"), "{:?}", scene.warnings);
    let radius = scene.geometry.positions.iter().map(|&position| Vec3::from(position).length());
    assert_eq!(radius.fold(0.0, f32::max), 2.0);
    assert_eq!(scene.geometry.triangles[0].map(|corner| corner < 4), [true; 3]);
    for unfinished in ["<!-- no end", "<? no end", "<shape type=\"a & b\""] {
        assert!(Scene::load(&folder.write("a.xml", document(unfinished))).is_err());
    }
}

#[test]
fn elements_are_read_where_papers_have_them() {
    let folder = Folder::new();
    image::save_buffer(folder.path().join("a.png"), &[255, 0, 0], 1, 1, image::ColorType::Rgb8)
        .unwrap();
    let text = r#"<scene version="2.0.0">
        <integrator type="guided"><integer name="max_depth" value="15"/></integrator>
        <film type="hdrfilm" id="film"><integer name="width" value="40"/></film>
        <sensor type="orthographic"/><sensor type="perspective"><ref id="film"/></sensor>
        <emitter type="envmap"><string name="filename" value="absent.hdr"/></emitter>
        <emitter type="constant"/>
        <shape type="merge"><shape type="rectangle"><bsdf type="diffuse">
          <spectrum type="bitmap" name="reflectance"><string name="filename" value="a.png"/></spectrum>
        </bsdf></shape><shape type="rectangle"><bsdf type="roughdiffuse">
          <float name="reflectance" value="0.3"/></bsdf></shape></shape></scene>"#;
    let scene = Scene::load(&folder.write("a.xml", text)).unwrap();
    assert_eq!((scene.asked.depth, scene.film.width), (Some(14), 40));
    assert_eq!(scene.geometry.triangles.len(), 4);
    assert!(scene.materials[0].surface.color.is_some());
    let MaterialKind::Diffuse { reflectance } = scene.materials[1].kind else { panic!() };
    assert_eq!(reflectance, Vec3::splat(0.3));
    let [unknown, absent, unused] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(unknown.contains("integrator `guided` (line 2)"), "{unknown}");
    assert!(absent.contains("`absent.hdr`, which is not there (line 5)"), "{absent}");
    assert!(unused.contains("sensors that are not used (line 4)"), "{unused}");
}

/// All of the film is seen at the depth of the sensor, from so far that depth counts little.
#[test]
fn orthographic_sensors_see_from_afar_and_others_find_a_view() {
    let sensor = |kind: &str| {
        let text = format!(
            "<scene version=\"3.0.0\"><sensor type=\"{kind}\"><transform name=\"to_world\">\
             <scale value=\"3\"/><lookat origin=\"0,0,5\" target=\"0,0,0\" up=\"0,1,0\"/></transform>\
             <film type=\"hdrfilm\"><integer name=\"width\" value=\"40\"/><integer name=\"height\" \
             value=\"20\"/></film></sensor><emitter type=\"constant\"/><shape type=\"cube\"/></scene>"
        );
        let folder = Folder::new();
        Scene::load(&folder.write("a.xml", text)).unwrap()
    };
    let flat = sensor("orthographic");
    let far = flat.camera.position.z - 5.0;
    let half = (0.5 * flat.camera.vertical_fov_deg).to_radians().tan() * far;
    assert!(far > 100.0 && (half - 1.5).abs() < 1e-3, "{far} {half}");
    let [warning] = &flat.warnings[..] else { panic!("{:?}", flat.warnings) };
    assert!(warning.contains("ignored sensor `orthographic` (line 1)"), "{warning}");
    let other = sensor("radiancemeter");
    assert_eq!((other.film.width, other.film.height), (40, 20));
    let [sensor, view] = &other.warnings[..] else { panic!("{:?}", other.warnings) };
    assert!(sensor.contains("ignored sensor `radiancemeter`"), "{sensor}");
    assert!(view.contains("one that frames the bounding box"), "{view}");
}

/// Mitsuba 3.9.1 takes 0 for an `eta` and 1 for a `k` that a file leaves out.
#[test]
fn a_metal_may_state_half_of_its_index() {
    let metal = |half: &str| {
        let text =
            format!("<shape type=\"rectangle\"><bsdf type=\"conductor\">{half}</bsdf></shape>");
        match load(&text).materials[0].kind {
            MaterialKind::Conductor { fresnel: ConductorFresnel::Exact { eta, k, .. }, .. } => {
                [eta, k]
            }
            ref other => panic!("{other:?}"),
        }
    };
    assert_eq!(metal("<float name=\"eta\" value=\"2\"/>"), [Vec3::splat(2.0), Vec3::ONE]);
    assert_eq!(metal("<float name=\"k\" value=\"2\"/>"), [Vec3::splat(0.01), Vec3::splat(2.0)]);
}

#[test]
fn what_moves_stands_in_its_first_pose() {
    let scene = load(
        "<shape type=\"rectangle\"><animation name=\"toWorld\"><transform time=\"0\">\
         <translate x=\"3\"/></transform><transform time=\"1\"><translate x=\"5\"/></transform>\
         </animation></shape>",
    );
    assert_eq!(Vec3::from(scene.geometry.positions[0]), Vec3::new(2.0, -1.0, 0.0));
    let expected = "motion of `rectangle` after its first pose (line 2)";
    assert!(scene.warnings[0].contains(expected), "{:?}", scene.warnings);
}

/// Pictures of point clouds are files of a ball for each point, often of a colour of its own.
#[test]
fn thousands_of_balls_are_copies_of_one() {
    let ball = |index: usize| {
        format!(
            "<shape type=\"sphere\"><float name=\"radius\" value=\"0.5\"/><point name=\"center\" y=\"1\"/>\
             <transform name=\"to_world\"><translate x=\"{index}\"/></transform>\
             <boolean name=\"flip_normals\" value=\"{}\"/>\
             <bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"{}\"/></bsdf></shape>",
            index.is_multiple_of(2),
            index as f32 / 4000.0
        )
    };
    let geometry = load(&(0..4000).map(ball).collect::<String>()).geometry;
    assert_eq!(geometry.triangle_count(), 4000 * 16_128);
    assert!(geometry.triangles.len() <= 1 << 20 && geometry.prototypes.len() == 2);
    let last = geometry.instances.last().unwrap();
    assert_eq!(last.affine().transform_point3(DVec3::X), DVec3::new(3999.5, 1.0, 0.0));
    let colors: HashSet<_> = geometry.instances.iter().map(|ball| ball.first_material).collect();
    assert_eq!(colors.len(), geometry.instances.len());
}
