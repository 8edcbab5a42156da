//! Scene files and meshes, and the messages that a user reads.

#![expect(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    collections::HashSet,
    f32::consts::FRAC_PI_2,
    path::{Path, PathBuf},
    sync::Arc,
};

use fenestra_scene::{
    Error, Scene, export, geometry_hash,
    instance::Instance,
    lamp::{LampKind, Spot, SpotFalloff},
    light_group::LightGroups,
    load::{Arrays, LoadOptions},
    material::{
        Anisotropy, ConductorFresnel, Distribution, Emission, MaterialKind, Principled, Surface,
    },
    mesh::Mesh,
    picture::{Image, RgbImage},
    still_hash,
    texture::{Channels, Encoding, Interpolation, Texels, Texture, TextureUse, Wrap},
    transform::Transform,
};
use glam::Vec3;

use crate::support::{
    assert_contains,
    folder::{self, Folder},
    gltf::{Attribute, base64, floats, gltf, gltf_of, png},
    seeds::glb,
};

const HEAD: &str = r#"
[camera]
position = [0, 1, 5]
look_at = [0, 1, 0]
vertical_fov_deg = 40

[environment]
constant = [1, 1, 1]

[[material]]
name = "grey"
type = "diffuse"
reflectance = [0.5, 0.5, 0.5]
"#;

fn load(folder: &Folder, text: &str) -> Result<Scene, Error> {
    Scene::load(&folder.write("room.toml", text))
}

/// Returns the message without the folder.
fn message(folder: &Folder, text: &str) -> String {
    strip(folder, &load(folder, text).expect_err("the scene must be refused"))
}

fn mesh_message(folder: &Folder, name: &str, bytes: impl AsRef<[u8]>) -> String {
    let path = folder.write(name, bytes);
    strip(folder, &Mesh::read(&path, &mut Vec::new()).expect_err("the mesh must be refused"))
}

fn strip(folder: &Folder, error: &Error) -> String {
    error.to_string().replace(&format!("{}/", folder.path().display()), "")
}

fn with_box(extra: &str) -> String {
    format!("{HEAD}[[object]]\nshape = \"box\"\nsize = [1, 1, 1]\nmaterial = \"grey\"\n{extra}\n")
}

fn read(folder: &Folder, name: &str, bytes: impl AsRef<[u8]>) -> Mesh {
    Mesh::read(&folder.write(name, bytes), &mut Vec::new()).unwrap()
}

// Arrays

#[test]
fn arrays_stand_for_files() {
    let quad = Mesh {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
        uvs: [vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], Vec::new()],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let pixels: Vec<[f32; 3]> = (0..8_u8).map(|index| [f32::from(index) * 0.125; 3]).collect();
    let image = RgbImage { width: 4, height: 2, pixels };
    let text = format!(
        "{HEAD}[[material]]\nname = \"print\"\ntype = \"diffuse\"\nreflectance = {{ texture = \"a.exr\" }}\n\
         [[object]]\nmesh = \"a.obj\"\nmaterial = \"print\"\n"
    )
    .replace("constant = [1, 1, 1]", "map = \"a.exr\"");
    let folder = Folder::new();
    let obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
               f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
    folder.write("a.obj", obj);
    Image::of_rgb(4, 2, &image.pixels).write_exr(&folder.path().join("a.exr")).unwrap();
    let files = load(&folder, &text).unwrap();

    let (mesh, name) = (PathBuf::from("a.obj"), PathBuf::from("a.exr"));
    let images = [(name, image)].into();
    let arrays = Arrays { meshes: [(mesh.clone(), quad.clone())].into(), images };
    let parse = |arrays: &Arrays| {
        let path = Path::new("nowhere/room");
        Scene::parse_with(path, &text, &LoadOptions::default(), arrays)
    };
    let scene = parse(&arrays).unwrap();
    assert_eq!(scene.hash, files.hash);
    assert_eq!(scene.inputs, [Path::new("nowhere/room")]);
    // Colours of vertices count where the material says so.
    let colors = vec![[0.5, 0.25, 0.125, 1.0]; 4];
    let meshes = [(mesh.clone(), Mesh { colors, ..quad.clone() })].into();
    let painted = Arrays { meshes, images: arrays.images.clone() };
    let scene = parse(&painted).unwrap();
    assert!(scene.geometry.colors.is_empty() && scene.warnings[0].contains("the vertex colours"));
    let colored = text.replace("name = \"print\"", "name = \"print\"\nvertex_color = true");
    let path = Path::new("nowhere/room");
    let scene = Scene::parse_with(path, &colored, &LoadOptions::default(), &painted).unwrap();
    assert!(scene.geometry.colors.len() == 4 && scene.warnings.is_empty(), "{:?}", scene.warnings);
    let meshes = [(mesh, Mesh { uvs: [vec![[0.0; 2]], Vec::new()], ..quad })].into();
    let message = parse(&Arrays { meshes, ..arrays }).unwrap_err().to_string();
    assert!(message.ends_with("uvs: expected one for each of 4 positions, found 1"), "{message}");
}

/// A colour above 1 is cut off, and is said so.
#[test]
fn images_above_one_are_named() {
    let folder = Folder::new();
    let image = |largest: f32| {
        let pixels = [[0.5, 0.0, largest], [0.25; 3]];
        Image::of_rgb(2, 1, &pixels).write_exr(&folder.path().join("a.exr")).unwrap();
    };
    let warnings = |factor: f32| {
        let used = format!("{{ texture = \"a.exr\", factor = {factor} }}");
        load(&folder, &HEAD.replace("[0.5, 0.5, 0.5]", &used)).unwrap().warnings
    };
    image(4.0);
    assert_eq!(warnings(0.25), Vec::<String>::new());
    assert_contains(&warnings(0.5).concat(), &["cut off in 1 of 1 materials: `grey` has 2"]);
    image(1.0);
    assert_eq!(warnings(1.0), Vec::<String>::new());
}

// Scene files

/// Compositors know objects by the names of a scene, or of a file that is one or is included.
#[test]
fn objects_keep_their_names() {
    let folder = Folder::new();
    let faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\no seat\nf 1 2 3\ng nothing\no back\nf 3 2 1\nf 1 3 2\n";
    folder.write("chair.obj", faces);
    let names = |scene: &Scene| {
        let starts = scene.geometry.objects.iter();
        starts.map(|start| (start.name.clone(), start.first_triangle)).collect::<Vec<_>>()
    };
    let chair = Scene::load(&folder.path().join("chair.obj")).unwrap();
    assert_eq!(names(&chair), [("seat".to_owned(), 0), ("back".to_owned(), 1)]);
    let text = with_box(
        "name = \"crate\"\n[[object]]\nmesh = \"chair.obj\"\nmaterial = \"grey\"\n\
         [[include]]\nfile = \"chair.obj\"",
    );
    let found = names(&load(&folder, &text).unwrap());
    assert_eq!(found[0], ("crate".to_owned(), 0), "{found:?}");
    assert!(found[1].0.starts_with("object 1 (chair.obj"), "the object is one: {found:?}");
    assert_eq!(
        found[2..].iter().map(|start| &*start.0).collect::<Vec<_>>(),
        ["chair/seat", "chair/back"]
    );
}

