//! Mitsuba scene files: what each element becomes, what is named, and what is refused.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    f32::consts::{FRAC_PI_2, PI},
    io::Write,
    path::Path,
};

use fenestra_scene::{
    Asked, Filter, Scene,
    export::{Settings, mitsuba::export},
    lamp::{LampKind, SpotFalloff},
    load::LoadOptions,
    material::{
        Anisotropy, ConductorFresnel, Distribution, Material, MaterialKind, Principled, Surface,
    },
    texture::{Encoding, Interpolation, Wrap},
};
use glam::{Vec2, Vec3};

use crate::support::{
    assert_each_counts,
    folder::{BALL, Folder, yard},
};

/// Sensor of 40 × 20 pixels that looks from (0, 0, 5) to the origin.
const SENSOR: &str = r#"<sensor type="perspective"><float name="fov" value="60"/>
    <transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="40"/><integer name="height" value="20"/></film>
    </sensor>"#;

/// Width of 0.3 everywhere.
const EVEN: &str = r#"<texture name="alpha" type="checkerboard"><float name="color0" value="0.3"/>
    <float name="color1" value="0.3"/></texture>"#;

/// Direction of the sun of Mitsuba's `sunsky` without parameters, with +Y up.
const DEFAULT_SUN: Vec3 = Vec3::new(0.051_378_17, 0.720_300_1, -0.691_757_2);

/// Mesh of one triangle.
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
    property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

fn document(content: &str) -> String {
    format!("<scene version=\"3.0.0\">\n{content}\n</scene>")
}

/// Loads a file, whose scene may be dark.
#[track_caller]
fn loaded(path: &Path) -> Scene {
    loaded_with(path, LoadOptions::default()).unwrap()
}

/// As [`loaded`], with options of the command line.
fn loaded_with(path: &Path, options: LoadOptions) -> fenestra_scene::Result<Scene> {
    let mut scene = Scene::load_with(path, &options)?;
    scene.warnings.retain(|warning| !warning.ends_with("no light: nothing is lit"));
    Ok(scene)
}

/// Loads a file of a sensor and `content`.
#[track_caller]
fn load(content: &str) -> Scene {
    let folder = Folder::new();
    let path = folder.write("a.xml", document(&format!("{SENSOR}{content}")));
    loaded(&path)
}

/// Message of the error of a file of a sensor and `content`.
#[track_caller]
fn refusal(content: &str) -> String {
    let folder = Folder::new();
    let path = folder.write("a.xml", document(&format!("{SENSOR}\n{content}")));
    Scene::load(&path).expect_err("the file is refused").to_string()
}

/// Material of a rectangle with the model `bsdf`.
#[track_caller]
fn material(bsdf: &str) -> (Material, Vec<String>) {
    let scene = load(&format!("<shape type=\"rectangle\">{bsdf}</shape>"));
    (scene.materials[0].clone(), scene.warnings)
}

#[track_caller]
fn assert_close(found: Vec3, expected: Vec3) {
    let within = 1e-5 * expected.abs().max_element().max(1.0);
    assert!(found.abs_diff_eq(expected, within), "{found}, expected {expected}");
}

/// Position of the first vertex of a rectangle with a transform; its own is (−1, −1, 0).
#[track_caller]
fn first_vertex(transform: &str) -> Vec3 {
    let text = format!(
        "<shape type=\"rectangle\"><transform name=\"toWorld\">{transform}</transform></shape>"
    );
    load(&text).geometry.positions[0].into()
}

#[test]
fn transforms_are_those_of_mitsuba() {
    let found = first_vertex(
        r#"<rotate x="0.6" z="0.8" angle="40"/><translate x="1"/><scale value="2"/>
        <rotate value="0,1,0" angle="90"/>"#,
    );
    // Matrix of Mitsuba 3.9.1 for these elements.
    let x = Vec3::new(0.224597, 1.02846, -1.70054);
    let y = Vec3::new(0.771345, 1.53209, 1.02846);
    assert_close(found, -x - y + Vec3::new(0.0, 0.0, -2.0));
    // Exporters write rotations by nothing.
    assert_close(first_vertex(r#"<rotate angle="0"/>"#), Vec3::new(-1.0, -1.0, 0.0));
    // Deviation: an axis of any length turns as one of length 1; Mitsuba 3.9.1 distorts.
    let long = first_vertex(r#"<rotate x="6" z="8" angle="40"/>"#);
    assert_close(long, first_vertex(r#"<rotate x="0.6" z="0.8" angle="40"/>"#));
    let found = first_vertex(r#"<lookat origin="1,2,3" target="2,5,-1" up="0.1 1 0"/>"#);
    let x = Vec3::new(-0.980286, 0.0980286, -0.17155);
    let y = Vec3::new(-0.0240312, 0.802643, 0.595975);
    assert_close(found, -x - y + Vec3::new(1.0, 2.0, 3.0));
    let found = first_vertex(r#"<lookat origin="0,0,0" target="0,0,-1"/>"#);
    assert_close(found, Vec3::new(-1.0, -1.0, 0.0));
    let matrix = "1 2 3e0 0 0 1 5 1e-1 0 0 2 0 0 0 0 1";
    let found = first_vertex(&format!("<matrix value=\"{matrix}\"/>"));
    assert_close(found, Vec3::new(-3.0, -0.9, 0.0));
    assert_close(
        first_vertex("<matrix value=\"1 2 3 0 1 5 0.1 0 2\"/>"),
        Vec3::new(-3.0, -1.0, -0.1),
    );
    for (transform, expected) in [
        ("<matrix value=\"1 2\"/>", "expected 16 or 9 numbers, found 2"),
        ("<rotate angle=\"3\"/>", "expected an axis"),
        ("<rotate x=\"1\"/>", "expected the attribute `angle`"),
        ("<scale x=\"0\"/>", "expected a matrix with an inverse"),
        ("<scale x=\"big\"/>", "expected a finite number, found `big`"),
        ("<scale value=\"1e300\"/>", "expected a finite number"),
        ("<turn x=\"1\"/>", "found `turn`"),
        ("<lookat origin=\"0,0,0\" target=\"0,0,0\"/>", "must differ"),
    ] {
        let text = format!("<transform name=\"to_world\">{transform}</transform>");
        let message = refusal(&format!("<shape type=\"rectangle\">{text}</shape>"));
        assert!(message.contains(expected) && message.contains("a.xml:6:"), "{message}");
    }
}

/// Camera of a sensor's parameters on a film of 200 × 100 pixels or of `film`.
#[track_caller]
fn camera(parameters: &str, film: &str) -> Scene {
    let folder = Folder::new();
    let film = if film.is_empty() {
        "<integer name=\"width\" value=\"200\"/><integer name=\"height\" value=\"100\"/>"
    } else {
        film
    };
    let text = format!(
        r#"<sensor type="perspective">{parameters}<film type="hdrfilm">{film}</film></sensor>"#
    );
    loaded(&folder.write("a.xml", document(&text)))
}

#[test]
fn fields_of_view_are_those_of_mitsuba() {
    // Half height of the picture at a distance of 1, from rays of Mitsuba 3.9.1.
    for (axis, tangent) in [
        ("x", 0.2774 / 0.9608),
        ("y", 0.5 / 0.866),
        ("diagonal", 0.25 / 0.9682),
        ("smaller", 0.5 / 0.866),
        ("larger", 0.2774 / 0.9608),
    ] {
        let text = format!(
            "<float name=\"fov\" value=\"60\"/><string name=\"fov_axis\" value=\"{axis}\"/>"
        );
        let found = (0.5 * camera(&text, "").camera.vertical_fov_deg).to_radians().tan();
        assert!((found - tangent).abs() < 3e-4, "{axis}: {found}, expected {tangent}");
    }
    for text in ["<string name=\"focalLength\" value=\"50mm\"/>", ""] {
        let found = (0.5 * camera(text, "").camera.vertical_fov_deg).to_radians().tan();
        assert!((found - 0.19 / 0.9818).abs() < 3e-4, "{found}");
    }
}

#[test]
fn cameras_look_along_z_and_stand_upright() {
    let scene = load("");
    let camera = scene.camera;
    assert_eq!(camera.position, Vec3::new(0.0, 0.0, 5.0));
    assert_close((camera.look_at - camera.position).normalize(), Vec3::NEG_Z);
    assert_close(camera.up, Vec3::Y);
    assert_eq!((scene.film.width, scene.film.height), (40, 20));
    assert_eq!(scene.film.filter, Filter::Gaussian);
    assert_eq!(scene.warnings, [""; 0]);
    assert_eq!(scene.environment.texels[0], Vec3::ZERO, "no light but that of the file");
    let mirrored = self::camera(
        r#"<transform name="to_world"><scale x="-1"/></transform>"#,
        r#"<rfilter type="tent"/>"#,
    );
    assert_eq!((mirrored.film.width, mirrored.film.height), (768, 576));
    assert_eq!(mirrored.warnings.len(), 1, "{:?}", mirrored.warnings);
    assert!(mirrored.warnings[0].contains("rfilter `tent`"), "{:?}", mirrored.warnings);
    assert!(mirrored.camera.mirrored && !camera.mirrored);
}

#[test]
fn crops_and_principal_points_shift_the_lens() {
    // Middle, upper edge and right edge of the picture at a distance of 1, from rays of Mitsuba 3.9.1.
    for (offset, crop, middle, top, right) in [
        ([-0.1, 0.0], None, [-0.4, 0.0], 1.0, 1.6),
        ([0.0, -0.1], None, [0.0, 0.2], 1.2, 2.0),
        ([0.0, 0.0], Some([60, 40, 100, 10]), [0.6, 0.4], 0.8, 1.2),
        ([0.1, 0.2], Some([60, 40, 100, 10]), [1.0, 0.0], 0.4, 1.6),
    ] {
        let integer =
            |(name, pixels): (&str, u32)| format!("<integer name=\"{name}\" value=\"{pixels}\"/>");
        let names = ["crop_width", "crop_height", "cropOffsetX", "crop_offset_y"];
        let crop = crop
            .map_or_else(String::new, |crop| names.into_iter().zip(crop).map(integer).collect());
        let film = integer(("width", 200)) + &integer(("height", 100)) + &crop;
        let number = |name: &str, value: f32| format!("<float name=\"{name}\" value=\"{value}\"/>");
        // Along x the same angle is that of the whole film, which is twice as wide as high.
        let (axis, tangent) = if offset[1] == 0.0 { ("x", 0.5) } else { ("y", 1.0) };
        let sensor = number("fov", 90.0)
            + &format!("<string name=\"fov_axis\" value=\"{axis}\"/>")
            + &number("principal_point_offset_x", offset[0])
            + &number("principal_point_offset_y", offset[1]);
        let scene = camera(&sensor, &film);
        assert_eq!(scene.warnings, [""; 0]);
        let half = (0.5 * scene.camera.vertical_fov_deg).to_radians().tan();
        let shift = scene.camera.shift.map(|heights| 2.0 * heights * half);
        let aspect = scene.film.width as f32 / scene.film.height as f32;
        let found = [shift[0], shift[1], shift[1] + half, shift[0] + half * aspect];
        for (found, expected) in found.into_iter().zip([middle[0], middle[1], top, right]) {
            assert!(
                (found - tangent * expected).abs() < 1e-5,
                "{offset:?}: {found}, not {expected}"
            );
        }
    }
}

#[test]
fn sensors_are_chosen_by_id_or_number() {
    let folder = Folder::new();
    let thin = r#"<sensor type="thinlens" id="close"><float name="apertureRadius" value="0.1"/>
        <float name="focus_distance" value="3"/><float name="near_clip" value="1"/></sensor>"#;
    let path = folder.write("a.xml", document(&format!("{SENSOR}{thin}")));
    let with = |name: &str| {
        loaded_with(&path, LoadOptions { camera: Some(name.into()), ..Default::default() })
    };
    assert_eq!(loaded(&path).camera.aperture_radius, 0.0);
    for name in ["close", "1"] {
        let scene = with(name).unwrap();
        assert_eq!((scene.camera.aperture_radius, scene.camera.focus_distance), (0.1, 3.0));
        assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
        assert!(scene.warnings[0].contains("sensors that are not used (line 2)"));
    }
    // A lens without a focus has it where the view ends.
    let far = thin.replace("focus_distance\" value=\"3", "far_clip\" value=\"50");
    let scene = loaded(&folder.write("b.xml", document(&far)));
    assert_eq!(scene.camera.focus_distance, 50.0);
    let message = with("far").unwrap_err().to_string();
    assert!(message.contains("--camera far") && message.contains("0, `close`"), "{message}");
}

#[test]
fn names_of_all_versions_and_defaults_are_read() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("parts")).unwrap();
    folder.write("parts/box.xml", document("<shape type=\"cube\"><ref id=\"$kind\"/></shape>"));
    let text = r#"<default name="red" value="0.5"/><default name="redder" value="0.75"/>
        <default name="red" value="0.1"/><default name="kind" value="paint"/>
        <bsdf type="roughplastic" id="coat"><string name="distribution" value="ggx"/>
          <rgb name="diffuseReflectance" value="$redder $red,0.25"/>
          <float name="intIOR" value="1.5"/><string name="extIOR" value="vacuum"/>
          <float name="alpha" value="0.2"/></bsdf>
        <alias id="coat" as="paint"/><include filename="parts/box.xml"/>"#;
    let path = folder.write("a.xml", document(&format!("{SENSOR}{text}")));
    let scene = loaded(&path);
    let MaterialKind::Plastic { diffuse, alpha, ior } = scene.materials[0].kind else { panic!() };
    assert_eq!((alpha, ior), (0.2, 1.5));
    assert_close(0.75 * diffuse / diffuse.x, Vec3::new(0.75, 0.5, 0.25));
    assert_eq!(scene.materials[0].name, "coat");
    assert!(!scene.materials[0].surface.two_sided);
    assert_eq!(scene.geometry.triangles.len(), 12);
    assert_eq!(scene.warnings, [""; 0]);
    assert_eq!(scene.inputs.len(), 2);
}

#[test]
fn models_become_materials() {
    let (paint, _) =
        material(r##"<bsdf type="diffuse"><srgb name="reflectance" value="#ff8000"/></bsdf>"##);
    let MaterialKind::Diffuse { reflectance } = paint.kind else { panic!() };
    assert_close(reflectance, Vec3::new(1.0, 0.2158605, 0.0));
    let sides = |text: &str| {
        let (sheet, warnings) = material(text);
        let MaterialKind::DiffuseTransmission { reflectance, transmittance } = sheet.kind else {
            panic!("{sheet:?}")
        };
        assert!(sheet.surface.two_sided);
        (reflectance, transmittance, warnings.len())
    };
    let rgb = r#"value="0.2,0.4,0.8"/>"#;
    let color = Vec3::new(0.2, 0.4, 0.8);
    let older = format!(r#"<bsdf type="difftrans"><rgb name="transmittance" {rgb}</bsdf>"#);
    assert_eq!(sides(&older), (Vec3::ZERO, color, 0));
    let thin = format!(
        r#"<bsdf type="principledthin"><rgb name="base_color" {rgb}
           <float name="diff_trans" value="1.5"/><float name="eta" value="1.3"/></bsdf>"#
    );
    assert_eq!(sides(&thin), (0.25 * color, 0.75 * color, 0));
    let clear = thin.replace("eta", "spec_trans");
    assert_eq!(sides(&clear), (0.25 * color, 0.75 * color, 1));
    let (copper, warnings) = material(
        r#"<bsdf type="twosided"><bsdf type="roughconductor"><string name="material" value="Cu"/>
        <float name="alphaU" value="0.1"/><float name="alphaV" value="0.3"/></bsdf></bsdf>"#,
    );
    let MaterialKind::Conductor { alpha, fresnel: ConductorFresnel::Exact { eta, k, .. } } =
        copper.kind
    else {
        panic!()
    };
    assert_eq!((alpha, copper.surface.two_sided), (0.1, true));
    let Anisotropy { strength, rotation, .. } = copper.surface.anisotropy;
    assert!((strength * strength - 0.2 / 0.9).abs() < 1e-6 && rotation == FRAC_PI_2);
    assert_eq!(eta, Vec3::new(0.104, 0.978, 1.204));
    assert_eq!(k, Vec3::new(2.828, 2.625, 2.357));
    let (sunk, _) = material(
        r#"<bsdf type="conductor"><string name="material" value="Cu"/>
        <float name="ext_eta" value="2"/></bsdf>"#,
    );
    let MaterialKind::Conductor { fresnel: ConductorFresnel::Exact { eta, k, .. }, .. } = sunk.kind
    else {
        panic!()
    };
    assert_eq!(eta, Vec3::new(0.052, 0.489, 0.602));
    assert_eq!(k, Vec3::new(1.414, 1.3125, 1.1785));
    let (wet, _) = material(
        r#"<bsdf type="conductor"><string name="material" value="Cu"/>
        <string name="ext_eta" value="water"/></bsdf>"#,
    );
    let MaterialKind::Conductor { fresnel: ConductorFresnel::Exact { eta, .. }, .. } = wet.kind
    else {
        panic!()
    };
    assert_close(1.333 * eta, Vec3::new(0.104, 0.978, 1.204));
    assert!(warnings.is_empty(), "{warnings:?}");
    let (dull, _) = material(
        r#"<bsdf type="conductor"><rgb name="eta" value="1"/><rgb name="k" value="2"/>
        <rgb name="specular_reflectance" value="0.5"/></bsdf>"#,
    );
    let MaterialKind::Conductor { fresnel, .. } = dull.kind else { panic!() };
    assert_close(fresnel.at_normal_incidence(), Vec3::splat(0.25));
    let expected = ConductorFresnel::Exact {
        reflectance: Vec3::splat(0.5),
        eta: Vec3::ONE,
        k: Vec3::splat(2.0),
    };
    assert_eq!(fresnel, expected);
    let (ideal, _) = material(
        r#"<bsdf type="roughconductor"><string name="material" value="none"/>
        <texture type="checkerboard" name="specular_reflectance"/></bsdf>"#,
    );
    let MaterialKind::Conductor { fresnel, .. } = ideal.kind else { panic!() };
    assert!(fresnel.at_normal_incidence().min_element() > 0.9995 && ideal.surface.color.is_some());
    let (mirror, _) =
        material(r#"<bsdf type="conductor"><string name="material" value="none"/></bsdf>"#);
    assert!(matches!(mirror.kind, MaterialKind::Mirror { reflectance: Vec3::ONE }));
    let (glass, _) = material(
        r#"<bsdf type="dielectric"><string name="int_ior" value="water"/>
        <string name="ext_ior" value="BK7"/></bsdf>"#,
    );
    let MaterialKind::Dielectric { ior, alpha, .. } = glass.kind else { panic!() };
    assert!((ior - 1.333 / 1.5046).abs() < 1e-6 && alpha == 0.0 && glass.surface.two_sided);
    let (stained, warnings) = material(
        r#"<bsdf type="thindielectric"><texture type="checkerboard" name="specular_transmittance">
        <rgb name="color0" value="0.2 0.4 0.6"/></texture></bsdf>"#,
    );
    let surface = stained.surface;
    assert!(surface.two_sided && surface.color.is_some() && warnings.is_empty(), "{warnings:?}");
    let (pane, _) = material(r#"<bsdf type="thindielectric"/>"#);
    let MaterialKind::ThinDielectric { ior, .. } = pane.kind else { panic!() };
    assert!((ior - 1.50418).abs() < 1e-5, "Mitsuba 3.9.1 says 1.50418: {ior}");
    // The weight is that of the second.
    let (diffuse, null) = (r#"<bsdf type="diffuse"/>"#, r#"<bsdf type="null"/>"#);
    for (models, opacity) in [([diffuse, null], 0.75), ([null, diffuse], 0.25)] {
        let weight = r#"<float name="weight" value="0.25"/>"#;
        let text = format!("<bsdf type=\"blendbsdf\">{weight}{}</bsdf>", models.concat());
        let (gone, warnings) = material(&text);
        assert_eq!((gone.surface.opacity.factor, warnings.len()), (opacity, 0));
    }
    let (nothing, _) = material(r#"<bsdf type="null"/>"#);
    assert_eq!(nothing.surface.opacity.factor, 0.0);
    let (mixed, warnings) = material(
        r#"<bsdf type="blendbsdf"><float name="weight" value="0.75"/><bsdf type="diffuse"/>
        <bsdf type="dielectric"/></bsdf>"#,
    );
    assert!(matches!(mixed.kind, MaterialKind::Dielectric { .. }));
    assert!(warnings[0].contains("lesser part of `blendbsdf`"), "{warnings:?}");
    let (cut, _) = material(
        r#"<bsdf type="mask"><float name="opacity" value="0.25"/><bsdf type="mask"><texture name="opacity"
        type="checkerboard"/><bsdf type="diffuse"/></bsdf></bsdf>"#,
    );
    assert_eq!(cut.surface.opacity.factor, 0.25);
    assert!(cut.surface.opacity.texture.is_some());
    // Half 0.8, a quarter 0.4, and a quarter of all light; half 0.8, and half 0.82 of which half is metal.
    let three = r#"<bsdf type="mixturebsdf"><string name="weights" value="0.5, 0.25, 0.25"/>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf>
        <bsdf type="lambertian"><rgb name="reflectance" value="0.4"/></bsdf>
        <bsdf type="mirror"/></bsdf>"#;
    let two = r#"<bsdf type="blendbsdf"><float name="weight" value="0.5"/>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf>
        <bsdf type="principled"><rgb name="base_color" value="0.8"/><float name="metallic" value="0.5"/>
        </bsdf></bsdf>"#;
    for (text, expected) in [(three, 0.75), (two, 0.81)] {
        let (mixed, warnings) = material(text);
        let MaterialKind::Principled(Principled { base_color, metallic, .. }) = mixed.kind else {
            panic!()
        };
        let reflected = base_color.x * (1.0 - metallic) * 0.96 + 0.04 * (1.0 - metallic);
        let reflected = reflected + base_color.x * metallic;
        assert!((reflected - expected).abs() < 0.02, "{base_color} {metallic}");
        assert!(
            matches!(&warnings[..], [one] if one.contains("gloss of `blendbsdf`")),
            "{warnings:?}"
        );
    }
    let (phong, warnings) = material(
        r#"<bsdf type="phong"><float name="exponent" value="50"/>
        <rgb name="specularReflectance" value="0.1 0.05 0"/></bsdf>"#,
    );
    let MaterialKind::Principled(Principled { base_color, roughness, specular_color, .. }) =
        phong.kind
    else {
        panic!()
    };
    // The base has the light that the coat leaves of its brightest channel.
    assert_close(base_color, Vec3::splat(0.5 / 0.9));
    assert!((roughness.powi(4) - 2.0 / 202.0).abs() < 1e-5, "{roughness}");
    assert!((specular_color.x * 0.04 - 0.1).abs() < 1e-5 && warnings.len() == 1, "{warnings:?}");
    let ward = r#"<bsdf type="ward"><string name="variant" value="ward-duer"/></bsdf>"#;
    assert_eq!(material(ward).1.len(), 1);
    let (glossy, warnings) = material(&ward.replace(
        "<string",
        r#"<float name="alpha_u" value="0.1"/><float name="alpha_v" value="0.325"/><string"#,
    ));
    assert!((glossy.surface.anisotropy.strength - 0.5).abs() < 1e-6 && warnings.len() == 1);
    let coated = r#"<bsdf type="coating"><bsdf type="diffuse"/></bsdf>"#;
    assert!(matches!(material(coated).0.kind, MaterialKind::Plastic { .. }));
    let gold = coated
        .replace("\"diffuse\"/", "\"conductor\"><string name=\"material\" value=\"Au\"/></bsdf");
    let (MaterialKind::Principled(gold), warnings) = (material(&gold).0.kind, material(&gold).1)
    else {
        panic!()
    };
    assert_eq!((gold.metallic, gold.coat_weight, warnings.len()), (1.0, 1.0, 0));
    assert!(gold.coat_roughness < 0.05 && gold.base_color.x > 0.5, "{gold:?}");
    // Coat and metal have a width each.
    let width = |alpha: f32| {
        format!(
            "<string name=\"distribution\" value=\"ggx\"/><float name=\"alpha\" value=\"{alpha}\"/>"
        )
    };
    let (coat, metal) = (width(0.25), width(0.04));
    let both = format!(
        "<bsdf type=\"roughcoating\">{coat}<bsdf type=\"roughconductor\">{metal}</bsdf></bsdf>"
    );
    let MaterialKind::Principled(both) = material(&both).0.kind else { panic!() };
    assert_eq!((both.roughness, both.coat_roughness), (0.04_f32.sqrt(), 0.5));
    let plastic = material(r#"<bsdf type="pplastic"><float name="alpha" value="0.2"/></bsdf>"#);
    let MaterialKind::Plastic { alpha: 0.2, .. } = plastic.0.kind else { panic!() };
    assert!(plastic.1.iter().any(|text| text.contains("polarisation of `pplastic`")));
    // A width is the same as a number and as an image of that number.
    let [number, image] = ["<float name=\"alpha\" value=\"0.3\"/>", EVEN].map(|alpha| {
        let ggx = r#"<string name="distribution" value="ggx"/>"#;
        let coating = format!("<bsdf type=\"roughcoating\">{ggx}{alpha}{diffuse}</bsdf>");
        let plastic = format!("<bsdf type=\"roughplastic\">{ggx}{alpha}</bsdf>");
        [plastic, coating].map(|text| {
            let material = material(&text).0;
            let MaterialKind::Plastic { diffuse, alpha, .. } = material.kind else { panic!() };
            let root = material.surface.roughness.map_or(1.0, |root| root.mean()[0]);
            Vec3::new(diffuse.x, diffuse.y, alpha * root * root)
        })
    });
    number.into_iter().zip(image).for_each(|(a, b)| assert!(a.abs_diff_eq(b, 1e-3), "{a} {b}"));
    let scene = load("<shape type=\"cube\"/>");
    let MaterialKind::Diffuse { reflectance } = scene.materials[0].kind else { panic!() };
    assert_eq!((reflectance, scene.materials[0].surface.two_sided), (Vec3::splat(0.5), false));
}

/// Beckmann's normals unless a file states others; a coat on metal is GGX's, and metal below it.
#[test]
fn microfacets_have_the_distribution_of_the_file() {
    let model = |kind: &str, distribution: &str, inner: &str| {
        let distribution = match distribution {
            "" => String::new(),
            name => format!("<string name=\"distribution\" value=\"{name}\"/>"),
        };
        let width = "<float name=\"alpha\" value=\"0.2\"/>";
        format!("<bsdf type=\"{kind}\">{distribution}{width}{inner}</bsdf>")
    };
    for kind in ["roughconductor", "roughplastic", "roughdielectric"] {
        for (name, expected, count) in [
            ("ggx", Distribution::Ggx, 0),
            ("beckmann", Distribution::Beckmann, 0),
            ("", Distribution::Beckmann, 0),
            ("phong", Distribution::Beckmann, 1),
        ] {
            let (found, warnings) = material(&model(kind, name, ""));
            assert_eq!((found.surface.distribution, warnings.len()), (expected, count), "{kind}");
        }
    }
    for (coat, metal, count) in [("ggx", "ggx", 0), ("", "ggx", 1), ("ggx", "", 1), ("", "", 2)] {
        let metal = model("roughconductor", metal, "");
        let (found, warnings) = material(&model("roughcoating", coat, &metal));
        let named = warnings.iter().filter(|text| text.contains("on coated metal")).count();
        assert_eq!((found.surface.distribution, named), (Distribution::Ggx, count.min(1)));
    }
    let diffuse = "<bsdf type=\"diffuse\"/>";
    let (lacquer, warnings) = material(&model("roughcoating", "", diffuse));
    assert_eq!((lacquer.surface.distribution, warnings.len()), (Distribution::Beckmann, 0));
}

#[test]
fn principled_becomes_the_material_of_gltf() {
    let (found, warnings) = material(
        r#"<bsdf type="principled"><rgb name="base_color" value="0.9 0.5 0.1"/>
        <float name="roughness" value="0.3"/><float name="metallic" value="0.75"/>
        <float name="specular" value="0.5"/><float name="sheen" value="0.5"/>
        <float name="clearcoat" value="0.8"/><float name="clearcoat_gloss" value="0.5"/>
        <float name="spec_trans" value="0"/></bsdf>"#,
    );
    let MaterialKind::Principled(Principled {
        base_color,
        metallic,
        roughness,
        ior,
        specular,
        coat_weight,
        coat_roughness,
        ..
    }) = found.kind
    else {
        panic!()
    };
    assert_eq!((metallic, roughness), (0.75, 0.3));
    // A quarter of the strength; α is half-way from 0.1 to 0.001.
    assert!((coat_weight - 0.2).abs() < 1e-6, "{coat_weight}");
    assert!((coat_roughness.powi(2) - 0.0505).abs() < 1e-6, "{coat_roughness}");
    // The quarter that is no metal is 3% lighter as a Lambertian base.
    assert_close(base_color, 1.00775 * Vec3::new(0.9, 0.5, 0.1));
    assert!((ior - 1.5).abs() < 1e-6 && specular == 1.0, "{ior}");
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains("`sheen`"));
    // Red is metal by its luminance, 0.2126.
    let red = ["color0", "color1"].map(|name| format!("<rgb name=\"{name}\" value=\"1 0 0\"/>"));
    let (found, _) = material(&format!(
        "<bsdf type=\"principled\"><texture name=\"metallic\" type=\"checkerboard\">{}</texture>\
         <float name=\"roughness\" value=\"0.3\"/></bsdf>",
        red.concat()
    ));
    let MaterialKind::Principled(Principled { base_color, .. }) = found.kind else { panic!() };
    assert_close(base_color, Vec3::splat(0.5 * (1.0 + 0.7874 * 0.031)));
    assert!(found.surface.metallic.is_some());
    // The aspect is √(1 − 0.9 · 5/6) = ½: widths of 0.16 / ½ and 0.16 · ½.
    let (brushed, warnings) = material(
        r#"<bsdf type="principled"><float name="anisotropic" value="0.8333333"/>
        <float name="roughness" value="0.4"/><float name="metallic" value="1"/></bsdf>"#,
    );
    let MaterialKind::Principled(Principled { roughness, .. }) = brushed.kind else { panic!() };
    let [along, across] = brushed.surface.anisotropy.widths(roughness * roughness);
    assert!((along - 0.32).abs() < 1e-5 && (across - 0.08).abs() < 1e-5, "{along} {across}");
    assert_eq!((brushed.surface.anisotropy.rotation, warnings), (0.0, vec![]));
    let (glass, warnings) = material(
        r#"<bsdf type="principled"><rgb name="base_color" value="0.25"/>
        <float name="roughness" value="0.5"/><float name="eta" value="1.3"/>
        <float name="spec_trans" value="1"/></bsdf>"#,
    );
    let MaterialKind::Dielectric { ior, alpha, transmittance, .. } = glass.kind else { panic!() };
    assert_eq!((ior, alpha, transmittance), (1.3, 0.25, Vec3::splat(0.5)));
    assert_eq!(warnings, [""; 0]);
    // Neither `eta` nor `specular`: that of 0.5.
    let (plain, _) = material(r#"<bsdf type="principled"/>"#);
    let MaterialKind::Principled(Principled { ior, roughness, .. }) = plain.kind else { panic!() };
    assert!((ior - 1.5).abs() < 1e-6 && roughness == 0.5, "{ior} {roughness}");
}

#[test]
fn normal_maps_stand_on_the_tangents_of_mitsuba() {
    let folder = Folder::new();
    write_image(&folder, "bumps.png");
    // With v turned round, u leads along +y and v along +x: a mirror image.
    let corners = "vt 0 1\nvt 0 0\nvt 1 1\nf 1/1 2/2 3/3\n";
    folder.write("turned.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{corners}"));
    let turned = r#"obj"><string name="filename" value="turned.obj"/>"#;
    for (shape, scale, tangent) in [
        ("rectangle\">", "1", [1.0, 0.0, 0.0, 1.0]),
        ("rectangle\">", "-1", [-1.0, 0.0, 0.0, 1.0]),
        (turned, "1", [0.0, 1.0, 0.0, 1.0]),
    ] {
        let text = format!(
            "{SENSOR}<shape type=\"{shape}<transform name=\"to_world\"><scale x=\"{scale}\"/>\
             </transform><bsdf type=\"normalmap\"><texture type=\"bitmap\" name=\"normalmap\">\
             <boolean name=\"raw\" value=\"true\"/>\
             <string name=\"filename\" value=\"bumps.png\"/></texture><bsdf type=\"diffuse\"/>\
             </bsdf></shape>"
        );
        let scene = loaded(&folder.write("a.xml", document(&text)));
        let normal = scene.materials[0].surface.normal.as_ref().unwrap();
        assert_eq!(normal.encoding, Encoding::Linear);
        assert!(scene.geometry.tangents.iter().all(|found| *found == tangent), "{shape} {scale}");
        assert_eq!(scene.geometry.uvs[0][0], [0.0; 2]);
    }
}

/// The image lies once on a rectangle of 2 × 2 units.
#[test]
fn heights_become_normals_along_their_image() {
    let folder = Folder::new();
    write_image(&folder, "bumps.png");
    let scaled = |name: &str, times: f32| {
        format!(
            "<texture type=\"bitmap\" name=\"{name}\"><boolean name=\"raw\" value=\"true\"/>\
             <string name=\"filename\" value=\"bumps.png\"/><string name=\"wrap_mode\" \
             value=\"clamp\"/><transform name=\"to_uv\"><scale y=\"{times}\"/></transform></texture>"
        )
    };
    let image = |name: &str| scaled(name, 1.0);
    let of = |bsdf: String| {
        let text = format!("{SENSOR}<shape type=\"rectangle\">{bsdf}</shape>");
        loaded(&folder.write("a.xml", document(&text)))
    };
    let bumps = |around: &str, inner: &str| {
        let own = "<float name=\"scale\" value=\"2\"/>\
             <boolean name=\"use_shadowing_function\" value=\"false\"/>";
        format!("<bsdf type=\"bumpmap\">{own}{around}{inner}</bsdf>")
    };
    let diffuse = "<bsdf type=\"diffuse\"/>";
    let scene = of(format!("<bsdf type=\"twosided\">{}</bsdf>", bumps(&image("any"), diffuse)));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert!(scene.geometry.tangents.is_empty());
    let [red, green, blue, white] = [0.2126_f32, 0.7152, 0.0722, 1.0];
    // An image of half the height is twice as steep along it.
    for times in [1.0, 2.0] {
        let scene = of(bumps(&scaled("any", times), diffuse));
        let normal = scene.materials[0].surface.normal.as_ref().unwrap();
        for (place, right, up) in
            [([0.25, 0.25], green - red, red - blue), ([0.75, 0.75], white - blue, green - white)]
        {
            let expected = Vec3::new(-right, -up * times, 1.0).normalize();
            let found = 2.0 * normal.value(place.into()).truncate() - 1.0;
            assert!(found.abs_diff_eq(expected, 2e-3), "{times}: {found} {expected}");
        }
    }
    // Where two rows repeat, each has the other on both sides, and no slope.
    let scene = of(bumps(&image("any").replace("wrap_mode", "wrap_mode_u"), diffuse));
    let normal = scene.materials[0].surface.normal.as_ref().unwrap();
    let found = 2.0 * normal.value(Vec2::splat(0.25)).truncate() - 1.0;
    let expected = Vec3::new(red - green, 0.0, 1.0).normalize();
    assert!(found.abs_diff_eq(expected, 2e-3), "{found} {expected}");
    // One of two maps counts; a constant height is none.
    let normals = format!("<bsdf type=\"normalmap\">{}{diffuse}</bsdf>", image("normalmap"));
    let both = of(bumps(&image("any"), &normals));
    assert!(both.warnings.iter().any(|warning| warning.contains("`bumpmap`")), "{both:?}");
    // Steps have no slope.
    let steps = "<string name=\"filter_type\" value=\"nearest\"/></texture>";
    for flat in ["<texture type=\"checkerboard\"/>", &image("any").replace("</texture>", steps)] {
        let scene = of(bumps(flat, diffuse));
        assert!(scene.materials[0].surface.normal.is_none() && scene.warnings.is_empty());
    }
}

/// An image of 2 × 2 texels: red and green above blue and white.
fn write_image(folder: &Folder, name: &str) {
    let texels = vec![255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255];
    let image = image::RgbImage::from_raw(2, 2, texels).unwrap();
    image.save(folder.path().join(name)).unwrap();
}

#[test]
fn textures_keep_their_coordinates() {
    let folder = Folder::new();
    write_image(&folder, "four colours.png");
    let text = r#"<shape type="rectangle"><bsdf type="mask">
        <texture type="bitmap" name="opacity"><string name="filename" value="four colours.png"/>
          <boolean name="raw" value="true"/><string name="wrapMode" value="clamp"/></texture>
        <bsdf type="diffuse"><texture type="bitmap" name="reflectance">
          <string name="filename" value="./four colours.png"/>
          <string name="filterType" value="Nearest"/>
          <string name="wrap_mode_v" value="mirror"/>
          <transform name="to_uv"><scale x="2" y="1"/><translate x="0.1" y="0.2"/></transform>
          </texture></bsdf></bsdf></shape>
        <shape type="rectangle"><bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
          <rgb name="color0" value="0.75"/><rgb name="color1" value="0.25 0.5 0.75"/>
          <float name="uscale" value="2"/><float name="uoffset" value="0.3"/>
          <float name="uvscale" value="4"/></texture></bsdf></shape>
        <shape type="rectangle"><bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance">
          <string name="name" value="vertex_color"/></texture></bsdf></shape>"#;
    let scene = loaded(&folder.write("a.xml", document(&format!("{SENSOR}{text}"))));
    assert_eq!(scene.warnings, [""; 0]);
    let [leaf, board, vertices] = &scene.materials[..] else { panic!() };
    let color = leaf.surface.color.as_ref().unwrap();
    // Mitsuba's (0, 0) is the upper left corner, as that of TextureUse.
    assert_eq!(color.image_from_uv, [[2.0, 0.0, 0.1], [0.0, 1.0, 0.2]]);
    assert_eq!((color.encoding, color.interpolation), (Encoding::Srgb, Interpolation::Nearest));
    assert_eq!(color.wrap, [Wrap::Repeat, Wrap::Mirror]);
    assert!(matches!(leaf.kind, MaterialKind::Diffuse { reflectance: Vec3::ONE }));
    let opacity = leaf.surface.opacity.texture.as_ref().unwrap();
    assert_eq!((opacity.encoding, opacity.wrap), (Encoding::Linear, [Wrap::Clamp; 2]));
    let board = board.surface.color.as_ref().unwrap();
    assert_eq!((board.bias, board.scale), ([0.75; 3], [-0.5, -0.25, 0.0]));
    assert_eq!(board.interpolation, Interpolation::Nearest);
    let [u, v] = board.image_from_uv;
    assert!(u[0] == 2.0 && (u[2] - 0.6).abs() < 1e-6, "{u:?}");
    assert_eq!(v, [0.0, 4.0, 0.0]);
    assert!(vertices.surface.vertex_color);
}

#[test]
fn spectra_become_the_colours_of_mitsuba() {
    let intensity = |text: &str| {
        let scene = load(&format!("<emitter type=\"point\">{text}</emitter>"));
        let LampKind::Point { intensity, .. } = scene.lamps[0].kind else { panic!() };
        intensity
    };
    // Colours of Mitsuba 3.9.1; its table has steps of 5 nm.
    let near = |found: Vec3, expected: Vec3| {
        assert!(found.abs_diff_eq(expected, 5e-3 * expected.max_element()), "{found}: {expected}");
    };
    near(
        intensity(r#"<spectrum name="intensity" value="2"/>"#),
        Vec3::new(2.40959, 1.89658, 1.81783),
    );
    near(
        intensity(r#"<spectrum name="intensity" value="400:1, 500:3 600:2 700:5"/>"#),
        Vec3::new(2.88172, 2.47458, 1.79734),
    );
    assert_eq!(intensity(r#"<rgb name="intensity" value="1 2 3"/>"#), Vec3::new(1.0, 2.0, 3.0));
    assert_eq!(intensity(r#"<float name="intensity" value="2"/>"#), Vec3::splat(2.0));
    let warm = intensity(r#"<blackbody name="intensity" temperature="3000K"/>"#);
    assert!(warm.x > 1.5 * warm.y && warm.y > 2.0 * warm.z, "{warm}");
    let twice = r#"<blackbody name="intensity" temperature="3000" scale="2"/>"#;
    assert_close(intensity(twice), 2.0 * warm);
    let of_type = |kind: &str, rest: &str| {
        intensity(&format!("<spectrum name=\"intensity\" type=\"{kind}\">{rest}</spectrum>"))
    };
    let kelvin = r#"<float name="temperature" value="3000"/><float name="scale" value="2"/>"#;
    assert_close(of_type("blackbody", kelvin), 2.0 * warm);
    for name in ["color", "value"] {
        let rgb = format!("<rgb name=\"{name}\" value=\"1 2 3\"/>");
        assert_eq!(of_type("rgb", &rgb), Vec3::new(1.0, 2.0, 3.0));
    }
    // Equal energy is white of this type, though not that of one number.
    assert_eq!(of_type("uniform", r#"<float name="value" value="3"/>"#), Vec3::splat(3.0));
    let tinted = r#"<rgb name="color" value="1 .5 .25"/><float name="scale" value="2"/>"#;
    assert_eq!(of_type("d65", tinted), Vec3::new(2.0, 1.0, 0.5));
    let irregular = |values: &str| {
        let list = |name: &str, list: &str| format!("<string name=\"{name}\" value=\"{list}\"/>");
        list("wavelengths", "400 500 600 700") + &list("values", values)
    };
    let expected = Vec3::new(2.88172, 2.47458, 1.79734);
    near(of_type("irregular", &irregular("1 3 2 5")), expected);
    let regular = r#"<float name="wavelength_min" value="400"/><float name="wavelength_max" value="700"/>
        <string name="values" value="1, 3, 2, 5"/>"#;
    near(of_type("regular", regular), expected);
    let spectrum =
        format!("<spectrum name=\"radiance\" type=\"irregular\">{}</spectrum>", irregular("1"));
    let message = refusal(&format!("<emitter type=\"constant\">{spectrum}</emitter>"));
    assert!(message.contains("as many values as wavelengths"), "{message}");
    let folder = Folder::new();
    folder.write("lamp.spd", "# nm, W\n400 1\n\n500 3 # blue\n600 2\n700 5\n");
    let spectrum = r#"<spectrum name="intensity" filename="lamp.spd"/>"#;
    let text = format!("{SENSOR}<emitter type=\"point\">{spectrum}</emitter>");
    let scene = loaded(&folder.write("a.xml", document(&text)));
    let LampKind::Point { intensity: found, .. } = scene.lamps[0].kind else { panic!() };
    near(found, expected);
    let (paint, _) = material(
        r#"<bsdf type="diffuse"><spectrum name="reflectance" value="400:0.1 500:.3 600:.2 700:.5"/>
        </bsdf>"#,
    );
    let MaterialKind::Diffuse { reflectance } = paint.kind else { panic!() };
    near(reflectance, Vec3::new(0.232248, 0.262201, 0.201645));
    let emitter = "<emitter type=\"area\"><texture name=\"radiance\" type=\"uniform\">\
                   <float name=\"value\" value=\"3\"/></texture></emitter>";
    let (lamp, warnings) = material(emitter);
    assert_eq!(lamp.surface.emission.unwrap().radiance, Vec3::splat(3.0));
    assert!(warnings.is_empty(), "{warnings:?}");
    for (value, expected) in [("2", 1.0), ("-1", 0.0), ("0.25", 0.25)] {
        let (paint, _) = material(&format!(
            "<bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"uniform\">\
             <float name=\"value\" value=\"{value}\"/></texture></bsdf>"
        ));
        let MaterialKind::Diffuse { reflectance } = paint.kind else { panic!() };
        assert_eq!(reflectance, Vec3::splat(expected));
    }
}

/// Version 0.6, for which such files were made, has white of one number, and copper without a name.
#[test]
fn files_of_version_0_6_look_as_they_did() {
    let folder = Folder::new();
    let content = r#"<emitter type="point"><spectrum name="intensity" value="2"/></emitter>
        <shape type="rectangle"><bsdf type="conductor"/></shape>
        <shape type="rectangle"><bsdf type="conductor"><string name="material" value="Cu"/></bsdf>
        </shape>"#;
    let text = document(&format!("{SENSOR}{content}")).replace("3.0.0", "0.6.0");
    let scene = loaded(&folder.write("a.xml", &text));
    let LampKind::Point { intensity, .. } = scene.lamps[0].kind else { panic!() };
    assert_eq!(intensity, Vec3::splat(2.0));
    let MaterialKind::Conductor { fresnel, .. } = &scene.materials[0].kind else { panic!() };
    let MaterialKind::Conductor { fresnel: copper, .. } = &scene.materials[1].kind else {
        panic!()
    };
    assert_eq!(fresnel.at_normal_incidence(), copper.at_normal_incidence());
    let scene = loaded(&folder.write("a.xml", text.replace("0.6.0", "3.0.0")));
    assert!(matches!(scene.materials[0].kind, MaterialKind::Mirror { reflectance: Vec3::ONE }));
}

#[test]
fn lamps_shine_where_they_look() {
    let scene = load(
        r#"<emitter type="spot" id="desk"><transform name="to_world">
          <lookat origin="1,2,3" target="1,0,3" up="1,0,0"/></transform>
          <float name="cutoff_angle" value="40"/></emitter>
        <emitter type="directional"><vector name="direction" value="0,-2,0"/>
          <rgb name="irradiance" value="1,2,3"/></emitter>
        <emitter type="point"><point name="position" x="1" z="2"/></emitter>
        <emitter type="spot"><float name="cutoff_angle" value="40"/>
          <float name="beam_width" value="60"/></emitter>"#,
    );
    assert_eq!(scene.warnings, [""; 0]);
    let LampKind::Spot(spot) = scene.lamps[0].kind else { panic!() };
    assert_close(spot.position, Vec3::new(1.0, 2.0, 3.0));
    assert_close(spot.direction, Vec3::NEG_Y);
    assert!((spot.inner_angle_rad - PI / 6.0).abs() < 1e-6);
    assert!((spot.outer_angle_rad - PI / 4.5).abs() < 1e-6);
    assert_eq!((spot.falloff, scene.lamps[0].name.as_str()), (SpotFalloff::LinearAngle, "desk"));
    let irradiance = Vec3::new(1.0, 2.0, 3.0);
    assert_eq!(scene.lamps[1].kind, LampKind::Directional { direction: Vec3::NEG_Y, irradiance });
    let position = Vec3::new(1.0, 0.0, 2.0);
    assert_eq!(scene.lamps[2].kind, LampKind::Point { position, intensity: Vec3::ONE });
    // A beam as wide as the cone has an edge that other formats can say.
    let LampKind::Spot(sharp) = scene.lamps[3].kind else { panic!() };
    let edges = sharp.inner_angle_rad..sharp.outer_angle_rad;
    assert!(edges.contains(&(0.9995 * sharp.outer_angle_rad)) && edges.start > 0.69, "{edges:?}");

    let folder = Folder::new();
    write_image(&folder, "a.png");
    let text = r#"<emitter type="spot"><rgb name="intensity" value="2,4,6"/>
        <texture type="bitmap" name="texture"><string name="filename" value="a.png"/></texture>
        </emitter>"#;
    let scene = loaded(&folder.write("a.xml", document(&format!("{SENSOR}{text}"))));
    let LampKind::Spot(spot) = scene.lamps[0].kind else { panic!() };
    assert_close(spot.intensity, Vec3::new(1.0, 2.0, 3.0));
    assert!(scene.warnings[0].ends_with("its mean over the whole cone"), "{:?}", scene.warnings);
}

#[test]
fn strands_of_files_are_tubes_in_the_world() {
    let folder = Folder::new();
    folder.write("a.txt", "0 0 0 0.1\n0 0 1 0.1\n0 0 2 0.1\n0 0 3 0.1\n\n5 0 0 .2\n5 0 3 .2\n");
    folder.write("b.hair", "0 0 0\n0 0 3\n");
    let mut binary = b"BINARY_HAIR\x04\0\0\0".to_vec();
    for number in
        [f32::INFINITY, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, f32::INFINITY, 5.0, 0.0, 0.0, 5.0, 0.0, 3.0]
    {
        binary.extend(number.to_le_bytes());
    }
    folder.write("c.hair", binary);
    // Kind, file, extent along y in the world, and tubes.
    let cases = [
        ("bsplinecurve", "a.txt", [2.0, 4.0], 1),
        ("linearcurve", "a.txt", [0.0, 6.0], 2),
        ("hair", "b.hair", [0.0, 6.0], 1),
        ("hair", "c.hair", [0.0, 6.0], 2),
    ];
    for (kind, file, extent, tubes) in cases {
        let text = format!(
            "{SENSOR}<shape type=\"{kind}\"><string name=\"filename\" value=\"{file}\"/>
            <transform name=\"to_world\"><rotate x=\"1\" angle=\"-90\"/><scale value=\"2\"/>
            </transform></shape>"
        );
        let scene = loaded(&folder.write("a.xml", document(&text)));
        let positions = &scene.geometry.positions;
        let along = |p: &[f32; 3]| p[1];
        let low = positions.iter().map(along).fold(f32::INFINITY, f32::min);
        let high = positions.iter().map(along).fold(f32::NEG_INFINITY, f32::max);
        assert!(
            (low - extent[0]).abs() < 1e-5 && (high - extent[1]).abs() < 1e-5,
            "{kind} {low} {high}"
        );
        let widest = positions.iter().map(|p| p[0].abs()).filter(|x| *x < 4.0).fold(0.0, f32::max);
        let radius = if kind == "hair" { 0.025 } else { 0.1 };
        assert!((0.8..1.05).contains(&(widest / radius)), "{kind}: {widest}");
        let far = positions.iter().any(|p| p[0] > 4.0);
        assert_eq!(far, tubes == 2, "{kind}");
        assert!(scene.warnings[0].contains("exact form of"), "{:?}", scene.warnings);
        assert_eq!(scene.inputs.len(), 2);
    }
    folder.write("a.txt", "0 0 0 0.1\n0 0 x 0.1\n");
    folder.write("b.hair", "0 0 0\n0 0 3 0.1\n");
    for (kind, file, expected) in [
        ("linearcurve", "a.txt", "line 2: expected x y z radius, found `0 0 x 0.1`"),
        ("hair", "b.hair", "line 2: expected x y z, found `0 0 3 0.1`"),
    ] {
        let text =
            format!("<shape type=\"{kind}\"><string name=\"filename\" value=\"{file}\"/></shape>");
        let path = folder.write("a.xml", document(&format!("{SENSOR}{text}")));
        let error = Scene::load(&path).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

/// So many that half of them are kept, each twice as thick.
#[test]
fn many_strands_stay_within_a_bound() {
    let count = 400_000_u32;
    let mut bytes = [b"BINARY_HAIR", &(2 * count).to_le_bytes()[..]].concat();
    let strand = [f32::INFINITY, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0].map(f32::to_le_bytes).concat();
    bytes.extend(strand.repeat(count as usize));
    let folder = Folder::new();
    folder.write("a.hair", bytes);
    let shape = r#"<shape type="hair"><string name="filename" value="a.hair"/>
        <float name="radius" value="1"/></shape>"#;
    let scene = loaded(&folder.write("a.xml", document(&format!("{SENSOR}{shape}"))));
    assert!(scene.warnings[0].contains("one of 2 strands"), "{:?}", scene.warnings);
    // Tubes of three sides, as wide on the mean as all strands.
    let kept = scene.geometry.triangles.len() / 6;
    assert!(kept <= (1 << 21) / 6, "{kept}");
    let [_, y, z] = scene.geometry.positions[0];
    let whole = kept as f32 * 3.0 * y.hypot(z) * (PI / 3.0).sin();
    let expected = PI * count as f32;
    assert!((whole / expected - 1.0).abs() < 0.01, "{whole} {expected}");
}

/// Reflectance at normal incidence, diffuse and specular together.
fn reflected(kind: &MaterialKind) -> Vec3 {
    match kind {
        MaterialKind::Diffuse { reflectance } => *reflectance,
        MaterialKind::Principled(own) => {
            let coat = 0.04 * own.specular * own.specular_color;
            let below = (1.0 - own.metallic) * (1.0 - coat.max_element());
            own.base_color * below + coat.lerp(own.base_color, own.metallic)
        }
        _ => panic!("{kind:?}"),
    }
}

#[test]
fn mixtures_are_linear_in_reflectance() {
    let folder = Folder::new();
    let bytes = [255, 0, 0, 0, 255, 0];
    image::save_buffer(folder.path().join("a.png"), &bytes, 2, 1, image::ColorType::Rgb8).unwrap();
    let image = |name: &str, rest: &str| {
        format!(
            "<texture type=\"bitmap\" name=\"{name}\"><string name=\"filename\" value=\"a.png\"/>\
             <boolean name=\"raw\" value=\"true\"/>{rest}</texture>"
        )
    };
    let mixed = |first: &str, second: &str, weight: &str| {
        let shape = format!(
            "<shape type=\"rectangle\"><bsdf type=\"blendbsdf\">{weight}{first}{second}</bsdf></shape>"
        );
        let scene = loaded(&folder.write("a.xml", document(&format!("{SENSOR}{shape}"))));
        (scene.materials[0].clone(), scene.warnings)
    };
    let quarter = "<float name=\"weight\" value=\"0.25\"/>";
    let by_image = image("weight", "");
    let [a, b] = [Vec3::new(0.8, 0.4, 0.2), Vec3::new(0.1, 0.3, 0.5)];
    let rgb = |color: Vec3| format!("value=\"{} {} {}\"/>", color.x, color.y, color.z);
    let plain = |color: Vec3| {
        format!("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" {}</bsdf>", rgb(color))
    };
    let textured = |color: Vec3, rest: &str| {
        format!(
            "<bsdf type=\"diffuse\"><texture type=\"scale\" name=\"reflectance\">{}\
             <rgb name=\"scale\" {}</texture></bsdf>",
            image("", rest),
            rgb(color)
        )
    };
    let texels = [Vec3::X, Vec3::Y];
    // Reflectance of both texels of a diffuse mixture.
    let both = |(material, warnings): (Material, Vec<String>)| {
        assert!(warnings.is_empty(), "{warnings:?}");
        let MaterialKind::Diffuse { reflectance } = material.kind else { panic!() };
        let values = material.surface.color.map_or(vec![[1.0; 4]; 2], |color| color.values());
        [0, 1].map(|at| reflectance * Vec3::from_slice(&values[at][..3]))
    };
    for (own, other) in [(false, false), (true, false), (false, true), (true, true)] {
        let of = |color: Vec3, is_image: bool| match is_image {
            true => textured(color, ""),
            false => plain(color),
        };
        let found = both(mixed(&of(a, own), &of(b, other), quarter));
        for (texel, found) in texels.iter().zip(found) {
            let first = if own { a * texel } else { a };
            let second = if other { b * texel } else { b };
            assert!(found.abs_diff_eq(first.lerp(second, 0.25), 1e-3), "{found}");
        }
    }
    let found = both(mixed(&plain(a), &plain(b), &by_image));
    for (luminance, found) in [0.2126, 0.7152].into_iter().zip(found) {
        assert!(found.abs_diff_eq(a.lerp(b, luminance), 1e-3), "{found}");
    }
    // One image is not two where it lies in two ways.
    let clamp = "<string name=\"wrap_mode\" value=\"clamp\"/>";
    let (_, warnings) = mixed(&textured(a, clamp), &textured(b, ""), quarter);
    assert!(warnings[0].contains("gloss of `blendbsdf`"), "{warnings:?}");
    // Three images of the same texels count texel by texel.
    let (found, _) = mixed(&textured(a, ""), &textured(b, ""), &by_image);
    let shares = [0.2126, 0.7152];
    for ((texel, share), found) in texels.iter().zip(shares).zip(both((found, Vec::new()))) {
        assert!(found.abs_diff_eq((a * texel).lerp(b * texel, share), 1e-3), "{found}");
    }

    let metal = Vec3::new(0.9, 0.8, 0.7);
    let mirror = format!(
        "<bsdf type=\"conductor\"><string name=\"material\" value=\"none\"/>\
         <rgb name=\"specular_reflectance\" {}</bsdf>",
        rgb(metal)
    );
    let kind = mixed(&mirror, &plain(b), quarter).0.kind;
    let expected = metal.lerp(b, 0.25);
    assert!(reflected(&kind).abs_diff_eq(expected, 0.02), "{kind:?} and {expected}");
    // The gloss is that of the one that has gloss, and either may have bumps.
    let MaterialKind::Principled(Principled { roughness, .. }) = kind else { panic!() };
    assert!((roughness - 1e-3_f32.sqrt()).abs() < 1e-3, "{roughness}");
    let bumpy =
        |inner: &str| format!("<bsdf type=\"normalmap\">{}{inner}</bsdf>", image("normalmap", ""));
    for (first, second) in [(bumpy(&mirror), plain(b)), (mirror.clone(), bumpy(&plain(b)))] {
        assert!(mixed(&first, &second, quarter).0.surface.normal.is_some());
    }
    // Neither loses light, nor its other side.
    let shiny = "<bsdf type=\"plastic\"><rgb name=\"diffuse_reflectance\" value=\"1\"/></bsdf>";
    let once = format!("<bsdf type=\"blendbsdf\">{quarter}{shiny}{}</bsdf>", plain(Vec3::ONE));
    let (white, _) = mixed(&once, shiny, quarter);
    assert!(reflected(&white.kind).abs_diff_eq(Vec3::ONE, 0.02), "{white:?}");
    assert!(!white.surface.two_sided);
    let two_sided = format!("<bsdf type=\"twosided\">{mirror}</bsdf>");
    assert!(mixed(&two_sided, &plain(b), quarter).0.surface.two_sided);
    // One of two metals is a metal.
    let MaterialKind::Principled(Principled { metallic, .. }) =
        mixed(&mirror, &mirror, quarter).0.kind
    else {
        panic!()
    };
    assert!((metallic - 1.0).abs() < 1e-4, "{metallic}");
    // By an image, whose texels have the luminances of red and green.
    let (Material { kind, surface, .. }, _) = mixed(&mirror, &plain(b), &by_image);
    let MaterialKind::Principled(kind) = kind else { panic!() };
    let [color, metal_share] = [surface.color, surface.metallic].map(|used| used.unwrap().values());
    for (index, luminance) in [0.2126, 0.7152].into_iter().enumerate() {
        let kind = MaterialKind::Principled(Principled {
            base_color: kind.base_color * Vec3::from_slice(&color[index][..3]),
            metallic: kind.metallic * metal_share[index][0],
            ..kind
        });
        let expected = metal.lerp(b, luminance);
        assert!(reflected(&kind).abs_diff_eq(expected, 0.02), "{kind:?} and {expected}");
    }
    let (glass, warnings) = mixed("<bsdf type=\"thindielectric\"/>", &plain(b), quarter);
    assert!(matches!(glass.kind, MaterialKind::ThinDielectric { .. }), "{glass:?}");
    assert!(warnings[0].contains("the lesser part of `blendbsdf`"), "{warnings:?}");
}

/// Normal of the winding of the first triangle.
fn winding(scene: &Scene) -> Vec3 {
    let [a, b, c] = scene.geometry.triangles[0]
        .map(|corner| Vec3::from(scene.geometry.positions[corner as usize]));
    (b - a).cross(c - a).normalize()
}

#[test]
fn sides_are_those_of_mitsuba() {
    let folder = Folder::new();
    folder.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.write("smooth.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n");
    // Mitsuba weighs the normals of triangles by their angles, here 90° and 45°.
    folder.write("bent.obj", "v 1 1 1\nv 2 1 1\nv 1 2 1\nv 1 2 2\nf 1 2 3\nf 1 3 4\n");
    let bent = "<shape type=\"obj\"><string name=\"filename\" value=\"bent.obj\"/></shape>";
    let scene = loaded(&folder.write("a.xml", document(&format!("{SENSOR}{bent}"))));
    let corner = scene.geometry.positions.iter().position(|place| *place == [1.0; 3]).unwrap();
    assert_close(scene.geometry.normals[corner].into(), Vec3::new(1.0, 0.0, 2.0).normalize());
    let light = "<emitter type=\"area\"><rgb name=\"radiance\" value=\"3\"/></emitter>";
    let mirror = "<transform name=\"to_world\"><scale x=\"-1\"/></transform>";
    let flip = "<boolean name=\"flipNormals\" value=\"true\"/>";
    let flat = "<boolean name=\"face_normals\" value=\"true\"/>";
    let file = |name: &str| format!("<string name=\"filename\" value=\"{name}.obj\"/>");
    // Shading normals of Mitsuba 3.9.1 along z.
    for (kind, content, up) in [
        ("rectangle", String::new(), true),
        ("rectangle", flip.to_owned(), false),
        ("rectangle", mirror.to_owned(), true),
        ("disk", mirror.to_owned() + flip, false),
        ("obj", file("flat"), true),
        ("obj", file("flat") + mirror, false),
        ("obj", file("flat") + mirror + flip, true),
        ("obj", file("smooth") + mirror, true),
        ("obj", file("smooth") + mirror + flat, false),
        ("obj", file("smooth") + flip, false),
    ] {
        let text = format!("{SENSOR}<shape type=\"{kind}\">{content}{light}</shape>");
        let scene = loaded(&folder.write("a.xml", document(&text)));
        let expected = if up { Vec3::Z } else { Vec3::NEG_Z };
        assert_close(winding(&scene), expected);
        let is_flat = content.contains("face_normals");
        let normal = if is_flat { Vec3::ZERO } else { expected };
        assert_close(scene.geometry.normals[0].into(), normal);
        let emission = scene.materials[0].surface.emission.clone().unwrap();
        assert_eq!((emission.radiance, emission.two_sided), (Vec3::splat(3.0), false));
    }
    let outward = |scene: Scene| {
        let corner = scene.geometry.triangles[0][0] as usize;
        winding(&scene).dot(Vec3::from(scene.geometry.positions[corner]).normalize()) > 0.0
    };
    let sphere =
        |content: &str| outward(load(&format!("<shape type=\"sphere\">{content}</shape>")));
    let instance = |content: &str| {
        outward(load(&format!(
            "<shape type=\"shapegroup\" id=\"group\"><shape type=\"sphere\">{content}</shape></shape>\
             <shape type=\"instance\"><ref id=\"group\"/>{mirror}</shape>"
        )))
    };
    let cube = |content: &str| {
        let scene = load(&format!("<shape type=\"cube\">{content}</shape>"));
        let centre = Vec3::from(scene.geometry.positions[scene.geometry.triangles[0][0] as usize]);
        (winding(&scene).dot(centre) > 0.0, scene.geometry.normals[0] == [0.0; 3])
    };
    assert_eq!(cube(mirror), (true, false));
    assert_eq!(cube(&(mirror.to_owned() + flat)), (false, true));
    assert!(sphere("") && !sphere(mirror) && !sphere(flip) && sphere(&(mirror.to_owned() + flip)));
    assert!(instance("") && !instance(mirror) && !instance(flip));
}

#[test]
fn images_cover_the_triangles_of_meshes_without_coordinates() {
    let folder = Folder::new();
    folder.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 4 3 2\n");
    let shape = |bsdf: &str| {
        let file = "<string name=\"filename\" value=\"flat.obj\"/>";
        let text = format!("{SENSOR}<shape type=\"obj\">{file}{bsdf}</shape>");
        loaded(&folder.write("a.xml", document(&text))).geometry
    };
    let checkers = "<texture name=\"reflectance\" type=\"checkerboard\"/>";
    let textured = shape(&format!("<bsdf type=\"diffuse\">{checkers}</bsdf>"));
    let corners = textured.triangles.as_flattened().iter().map(|at| *at as usize);
    let found: Vec<_> = corners.map(|at| (textured.positions[at], textured.uvs[0][at])).collect();
    assert_eq!(found[1], ([1.0, 0.0, 0.0], [1.0, 0.0]));
    assert_eq!(found[4], ([0.0, 1.0, 0.0], [1.0, 0.0]));
    assert_eq!(found[5], ([1.0, 0.0, 0.0], [0.0, 1.0]));
    assert_eq!((textured.positions.len(), textured.normals.len()), (6, 6));
    assert_eq!(shape("").positions.len(), 4);
}

#[test]
fn round_shapes_stand_where_they_should() {
    let scene = load(
        r#"<shape type="sphere"><point name="center" x="1" y="2" z="3"/>
          <float name="radius" value="2"/>
          <transform name="to_world"><scale value="2"/></transform></shape>"#,
    );
    for position in &scene.geometry.positions {
        let distance = Vec3::from(*position).distance(Vec3::new(2.0, 4.0, 6.0));
        assert!((distance - 4.0).abs() < 1e-4, "{distance}");
    }
    let scene = load(
        r#"<shape type="cylinder"><point name="p0" value="1,0,0"/><point name="p1" value="5,0,0"/>
          <float name="radius" value="2"/></shape>"#,
    );
    // A ray of Mitsuba 3.9.1 found these coordinates there.
    let place = Vec3::new(5.0, 0.5, 1.93649);
    let distance = |at: &usize| Vec3::from(scene.geometry.positions[*at]).distance(place);
    let nearest =
        (0..scene.geometry.positions.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let nearest = nearest.unwrap();
    let [u, v] = scene.geometry.uvs[0][nearest];
    assert!(distance(&nearest) < 0.06 && (u - 0.459785).abs() < 0.01 && v == 1.0, "{u}, {v}");
    // One that leans is as round.
    let scene = load(r#"<shape type="cylinder"><point name="p1" value="2,3,-6"/></shape>"#);
    for position in &scene.geometry.positions {
        let distance = Vec3::from(*position).cross(Vec3::new(2.0, 3.0, -6.0) / 7.0).length();
        assert!((distance - 1.0).abs() < 1e-5, "{distance}");
    }
}

/// Areas, and texture coordinates that rays of Mitsuba 3.9.1 met near these vertices.
#[test]
fn shapes_face_outward_and_have_the_coordinates_of_mitsuba() {
    type Coordinates = ([f32; 3], [f32; 2]);
    let cases: [(&str, f32, &[Coordinates]); 5] = [
        (
            "sphere",
            4.0 * PI,
            &[
                ([0.842615, 0.2, 0.5], [0.0370901, 0.333333]),
                ([-0.3, 0.812404, -0.5], [0.3063, 0.666667]),
            ],
        ),
        ("disk", PI, &[([0.6, 0.8, 0.0], [1.0, 0.147584]), ([0.6, -0.8, 0.0], [1.0, 0.852416])]),
        ("cylinder", 2.0 * PI, &[([0.916515, 0.4, 1.0], [0.0654949, 1.0])]),
        ("rectangle", 4.0, &[([1.0, -1.0, 0.0], [1.0, 0.0])]),
        ("cube", 24.0, &[]),
    ];
    for (shape, area, coordinates) in cases {
        let mesh = load(&format!("<shape type=\"{shape}\"/>")).geometry;
        let vector = |of: &[[f32; 3]], at: u32| Vec3::from(of[at as usize]);
        let mut sum = 0.0;
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|at| vector(&mesh.positions, at));
            let normal = (b - a).cross(c - a);
            sum += 0.5 * normal.length();
            for own in triangle.map(|at| vector(&mesh.normals, at)) {
                assert!((own.length() - 1.0).abs() < 1e-6, "{shape}");
                assert!(own.dot(normal.normalize()) > 0.99, "{shape}: {own} on {normal}");
            }
        }
        assert!((sum / area - 1.0).abs() < 1e-3, "{shape}: {sum}, expected {area}");
        for (place, expected) in coordinates {
            let distance =
                |at: &u32| vector(&mesh.positions, *at).distance_squared((*place).into());
            let corners = mesh.triangles.iter().flatten();
            let nearest = corners.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
            let found = Vec2::from(mesh.uvs[0][*nearest as usize]);
            assert!(found.abs_diff_eq((*expected).into(), 1.0 / 128.0), "{shape}: {found}");
        }
        assert!(shape != "cube" || mesh.uvs[0][0] == [0.0, 1.0]);
    }
}

/// Albedo of Mitsuba 3.9.1's `roughplastic` less that of its coat, over the share of light that the coat
/// leaves: distribution, alpha, index, white base, grey base of ½ that deepens.
#[test]
fn rough_coats_lose_what_those_of_mitsuba_lose() {
    for (distribution, alpha, ior, white, grey) in [
        ("ggx", 0.05, 1.5, 0.9501, 0.2829),
        ("ggx", 0.3, 1.5, 0.6586, 0.2431),
        ("ggx", 1.0, 1.5, 0.2722, 0.1276),
        ("ggx", 0.1, 1.3, 0.9236, 0.3461),
        ("ggx", 0.5, 1.8, 0.3898, 0.1447),
        ("beckmann", 0.2, 1.5, 0.9187, 0.2801),
        ("beckmann", 1.0, 1.5, 0.4737, 0.2055),
        ("beckmann", 0.5, 1.8, 0.6426, 0.1869),
    ] {
        for (base, deepens, expected) in [(1.0, false, white), (0.5, true, grey)] {
            let floats = [("alpha", alpha), ("int_ior", ior), ("ext_ior", 1.0)]
                .map(|(name, value)| format!("<float name=\"{name}\" value=\"{value}\"/>"));
            let (plastic, _) = material(&format!(
                "<bsdf type=\"roughplastic\"><string name=\"distribution\" \
                 value=\"{distribution}\"/>{}<rgb name=\"diffuse_reflectance\" value=\"{base}\"/>\
                 <boolean name=\"nonlinear\" value=\"{deepens}\"/></bsdf>",
                floats.concat()
            ));
            let MaterialKind::Plastic { diffuse, .. } = plastic.kind else { panic!() };
            let ratio = diffuse.x / expected;
            assert!(
                (ratio - 1.0).abs() < 0.02,
                "{distribution} {alpha} {ior}: {diffuse} {expected}"
            );
        }
    }
}

#[test]
fn instances_repeat_their_group() {
    let scene = load(
        r#"<shape type="shapegroup" id="pair"><float name="mass" value="3"/><shape type="rectangle"/>
          <shape type="rectangle"><transform name="to_world"><translate z="1"/></transform></shape>
          </shape>
        <shape type="instance"><ref id="pair"/>
          <transform name="to_world"><translate x="10"/></transform></shape>
        <shape type="instance"><ref id="pair"/></shape>"#,
    );
    assert!(scene.warnings[0].contains("`mass` of `shapegroup`"), "{:?}", scene.warnings);
    assert_eq!(scene.geometry.triangles.len(), 8);
    assert_eq!(scene.geometry.positions[4], [9.0, -1.0, 1.0]);
    let message = refusal(
        r#"<shape type="shapegroup" id="loop"><shape type="instance"><ref id="loop"/></shape></shape>
        <shape type="instance"><ref id="loop"/></shape>"#,
    );
    assert!(message.contains("a shapegroup contains itself"), "{message}");
}

/// Flags of single and double precision.
const SINGLE: u32 = 0x1000;
const DOUBLE: u32 = 0x2000;

/// A serialized file of one triangle with texture coordinates and `flags`.
fn serialized(version: u16, flags: u32, corner: u32) -> Vec<u8> {
    let mut content = Vec::new();
    content.extend((0x0002 | flags).to_le_bytes());
    if version == 4 {
        content.extend(b"sail\0");
    }
    content.extend(3_u64.to_le_bytes());
    content.extend(1_u64.to_le_bytes());
    let numbers = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.25, 1.0, 0.0, 0.0, 1.0];
    for number in numbers {
        if flags & DOUBLE != 0 {
            content.extend(f64::to_le_bytes(number));
        } else {
            content.extend((number as f32).to_le_bytes());
        }
    }
    content.extend([0, 1, corner].into_iter().flat_map(u32::to_le_bytes));
    let mut file = [0x041C_u16.to_le_bytes(), version.to_le_bytes()].concat();
    let mut encoder = flate2::write::ZlibEncoder::new(file.split_off(4), Default::default());
    encoder.write_all(&content).unwrap();
    file.extend(encoder.finish().unwrap());
    if version == 4 {
        file.extend(0_u64.to_le_bytes());
    } else {
        file.extend(0_u32.to_le_bytes());
    }
    file.extend(1_u32.to_le_bytes());
    file
}

#[test]
fn serialized_meshes_of_both_versions_are_read() {
    let folder = Folder::new();
    let shape = |index: u32| {
        format!(
            "{SENSOR}<shape type=\"serialized\"><string name=\"filename\" value=\"a.serialized\"/>\
             <integer name=\"shapeIndex\" value=\"{index}\"/></shape>"
        )
    };
    let path = folder.write("a.xml", document(&shape(0)));
    for (version, flags) in [(3, SINGLE), (3, DOUBLE), (4, SINGLE), (4, DOUBLE)] {
        folder.write("a.serialized", serialized(version, flags, 2));
        let scene = loaded(&path);
        assert_eq!(scene.geometry.positions[1], [1.0, 0.0, 0.0]);
        assert_eq!(scene.geometry.uvs[0][0], [0.0, 0.25]);
        assert_eq!(scene.geometry.triangles, [[0, 1, 2]]);
        assert_eq!(scene.geometry.normals[2], [0.0, 0.0, 1.0], "smooth where none are given");
        folder.write("a.serialized", serialized(version, flags | 0x0010, 2));
        assert_eq!(loaded(&path).geometry.normals[2], [0.0; 3], "flat where the file says so");
    }
    // The offsets of the meshes and their count stand at the end.
    let (mut file, mut numbers) = (Vec::new(), Vec::new());
    for flags in [SINGLE, DOUBLE, SINGLE] {
        numbers.push(file.len() as u32);
        file.extend(serialized(3, flags, 2).split_last_chunk::<8>().unwrap().0);
    }
    numbers.push(3);
    file.extend(numbers.into_iter().flat_map(u32::to_le_bytes));
    folder.write("a.serialized", file);
    for index in 0..3 {
        let scene = loaded(&folder.write("b.xml", document(&shape(index))));
        assert_eq!(scene.geometry.positions[1], [1.0, 0.0, 0.0], "mesh {index}");
    }
    let whole = serialized(4, SINGLE, 2);
    for length in 0..whole.len() {
        folder.write("a.serialized", &whole[..length]);
        assert!(Scene::load(&path).is_err(), "cut off at {length}");
    }
    folder.write("a.serialized", serialized(4, SINGLE, 3));
    let message = Scene::load(&path).unwrap_err().to_string();
    assert!(message.contains("a triangle has the vertex 3, there are 3"), "{message}");
    folder.write("a.serialized", whole);
    let message = Scene::load(&folder.write("b.xml", document(&shape(1)))).unwrap_err().to_string();
    assert!(message.contains("shape_index 1: the file has 1 meshes"), "{message}");
}

#[test]
fn what_is_not_understood_is_named_once_with_its_line() {
    let scene = load(
        r#"
        <integrator type="depth"><boolean name="hide_emitters" value="true"/></integrator>
        <bsdf type="diffuse" id="paint"><boolean name="shiny" value="true"/></bsdf>
        <shape type="cube"><ref id="paint"/><float name="mass" value="3"/></shape>
        <shape type="cube"><ref id="paint"/><float name="mass" value="3"/>
          <medium type="homogeneous" name="interior"/></shape>
        <fog/>
        <shape type="cube"><ref id="paint"/><bsdf type="null"/></shape>
        <emitter type="sunsky"><boolean name="complex_sun" value="true"/></emitter>"#,
    );
    let texts: Vec<_> =
        scene.warnings.iter().map(|text| text.split_once(": ignored ").unwrap().1).collect();
    assert_eq!(
        texts,
        [
            "`hide_emitters` (line 6): lights are seen",
            "integrator `depth` (line 6)",
            "`shiny` of `diffuse` (2, first in line 7)",
            "`mass` of `cube` (2, first in line 8)",
            "other uses of `medium` (line 10)",
            "`fog` in `scene` (line 11)",
            "`bsdf` in `cube` (line 12)",
            "`complex_sun` of `sunsky` (line 13)",
        ]
    );
}

/// Files of others rarely hold all that they name; the rest of them renders.
#[test]
fn shapes_and_models_that_are_not_there_leave_the_rest() {
    let folder = Folder::new();
    folder.write("Ball.ply", PLY);
    let file = |name: &str| format!("<string name=\"filename\" value=\"{name}\"/>");
    let texture =
        format!("<texture type=\"bitmap\" name=\"reflectance\">{}</texture>", file("absent.png"));
    let text = format!(
        r#"{SENSOR}<emitter type="area" id="light"><rgb name="radiance" value="3"/></emitter>
        <emitter type="projector"/>
        <shape type="sdfgrid"/><shape type="sdfgrid"/><shape type="ply">{}</shape>
        <shape type="ply">{}</shape>
        <shape type="rectangle"><bsdf type="velvet"/><emitter type="directionalarea"/></shape>
        <shape type="rectangle"><ref id="light"/><bsdf type="diffuse">{texture}</bsdf></shape>
        <shape type="rectangle"><emitter type="area"><texture type="mesh_attribute" name="radiance">
        <string name="name" value="vertex_color"/></texture></emitter></shape>"#,
        file("absent.ply"),
        file("ball.PLY"),
    );
    let scene = loaded(&folder.write("a.xml", document(&text)));
    assert_eq!(scene.geometry.triangles.len(), 1 + 2 + 2 + 2);
    let emission = scene.materials.iter().find_map(|material| material.surface.emission.as_ref());
    assert_eq!(emission.unwrap().radiance, Vec3::splat(3.0));
    for expected in [
        "ignored emitter `projector` (line 6)",
        "ignored shapes of the kind `sdfgrid` (2, first in line 7)",
        "that are not there (2, first in `absent.ply`, line 7)",
        "in another case (`ball.PLY`)",
        "`velvet`, which is diffuse of 0.5 (line 9)",
        "ignored emitter `directionalarea` of a shape (line 9)",
        "ignored emitter `area` of the colours of vertices (line 11)",
    ] {
        let is_named = |text: &&String| text.contains(expected);
        let count = scene.warnings.iter().filter(is_named).count();
        assert_eq!(count, 1, "{expected}: {:#?}", scene.warnings);
    }
    assert_eq!(scene.warnings.len(), 7, "{:#?}", scene.warnings);
}

#[test]
fn images_that_cannot_be_read_leave_the_rest() {
    let folder = Folder::new();
    let image = |name: &str| {
        format!(
            "<shape type=\"rectangle\"><bsdf type=\"diffuse\"><texture type=\"bitmap\" \
             name=\"reflectance\"><string name=\"filename\" value=\"{name}\"/></texture></bsdf></shape>"
        )
    };
    let names = ["../a.png", "/dev/zero", "C:\\a.png", "a.xml", "a.xml"];
    let shapes = names.map(image).concat();
    let scene = loaded(&folder.write("a.xml", document(&format!("{SENSOR}{shapes}"))));
    assert_eq!(scene.materials.len(), names.len());
    for material in &scene.materials {
        assert!(
            matches!(material.kind, MaterialKind::Diffuse { reflectance } if reflectance.x == 0.5)
        );
    }
    let [unreadable, absent] = &scene.warnings[..] else { panic!("{:#?}", scene.warnings) };
    assert!(unreadable.contains("a.xml: expected a PNG, JPEG"), "{unreadable}");
    assert!(absent.contains("that are not there (3, first in `../a.png`, line 5)"), "{absent}");
}

/// Mitsuba 3.9.1 reads the first colour, 0.4, where a colour is asked for, and the second for a number.
#[test]
fn checkerboards_of_numbers_are_the_other_way_round() {
    let board = |name: &str| format!("<texture name=\"{name}\" type=\"checkerboard\"/>");
    let surface = |bsdf: &str| material(bsdf).0.surface;
    let mask = format!("<bsdf type=\"mask\">{}<bsdf type=\"diffuse\"/></bsdf>", board("opacity"));
    let blend = format!(
        "<bsdf type=\"blendbsdf\">{}<bsdf type=\"null\"/><bsdf type=\"diffuse\"/></bsdf>",
        board("weight")
    );
    let principled = format!("<bsdf type=\"principled\">{}</bsdf>", board("roughness"));
    let diffuse = format!("<bsdf type=\"diffuse\">{}</bsdf>", board("reflectance"));
    for (used, expected) in [
        (surface(&mask).opacity.texture, 0.2),
        (surface(&blend).opacity.texture, 0.2),
        (surface(&principled).roughness, 0.2),
        (surface(&diffuse).color, 0.4),
    ] {
        let found = used.unwrap().value(Vec2::splat(0.25)).x;
        assert!((found - expected).abs() < 1e-6, "{found}, expected {expected}");
    }
}

#[test]
fn a_texture_in_a_checkerboard_is_its_mean() {
    let (material, warnings) = material(
        r#"<bsdf type="diffuse"><texture name="reflectance" type="checkerboard">
          <texture name="color0" type="checkerboard"/></texture></bsdf>"#,
    );
    assert!((material.surface.color.unwrap().bias[0] - 0.3).abs() < 1e-6);
    assert!(warnings[0].contains("textures of a `checkerboard`"), "{warnings:?}");
}

/// Values of Mitsuba 3.9.1.
#[test]
fn lights_of_surfaces_shine_whatever_the_surface_is() {
    let light = |bsdf: &str| {
        let (material, warnings) = material(&format!(
            "{bsdf}<emitter type=\"area\"><rgb name=\"radiance\" value=\"3 2 1\"/></emitter>"
        ));
        let Surface { emission, opacity, .. } = material.surface;
        let emitted = opacity.factor * emission.unwrap().radiance;
        let MaterialKind::Diffuse { reflectance } = material.kind else { panic!() };
        (reflectance.x, opacity, emitted, warnings)
    };
    let mask =
        |opacity: &str| format!("<bsdf type=\"mask\">{opacity}<bsdf type=\"diffuse\"/></bsdf>");
    let whole = Vec3::new(3.0, 2.0, 1.0);
    let (reflectance, opacity, emitted, warnings) = light("");
    assert_eq!((reflectance, opacity.factor, emitted), (0.0, 1.0, whole));
    assert!(warnings.is_empty(), "{warnings:?}");
    let (reflectance, opacity, emitted, warnings) = light("<bsdf type=\"null\"/>");
    assert_eq!((reflectance, opacity.factor, emitted), (0.0, 1.0, whole));
    assert!(warnings[0].contains("ignored light of `null`"), "{warnings:?}");
    let quarter = mask(r#"<float name="opacity" value="0.25"/>"#);
    let (reflectance, opacity, emitted, warnings) = light(&quarter);
    assert_eq!((reflectance, opacity.factor, emitted), (0.5, 0.25, whole));
    assert!(warnings.is_empty(), "{warnings:?}");
    let checks = r#"<texture name="opacity" type="checkerboard"/>"#;
    let (_, opacity, _, warnings) = light(&mask(checks));
    assert!(opacity.texture.is_some() && warnings[0].contains("light of"), "{warnings:?}");
}

#[test]
fn a_file_without_a_sensor_is_seen_from_outside() {
    let folder = Folder::new();
    let scene = loaded(&folder.write("a.xml", document("<shape type=\"cube\"/>")));
    assert_eq!((scene.film.width, scene.film.height), (768, 576));
    assert!(scene.warnings[0].contains("no perspective camera; one that frames the bounding box"));
    let away = scene.camera.position.length();
    assert!(away > 3.0_f32.sqrt() && away < 10.0, "{away}");
}

#[test]
fn files_beside_the_folder_need_leave() {
    let folder = Folder::new();
    for name in ["room", "common"] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
    }
    folder.write("common/ball.ply", PLY);
    let shape = |name: &str| {
        format!("<shape type=\"ply\"><string name=\"filename\" value=\"{name}\"/></shape>")
    };
    for content in
        [shape("../common/ball.ply"), format!("<path value=\"../common\"/>{}", shape("ball.ply"))]
    {
        let path = folder.write("room/a.xml", document(&format!("{SENSOR}{content}")));
        let message = Scene::load(&path).unwrap_err().to_string();
        assert!(message.contains("allow its folder by --allow-root"), "{message}");
        let allow_root = Some(folder.path().to_path_buf());
        let scene = loaded_with(&path, LoadOptions { allow_root, ..Default::default() }).unwrap();
        assert!(!scene.geometry.triangles.is_empty() && scene.warnings.is_empty());
    }
    let allow_root = Some(folder.path().join("common"));
    let options = LoadOptions { allow_root, ..Default::default() };
    folder.write("commoner/ball.ply", PLY);
    let whole = folder.path().join("common/ball.ply");
    for (name, is_allowed) in [
        ("../common/ball.ply", true),
        (whole.to_str().unwrap(), true),
        ("../commoner/ball.ply", false),
        ("../common/../commoner/ball.ply", false),
        ("/etc/passwd", false),
        ("", false),
    ] {
        let path = folder.write("room/a.xml", document(&format!("{SENSOR}{}", shape(name))));
        assert_eq!(loaded_with(&path, options.clone()).is_ok(), is_allowed, "{name}");
    }
}

#[test]
fn a_file_asks_for_samples_and_depth() {
    let scene = load(
        r#"<integrator type="aov"><integrator type="volpath"><integer name="maxDepth" value="13"/>
        <integer name="rrDepth" value="7"/></integrator></integrator>
        <sampler type="ldsampler"><integer name="sampleCount" value="256"/></sampler>"#,
    );
    let Asked { samples, depth, roulette_depth } = scene.asked;
    assert_eq!((samples, depth, roulette_depth), (Some(256), Some(12), Some(7)));
    assert_eq!(scene.warnings, [""; 0]);
    let asked = |integrator: &str| load(integrator).asked.depth;
    assert_eq!(asked(r#"<integrator type="direct"/>"#), Some(1));
    let endless = r#"<integrator type="path"><integer name="max_depth" value="-1"/></integrator>"#;
    let unstated = asked(r#"<integrator type="path"/>"#);
    assert_eq!((asked(endless), unstated, asked("")), (Some(64), Some(64), None));
    for (edges, warnings) in [(1, 1), (2, 0)] {
        let integrator = endless.replace("-1", &edges.to_string());
        let scene = load(&integrator);
        assert_eq!((scene.asked.depth, scene.warnings.len()), (Some(1), warnings), "{edges}");
    }
}

/// Radiances of Mitsuba 3.9.1 from the direction of the sun's place at a date.
#[test]
fn daylight_stands_where_mitsuba_has_it() {
    let sky = |parameters: &str, version: &str| {
        let folder = Folder::new();
        let emitter = format!("<emitter type=\"sunsky\">{parameters}</emitter>");
        let text = document(&format!("{SENSOR}{emitter}")).replace("3.0.0", version);
        loaded(&folder.write("a.xml", text)).environment
    };
    let brightest = |map: &fenestra_scene::EnvironmentMap| {
        let of = |index: usize| map.texels[index].element_sum();
        let index = (0..map.texels.len()).max_by(|a, b| of(*a).total_cmp(&of(*b))).unwrap();
        let (width, height) = (map.width as f32, map.height as f32);
        let longitude = ((index % map.width as usize) as f32 + 0.5) / width - 0.5;
        let colatitude = ((index / map.width as usize) as f32 + 0.5) / height;
        let (sine, cosine) = (colatitude * PI).sin_cos();
        let (across, along) = (longitude * 2.0 * PI).sin_cos();
        Vec3::new(sine * across, cosine, -sine * along)
    };
    let upright = r#"<transform name="to_world"><rotate x="1" angle="-90"/></transform>"#;
    let sun = r#"<vector name="sun_direction" value="0.3 0.6 0.5"/>"#;
    let turned = upright.replace("x=\"1\" angle=\"-90\"", "y=\"1\" angle=\"90\"");
    // In version 0.6 the transform turns the sun too.
    for (transform, version, direction) in [
        (upright, "3.0.0", Vec3::new(0.3, 0.6, 0.5)),
        ("", "0.6.0", Vec3::new(0.3, 0.6, 0.5)),
        (&turned, "0.6.0", Vec3::new(0.5, 0.6, -0.3)),
    ] {
        let found = brightest(&sky(&format!("{transform}{sun}"), version));
        assert!(found.dot(direction.normalize()) > 0.9999, "{version}: {found}");
    }
    let found = brightest(&sky(upright, "3.0.0"));
    assert!(found.dot(DEFAULT_SUN) > 0.9999, "{found}");
    let clock = |hour: u32, minute: u32, second: u32| {
        [("hour", hour), ("minute", minute), ("second", second)]
            .map(|(name, value)| format!("<float name=\"{name}\" value=\"{value}\"/>"))
            .concat()
    };
    let found = brightest(&sky(&format!("{upright}{}", clock(14, 30, 1800)), "3.0.0"));
    assert!(found.dot(DEFAULT_SUN) > 0.9999, "{found}: an hour in three parts");
    // One scale is that of both.
    let of_sky = |name: &str, scale: f32| {
        let scales = [(name, scale), ("sun_scale", 0.0)]
            .map(|(name, value)| format!("<float name=\"{name}\" value=\"{value}\"/>"));
        sky(&format!("{upright}{}", scales.concat()), "3.0.0").texels.iter().sum::<Vec3>()
    };
    assert!((of_sky("scale", 2.0) / of_sky("sky_scale", 0.5)).abs_diff_eq(Vec3::splat(4.0), 1e-3));
    let of_sun = |aperture: u32, scale: u32| {
        let numbers = [("sun_aperture", aperture), ("sun_radius_scale", scale)]
            .map(|(name, value)| format!("<float name=\"{name}\" value=\"{value}\"/>"));
        sky(&format!("{upright}{}", numbers.concat()), "3.0.0").texels
    };
    assert!(of_sun(3, 2) == of_sun(6, 1), "half as wide and twice as wide again");
}

/// The zenith of version 0.6 is +Y, and its north −Z, as those of scene files.
#[test]
fn daylight_of_scene_files_is_that_of_mitsuba() {
    let head = "[camera]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov_deg = 60\n";
    for (own, theirs) in [
        (
            "date = [2026, 3, 21], hour = 9.5, timezone = 1, place = [48.14, 11.58], sun_scale = 0.5",
            r#"<integer name="year" value="2026"/><integer name="month" value="3"/>
            <integer name="day" value="21"/><float name="hour" value="9.5"/>
            <float name="timezone" value="1"/><float name="latitude" value="48.14"/>
            <float name="longitude" value="11.58"/><float name="sun_scale" value="0.5"/>"#,
        ),
        (
            "sun_direction = [0.3, 0.6, 0.5], turbidity = 4.5",
            r#"<vector name="sun_direction" value="0.3 0.6 0.5"/>
            <float name="turbidity" value="4.5"/>"#,
        ),
    ] {
        let folder = Folder::new();
        let emitter = format!(
            "<emitter type=\"sunsky\">{theirs}<rgb name=\"albedo\" value=\"0.3\"/></emitter>"
        );
        let text = document(&format!("{SENSOR}{emitter}")).replace("3.0.0", "0.6.0");
        let theirs = loaded(&folder.write("a.xml", text)).environment;
        let text = format!("{head}[environment]\ndaylight = {{ {own} }}\n");
        let own = loaded(&folder.write("b.toml", text)).environment;
        assert!(own.texels == theirs.texels && !own.is_black(), "{own:?}");
    }
}

#[test]
fn bad_files_end_in_one_error_with_file_and_line() {
    let shape = |content: &str| format!("<shape type=\"rectangle\">{content}</shape>");
    let bsdf = |content: &str| shape(&format!("<bsdf type=\"diffuse\">{content}</bsdf>"));
    let deep = "<bsdf type=\"twosided\">".repeat(40) + &"</bsdf>".repeat(40);
    for (content, expected) in [
        (shape("<ref id=\"absent\"/>"), "expected the id of an object, found `absent`"),
        (bsdf("<string name=\"reflectance\" value=\"red\"/>"), "expected a colour, found `string`"),
        (bsdf("<rgb name=\"reflectance\" value=\"2 2 2\"/>"), "expected 0 to 1"),
        (bsdf("<rgb name=\"reflectance\" value=\"$mood\"/>"), "`$mood` has no value"),
        (
            "<emitter type=\"constant\"><blackbody name=\"radiance\" temperature=\"0.5\"/></emitter>"
                .to_owned(),
            "expected 1 to 1e6 kelvins, found 0.5",
        ),
        (
            bsdf("").replace("diffuse\">", "plastic\"><float name=\"int_ior\" value=\"4.1\"/>"),
            "int_ior over ext_ior: expected at most 4, found 4.0",
        ),
        (shape("<integer name=\"flip_normals\" value=\"1\"/>"), "expected an element boolean"),
        (
            "<shape type=\"ply\"><string name=\"filename\" value=\"a.xml\"/></shape>".to_owned(),
            "ply: expected a file in .ply, found `a.xml`",
        ),
        ("<include filename=\"absent.xml\"/>".to_owned(), "the file `absent.xml` is not there"),
        ("<include filename=\"a.xml\"/>".to_owned(), "`a.xml` includes itself"),
        (
            shape(&format!(
                "<transform name=\"to_world\">{}</transform>",
                "<scale value=\"1e38\"/>".repeat(9)
            )),
            "expected finite numbers in the product of its elements",
        ),
        (shape(&deep), "nested deeper than 32"),
        (
            "<bsdf type=\"twosided\" id=\"a\"><ref id=\"a\"/></bsdf>".to_owned()
                + &shape("<ref id=\"a\"/>"),
            "a bsdf contains itself",
        ),
        ("<bsdf type=\"null\" id=\"a\"/><bsdf type=\"null\" id=\"a\"/>".to_owned(), "is taken by"),
        ("<emitter type=\"constant\"/><emitter type=\"constant\"/>".to_owned(), "at most one"),
        (
            "<emitter type=\"envmap\"><rgb name=\"scale\" value=\"1\"/></emitter>".to_owned(),
            "`filename`",
        ),
        ("<shape".to_owned(), "a.xml:"),
    ] {
        let message = refusal(&content);
        assert!(message.contains(expected), "expected {expected:?} in {message:?}");
        assert!(message.contains("a.xml:6:") || content == "<shape", "{message}");
    }
    let folder = Folder::new();
    let room =
        Scene::load(&folder.write("a.xml", "<room version=\"3.0.0\"/>")).unwrap_err().to_string();
    assert!(room.contains("a.xml:1:1: expected the element `scene` of a Mitsuba file"), "{room}");
}

#[test]
fn text_that_would_exhaust_the_program_is_refused_soon() {
    let folder = Folder::new();
    let bomb = "<!DOCTYPE x [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;&a;\">]><scene>&b;</scene>";
    let message = Scene::load(&folder.write("a.xml", bomb)).unwrap_err().to_string();
    assert!(message.contains("a.xml:1:"), "{message}");
    let deep = document(&("<shape>".repeat(500_000) + &"</shape>".repeat(500_000)));
    let message = Scene::load(&folder.write("a.xml", deep)).unwrap_err().to_string();
    assert!(message.contains("nested deeper"), "{message}");
    // Each file includes the next ten times.
    for level in 0..8 {
        let include = format!("<include filename=\"{}.xml\"/>", level + 1);
        folder.write(&format!("{level}.xml"), document(&include.repeat(10)));
    }
    folder.write("8.xml", document("<shape type=\"cube\"/>"));
    let message = Scene::load(&folder.path().join("0.xml")).unwrap_err().to_string();
    assert!(message.contains("files are included"), "{message}");
    // Each default doubles the one before it.
    let mut text = "<default name=\"d0x\" value=\"aaaaaaaa\"/>".to_owned();
    for level in 1..40 {
        let before = format!("$d{}x", level - 1);
        text += &format!("<default name=\"d{level}x\" value=\"{before}{before}\"/>");
    }
    let message = Scene::load(&folder.write("a.xml", document(&text))).unwrap_err().to_string();
    assert!(message.contains("a value of more than 65536 characters"), "{message}");
    let spheres = "<shape type=\"sphere\"><emitter type=\"area\"/></shape>".repeat(3000);
    let message = refusal(&spheres);
    assert!(message.contains("the shapes of a scene may have"), "{message}");
}

#[cfg(unix)]
#[test]
fn pipes_are_no_input() {
    let folder = Folder::new();
    for extension in ["xml", "ply", "obj", "serialized", "png", "exr"] {
        let pipe = folder.path().join(format!("pipe.{extension}"));
        assert!(std::process::Command::new("mkfifo").arg(pipe).status().unwrap().success());
    }
    let of = |kind: &str| format!("<string name=\"filename\" value=\"pipe.{kind}\"/>");
    let mut cases: Vec<String> = ["ply", "obj", "serialized"]
        .map(|kind| format!("<shape type=\"{kind}\">{}</shape>", of(kind)))
        .into();
    cases.push("<include filename=\"pipe.xml\"/>".to_owned());
    cases.push(format!("<emitter type=\"envmap\">{}</emitter>", of("exr")));
    cases.push(format!(
        "<shape type=\"cube\"><bsdf type=\"diffuse\"><texture type=\"bitmap\" \
         name=\"reflectance\">{}</texture></bsdf></shape>",
        of("png")
    ));
    for content in cases {
        let path = folder.write("a.xml", document(&format!("{SENSOR}{content}")));
        // Without an image the rest renders.
        let message = match Scene::load(&path) {
            Ok(scene) if content.contains("png") => scene.warnings[0].clone(),
            loaded => loaded.unwrap_err().to_string(),
        };
        assert!(message.contains("expected a regular file, found a pipe"), "{content}: {message}");
    }
    let message = Scene::load(&folder.path().join("pipe.xml")).unwrap_err().to_string();
    assert!(message.contains("expected a regular file, found a pipe"), "{message}");
}

#[test]
fn widths_and_colours_by_place_are_read() {
    let folder = Folder::new();
    write_image(&folder, "a.png");
    let texture = "<texture type=\"bitmap\" name=\"alpha\"><string name=\"filename\" \
                   value=\"a.png\"/><boolean name=\"raw\" value=\"true\"/></texture>";
    for kind in ["roughplastic", "roughconductor", "roughdielectric"] {
        let text = format!(
            "{SENSOR}<shape type=\"rectangle\"><bsdf type=\"{kind}\"><string \
             name=\"distribution\" value=\"ggx\"/>{texture}</bsdf></shape>"
        );
        let scene = loaded(&folder.write("a.xml", document(&text)));
        assert_eq!(scene.warnings, [""; 0], "{kind}");
        let (MaterialKind::Plastic { alpha, .. }
        | MaterialKind::Conductor { alpha, .. }
        | MaterialKind::Dielectric { alpha, .. }) = scene.materials[0].kind
        else {
            panic!("{kind}")
        };
        assert_eq!(alpha, 1.0);
        let surface = &scene.materials[0].surface;
        let (roots, widths) = (surface.roughness.as_ref().unwrap().values(), {
            let path = folder.path().join("a.png");
            let image = fenestra_scene::texture::Texture::load(&path, &mut Vec::new()).unwrap();
            image.linear_texels(Encoding::Linear)
        });
        // A number of colours is their luminance, as in `eval_1` of Mitsuba's `bitmap`.
        for (root, [red, green, blue, _]) in roots.iter().zip(widths) {
            let width = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
            assert!((root[0] * root[0] - width).abs() < 2e-3, "{root:?} {width}");
        }
    }
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                  property float z\nproperty float r\nproperty float g\nproperty float b\n\
                  element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let corners = "0 0 0 0.25 0.5 1\n1 0 0 0.25 0.5 1\n0 1 0 0.5 0.25 0\n3 0 1 2\n";
    folder.write("a.ply", format!("{header}{corners}"));
    let of = |bsdf: &str| {
        let text = format!(
            "{SENSOR}<shape type=\"ply\"><string name=\"filename\" value=\"a.ply\"/>{bsdf}</shape>"
        );
        loaded(&folder.write("a.xml", document(&text)))
    };
    let colored =
        of("<bsdf type=\"diffuse\"><texture type=\"mesh_attribute\" name=\"reflectance\"/>\
                      </bsdf>");
    assert_eq!(colored.warnings, [""; 0]);
    assert!(colored.materials[0].surface.vertex_color);
    assert_eq!(colored.geometry.colors[2], [0.5, 0.25, 0.0, 1.0]);
    let plain = of("");
    assert!(plain.geometry.colors.is_empty() && plain.warnings.is_empty(), "{:?}", plain.warnings);
    let (mixed, warnings) = material(
        "<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.25\"/><bsdf type=\"diffuse\">\
         <rgb name=\"reflectance\" value=\"1 0 0\"/></bsdf><bsdf type=\"diffuse\"><rgb \
         name=\"reflectance\" value=\"0 0 1\"/></bsdf></bsdf>",
    );
    let MaterialKind::Diffuse { reflectance } = mixed.kind else { panic!() };
    assert_eq!((reflectance, warnings.len()), (Vec3::new(0.75, 0.0, 0.25), 0));
}

/// Exports a scene of `environment`, `clay` and a camera with a lens, and reads both.
fn exported(environment: &str, clay: &str) -> [Scene; 2] {
    let folder = Folder::new();
    let lens = "vertical_fov_deg = 45.0\naperture_radius = 0.05\nfocus_distance = 3.0";
    let text = yard([32, 24], environment, clay, BALL).replace("vertical_fov_deg = 45.0", lens);
    let scene = loaded(&folder.write("scene.toml", text));
    let path = folder.path().join("out/a.xml");
    export(&scene, &path, Settings { depth: 3, samples: 4 }).write().unwrap();
    [scene, loaded(&path)]
}

#[test]
fn our_own_export_comes_back_as_it_was() {
    let sky = "sky = { width = 64, sun_radius_deg = 10.0 }\nrotation_deg = 30.0";
    for (environment, clay) in [
        (sky, "type = \"diffuse\"\nreflectance = [0.5, 0.25, 0.125]"),
        (
            "constant = [1, 2, 3]",
            "type = \"plastic\"\ndiffuse = [0.5, 0.2, 0.1]\nalpha = 0.2\nior = 1.33",
        ),
        (sky, "type = \"conductor\"\nalpha = 0.3\neta = [0.2, 0.9, 1.1]\nk = [3.9, 2.4, 2.1]"),
    ] {
        let [ours, read] = exported(environment, clay);
        assert_eq!(read.warnings, [""; 0]);
        assert_eq!((read.asked.depth, read.asked.samples), (Some(3), Some(4)));
        assert_eq!((read.film, read.lamps.len()), (ours.film, 0));
        let (camera, expected) = (read.camera, ours.camera);
        assert_close(camera.position, expected.position);
        let forward = (expected.look_at - expected.position).normalize();
        assert_close((camera.look_at - camera.position).normalize(), forward);
        let right = forward.cross(expected.up).normalize();
        assert_close(forward.cross(camera.up).normalize(), right);
        assert!((camera.vertical_fov_deg - expected.vertical_fov_deg).abs() < 1e-4);
        assert_eq!(camera.aperture_radius, expected.aperture_radius);
        assert_eq!(camera.focus_distance, expected.focus_distance);
        assert_eq!(read.environment.width, ours.environment.width);
        assert_eq!(read.environment.height, ours.environment.height);
        assert_eq!(read.environment.texels, ours.environment.texels);
        let turn = read.environment.rotation_rad - ours.environment.rotation_rad;
        assert!(turn.abs() < 1e-5 || (turn.abs() - 2.0 * PI).abs() < 1e-5, "{turn}");
        // The export has one mesh for each material.
        let corners = |scene: &Scene| {
            let mut corners: Vec<_> = scene
                .geometry
                .triangles
                .iter()
                .map(|triangle| {
                    triangle.map(|at| {
                        let at = at as usize;
                        let bits = |vector: [f32; 3]| vector.map(f32::to_bits);
                        (bits(scene.geometry.positions[at]), bits(scene.geometry.normals[at]))
                    })
                })
                .collect();
            corners.sort_unstable();
            corners
        };
        assert_eq!(corners(&read), corners(&ours));
        assert_eq!(read.materials.len(), 1);
        let numbers = |scene: &Scene| scene.materials[0].kind.parameters().2.concat();
        let pairs = numbers(&read).into_iter().zip(numbers(&ours));
        pairs.for_each(|(read, ours)| assert!((read - ours).abs() < 1e-6, "{read} {ours}"));
        assert_eq!(read.materials[0].surface, ours.materials[0].surface);
    }
}

#[test]
fn environments_turn_as_in_mitsuba() {
    let [ours, _] = exported(
        "sky = { width = 64, sun_radius_deg = 10.0 }\nrotation_deg = 30.0",
        "type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]",
    );
    let folder = Folder::new();
    // A map that is not of our own export, turned by a matrix and then by the other way of saying it.
    let mut image = fenestra_scene::picture::Image::new(64, 32);
    let texels: Vec<_> = ours.environment.texels.iter().map(|texel| texel.to_array()).collect();
    image.insert_triple(["R", "G", "B"], &texels);
    image.write_exr(&folder.path().join("sky map.exr")).unwrap();
    let load = |turn: &str| {
        let text = format!(
            "{SENSOR}<emitter type=\"envmap\"><string name=\"filename\" value=\"sky map.exr\"/>\
             <float name=\"scale\" value=\"2\"/><transform name=\"to_world\">{turn}</transform></emitter>"
        );
        loaded(&folder.write("a.xml", document(&text)))
    };
    let plain = load("");
    assert_eq!((plain.environment.width, plain.environment.height), (64, 62));
    assert!((plain.environment.rotation_rad - PI).abs() < 1e-6);
    // Mitsuba's +Z is the middle of the image, between two rows and two columns.
    let middle: f32 = [(15, 31), (15, 32), (16, 31), (16, 32)]
        .map(|(row, column)| ours.environment.texels[row * 64 + column].x)
        .iter()
        .sum();
    let found = plain.environment.radiance(Vec3::Z).x;
    assert!((found / (0.5 * middle) - 1.0).abs() < 1e-3, "{found}, {middle}");
    let quarter =
        load(r#"<matrix value="-4.37114e-008 0 1 0 0 1 0 0 -1 0 -4.37114e-008 0 0 0 0 1"/>"#);
    let tilted = load(r#"<rotate x="1" angle="90"/>"#);
    assert!(tilted.warnings[0].contains("resampled"), "{:?}", tilted.warnings);
    let mirrored = load(r#"<scale x="-1"/>"#);
    assert!(mirrored.warnings[0].contains("resampled"), "{:?}", mirrored.warnings);
    assert_eq!(quarter.warnings, [""; 0]);
    for direction in
        [Vec3::new(0.3, 0.2, 0.9), Vec3::new(-0.5, 0.7, 0.1), Vec3::new(0.1, -0.9, -0.4)]
    {
        let direction = direction.normalize();
        let expected = plain.environment.radiance(direction);
        // A quarter turn about +Y takes +Z to +X; one about +X takes +Y to +Z.
        let turned = Vec3::new(direction.z, direction.y, -direction.x);
        assert!(quarter.environment.radiance(turned).abs_diff_eq(expected, 1e-4));
        let turned = Vec3::new(direction.x, -direction.z, direction.y);
        let image = Vec3::new(-direction.x, direction.y, direction.z);
        for (map, direction) in [(&tilted, turned), (&mirrored, image)] {
            let found = map.environment.radiance(direction);
            let error = found.distance(expected);
            assert!(error < 0.1 * expected.max_element(), "{found}, {expected}");
        }
    }
}

/// Folder of scenes from elsewhere, which a checkout may lack.
fn imports() -> Option<std::path::PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/import/mitsuba");
    folder.is_dir().then_some(folder)
}

#[test]
fn real_scenes_load() {
    let Some(folder) = imports() else {
        eprintln!("SKIPPED: no folder of real scenes");
        return;
    };
    for name in ["scene.xml", "scene_mi3.xml"] {
        let scene = loaded(&folder.join("living-room").join(name));
        assert_eq!((scene.film.width, scene.film.height), (1280, 720));
        assert_eq!(scene.materials.len(), 19);
        let named = |part: &str| scene.warnings.iter().any(|warning| warning.contains(part));
        assert_eq!(scene.asked.depth, Some(64));
        assert!(!named("integrator") && !named("`high_quality_edges`"));
        let leaves = scene.materials.iter().find(|material| material.name == "Leaves").unwrap();
        assert!(leaves.surface.opacity.texture.is_some() && leaves.surface.color.is_some());
        assert!(leaves.surface.two_sided);
        assert!(scene.environment.width > 64 && scene.lamps.is_empty());
        assert!((scene.environment.rotation_rad - 1.5 * PI).abs() < 1e-5);
        eprintln!("{name}: {} triangles, {:#?}", scene.geometry.triangles.len(), scene.warnings);
    }
    let scene = loaded(&folder.join("staircase2/scene.xml"));
    let lights = scene.materials.iter().filter(|material| material.surface.emission.is_some());
    assert_eq!(lights.count(), 13);
    eprintln!("staircase2: {} triangles, {:#?}", scene.geometry.triangles.len(), scene.warnings);
}

#[test]
fn a_real_environment_has_the_radiance_of_mitsuba() {
    let Some(imports) = imports() else {
        eprintln!("SKIPPED: no folder of real scenes");
        return;
    };
    let folder = Folder::new();
    let sky = imports.join("living-room/textures/Sky 19.exr");
    std::fs::copy(sky, folder.path().join("Sky 19.exr")).unwrap();
    let quarter = r#"<matrix value="-4.37114e-008 0 1 0 0 1 0 0 -1 0 -4.37114e-008 0 0 0 0 1"/>"#;
    // Radiance of Mitsuba 3.9.1 from two directions.
    for (turn, expected, within) in [
        ("", [[34.34028, 22.045317, 10.458131], [15.917794, 9.753819, 6.5390625]], 0.02),
        (quarter, [[21.822693, 17.34849, 9.476674], [2.3509755, 4.396645, 5.3459525]], 0.02),
        (
            r#"<rotate x="1" angle="90"/>"#,
            [[4.646995, 3.9887207, 3.8245702], [29.462254, 18.335894, 6.9594727]],
            0.1,
        ),
    ] {
        let text = format!(
            "{SENSOR}<emitter type=\"envmap\"><string name=\"filename\" value=\"Sky 19.exr\"/>\
             <transform name=\"toWorld\">{turn}</transform></emitter>"
        );
        let scene = loaded(&folder.write("a.xml", document(&text)));
        let directions = [Vec3::new(0.3, 0.2, 0.9), Vec3::new(-0.5, 0.7, 0.1)];
        for (direction, expected) in directions.into_iter().zip(expected.map(Vec3::from)) {
            let found = scene.environment.radiance(direction.normalize());
            let ratio = found / expected;
            assert!(ratio.abs_diff_eq(Vec3::ONE, within), "{turn}: {found}, expected {expected}");
        }
    }
}

/// Each parameter, alone in place of `@`, makes a scene that no other parameter of its value makes; those
/// after `;` state defaults of Mitsuba, and change nothing.
#[test]
fn every_parameter_counts_and_none_for_another() {
    let surface = |kind: &str| {
        format!("{SENSOR}<shape type=\"rectangle\"><bsdf type=\"{kind}\">@</bsdf></shape>")
    };
    let shape = |kind: &str| format!("{SENSOR}<shape type=\"{kind}\">@</shape>");
    let emitter = |kind: &str| format!("{SENSOR}<emitter type=\"{kind}\">@</emitter>");
    let masks = r#"<bsdf type="mask"><float name="opacity" value="0.3"/><bsdf type="mask">@
        <bsdf type="diffuse"/></bsdf></bsdf>"#;
    let medium = r#"<bsdf type="dielectric"/><medium name="interior" type="homogeneous">
        <float name="albedo" value="0"/>@</medium>"#;
    let groups = [
        (
            r#"<sensor type="thinlens"><float name="aperture_radius" value="0.1"/>@</sensor>"#
                .to_owned(),
            "float fov 50|string focal_length 70mm|float focus_distance 3|\
             float principal_point_offset_x 0.1|float principal_point_offset_y 0.1",
        ),
        (
            r#"<sensor type="perspective"><film type="hdrfilm">@</film></sensor>"#.to_owned(),
            "integer width 500|integer height 500|integer crop_width 500|integer crop_height 500;\
             integer width 768|integer height 576|integer crop_offset_x 0",
        ),
        (
            r#"<sensor type="perspective"><film type="hdrfilm"><integer name="crop_width" value="500"/>
            <integer name="crop_height" value="500"/>@</film></sensor>"#
                .to_owned(),
            "integer crop_offset_x 30|integer crop_offset_y 30",
        ),
        (surface("diffuse"), "float reflectance .3;float reflectance .5"),
        (
            surface("roughconductor"),
            "float alpha .3|float eta .3|float k .3|string material Ag|\
             float specular_reflectance .3|string distribution ggx;float alpha .1|\
             float specular_reflectance 1|string distribution beckmann|float ext_eta 1.000277",
        ),
        (
            surface("conductor").replace('@', "<string name=\"material\" value=\"Ag\"/>@"),
            "float ext_eta 1.3|float specular_reflectance .3;float specular_reflectance 1",
        ),
        (
            surface("roughplastic"),
            "float alpha .3|float int_ior 1.3|float ext_ior 1.3|float diffuse_reflectance .3|\
             boolean nonlinear true|string distribution ggx;float alpha .1|float int_ior 1.49|\
             float ext_ior 1.000277|float diffuse_reflectance .5|float specular_reflectance 1|\
             boolean nonlinear false|string distribution beckmann",
        ),
        (
            surface("plastic"),
            "float int_ior 1.3|float ext_ior 1.3|float diffuse_reflectance .3|boolean nonlinear true;\
             string int_ior polypropylene|string ext_ior air|\
             float diffuse_reflectance .5|boolean nonlinear false",
        ),
        (
            surface("roughdielectric"),
            "float alpha .3|float int_ior 1.3|float ext_ior 1.3|float specular_reflectance .3|\
             float specular_transmittance .3|string distribution ggx;float alpha .1|float int_ior 1.5046|\
             string ext_ior air|float specular_reflectance 1|float specular_transmittance 1",
        ),
        (
            surface("thindielectric"),
            "float int_ior 1.3|float ext_ior 1.3|float specular_reflectance .3|\
             float specular_transmittance .3;string int_ior bk7|float specular_transmittance 1",
        ),
        (
            surface("principled"),
            "float base_color .3|float roughness .3|float metallic .3|float anisotropic .3|\
             float clearcoat .3|float eta 1.3|float specular .3|float spec_trans .6;float base_color .5|\
             float roughness .5|float metallic 0|float anisotropic 0|float clearcoat 0|float specular .5|\
             float spec_trans 0|float spec_tint 0|float sheen 0|float sheen_tint 0|float flatness 0",
        ),
        (
            surface("principledthin"),
            "float base_color .3|float diff_trans .3;float base_color .5|float roughness .5|\
             float diff_trans 0",
        ),
        (surface("mask").replace('@', "@<bsdf type=\"diffuse\"/>"), "float opacity .3;float opacity .5"),
        (
            surface("diffuse").replace("<bsdf type=\"diffuse\">@</bsdf>", masks),
            "float opacity .3|float opacity .6",
        ),
        (
            surface("diffuse").replace("<bsdf type=\"diffuse\">@</bsdf>", medium),
            "float sigma_t .3|float scale .5;float scale 1",
        ),
        (emitter("point"), "point position 1,0,0|rgb intensity 1,2,3;point position 0,0,0|float intensity 1"),
        (
            emitter("spot"),
            "rgb intensity 1,2,3|float cutoff_angle 10|float beam_width 10;float cutoff_angle 20|\
             float beam_width 15",
        ),
        (emitter("directional"), "vector direction 1,0,0|rgb irradiance 1,2,3;vector direction 0,0,1"),
        (emitter("constant"), "rgb radiance 1,2,3;float radiance 1"),
        (
            shape("rectangle").replace('@', "<emitter type=\"area\">@</emitter>"),
            "rgb radiance 1,2,3|float radiance 2",
        ),
        (
            shape("sphere"),
            "float radius 2|point center 0,0,2|boolean flip_normals true;float radius 1|\
             point center 0,0,0",
        ),
        (
            shape("cylinder"),
            "float radius 2|point p0 0,0,.5|point p1 0,0,.5|boolean flip_normals true;float radius 1|\
             point p0 0,0,0|point p1 0,0,1|boolean flip_normals false",
        ),
        (shape("disk"), "boolean flip_normals true"),
        (
            surface("diffuse")
                .replace('@', "<texture name=\"reflectance\" type=\"checkerboard\">@</texture>"),
            "float color0 .3|float color1 .3|float uscale .3|float vscale .3|float uoffset .3|\
             float voffset .3|float uvscale .3;float color0 .4|float color1 .2",
        ),
    ];
    for (text, parameters) in groups {
        let folder = Folder::new();
        let read = |parameter: &str| {
            let stated = parameter.trim().splitn(3, ' ').collect::<Vec<_>>();
            let stated = <[_; 3]>::try_from(stated).map_or(String::new(), |[tag, name, value]| {
                format!("<{tag} name=\"{name}\" value=\"{value}\"/>")
            });
            loaded(&folder.write("a.xml", document(&text.replace('@', &stated))))
        };
        assert_each_counts(&text, parameters, read);
    }
}