#[test]
fn defaults_are_those_of_the_format() {
    let folder = Folder::new();
    let scene = load(&folder, &with_box("")).unwrap();
    assert_eq!(scene.name, "room");
    assert_eq!(scene.camera.up, Vec3::Y);
    assert_eq!((scene.film.width, scene.film.height), (640, 480));
    assert_eq!(scene.film.filter, fenestra_scene::Filter::Gaussian);
    assert_eq!(scene.geometry.triangles.len(), 12);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn a_camera_that_is_moved_alone_keeps_its_direction() {
    let folder = Folder::new();
    let path = folder.write("room.toml", with_box(""));
    let options = LoadOptions { look_from: Some([2.0, 3.0, 9.0]), ..LoadOptions::default() };
    let camera = Scene::load_with(&path, &options).unwrap().camera;
    assert_eq!((camera.position, camera.look_at), ([2.0, 3.0, 9.0].into(), [2.0, 3.0, 4.0].into()));
}

#[test]
fn a_camera_that_is_told_whole_is_no_warning() {
    let folder = Folder::new();
    let path = folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let scene = Scene::load(&path).unwrap();
    let camera = &scene.camera;
    let mut options = LoadOptions {
        look_from: Some(camera.position.into()),
        look_at: Some(camera.look_at.into()),
        vertical_fov_deg: Some(camera.vertical_fov_deg),
        ..LoadOptions::default()
    };
    let lacking = |text: &String| text.contains("no perspective camera; one that frames");
    let told = Scene::load_with(&path, &options).unwrap();
    assert_eq!(told.hash, scene.hash);
    let others: Vec<_> = scene.warnings.iter().filter(|text| !lacking(text)).collect();
    assert_eq!(told.warnings.iter().collect::<Vec<_>>(), others);
    options.vertical_fov_deg = None;
    assert!(Scene::load_with(&path, &options).unwrap().warnings.iter().any(lacking));
}

#[test]
fn materials_take_every_form() {
    let folder = Folder::new();
    let text = format!(
        "{HEAD}
        [[material]]
        name = \"coat\"
        type = \"plastic\"
        diffuse = [0.1, 0.2, 0.3]
        roughness = 0.5
        [[material]]
        name = \"gold\"
        type = \"conductor\"
        alpha = 0.1
        eta = [0.14, 0.37, 1.44]
        k = [3.98, 2.38, 1.6]
        reflectance = [0.9, 0.8, 0.7]
        [[material]]
        name = \"steel\"
        type = \"conductor\"
        alpha = 0.2
        reflectance = [0.5, 0.5, 0.6]"
    );
    let scene = load(&folder, &text).unwrap();
    let kinds: Vec<_> = scene.materials.iter().map(|material| &material.kind).collect();
    assert!(matches!(kinds[1], MaterialKind::Plastic { alpha, ior, .. }
        if *alpha == 0.25 && *ior == 1.5));
    let MaterialKind::Conductor { fresnel, .. } = kinds[2] else { unreachable!() };
    let expected = ConductorFresnel::Exact {
        reflectance: Vec3::new(0.9, 0.8, 0.7),
        eta: Vec3::new(0.14, 0.37, 1.44),
        k: Vec3::new(3.98, 2.38, 1.6),
    };
    assert_eq!(*fresnel, expected);
    assert!(matches!(
        kinds[3],
        MaterialKind::Conductor { fresnel: ConductorFresnel::Schlick { .. }, .. }
    ));
}

#[test]
fn a_file_called_scene_is_named_after_its_folder() {
    let folder = Folder::new();
    let path = folder.write("gallery/scene.toml", HEAD);
    assert_eq!(Scene::load(&path).unwrap().name, "gallery");
}

#[test]
fn a_scene_without_objects_has_a_material_and_no_triangles() {
    let folder = Folder::new();
    let text = HEAD.split("[[material]]").next().unwrap();
    let scene = load(&folder, text).unwrap();
    assert_eq!(scene.materials.len(), 1);
    assert!(scene.geometry.triangles.is_empty());
}

#[test]
fn transforms_scale_turn_and_shift_in_this_order() {
    let folder = Folder::new();
    let scene = load(
        &folder,
        &with_box("scale = [2, 1, 1]\nrotate_deg = [0, 90, 0]\ntranslate = [10, 0, 0]"),
    )
    .unwrap();
    let bounds = |axis: usize| {
        let values = scene.geometry.positions.iter().map(|position| position[axis]);
        values.fold((f32::MAX, f32::MIN), |(low, high), value| (low.min(value), high.max(value)))
    };
    assert_eq!((bounds(0), bounds(1), bounds(2)), ((9.5, 10.5), (-0.5, 0.5), (-1.0, 1.0)));
}

#[test]
fn one_mesh_used_twice_is_placed_twice() {
    let folder = Folder::new();
    folder.write("meshes/corner.ply", ascii_ply("3 0 1 2"));
    let object = "[[object]]\nmesh = \"meshes/corner.ply\"\nmaterial = \"grey\"\n";
    let scene =
        load(&folder, &format!("{HEAD}{object}scale = 2\n{object}scale = [-1, 1, 1]")).unwrap();
    assert_eq!(scene.geometry.positions.len(), 8);
    assert_eq!(scene.geometry.triangles, [[0, 1, 2], [4, 6, 5]]);
    assert_eq!(scene.geometry.positions[1], [2.0, 0.0, 0.0]);
}

#[test]
fn text_that_is_no_scene_is_refused_with_line_and_column() {
    let folder = Folder::new();
    let case = |text: &str, expected: &str| {
        assert_contains(&message(&folder, text), &[expected]);
    };
    case("[camera\n", "room.toml:1:8: ");
    case(
        &format!("{HEAD}[lamps]\n"),
        "room.toml:14:2: unknown key `lamps` in the scene, expected one of `camera`, `film`, \
         `environment`, `lamp`, `portal`, `material`, `object`, `include`",
    );
    case(
        &HEAD.replace("look_at", "lookat"),
        "room.toml:4:1: unknown field `lookat`, expected one of `position`, `look_at`, `up`, \
         `vertical_fov_deg`, `aperture_radius`, `focus_distance`",
    );
    case(
        &HEAD.replace("vertical_fov_deg = 40", ""),
        "room.toml:2:1: missing field `vertical_fov_deg`",
    );
    case(
        &HEAD.replace("[0, 1, 5]", "[0, 1]"),
        "room.toml:3:12: invalid length 2, expected an array of length 3",
    );
    case(
        &HEAD.replace("[0, 1, 5]", "[0, \"1\", 5]"),
        "room.toml:3:16: invalid type: string \"1\", expected f32",
    );
    case(
        &HEAD.replace("\"diffuse\"", "\"metal\""),
        "room.toml:12:8: unknown material type `metal`, expected one of `diffuse`, \
         `diffuse_transmission`, `plastic`, `conductor`, `principled`, `mirror`, `dielectric`, \
         `thin_dielectric`, `measured`",
    );
    let bright = "\"diffuse_transmission\"\ntransmittance = [0.25, 0.75, 0.5]";
    case(
        &HEAD.replace("\"diffuse\"", bright),
        "reflectance and transmittance: expected a sum of at most 1, found 1.25",
    );
    case(
        &HEAD.replace("reflectance", "color"),
        "room.toml:13:1: unknown key `color` in material `grey` of type `diffuse`, expected one \
         of `name`, `type`, `normal`, `anisotropy`, `anisotropy_rotate_deg`, `distribution`, `opacity`, \
         `opacity_cutoff`, `emission`, `emission_two_sided`, `two_sided`, `vertex_color`, `reflectance`",
    );
    let both = "\"principled\"\nbase_color = [1, 1, 1]\nroughness = 1\ncoat_weight = 1\n\
                sheen_color = [1, 0, 0]";
    let covered = HEAD.replace("reflectance = [0.5, 0.5, 0.5]", "").replace("\"diffuse\"", both);
    case(&covered, "material `grey` (line 10): expected a coat or a sheen, found both");
    case(
        &HEAD.replace("reflectance", "distribution = \"beckmann\"\nreflectance"),
        "distribution is for conductor, plastic and dielectric materials",
    );
    case(
        &HEAD.replace("reflectance", "anisotropy = 0.5\nreflectance"),
        "anisotropy is for conductor and principled materials",
    );
    case(
        &HEAD.replace("reflectance = [0.5, 0.5, 0.5]", ""),
        "material `grey` of type `diffuse`: missing field `reflectance`",
    );
    case(
        &format!("{HEAD}[film]\nfilter = \"tent\"\n"),
        "room.toml:15:10: unknown variant `tent`, expected `box` or `gaussian`",
    );
    case(
        &format!("{HEAD}[film]\nwidth = -5\n"),
        "room.toml:15:9: invalid value: integer `-5`, expected u32",
    );
    case(
        &with_box("radius = 2"),
        "room.toml:18:1: unknown key `radius` in object of shape `box`, expected one of `name`, \
         `mesh`, `shape`, `material`, `scale`, `rotate_deg`, `translate`, `light_group`, `size`, \
         `bevel`, `bevel_segments`",
    );
    case(
        &with_box("").replace("\"box\"", "\"cube\""),
        "room.toml:15:9: unknown shape `cube`, expected one of `box`, `sphere`",
    );
    case(&with_box("mesh = \"a.ply\""), "needs exactly one of `mesh` and `shape`, found both");
    case(
        &with_box("").replace("shape = \"box\"", ""),
        "needs exactly one of `mesh` and `shape`, found neither",
    );
    case(
        &with_box("scale = \"big\""),
        "room.toml:18:9: invalid type: string \"big\", expected a number or an array of three numbers",
    );
    case(
        &with_box("scale = [1, 2]"),
        "room.toml:18:9: invalid length 2, expected an array of length 3",
    );
    case(&format!("{HEAD}object = 3\n"), "room.toml:14:1: ");
    case(
        &HEAD.replace("[[material]]", "[material]"),
        "expected an array of tables, `[[material]]`",
    );
    case(
        &HEAD.replace("constant = [1, 1, 1]", "court = { wide = 3 }"),
        "room.toml:8:11: unknown field `wide`, expected one of ",
    );
}

#[test]
fn numbers_that_cannot_be_rendered_are_refused_by_name() {
    let folder = Folder::new();
    let case = |text: &str, expected: &str| {
        assert_contains(&message(&folder, text), &[expected]);
    };
    let set = |from: &str, to: &str| HEAD.replace(from, to);
    case(
        &set("= 40", "= 0"),
        "camera.vertical_fov_deg: expected a number from 0.01 to 179, found 0",
    );
    case(&set("= 40", "= 180"), "camera.vertical_fov_deg");
    case(
        &set("= 40", "= nan"),
        "camera.vertical_fov_deg: expected a number from 0.01 to 179, found NaN",
    );
    case(
        &set("= 40", "= 40\nshift = [0, -2e5]"),
        "camera.shift: expected a number from -100000 to",
    );
    case(&set("[0, 1, 5]", "[0, inf, 5]"), "camera.position: expected a finite number, found inf");
    case(
        &set("[0, 1, 5]", "[0, 1e300, 5]"),
        "camera.position: expected a finite number, found inf",
    );
    case(&set("[0, 1, 5]", "[0, 1, 0]"), "camera.position and camera.look_at must differ");
    case(&set("= 40", "= 40\nup = [0, 0, 2]"), "camera.up must not be zero or along the view");
    case(&set("= 40", "= 40\nup = [0, 0, 0]"), "camera.up must not be zero");
    case(
        &set("= 40", "= 40\naperture_radius = 0.1"),
        "camera.aperture_radius needs camera.focus_distance",
    );
    case(&set("= 40", "= 40\nfocus_distance = 0"), "camera.focus_distance");
    case(&format!("{HEAD}[film]\nwidth = 0"), "film.width: expected 1 to 16384 pixels, found 0");
    case(
        &format!("{HEAD}[film]\nheight = 100000"),
        "film.height: expected 1 to 16384 pixels, found 100000",
    );
    case(
        &set("constant = [1, 1, 1]", ""),
        "environment: expected exactly one of map, constant, court, sky, daylight, found none",
    );
    case(&set("[1, 1, 1]", "[1, 1, 1]\nmap = \"a.hdr\""), "found map and constant");
    case(
        &set("[1, 1, 1]", "[1, -1, 1]"),
        "environment.constant: expected a finite number of at least 0, found -1",
    );
    case(&set("[1, 1, 1]", "[1, 1, 1]\nscale = -1"), "environment.scale");
    case(
        &set("[1, 1, 1]", "[1, 1, 1]\nrotation_deg = nan"),
        "environment.rotation_deg: expected a finite number, found NaN",
    );
    case(&set("constant = [1, 1, 1]", "map = \"missing.hdr\""), "missing.hdr: cannot read");
    case(
        &set("[0.5, 0.5, 0.5]", "[0.5, -0.5, 0.5]"),
        "material `grey` (line 10): reflectance: expected a number from 0 to 1, found -0.5",
    );
    case(&set("[0.5, 0.5, 0.5]", "[0.5, 1.5, 0.5]"), "found 1.5");
    case(
        &format!("{HEAD}{}", &HEAD[HEAD.find("[[material]]").unwrap()..]),
        "material `grey` (line 14): the name is taken by the material of line 10",
    );
    let material = |keys: &str| format!("{HEAD}[[material]]\nname = \"m\"\n{keys}\n");
    case(
        &material("type = \"plastic\"\ndiffuse = [0, 0, 0]"),
        "material `m` (line 14): expected exactly one of alpha and roughness, found neither",
    );
    case(
        &material("type = \"plastic\"\ndiffuse = [0, 0, 0]\nalpha = 0.1\nroughness = 0.1"),
        "found both",
    );
    case(
        &material("type = \"plastic\"\ndiffuse = [0, 0, 0]\nalpha = 0"),
        "alpha: expected a number from 0.001 to 1, found 0",
    );
    case(
        &material("type = \"plastic\"\ndiffuse = [0, 0, 0]\nalpha = 0.1\nior = 0.5"),
        "ior: expected a number from 1.01 to 4, found 0.5",
    );
    case(
        &material(
            "type = \"principled\"\nbase_color = [0, 0, 0]\nmetallic = 0\nroughness = 1\nior = 5",
        ),
        "ior: expected a number from 1 to 4, found 5",
    );
    case(
        &material(
            "type = \"principled\"\nbase_color = [0, 0, 0]\nmetallic = 0\nroughness = 1\nspecular = 2",
        ),
        "specular: expected a number from 0 to 1, found 2",
    );
    case(
        &material("type = \"conductor\"\nalpha = 0.1"),
        "a conductor needs reflectance, or eta and k, or all three",
    );
    case(
        &material("type = \"conductor\"\nalpha = 0.1\neta = [1, 1, 1]"),
        "a conductor needs reflectance, or eta and k",
    );
    case(
        &material("type = \"conductor\"\nalpha = 0.1\neta = [0, 1, 1]\nk = [1, 1, 1]"),
        "eta: expected a number from 0.01 to 100, found 0",
    );
    case(
        &material("type = \"measured\"\nfile = \"missing.binary\""),
        "missing.binary: cannot read",
    );
    case(
        &with_box("").replace("material = \"grey\"", "material = \"gray\""),
        "object 0 (box, line 14): unknown material `gray`, the scene has grey",
    );
    case(
        &with_box("").replace("material = \"grey\"", ""),
        "object 0 (box, line 14): expected a material, found none",
    );
    case(&with_box("name = \"a\"\nscale = 0"), "object `a` (box, line 14): scale must not be 0");
    case(&with_box("scale = [1, nan, 1]"), "scale: expected a finite number, found NaN");
    case(&with_box("rotate_deg = [0, inf, 0]"), "rotate_deg: expected a finite number, found inf");
    case(&with_box("translate = [0, -inf, 0]"), "translate: expected a finite number, found -inf");
    case(
        &with_box("bevel = 2"),
        "object 0 (box, line 14): bevel: expected a number from 0 to 0.5, found 2",
    );
    let object = "[[object]]\nname = \"a\"\nshape = \"sphere\"\nradius = 1\nmaterial = \"grey\"\n";
    case(
        &format!("{HEAD}{object}{object}"),
        "object `a` (sphere, line 19): the name is taken by the object of line 14",
    );
    case(
        &format!("{HEAD}[[object]]\nmesh = \"missing.ply\"\nmaterial = \"grey\""),
        "missing.ply: cannot read",
    );
    case(
        &format!("{HEAD}[[object]]\nmesh = \"room.toml\"\nmaterial = \"grey\""),
        "expected a mesh in .ply, .obj, .gltf or .glb, found .toml",
    );
}

/// Dark red with half opacity, and white.
const TEXELS: [[u8; 4]; 2] = [[128, 0, 0, 128], [255; 4]];

/// A square in an OBJ file.
const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

#[test]
fn materials_take_textures_opacity_and_emission() {
    let folder = Folder::new();
    folder.write("wood.png", png(TEXELS));
    let text = format!(
        "{HEAD}
        [[material]]
        name = \"wood\"
        type = \"principled\"
        base_color = {{ texture = \"wood.png\", scale = [2, 4], factor = 0.5 }}
        metallic = {{ texture = \"./wood.png\", channel = \"b\" }}
        roughness = {{ texture = \"wood.png\", factor = 0.8, wrap = \"mirror\" }}
        normal = {{ texture = \"wood.png\", strength = 2, interpolation = \"nearest\" }}
        anisotropy = {{ texture = \"wood.png\", factor = 0.5 }}
        anisotropy_rotate_deg = 90
        opacity = {{ texture = \"wood.png\", channel = \"a\" }}
        opacity_cutoff = 0.5
        emission = [1, 2, 3]
        emission_two_sided = true
        two_sided = false
        vertex_color = true
        [[material]]
        name = \"glass\"
        type = \"dielectric\"
        opacity = 0.25
        [[material]]
        name = \"frosted\"
        type = \"dielectric\"
        ior = 1.33
        roughness = 0.5
        transmittance = [0.5, 0.6, 0.7]
        absorption = [1, 0, 20]
        [[material]]
        name = \"pane\"
        type = \"thin_dielectric\"
        alpha = 0.0625
        transmittance = {{ texture = \"wood.png\", factor = [0.9, 0.8, 0.7] }}
        [[material]]
        name = \"silver\"
        type = \"mirror\"
        reflectance = {{ texture = \"wood.png\" }}
        emission = {{ texture = \"wood.png\", factor = [10, 20, 30] }}
        [[material]]
        name = \"steel\"
        type = \"conductor\"
        distribution = \"beckmann\"
        reflectance = [0.5, 0.5, 0.6]
        roughness = {{ texture = \"wood.png\", factor = 0.5 }}"
    );
    let scene = load(&folder, &text).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let [_, wood, glass, frosted, pane, silver, steel] = &scene.materials[..] else {
        unreachable!()
    };
    let MaterialKind::Principled(Principled {
        base_color, metallic, roughness, ior, specular, ..
    }) = wood.kind
    else {
        unreachable!()
    };
    assert_eq!(base_color, Vec3::splat(0.5));
    assert_eq!([metallic, roughness, ior, specular], [1.0, 0.8, 1.5, 1.0]);
    let surface = &wood.surface;
    let color = surface.color.as_ref().unwrap();
    assert_eq!((color.encoding, color.scale), (Encoding::Srgb, [1.0; 3]));
    // The lower left corner of the surface is that of the image.
    assert_eq!(color.image_from_uv, [[2.0, 0.0, 0.0], [0.0, -4.0, 1.0]]);
    let metallic = surface.metallic.as_ref().unwrap();
    assert_eq!((metallic.encoding, metallic.channels), (Encoding::Linear, Channels::Blue));
    assert!(Arc::ptr_eq(&metallic.texture, &color.texture), "one file is one texture");
    assert_eq!(surface.roughness.as_ref().unwrap().wrap, [Wrap::Mirror; 2]);
    let normal = surface.normal.as_ref().unwrap();
    assert_eq!((normal.encoding, normal.interpolation), (Encoding::Linear, Interpolation::Nearest));
    assert_eq!(surface.normal_scale, 2.0);
    let Anisotropy { strength, rotation, direction } = &surface.anisotropy;
    assert_eq!((*strength, *rotation), (0.5, FRAC_PI_2));
    assert_eq!(direction.as_ref().unwrap().encoding, Encoding::Linear);
    assert_eq!((surface.opacity.factor, surface.opacity.cutoff), (1.0, Some(0.5)));
    assert_eq!(surface.opacity.texture.as_ref().unwrap().channels, Channels::Alpha);
    let emission = surface.emission.as_ref().unwrap();
    assert_eq!((emission.radiance, emission.two_sided), (Vec3::new(1.0, 2.0, 3.0), true));
    assert!(surface.vertex_color && !surface.two_sided);
    assert!(matches!(glass.kind, MaterialKind::Dielectric { ior: 1.5, alpha: 0.0, .. }));
    assert_eq!(glass.surface.opacity.factor, 0.25);
    assert!(matches!(frosted.kind, MaterialKind::Dielectric { alpha: 0.25, transmittance, .. }
        if transmittance == Vec3::new(0.5, 0.6, 0.7)));
    assert_eq!(frosted.kind.absorption(), Some(Vec3::new(1.0, 0.0, 20.0)));
    let MaterialKind::ThinDielectric { ior, alpha, transmittance, .. } = pane.kind else {
        unreachable!()
    };
    assert_eq!((ior, alpha, transmittance), (1.5, 0.0625, Vec3::new(0.9, 0.8, 0.7)));
    assert_eq!(pane.surface.color.as_ref().unwrap().encoding, Encoding::Srgb);
    assert_eq!(steel.surface.distribution, Distribution::Beckmann);
    assert!(matches!(silver.kind, MaterialKind::Mirror { reflectance: Vec3::ONE }));
    let emission = silver.surface.emission.as_ref().unwrap();
    assert_eq!(emission.radiance, Vec3::new(10.0, 20.0, 30.0));
    assert_eq!(emission.texture.as_ref().unwrap().encoding, Encoding::Srgb);
    assert!(matches!(steel.kind, MaterialKind::Conductor { alpha: 0.25, .. }), "{:?}", steel.kind);
    let wood = folder.path().join("wood.png");
    assert_eq!(scene.inputs.iter().filter(|input| input.ends_with("wood.png")).count(), 1);
    assert!(scene.inputs.contains(&wood));
}

/// Each line, in the place of that of its key, makes a scene that no other makes; images are inputs.
#[test]
fn every_key_of_a_material_counts() {
    let folder = Folder::new();
    folder.write("wood.png", png(TEXELS));
    let of_all = "opacity = 0.5|opacity = T|emission = [1, 1, 1]|emission = T|normal = T|two_sided = false|\
                  vertex_color = true";
    let rough = "alpha = 0.3|roughness = T|distribution = \"beckmann\"";
    for (kind, keys, lines) in [
        ("diffuse", "reflectance = C", "reflectance = T|reflectance = D"),
        (
            "diffuse_transmission",
            "reflectance = C|transmittance = C",
            "reflectance = D|reflectance = { texture = \"wood.png\", factor = 0.4 }|transmittance = D",
        ),
        (
            "plastic",
            "diffuse = C|alpha = 0.2",
            "diffuse = D|diffuse = T|ior = 1.6|alpha = 0.3|roughness = 0.6|distribution = \"beckmann\"",
        ),
        (
            "conductor",
            "reflectance = C|alpha = 0.2",
            "reflectance = D|reflectance = T|anisotropy = 0.5|R",
        ),
        (
            "conductor",
            "eta = C|k = C|alpha = 0.2",
            "eta = D|k = D|reflectance = C|reflectance = T|R",
        ),
        (
            "principled",
            "base_color = C|roughness = 0.4",
            "base_color = D|base_color = T|roughness = 0.3|roughness = T|metallic = 0.5|metallic = T|\
             ior = 1.6|specular = 0.5|specular_color = D|coat_weight = 0.5|sheen_color = C|anisotropy = 0.5",
        ),
        (
            "principled",
            "base_color = C|roughness = 0.4|sheen_color = C",
            "sheen_color = D|sheen_roughness = 0.4",
        ),
        (
            "principled",
            "base_color = C|roughness = 0.4|coat_weight = 0.5",
            "coat_weight = 0.4|coat_roughness = 0.4",
        ),
        ("mirror", "reflectance = C", "reflectance = D|reflectance = T"),
        (
            "dielectric",
            "alpha = 0.2",
            "ior = 1.6|reflectance = C|transmittance = C|transmittance = T|absorption = C|alpha = 0.3|\
             distribution = \"beckmann\"",
        ),
        (
            "thin_dielectric",
            "",
            "ior = 1.6|alpha = 0.3|reflectance = C|transmittance = C|transmittance = T",
        ),
    ] {
        let name = |line: &str| line.split(' ').next().unwrap_or_default().to_owned();
        let read = |line: &str| {
            // `alpha` and `roughness` stand for one another.
            let width = |key: String| if key == "roughness" { "alpha".to_owned() } else { key };
            let others = keys.split('|').filter(|key| width(name(key)) != width(name(line)));
            let lines: Vec<_> = others.chain([line]).collect();
            let lines = lines.join("\n").replace("= C", "= [0.5, 0.5, 0.5]");
            let lines = lines.replace("= D", "= [0.5, 0.5, 0.4]");
            let lines = lines.replace("= T", "= { texture = \"wood.png\" }");
            let text = HEAD.replace("reflectance = [0.5, 0.5, 0.5]", &lines);
            load(&folder, &text.replace("\"diffuse\"", &format!("\"{kind}\""))).expect(line)
        };
        let mut seen = HashSet::from([read("").hash]);
        for line in format!("{lines}|{of_all}").replace("|R|", &format!("|{rough}|")).split('|') {
            let scene = read(line);
            assert!(seen.insert(scene.hash), "{kind}: {line}");
            let has_image = scene.inputs.iter().any(|input| input.ends_with("wood.png"));
            assert_eq!(has_image, line.ends_with(['T', '}']), "{kind}: {line}");
        }
    }
}

#[test]
fn textures_are_placed_by_offset_turn_and_repetitions() {
    let folder = Folder::new();
    folder.write("wood.png", png(TEXELS));
    let text = HEAD.replace(
        "[0.5, 0.5, 0.5]",
        "{ texture = \"wood.png\", scale = 2, offset = [0.25, 0.5], rotate_deg = 90 }",
    );
    let scene = load(&folder, &text).unwrap();
    let used = scene.materials[0].surface.color.as_ref().unwrap();
    let image = |u: f32, v: f32| {
        used.image_from_uv.map(|row| Vec3::from_array(row).dot(Vec3::new(u, v, 1.0)))
    };
    assert_eq!(image(0.25, 0.5), [0.0, 1.0], "lower left corner of the image");
    // Turned to the left, the image's right edge is above and its upper edge at the left.
    assert_eq!(image(0.25, 1.0), [1.0, 1.0]);
    assert_eq!(image(-0.25, 0.5), [0.0, 0.0]);
}

#[test]
fn an_image_that_is_named_in_two_ways_is_one_texture() {
    let folder = Folder::new();
    folder.write("wood.png", png(TEXELS));
    folder.write("parts/oak.txt", "a folder to go through");
    let text = HEAD.replace("[0.5, 0.5, 0.5]", "{ texture = \"wood.png\" }")
        + "[[material]]\nname = \"oak\"\ntype = \"mirror\"\n\
           reflectance = { texture = \"parts/../wood.png\" }\n";
    let scene = load(&folder, &text).unwrap();
    let image = |at: usize| &scene.materials[at].surface.color.as_ref().unwrap().texture;
    assert!(Arc::ptr_eq(image(0), image(1)));
    assert_eq!(scene.inputs.len(), 2, "{:?}", scene.inputs);
}

#[test]
fn what_textures_cannot_do_is_refused_by_name() {
    let folder = Folder::new();
    folder.write("wood.png", png(TEXELS));
    folder.write("text.png", "no image");
    let case = |body: &str, expected: &str| {
        let text = HEAD.replace("type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]", body);
        assert_ne!(text, HEAD);
        assert_contains(&message(&folder, &text), &[expected]);
    };
    let wood = "{ texture = \"wood.png\" }";
    case(
        &format!("type = \"plastic\"\ndiffuse = [0, 0, 0]\nroughness = {wood}"),
        "material `grey` (line 10): roughness: expected one number, found a texture; the tables of a \
         plastic are made for one roughness: use type = \"principled\"",
    );
    case(
        &format!("type = \"dielectric\"\nroughness = {wood}"),
        "roughness: expected one number, found a texture; the tables of a dielectric",
    );
    case(
        &format!("type = \"measured\"\nfile = \"a.binary\"\nreflectance = {wood}"),
        "room.toml:14:1: unknown key `reflectance` in material `grey` of type `measured`",
    );
    case(
        "type = \"diffuse\"\nreflectance = 0.5",
        "room.toml:13:15: material `grey` of type `diffuse`: invalid type: floating point `0.5`, \
         expected an array of three numbers or a table with `texture`",
    );
    case(
        "type = \"diffuse\"\nreflectance = { file = \"wood.png\" }",
        "unknown field `file`, expected one of `texture`, `scale`",
    );
    case("type = \"diffuse\"\nreflectance = { scale = 2 }", "missing field `texture`");
    case(
        "type = \"diffuse\"\nreflectance = { texture = \"wood.png\", wrap = \"tile\" }",
        "unknown variant `tile`, expected one of `repeat`, `mirror`, `clamp`",
    );
    case(
        "type = \"diffuse\"\nreflectance = { texture = \"wood.png\", factor = 2 }",
        "material `grey` (line 10): reflectance.factor: expected a number from 0 to 1, found 2",
    );
    case(
        "type = \"diffuse\"\nreflectance = { texture = \"wood.png\", strength = 2 }",
        "reflectance: strength is for `normal`",
    );
    case(
        "type = \"principled\"\nbase_color = [0, 0, 0]\nroughness = [1, 1, 1]",
        "invalid type: sequence, expected a number or a table with `texture`",
    );
    case("type = \"diffuse\"\nreflectance = { texture = \"none.png\" }", "none.png: cannot read");
    case(
        "type = \"diffuse\"\nreflectance = { texture = \"text.png\" }",
        "text.png: not a readable image",
    );
    case(
        "type = \"dielectric\"\nabsorption = [0, -1, 0]",
        "absorption: expected a number from 0 to 1000000, found -1",
    );
    case("type = \"dielectric\"\nior = 1\nalpha = 0.1", "ior: a rough dielectric of index 1");
    case(
        "type = \"diffuse\"\nreflectance = [0, 0, 0]\nopacity = 2",
        "opacity: expected a number from 0 to 1, found 2",
    );
    case(
        "type = \"diffuse\"\nreflectance = [0, 0, 0]\nemission_two_sided = true",
        "emission_two_sided needs emission",
    );
}

#[test]
fn a_texture_without_coordinates_is_a_warning_by_name() {
    let folder = Folder::new();
    folder.write("wood.png", png(TEXELS));
    folder.write("bare.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let textured = HEAD.replace("[0.5, 0.5, 0.5]", "{ texture = \"wood.png\" }");
    let object = "[[object]]\nname = \"sheet\"\nmesh = \"bare.obj\"\nmaterial = \"grey\"\n";
    let scene = load(&folder, &format!("{textured}{object}")).unwrap();
    let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(
        warning.contains("object `sheet` (bare.obj, line 14): the material `grey` has textures")
    );
    let brushed = "type = \"conductor\"\nalpha = 0.1\nanisotropy = 0.5\nreflectance";
    let brushed = HEAD.replace("type = \"diffuse\"\nreflectance", brushed);
    let scene = load(&folder, &format!("{brushed}{object}")).unwrap();
    let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(warning.ends_with("no texture coordinates: their direction is arbitrary"), "{warning}");
    // A material may read the second set of coordinates, and the file have the first alone.
    let attributes = [
        Attribute::floats("POSITION", "VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        Attribute::floats("TEXCOORD_0", "VEC2", &[0.0; 6]),
    ];
    let sail = r#"{"name": "sail", "pbrMetallicRoughness":
        {"baseColorTexture": {"index": 0, "texCoord": 1}}}"#;
    let rest = r#", "images": [{"uri": "wood.png"}], "textures": [{"source": 0}]"#;
    let path = folder.write("sail.gltf", gltf_of(&attributes, 3, sail, rest));
    let warnings = Scene::load(&path).unwrap().warnings.concat();
    assert!(
        warnings.contains("the material `sail` has textures, but the mesh has no"),
        "{warnings}"
    );
    // A shape has coordinates of its own.
    let with_shape = with_box("").replace("[0.5, 0.5, 0.5]", "{ texture = \"wood.png\" }");
    assert_eq!(load(&folder, &with_shape).unwrap().warnings, [""; 0]);
}

#[test]
fn lamps_take_every_form_and_a_scene_needs_no_environment() {
    let folder = Folder::new();
    let dark = with_box("").replace("[environment]\nconstant = [1, 1, 1]\n", "");
    let scene = load(&folder, &dark).unwrap();
    assert!(scene.warnings[0].contains("nothing is lit"), "{:?}", scene.warnings);
    assert!(scene.environment.texels.iter().all(|texel| *texel == Vec3::ZERO));
    let lamps = "
        [[lamp]]
        name = \"bulb\"
        type = \"point\"
        position = [1, 2, 3]
        intensity = [4, 5, 6]
        [[lamp]]
        type = \"spot\"
        position = [0, 3, 0]
        direction = [0, -2, 0]
        intensity = [1, 1, 1]
        inner_angle_deg = 10
        falloff = \"smooth_cosine\"
        [[lamp]]
        type = \"directional\"
        direction = [0, -1, -1]
        irradiance = [1, 2, 3]\n";
    // A black map lights nothing, and is no matter of a warning beside a lamp.
    let black = with_box("").replace("constant = [1, 1, 1]", "constant = [0, 0, 0]");
    assert_eq!(load(&folder, &black).unwrap().warnings, scene.warnings);
    assert_eq!(load(&folder, &format!("{black}{lamps}")).unwrap().warnings, [""; 0]);
    let scene = load(&folder, &format!("{dark}{lamps}")).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!(scene.lamps[0].name, "bulb");
    let position = Vec3::new(1.0, 2.0, 3.0);
    let intensity = Vec3::new(4.0, 5.0, 6.0);
    assert_eq!(scene.lamps[0].kind, LampKind::Point { position, intensity });
    let LampKind::Spot(spot) = scene.lamps[1].kind else { unreachable!() };
    assert_eq!((spot.direction, spot.falloff), (Vec3::NEG_Y, SpotFalloff::SmoothCosine));
    let angles = [10.0_f32, 45.0].map(f32::to_radians);
    assert_eq!([spot.inner_angle_rad, spot.outer_angle_rad], angles);
    assert!(matches!(scene.lamps[2].kind, LampKind::Directional { direction, .. }
        if direction.is_normalized()));
    let case = |from: &str, to: &str, expected: &str| {
        assert_contains(
            &message(&folder, &format!("{dark}{}", lamps.replace(from, to))),
            &[expected],
        );
    };
    case("\"point\"", "\"area\"", "unknown lamp type `area`, expected one of `point`");
    case("direction = [0, -2, 0]", "", "lamp of type `spot`: missing field `direction`");
    case("direction = [0, -2, 0]", "direction = [0, 0, 0]", "expected a vector other than 0");
    case("inner_angle_deg = 10", "inner_angle_deg = 50", "found 50 and 45");
    case("[4, 5, 6]", "[4, -5, 6]", "lamp `bulb` (line ");
    case("irradiance", "intensity", "unknown key `intensity` in lamp of type `directional`");
    let emission = dark.replace("\"diffuse\"", "\"diffuse\"\nemission = [1, 1, 1]");
    assert!(load(&folder, &emission).unwrap().warnings.is_empty());
}

/// The second edge leans by less than a twentieth of a degree.
#[test]
fn portals_are_rectangles_along_their_first_edges() {
    let edges = "first_edge = [2, 0, 0]\nsecond_edge = [0.003, 4, 0]";
    let text = with_box(&format!("[[portal]]\ncorner = [1, 2, 3]\n{edges}"));
    let portal = load(&Folder::new(), &text).unwrap().portals.remove(0);
    assert_eq!((portal.corner, portal.axes[0]), (Vec3::new(1.0, 2.0, 3.0), Vec3::X));
    assert!(portal.axes[1].abs_diff_eq(Vec3::Y, 1e-6), "{}", portal.axes[1]);
    assert!(portal.size[0] == 2.0 && (portal.size[1] - 4.0).abs() < 1e-5, "{:?}", portal.size);
}

#[test]
fn lamps_and_objects_name_groups_of_lights() {
    let folder = Folder::new();
    let object = |group: &str| {
        format!("[[object]]\nshape = \"sphere\"\nradius = 1\nmaterial = \"grey\"\n{group}")
    };
    let dark = with_box("");
    let lit = dark.replace("\"diffuse\"", "\"diffuse\"\nemission = [1, 1, 1]");
    let lamp = "[[lamp]]\ntype = \"point\"\nposition = [1, 2, 3]\nintensity = [4, 5, 6]\n\
                light_group = \"key\"\n";
    let groups = |text: &str| LightGroups::new(&load(&folder, text).unwrap()).names;
    assert_eq!(groups(&dark), ["environment"]);
    assert_eq!(groups(&lit), ["environment", "lamps"]);
    let named = "light_group = \"bulbs 2\"\n";
    let all = format!("{lit}{}{0}{}{lamp}", object(named), object(""));
    assert_eq!(groups(&all), ["environment", "bulbs 2", "key", "lamps"]);
    // Both objects of the group have one material.
    let scene = load(&folder, &all).unwrap();
    assert_eq!(scene.materials.len(), load(&folder, &lit).unwrap().materials.len() + 1);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let left_out = export::gltf::export(&scene, &folder.path().join("room.gltf")).warnings;
    assert!(left_out.iter().any(|line| line.contains("light groups: left out, `bulbs 2`")));
    let other = all.replace("bulbs 2", "bulbs 3");
    assert_ne!(load(&folder, &other).unwrap().hash, scene.hash);
    let warnings = load(&folder, &format!("{dark}{}", object(named))).unwrap().warnings;
    assert!(
        warnings[0].ends_with("ignored light_group: the object emits no light"),
        "{warnings:?}"
    );
    let include = "[[include]]\nfile = \"none.obj\"\nlight_group = \"key\"\n";
    for (name, text) in [("", lamp), ("a.b", &object("light_group = \"key\"")), ("c.d", include)] {
        let message = message(&folder, &format!("{dark}{}", text.replace("key", name)));
        let expected = format!(
            "light_group: expected up to 63 letters, digits, spaces, `_` and `-`, \
                                found `{name}`"
        );
        assert!(message.contains(&expected), "{message}");
    }
}

#[test]
fn an_included_file_is_placed_with_its_materials() {
    let folder = Folder::new();
    // No library describes the glass, which is replaced.
    folder.write("parts/room.mtl", "newmtl wall\nKd 0.1 0.2 0.3\n");
    let square = SQUARE.replace("f 1", "mtllib room.mtl\nusemtl wall\nf 1");
    folder.write("parts/room.obj", format!("{square}usemtl glass\nf 1 2 3\n"));
    let include = "
        [[include]]
        file = \"parts/room.obj\"
        scale = 2
        rotate_deg = [0, 90, 0]
        translate = [10, 0, 0]
        materials = { glass = \"grey\" }\n";
    let scene = load(&folder, &format!("{}{include}", with_box(""))).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let names: Vec<_> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["grey", "room/wall"]);
    let geometry = &scene.geometry;
    assert_eq!(geometry.triangles.len(), 15);
    assert_eq!(geometry.materials[12..], [1, 1, 0]);
    let mut corners = geometry.triangles[12..14].iter().flatten();
    assert!(corners.any(|&corner| geometry.positions[corner as usize] == [10.0, 2.0, -2.0]));
    assert!(scene.inputs.iter().any(|input| input.ends_with("parts/room.mtl")));
    let case = |from: &str, to: &str, expected: &str| {
        assert_contains(
            &message(&folder, &format!("{HEAD}{}", include.replace(from, to))),
            &[expected],
        );
    };
    case("glass =", "ice =", "found `ice`; the file has wall, glass");
    case("\"grey\"", "\"gray\"", "unknown material `gray`, the scene has grey");
    case("room.obj", "room.ply", "expected a file in .gltf, .glb, .obj, .pbrt or .xml");
    case("scale = 2", "scale = 0", "include parts/room.obj (line 15): scale must not be 0");
    case("file", "mesh", "unknown field `mesh`, expected one of `file`, `scale`");
}

/// A file that is included twice as large absorbs half as much per metre, and looks the same.
#[test]
fn absorption_of_an_included_file_scales_with_it() {
    let folder = Folder::new();
    let glass = r#"<scene version="3.0.0"><sensor type="perspective"/>
        <shape type="sphere"><bsdf type="dielectric"/>
        <medium name="interior" type="homogeneous"><rgb name="sigma_t" value="2, 0, 1"/>
        <float name="albedo" value="0"/><float name="scale" value="3"/></medium></shape></scene>"#;
    folder.write("glass.xml", glass);
    let include = "[[include]]\nfile = \"glass.xml\"\nscale = 2\n";
    let scene = load(&folder, &format!("{}{include}", with_box(""))).unwrap();
    assert_eq!(scene.materials[1].kind.absorption(), Some(Vec3::new(3.0, 0.0, 1.5)));
    // A medium of Mitsuba scatters three quarters unless it says otherwise, and is left out.
    folder.write("glass.xml", glass.replace("<float name=\"albedo\" value=\"0\"/>", ""));
    let scene = load(&folder, &format!("{}{include}", with_box(""))).unwrap();
    assert_eq!(scene.materials[1].kind.absorption(), None);
}

#[test]
fn lamps_of_an_included_file_are_placed_with_it() {
    let folder = Folder::new();
    let text = r#"{"asset": {"version": "2.0"}, "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "point", "intensity": 10}, {"type": "directional", "intensity": 10},
            {"type": "spot", "intensity": 10, "spot": {}}]}},
        "nodes": [
            {"translation": [1, 0, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"extensions": {"KHR_lights_punctual": {"light": 1}}},
            {"translation": [1, 0, 0], "extensions": {"KHR_lights_punctual": {"light": 2}}}],
        "scenes": [{"nodes": [0, 1, 2]}], "scene": 0}"#;
    let path = folder.write("lamps.gltf", text);
    let own = Mesh::read(&path, &mut Vec::new()).unwrap().lamps;
    let LampKind::Point { intensity: own, .. } = own[0].kind else { unreachable!() };
    let include = "[[include]]\nfile = \"lamps.gltf\"\nscale = 2\nrotate_deg = [0, 90, 0]\n\
                   translate = [0, 5, 0]\n";
    let scene = load(&folder, &format!("{HEAD}{include}")).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let [point, sun, spot] = &scene.lamps[..] else { unreachable!() };
    let LampKind::Point { position, intensity } = point.kind else { unreachable!() };
    assert_eq!(position, Vec3::new(0.0, 5.0, -2.0));
    assert!(intensity.abs_diff_eq(4.0 * own, 1e-4 * own.x), "{intensity} of {own}");
    let LampKind::Directional { direction, .. } = sun.kind else { unreachable!() };
    assert!(direction.abs_diff_eq(Vec3::NEG_X, 1e-6), "along −Z in the file: {direction}");
    let LampKind::Spot(spot) = spot.kind else { unreachable!() };
    assert_eq!((spot.position, spot.intensity), (position, intensity));
    assert!(spot.direction.abs_diff_eq(Vec3::NEG_X, 1e-6), "{}", spot.direction);
}

#[test]
fn scenes_of_other_programs_are_included_with_their_lamps() {
    let folder = Folder::new();
    folder.write(
        "lamp.pbrt",
        "Camera \"perspective\"\nWorldBegin\nLightSource \"infinite\"\n\
         LightSource \"point\" \"point3 from\" [1 0 0]\nMaterial \"diffuse\"\n\
         Shape \"sphere\" \"float radius\" 0.5\n",
    );
    folder.write(
        "quad.xml",
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><shape type=\"rectangle\">\
         <bsdf type=\"diffuse\" id=\"wall\"/></shape></scene>",
    );
    let text = format!(
        "{HEAD}[[include]]\nfile = \"lamp.pbrt\"\ntranslate = [0, 5, 0]\n\
         [[include]]\nfile = \"quad.xml\"\nscale = 2\n"
    );
    let scene = load(&folder, &text).unwrap();
    let LampKind::Point { position, .. } = scene.lamps[0].kind else { unreachable!() };
    assert!(position.y == 5.0 && position.x.abs() == 1.0, "{position}");
    assert!(scene.geometry.positions.iter().any(|position| position[0] == 2.0), "the rectangle");
    let ignored = "include lamp.pbrt (line";
    let named = |text: &String| text.contains(ignored) && text.contains("environment");
    assert!(scene.warnings.iter().any(named), "{:?}", scene.warnings);
    // Lamps of included files come after those of the scene.
    let bulb = "[[lamp]]\nname = \"bulb\"\ntype = \"point\"\nposition = [1, 2, 3]\n\
                intensity = [4, 5, 6]\n";
    let lamps = load(&folder, &format!("{text}{bulb}")).unwrap().lamps;
    assert_eq!((lamps.len(), lamps[0].name.as_str()), (2, "bulb"));
}

#[test]
fn an_included_file_names_the_group_of_its_lights() {
    let folder = Folder::new();
    let quad = "Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]\n";
    let material =
        "MakeNamedMaterial \"pane\" \"string type\" \"diffuse\"\nNamedMaterial \"pane\"\n";
    folder.write("quad.pbrt", format!("Camera \"perspective\"\nWorldBegin\n{material}{quad}"));
    let light = "LightSource \"point\"\nLightSource \"distant\"\nAreaLightSource \"diffuse\"\n";
    folder.write("lamps.pbrt", format!("Camera \"perspective\"\nWorldBegin\n{light}{quad}"));
    let scene = |include: &str| {
        let glow = with_box("").replace("\"diffuse\"", "\"diffuse\"\nemission = [1, 1, 1]");
        load(&folder, &format!("{glow}[[include]]\nfile = {include}\n")).unwrap()
    };
    let groups = |scene: &Scene| LightGroups::new(scene).names;
    assert_eq!(groups(&scene("\"lamps.pbrt\"")), ["environment", "lamps"]);
    let named = scene("\"lamps.pbrt\"\nlight_group = \"ceiling\"");
    assert_eq!(groups(&named), ["environment", "ceiling", "lamps"]);
    let of_lamps: Vec<_> = named.lamps.iter().map(|lamp| lamp.light_group.as_deref()).collect();
    assert_eq!(of_lamps, [Some("ceiling"); 2]);
    let lit = |scene: &Scene| {
        let index = scene.geometry.materials.last().copied().unwrap() as usize;
        scene.materials[index].surface.light_group.clone()
    };
    assert_eq!(lit(&named).as_deref(), Some("ceiling"));
    // A material of the scene that emits in place of one of the file belongs to the group there alone.
    let replaced = "\"quad.pbrt\"\nlight_group = \"ceiling\"\nmaterials = { pane = \"grey\" }";
    let replaced = scene(replaced);
    assert_eq!(groups(&replaced), ["environment", "ceiling", "lamps"]);
    assert_eq!(lit(&replaced).as_deref(), Some("ceiling"));
    let one = format!("{quad}AreaLightSource \"diffuse\"\n{quad}");
    folder.write("one.pbrt", format!("Camera \"perspective\"\nWorldBegin\n{one}"));
    assert_eq!(scene("\"one.pbrt\"\nlight_group = \"ceiling\"").warnings, [""; 0]);
    let dark = scene("\"quad.pbrt\"\nlight_group = \"ceiling\"").warnings;
    assert!(
        dark.iter().any(|line| line.ends_with("ignored light_group: the file emits no light")),
        "{dark:?}"
    );
}

/// Rooms one on the other, together 8 × 3 × 4 m, whose walls look inwards or outwards.
#[test]
fn a_room_is_seen_from_inside_and_a_box_is_not() {
    let folder = Folder::new();
    let seen = |looks_in: bool, storeys: usize| {
        let mut text = String::new();
        for storey in 0..storeys {
            let height = 3.0 / storeys as f32;
            for corner in 0..8 {
                let [x, y, z] = [0, 1, 2].map(|axis| (corner >> axis & 1) as f32);
                let y = (storey as f32 + y) * height;
                text += &format!("v {} {y} {}\n", 8.0 * x - 4.0, 4.0 * z - 2.0);
            }
            let faces = [
                [0, 4, 6, 2],
                [1, 3, 7, 5],
                [0, 1, 5, 4],
                [2, 6, 7, 3],
                [0, 2, 3, 1],
                [4, 5, 7, 6],
            ];
            for [a, b, c, d] in faces.map(|face| face.map(|corner| 8 * storey + corner + 1)) {
                let [b, d] = if looks_in { [d, b] } else { [b, d] };
                text += &format!("f {a} {b} {c} {d}\n");
            }
        }
        let scene = Scene::load(&folder.write("room.obj", text)).unwrap();
        let is_inside = scene.warnings.iter().any(|text| text.contains("stands in the room"));
        (is_inside, scene.camera.position, scene.camera.look_at)
    };
    let (is_inside, from, at) = seen(true, 1);
    assert!(is_inside && (from.y - 1.6).abs() < 0.2, "{from}");
    let (low, high) = (Vec3::new(-4.0, 0.0, -2.0), Vec3::new(4.0, 3.0, 2.0));
    assert!(from.cmpgt(low).all() && from.cmplt(high).all(), "{from}");
    let along = (at - from).normalize();
    assert!(along.x.abs() > 0.9 && (at - from).length() > 4.0, "{from} {at}");
    // The middle of the view lies lower than the eyes, by 0.06 of its length.
    assert!((along.y / along.with_y(0.0).length() + 0.06).abs() < 1e-3, "{along}");
    assert!(!seen(false, 1).0);
    assert!(!seen(true, 4).0, "shelves");
}

#[test]
fn files_that_are_no_scenes_are_refused() {
    let message = Scene::load(Path::new("missing.toml")).unwrap_err().to_string();
    assert!(message.contains("missing.toml: cannot read"), "{message}");
    let folder = Folder::new();
    let path = folder.write("binary.toml", [b'a', 0xff, 0xfe]);
    assert!(Scene::load(&path).unwrap_err().to_string().contains("byte 1 is not UTF-8"));
}

#[test]
fn the_hash_follows_the_picture_and_not_the_text() {
    let folder = Folder::new();
    let hash = |text: &str| load(&folder, text).unwrap().hash;
    let original = hash(&with_box(""));
    assert_eq!(original.len(), 64);
    assert_eq!(original, hash(&with_box("# a comment\nname = \"crate\"")));
    assert_eq!(original, hash(&with_box("").replace("grey", "gray")));
    let metal = "type = \"conductor\"\nalpha = 0.5\neta = [1, 1, 1]\nk = [3, 3, 3]\n";
    let tinted = metal.to_owned() + "reflectance";
    let mut hashes = HashSet::from([original.clone()]);
    for (from, to) in [
        ("[0, 1, 5]", "[0, 1, 5.001]"),
        ("= 40", "= 41"),
        ("= 40", "= 40\nup = [0.1, 1, 0]"),
        // The point looked at is 5 m away, and in focus without this.
        ("= 40", "= 40\naperture_radius = 0.1\nfocus_distance = 5"),
        ("= 40", "= 40\nfocus_distance = 4"),
        ("= 40", "= 40\nshift = [0, 0.1]"),
        ("= 40", "= 40\nmirrored = true"),
        ("= 40", "= 40\nshift = [0, 0.1]\nmirrored = true"),
        ("constant = [1, 1, 1]", "constant = [1, 1, 1.001]"),
        ("0.5, 0.5, 0.5", "0.5, 0.5, 0.501"),
        ("type = \"diffuse\"\nreflectance", "type = \"conductor\"\nalpha = 0.5\nreflectance"),
        ("type = \"diffuse\"\nreflectance", &tinted),
        ("type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]", metal),
        ("size = [1, 1, 1]", "size = [1, 1, 1.001]"),
        ("[camera]", "[film]\nfilter = \"box\"\n[camera]"),
        ("[camera]", "[film]\nwidth = 641\n[camera]"),
    ] {
        assert!(hashes.insert(hash(&with_box("").replace(from, to))), "{from} → {to}");
    }
    let mesh = |faces: &str| {
        folder.write("a.ply", ascii_ply(faces));
        hash(&format!("{HEAD}[[object]]\nmesh = \"a.ply\"\nmaterial = \"grey\"\n"))
    };
    assert_ne!(mesh("3 0 1 2"), mesh("3 1 2 3"));
    let portal = |width: u32| {
        let edges = format!("first_edge = [{width}, 0, 0]\nsecond_edge = [0, 1, 0]");
        hash(&with_box(&format!("[[portal]]\ncorner = [0, 0, 0]\n{edges}")))
    };
    assert_ne!(portal(1), portal(2));
    let lamp = |height: u32| {
        let keys = format!("position = [0, {height}, 0]\nintensity = [1, 1, 1]");
        hash(&with_box(&format!("[[lamp]]\ntype = \"point\"\n{keys}")))
    };
    assert_ne!(lamp(1), lamp(2));
}

#[test]
fn the_hash_follows_every_part_of_surfaces_and_lights() {
    let spot = "[[lamp]]\ntype = \"spot\"\nposition = [0, 3, 0]\ndirection = [0, -1, 0]\n\
                intensity = [1, 1, 1]";
    let original = load(&Folder::new(), &with_box(spot)).unwrap();
    fn surface(scene: &mut Scene) -> &mut Surface {
        &mut scene.materials[0].surface
    }
    fn lit(scene: &mut Scene, two_sided: bool) {
        let emission = Emission { radiance: Vec3::ONE, texture: None, two_sided };
        surface(scene).emission = Some(emission);
    }
    fn beam(scene: &mut Scene) -> &mut Spot {
        let LampKind::Spot(spot) = &mut scene.lamps[0].kind else { panic!("a spot") };
        spot
    }
    fn stretched(scene: &mut Scene, rotation: f32, direction: Option<TextureUse>) {
        surface(scene).anisotropy = Anisotropy { strength: 0.5, rotation, direction };
    }
    fn shine(scene: &mut Scene, direction: Vec3, irradiance: f32) {
        let irradiance = Vec3::splat(irradiance);
        scene.lamps[0].kind = LampKind::Directional { direction, irradiance };
    }
    fn repeat(scene: &mut Scene, width: f32, replaces: bool) {
        let place = Transform::new([width, 1.0, 1.0], [0.0; 3], [0.0; 3]);
        scene.geometry.instances.push(Instance::new(0, &place, 0, replaces).unwrap());
    }
    let changes: [fn(&mut Scene); 25] = [
        |_| (),
        |scene| surface(scene).distribution = Distribution::Beckmann,
        |scene| stretched(scene, 0.0, None),
        |scene| stretched(scene, 0.5, None),
        |scene| {
            let texels = Texels::Bytes(vec![[1, 2, 3, 4]]);
            let texture = Texture { name: "a".into(), width: 1, height: 1, texels };
            stretched(scene, 0.0, Some(TextureUse::new(Arc::new(texture))));
        },
        |scene| scene.environment.rotation_rad = 1.0,
        |scene| lit(scene, false),
        |scene| lit(scene, true),
        |scene| surface(scene).opacity.factor = 0.5,
        |scene| surface(scene).opacity.cutoff = Some(0.5),
        |scene| surface(scene).normal_scale = 0.5,
        |scene| surface(scene).vertex_color = true,
        |scene| surface(scene).two_sided = false,
        |scene| beam(scene).position.x = 1.0,
        |scene| beam(scene).direction = Vec3::NEG_Z,
        |scene| beam(scene).intensity.y = 2.0,
        |scene| beam(scene).inner_angle_rad = 0.1,
        |scene| beam(scene).outer_angle_rad = 1.0,
        |scene| beam(scene).falloff = SpotFalloff::LinearAngle,
        |scene| shine(scene, Vec3::NEG_Y, 1.0),
        |scene| shine(scene, Vec3::NEG_Y, 2.0),
        |scene| shine(scene, Vec3::NEG_Z, 1.0),
        |scene| repeat(scene, 1.0, true),
        |scene| repeat(scene, 1.0, false),
        |scene| repeat(scene, 2.0, true),
    ];
    let hashes = changes.map(|change| {
        let mut scene = original.clone();
        change(&mut scene);
        still_hash(&scene)
    });
    assert_eq!(hashes.iter().collect::<HashSet<_>>().len(), changes.len(), "{hashes:#?}");
    // Instances block light where they stand.
    let [narrow, wide] = [1.0, 2.0].map(|width| {
        let mut scene = original.clone();
        repeat(&mut scene, width, true);
        geometry_hash(&scene)
    });
    assert_ne!(narrow, wide);
}

#[test]
fn the_hash_follows_every_part_of_a_texture() {
    let mut scene = load(&Folder::new(), &with_box("")).unwrap();
    let texels = Texels::Bytes(vec![[1, 2, 3, 4], [5, 6, 7, 8]]);
    let texture = Texture { name: "a".into(), width: 2, height: 1, texels };
    let changes: [fn(&mut TextureUse); 13] = [
        |_| (),
        |used| Arc::make_mut(&mut used.texture).texels = Texels::Bytes(vec![[1; 4]; 2]),
        |used| {
            let texture = Arc::make_mut(&mut used.texture);
            (texture.width, texture.height) = (1, 2);
        },
        |used| used.channels = Channels::Red,
        |used| used.encoding = Encoding::Linear,
        |used| used.uv_set = 1,
        |used| used.image_from_uv[0][1] = 0.5,
        |used| used.image_from_uv[1][2] = 0.5,
        |used| used.wrap[0] = Wrap::Mirror,
        |used| used.wrap[1] = Wrap::Mirror,
        |used| used.interpolation = Interpolation::Nearest,
        |used| used.scale[2] = 0.5,
        |used| used.bias[2] = 0.5,
    ];
    let hashes = changes.map(|change| {
        let mut used = TextureUse::new(Arc::new(texture.clone()));
        change(&mut used);
        scene.materials[0].surface.color = Some(used);
        still_hash(&scene)
    });
    assert_eq!(hashes.iter().collect::<HashSet<_>>().len(), changes.len(), "{hashes:#?}");
}

// Meshes

/// Formats an ASCII PLY of four vertices and these faces.
fn ascii_ply(faces: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
         property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n\
         0 0 0\n1 0 0\n1 1 0\n0 1 0\n{faces}\n",
        faces.lines().count()
    )
}

/// Encodes a quad and a triangle with normals, foreign properties and an element in between.
fn binary_ply(big_endian: bool) -> Vec<u8> {
    let name = if big_endian { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = format!(
        "ply\nformat {name} 1.0\ncomment made by a test\nelement vertex 4\nproperty double x\n\
         property uchar quality\nproperty float y\nproperty float z\nproperty float nx\n\
         property float ny\nproperty float nz\nelement edge 1\nproperty list ushort short ends\n\
         element face 2\nproperty uchar flags\n\
         property list uint ushort vertex_index\nend_header\n"
    )
    .into_bytes();
    let mut push = |little: &[u8]| {
        let reversed = little.iter().rev().copied();
        if big_endian { bytes.extend(reversed) } else { bytes.extend_from_slice(little) }
    };
    for [x, y] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
        push(&f64::to_le_bytes(x));
        push(&[7]);
        for component in [y as f32, 0.0, 0.0, 0.0, 1.0] {
            push(&component.to_le_bytes());
        }
    }
    push(&2_u16.to_le_bytes());
    push(&3_i16.to_le_bytes());
    push(&(-4_i16).to_le_bytes());
    for face in [&[0_u16, 1, 2, 3][..], &[0, 2, 3]] {
        push(&[1]);
        push(&(face.len() as u32).to_le_bytes());
        face.iter().for_each(|index| push(&index.to_le_bytes()));
    }
    bytes
}

#[test]
fn ply_reads_all_three_encodings() {
    let folder = Folder::new();
    let little = read(&folder, "little.ply", binary_ply(false));
    let big = read(&folder, "big.ply", binary_ply(true));
    assert_eq!((&little.positions, &little.normals), (&big.positions, &big.normals));
    assert_eq!(little.triangles, big.triangles);
    assert_eq!(little.positions, [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(little.normals, [[0.0, 0.0, 1.0]; 4]);
    assert_eq!(little.triangles.len(), 3);
    let ascii = read(&folder, "ascii.ply", ascii_ply("3 0 1 2\n4 0 1 2 3"));
    assert_eq!(ascii.positions, little.positions);
    assert!(ascii.normals.is_empty());
    assert_eq!(ascii.triangles[0], [0, 1, 2]);
    assert_eq!(ascii.triangles.len(), 3);
    let squares = read(&folder, "squares.ply", ascii_ply("4 0 1 2 3\n4 3 2 1 0"));
    assert_eq!(squares.triangles.len(), 4);
    let strips = "element tristrips 0\nproperty list uchar int vertex_indices\nend_header";
    let no_strips = ascii_ply("3 0 1 2").replace("end_header", strips);
    assert_eq!(read(&folder, "strips.ply", no_strips).triangles.len(), 1);
    let windows = ascii_ply("3 0 1 2").replace('\n', "\r\n");
    assert_eq!(read(&folder, "windows.ply", windows).triangles, [[0, 1, 2]]);
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty char x\n\
        property uchar y\nproperty int8 z\nelement face 1\n\
        property list uchar uint8 vertex_indices\nend_header\n"
        .to_vec();
    bytes.extend([255, 255, 128, 1, 0, 0, 0, 1, 127, 3, 0, 1, 2]);
    let of_bytes = read(&folder, "bytes.ply", bytes);
    let expected = [[-1.0, 255.0, -128.0], [1.0, 0.0, 0.0], [0.0, 1.0, 127.0]];
    assert_eq!((of_bytes.positions, of_bytes.triangles), (expected.to_vec(), vec![[0, 1, 2]]));
}

#[test]
fn ply_faces_may_come_first_and_polygons_may_be_concave() {
    let folder = Folder::new();
    let areas = |outline: &[[f32; 2]]| -> Vec<f32> {
        let count = outline.len();
        let corners: String = (0..count).map(|at| format!(" {at}")).collect();
        let points: String = outline.iter().map(|[x, y]| format!("{x} {y} 0\n")).collect();
        let text = format!(
            "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\n\
             element vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
             end_header\n{count}{corners}\n{points}"
        );
        let mesh = read(&folder, "a.ply", text);
        assert_eq!(mesh.triangles.len(), count - 2);
        let area = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|index| Vec3::from_array(mesh.positions[index as usize]));
            0.5 * (b - a).cross(c - a).z
        };
        mesh.triangles.iter().map(area).collect()
    };
    let arrow = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.5], [0.0, 2.0]];
    let comb = [
        [[0.0, 0.0], [5.0, 0.0], [5.0, 3.0], [4.0, 3.0], [4.0, 1.0], [3.0, 1.0]],
        [[3.0, 3.0], [2.0, 3.0], [2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]],
    ];
    for (outline, expected) in [(&arrow[..], 2.5), (comb.as_flattened(), 11.0)] {
        for turn in [1.0, -1.0] {
            let mut outline = outline.to_vec();
            if turn < 0.0 {
                outline.reverse();
            }
            let found = areas(&outline);
            assert!(found.iter().all(|area| turn * area > 0.0), "a triangle is turned over");
            assert!((found.iter().sum::<f32>() - turn * expected).abs() < 1e-5, "{found:?}");
        }
    }
    // An outline that crosses itself is closed all the same.
    areas(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
}

#[test]
fn broken_ply_files_are_refused_with_their_place() {
    let folder = Folder::new();
    let case = |bytes: &[u8], expected: &str| {
        assert_contains(&mesh_message(&folder, "broken.ply", bytes), &[expected]);
    };
    let good = ascii_ply("3 0 1 2");
    let set = |from: &str, to: &str| good.replace(from, to).into_bytes();
    case(b"", "truncated: the file ends before `end_header`");
    case(b"PK\x03\x04", "expected a PLY file that starts with `ply`, found `PK");
    case(b"ply\nformat ascii 1.0\n", "truncated: the file ends before `end_header`");
    case(
        &set("ascii", "EBCDIC"),
        "broken.ply:2:1: expected format ascii, binary_little_endian or binary_big_endian, found \
         `EBCDIC 1.0`",
    );
    case(&set("format ascii 1.0\n", ""), "the header has no line `format`");
    case(
        &set("property float x", "property half x"),
        "broken.ply:4:1: property `x` has the unknown type `half`",
    );
    case(&set("property float x\n", ""), "expected the properties `x`, `y` and `z`");
    case(
        &set("element vertex 4", "element vertex four"),
        "broken.ply:3:1: expected the number of `vertex`, found `four`",
    );
    case(&set("element vertex", "element point"), "expected one element `vertex`, found 0");
    case(&set("vertex_indices", "corners"), "expected the list property `vertex_indices`");
    case(
        &set("element vertex 4", "element vertex 4000000000"),
        "truncated: 4000000000 elements `vertex` need at least",
    );
    case(&set("element vertex 4", "element vertex 9000000000"), "9000000000 vertices, at most");
    case(
        &set("3 0 1 2", "3 0 1 4"),
        "broken.ply:14:1: face 0 of 1: vertex index 4 is out of range, the file has 4 vertices",
    );
    case(&set("3 0 1 2", "3 0 1 -1"), "face 0 of 1: vertex index -1 is out of range");
    case(&set("3 0 1 2", "3 0 1"), "truncated: the file ends in face 0 of 1");
    case(
        &set("1 1 0", "1 one 0"),
        "broken.ply:12:1: vertex 2 of 4: expected a number, found `one`",
    );
    case(
        &set("1 1 0", &format!("{} 1 0", "1".repeat(65))),
        "broken.ply:12:1: vertex 2 of 4: expected a number, found a long word",
    );
    case(
        &set("element face", "element edge"),
        "expected one element `face` or `tristrips`, found 0",
    );
    let binary = binary_ply(false);
    case(&binary[..binary.len() - 1], "truncated: the file ends in face 1 of 2");
    case(&binary[..binary.len() - 40], "truncated: ");
    let mut long = binary.clone();
    let count = long.len() - 10;
    long[count..count + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    case(&long, "face 1 of 2");
}

#[test]
fn obj_reads_groups_polygons_normals_and_colors() {
    let folder = Folder::new();
    folder.write(
        "two colors.mtl",
        "# two\nnewmtl red paint\nKd 0.8 0.1 0.1\nNs 10\nnewmtl grey\nKd 0.5\n",
    );
    let text = "# a square and two triangles\nmtllib  two colors.mtl \nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\n\
        v 0 1 0\nvt 0 0\nvn 0 0 1\nvn 0 0 -1\no first\ng a b\nusemtl red paint\nf 1//1 2//1 3//1 4//1\n\
        s off\ng c\nusemtl grey\nf -4/1/2 \\\n -2/1/2 -3/1/2\nl 1 2\nf 1 2 3\n";
    let mesh = read(&folder, "shapes.obj", text);
    assert_eq!(mesh.triangles.len(), 4);
    let reflectance = |index: usize| match mesh.materials[index].material.kind {
        MaterialKind::Diffuse { reflectance } => reflectance,
        _ => panic!("expected a diffuse material"),
    };
    assert_eq!(reflectance(0), Vec3::new(0.8, 0.1, 0.1));
    assert_eq!(reflectance(1), Vec3::splat(0.5));
    assert_eq!(mesh.uvs[0].len(), mesh.positions.len());
    assert_eq!(mesh.runs.iter().map(|run| run.first_triangle).collect::<Vec<_>>(), [0, 2]);
    let corners = |triangle: usize| mesh.triangles[triangle].map(|corner| corner as usize);
    assert!(corners(0).iter().all(|&corner| mesh.normals[corner] == [0.0, 0.0, 1.0]));
    assert!(corners(2).iter().all(|&corner| mesh.normals[corner] == [0.0, 0.0, -1.0]));
    assert!(corners(3).iter().all(|&corner| mesh.normals[corner] == [0.0; 3]));
    assert_eq!(corners(2).map(|corner| mesh.positions[corner][0]), [0.0, 1.0, 1.0]);

    // Without a material of the scene, the colours of the mesh file apply.
    let scene =
        load(&folder, &format!("{HEAD}[[object]]\nname = \"o\"\nmesh = \"shapes.obj\"\n")).unwrap();
    let names: Vec<_> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["grey", "o/red paint", "o/grey"]);
    assert_eq!(scene.geometry.materials, [1, 1, 2, 2]);
    let plain = text.replace("usemtl red paint\n", "");
    folder.write("shapes.obj", plain);
    let message =
        message(&folder, &format!("{HEAD}[[object]]\nname = \"o\"\nmesh = \"shapes.obj\"\n"));
    assert!(message.contains("object `o` (shapes.obj, line 14): expected a material"), "{message}");
}

/// Corners that share a point are many vertices, each with its own normal.
#[test]
fn a_point_of_an_obj_file_may_have_many_normals() {
    let folder = Folder::new();
    let (mut text, count) = ("v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned(), 40);
    for normal in 1..=count {
        text += &format!("vn {normal} 0 1\nf 1//{normal} 2//{normal} 3//{normal}\n");
    }
    // They are found again.
    text += &format!("f 1//1 2//{count} 3//{count}\n");
    let mesh = read(&folder, "fan.obj", text);
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (3 * count, count + 1));
    for (triangle, normal) in mesh.triangles.iter().zip(1..=count) {
        assert_eq!(triangle.map(|at| mesh.normals[at as usize]), [[normal as f32, 0.0, 1.0]; 3]);
    }
}

#[test]
fn broken_obj_files_are_refused_with_their_line() {
    let folder = Folder::new();
    let good = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
    let case = |from: &str, to: &str, expected: &str| {
        assert_contains(&mesh_message(&folder, "broken.obj", good.replace(from, to)), &[expected]);
    };
    case(
        "f 1 2 3",
        "f 1 2 4",
        "broken.obj:4:1: face after 0 triangles: position index 4 is out of range, there are 3 \
         positions so far",
    );
    case("f 1 2 3", "f 0 1 2", "position index 0 is out of range");
    case("f 1 2 3", "f -4 1 2", "position index -4 is out of range");
    case("f 1 2 3", "f 1 2 x", "expected the index of a position, found `x`");
    case("f 1 2 3", "f 1 2 99999999999999999999", "expected the index of a position");
    case("v 1 0 0", "v 1 zero 0", "broken.obj:2:1: expected three numbers, found `zero`");
    case("v 1 0 0", "v 1 \\\n zero 0", "broken.obj:2:1: expected three numbers, found `zero`");
    case("v 1 0 0", "v 1 0", "broken.obj:2:1: expected three numbers, found ``");
    let mut warnings = Vec::new();
    let path = folder.write("lost.obj", format!("mtllib lost.mtl\n{good}"));
    Mesh::read(&path, &mut warnings).unwrap();
    assert!(warnings[0].contains("lost.obj:1: cannot read the material library"), "{warnings:?}");
}

/// Formats a triangle under a node that shifts and one that mirrors. `uri` names the buffer.
fn gltf_json(uri: &str) -> String {
    let uri = if uri.is_empty() { String::new() } else { format!("\"uri\": \"{uri}\",") };
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}],
        "nodes": [{{"translation": [10, 0, 0], "children": [1]}},
                  {{"mesh": 0, "scale": [-1, 1, 1]}}],
        "materials": [{{"name": "leaf", "pbrMetallicRoughness": {{"baseColorFactor": [0.1, 0.6, 0.2, 1]}}}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "NORMAL": 1}}, "indices": 2,
                                      "material": 0}},
                                    {{"attributes": {{"POSITION": 0}}, "mode": 0}}]}}],
        "accessors": [
          {{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [0, 0, 0], "max": [1, 1, 0]}},
          {{"bufferView": 0, "byteOffset": 36, "componentType": 5126, "count": 3, "type": "VEC3"}},
          {{"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteOffset": 0, "byteLength": 72}},
                        {{"buffer": 0, "byteOffset": 72, "byteLength": 6}}],
        "buffers": [{{{uri} "byteLength": 80}}]}}"#
    )
}

fn gltf_buffer() -> Vec<u8> {
    let positions = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let normals = [0.0_f32, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
    let mut bytes = floats(&[positions, normals].concat());
    bytes.extend([0_u16, 1, 2, 0].iter().flat_map(|index| index.to_le_bytes()));
    bytes
}

#[test]
fn gltf_reads_nodes_from_every_kind_of_buffer() {
    let folder = Folder::new();
    folder.write("my buffer.bin", gltf_buffer());
    let inline = format!("data:application/octet-stream;base64,{}", base64(&gltf_buffer()));
    let files = [
        ("beside.gltf", gltf_json("my%20buffer.bin").into_bytes()),
        ("inline.gltf", gltf_json(&inline).into_bytes()),
        ("one.glb", glb(&gltf_json(""), &gltf_buffer())),
    ];
    for (name, bytes) in files {
        let mut warnings = Vec::new();
        let mesh = Mesh::read(&folder.write(name, bytes), &mut warnings).unwrap();
        assert_eq!(mesh.positions, [[10.0, 0.0, 0.0], [9.0, 0.0, 0.0], [10.0, 1.0, 0.0]]);
        assert_eq!(mesh.triangles, [[0, 2, 1]], "{name}: a mirror turns the winding");
        assert_eq!(mesh.normals, [[0.0, 0.0, 1.0]; 3]);
        let kind = &mesh.materials[0].material.kind;
        let MaterialKind::Principled(Principled { base_color, .. }) = kind else {
            panic!("{kind:?}")
        };
        assert_eq!(*base_color, Vec3::new(0.1, 0.6, 0.2));
        assert!(warnings[0].ends_with("ignored points and lines (mesh 0)"), "{warnings:?}");
        assert_eq!(mesh.side_files.len(), usize::from(name == "beside.gltf"), "{name}");
    }
    // The scene that is not rendered is named.
    let scenes = r#"[{"name": "night", "nodes": [0]}, {"nodes": [0]}]"#;
    let two = gltf_json(&inline).replace(r#""scene": 0"#, r#""scene": 1"#);
    let path = folder.write("two.gltf", two.replace(r#"[{"nodes": [0]}]"#, scenes));
    let mut warnings = Vec::new();
    assert_eq!(Mesh::read(&path, &mut warnings).unwrap().triangles, [[0, 2, 1]]);
    assert!(
        warnings.iter().any(|line| line.contains("further scenes (scene `night`)")),
        "{warnings:?}"
    );
}

#[test]
fn the_first_gltf_camera_with_perspective_gives_view_and_film() {
    let nodes =
        r#"{"mesh": 0, "children": [1, 2, 3]}, {"camera": 0}, {"camera": 1}, {"camera": 2}"#;
    let rest = r#", "cameras": [{"type": "orthographic", "name": "flat",
        "orthographic": {"xmag": 1, "ymag": 1, "zfar": 9, "znear": 0.1}},
        {"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 2, "znear": 0.1}},
        {"type": "perspective", "name": "far", "perspective": {"yfov": 1, "znear": 0.1}}]"#;
    let folder = Folder::new();
    let scene = Scene::load(&folder.write("a.gltf", gltf(nodes, "", "", rest))).unwrap();
    assert!((scene.camera.vertical_fov_deg.to_radians() - 0.5).abs() < 1e-6, "{:?}", scene.camera);
    assert_eq!((scene.film.width, scene.film.height), (640, 320));
    let left_out = ["orthographic cameras (`flat`)", "cameras that are not used (`far`)"];
    assert_contains(&scene.warnings.concat(), &left_out);
}

/// All of its height is seen at the depth of the camera, from so far that depth counts little.
#[test]
fn orthographic_cameras_of_gltf_see_from_afar() {
    let nodes = r#"{"mesh": 0, "children": [1]},
        {"camera": 0, "translation": [0, 1, 5], "scale": [2, 2, 2]}"#;
    let rest = r#", "cameras": [{"type": "orthographic", "name": "flat",
        "orthographic": {"xmag": 6, "ymag": 3, "zfar": 9, "znear": 0.1}}]"#;
    let folder = Folder::new();
    let path = folder.write("a.gltf", gltf(nodes, "", "", rest));
    for name in [None, Some("flat".to_owned())] {
        let options = LoadOptions { camera: name, ..LoadOptions::default() };
        let scene = Scene::load_with(&path, &options).unwrap();
        let place = scene.camera.position - Vec3::new(0.0, 1.0, 5.0);
        let half = (0.5 * scene.camera.vertical_fov_deg).to_radians().tan() * place.z;
        assert!(place.truncate().length() < 1e-3 && place.z > 1000.0, "{place}");
        assert!((half - 6.0).abs() < 1e-3, "{half}");
        assert_eq!((scene.film.width, scene.film.height), (640, 320));
        assert_contains(&scene.warnings.concat(), &["orthographic cameras (`flat`)"]);
    }
}

/// Nothing is seen of a surface without opacity, not even its light.
#[test]
fn a_light_that_is_not_seen_is_named() {
    let folder = Folder::new();
    let clay = |opacity: &str| {
        let clay = "type = \"diffuse\"\nreflectance = [1, 1, 1]\nemission = [2, 2, 2]";
        folder::yard(
            [8, 8],
            "constant = [1, 1, 1]",
            &format!("{clay}\n{opacity}"),
            "shape = \"sphere\"\nradius = 1.0",
        )
    };
    let scene = |opacity| Scene::load(&folder.write("a.toml", clay(opacity))).unwrap();
    let expected = "a.toml: the light of `clay` is not seen: its opacity is 0";
    assert_contains(&scene("opacity = 0.0").warnings.concat(), &[expected]);
    assert_eq!(scene("opacity = 0.1").warnings, [""; 0]);
}

#[test]
fn broken_gltf_files_are_refused() {
    let folder = Folder::new();
    folder.write("buffer.bin", gltf_buffer());
    let good = gltf_json("buffer.bin");
    let case = |from: &str, to: &str, expected: &str| {
        assert!(good.contains(from), "the case `{from}` must change something");
        assert_contains(&mesh_message(&folder, "broken.gltf", good.replace(from, to)), &[expected]);
    };
    case("\"scene\": 0,", "\"scene\": 0", "broken.gltf:1:");
    case("buffer.bin", "missing.bin", "missing.bin: cannot read");
    case("buffer.bin", "data:;base64,AAAA", "truncated: buffer 0 should have 80 bytes, found 3");
    case("buffer.bin", "data:;base64,*", "buffer 0 is not base64 data");
    case(
        "\"byteLength\": 72",
        "\"byteLength\": 720",
        "truncated: buffer view 0 needs 720 bytes from byte 0, its buffer has 80",
    );
    case(
        "\"count\": 3, \"type\": \"SCALAR\"",
        "\"count\": 4, \"type\": \"SCALAR\"",
        "accessor 2: 4 elements of 2 bytes every 2 from byte 0 do not fit into the 6 bytes",
    );
    case(
        "\"componentType\": 5123",
        "\"componentType\": 5122",
        "accessor 2: expected unsigned indices",
    );
    case("\"children\": [1]", "\"children\": [1, 0]", "node 0 has more than one parent");
    case(
        "\"asset\"",
        "\"extensionsRequired\": [\"EXT_unknown\"], \"asset\"",
        "the file requires the extension `EXT_unknown`, which is not supported: export it without",
    );
    let mut bytes = gltf_buffer();
    bytes[74] = 9;
    folder.write("buffer.bin", bytes);
    case(
        "\"scene\": 0",
        "\"scene\": 0 ",
        "accessor 2, element 1 (triangle 0): vertex index 9 is out of range, the primitive has 3 vertices",
    );
    let whole = glb(&gltf_json(""), &gltf_buffer());
    let message = mesh_message(&folder, "short.glb", &whole[..whole.len() - 8]);
    let expected =
        format!("truncated: the header states {} bytes, found {}", whole.len(), whole.len() - 8);
    assert!(message.contains(&expected), "{message}");
    for length in 0..whole.len().min(200) {
        mesh_message(&folder, "short.glb", &whole[..length]);
    }
    let mut small = whole;
    small[8..12].copy_from_slice(&11_u32.to_le_bytes());
    let message = mesh_message(&folder, "small.glb", &small);
    assert!(
        message.contains("the header states 11 bytes, expected at least its own 12"),
        "{message}"
    );
}

#[test]
fn bad_triangles_are_dropped_with_a_warning_that_counts_them() {
    let folder = Folder::new();
    let faces = "3 0 1 2\n3 0 1 1\n3 0 0 0\n3 1 2 3";
    folder.write("bad.ply", ascii_ply(faces).replace("0 1 0\n", "nan 1 0\n"));
    let scene = load(
        &folder,
        &format!("{HEAD}[[object]]\nname = \"b\"\nmesh = \"bad.ply\"\nmaterial = \"grey\"\n"),
    )
    .unwrap();
    assert_eq!(scene.geometry.triangles, [[0, 1, 2]]);
    assert!(scene.geometry.positions.iter().flatten().all(|component| component.is_finite()));
    assert_eq!(
        scene.warnings,
        [
            "object `b` (bad.ply, line 14): dropped 2 triangles of zero area of 4",
            "object `b` (bad.ply, line 14): dropped 1 triangles with infinite or NaN corners of 4"
        ]
    );
}

// Real input

#[test]
fn the_scenes_of_the_repository_load_without_a_warning() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    for name in [
        "buddha_and_car",
        "bathroom",
        "meeting_room",
        "restroom",
        "courtyard",
        "furnace",
        "reading_room",
    ] {
        let scene = Scene::load(&folder.join(format!("{name}.toml"))).unwrap();
        assert_eq!(scene.name, name);
        assert!(scene.warnings.is_empty(), "{name}: {:?}", scene.warnings);
        assert!(scene.geometry.triangles.len() > 10_000, "{name}");
    }
}

#[test]
fn the_four_test_scenes_have_their_triangles() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes");
    if !scenes.is_dir() {
        return;
    }
    for (name, triangles) in [
        ("buddha_and_car", 163_983),
        // 236 slivers of the radiator lose their area where it stands: the file has 96,168.
        ("bathroom", 95_932),
        ("meeting_room", 125_842),
        ("restroom", 63_113),
    ] {
        let scene = Scene::load(&scenes.join(name).join("scene.toml")).unwrap();
        assert_eq!(scene.name, name);
        assert_eq!(scene.geometry.triangles.len(), triangles, "{name}: {:?}", scene.warnings);
    }
}
