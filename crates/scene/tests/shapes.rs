//! Shapes of scene files: closed, wound outward, of their volume, with coordinates that are not mirrored.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::{
    collections::HashMap,
    f64::consts::{PI, TAU},
};

use fenestra_scene::{Geometry, Scene};
use glam::{DVec2, DVec3, Vec3};

use crate::support::gltf::png;

/// Loads a shape by the keys of its table, with texture coordinates.
fn shape(kind: &str, keys: &str) -> Result<Geometry, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.png"), png([[255; 4]; 2])).unwrap();
    let path = folder.path().join("room.toml");
    let text = format!(
        "[camera]\nposition = [0, 1, 5]\nlook_at = [0, 1, 0]\nvertical_fov_deg = 40\n\
         [[material]]\nname = \"grey\"\ntype = \"diffuse\"\nreflectance = {{ texture = \"a.png\" }}\n\
         [[object]]\nshape = \"{kind}\"\nmaterial = \"grey\"\n{keys}\n"
    );
    std::fs::write(&path, text).unwrap();
    Scene::load(&path).map(|scene| scene.geometry).map_err(|error| error.to_string())
}

/// Volume inside a closed mesh, by the divergence theorem.
fn volume(mesh: &Geometry) -> f64 {
    let corner = |index: u32| DVec3::from(mesh.positions[index as usize].map(f64::from));
    let part = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(corner);
        a.dot(b.cross(c)) / 6.0
    };
    mesh.triangles.iter().map(part).sum()
}

/// Asserts that every edge is walked equally often both ways, that normals and winding agree and
/// nothing is degenerate; returns the volume and the Euler characteristic.
fn check_closed(mesh: &Geometry) -> (f64, i64) {
    let mut ids = HashMap::new();
    let mut id = |index: u32| {
        let bits = mesh.positions[index as usize].map(|component| (component + 0.0).to_bits());
        let next = ids.len();
        *ids.entry(bits).or_insert(next)
    };
    let mut edges: HashMap<(usize, usize), i64> = HashMap::new();
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(&mut id);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            assert_ne!(from, to, "a triangle has an edge without length");
            *edges.entry((from.min(to), from.max(to))).or_default() +=
                if from < to { 1 } else { -1 };
        }
    }
    let open = edges.values().filter(|balance| **balance != 0).count();
    assert_eq!(open, 0, "of {} edges so many are open", edges.len());
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|index| Vec3::from_array(mesh.positions[index as usize]));
        let face = (b - a).cross(c - a);
        assert!(face.length() > 0.0);
        for &index in triangle {
            let normal = Vec3::from_array(mesh.normals[index as usize]);
            assert!((normal.length() - 1.0).abs() < 1e-5, "{normal}");
            assert!(face.normalize().dot(normal) > 0.3, "normal {normal} on a face to {face}");
        }
    }
    let characteristic = ids.len() as i64 - edges.len() as i64 + mesh.triangles.len() as i64;
    (volume(mesh), characteristic)
}

fn assert_close(found: f64, expected: f64, relative: f64) {
    assert!((found / expected - 1.0).abs() < relative, "found {found}, expected {expected}");
}

#[test]
fn box_has_twelve_triangles_and_its_volume() {
    let mesh = shape("box", "size = [2.0, 3.0, 0.5]").unwrap();
    assert_eq!(mesh.triangles.len(), 12);
    let (volume, characteristic) = check_closed(&mesh);
    assert_close(volume, 3.0, 1e-6);
    assert_eq!(characteristic, 2);
    let low = mesh.positions.iter().copied().reduce(|a, b| [0, 1, 2].map(|i| a[i].min(b[i])));
    assert_eq!(low, Some([-1.0, -1.5, -0.25]));
}

#[test]
fn rounded_box_has_the_volume_of_a_box_swept_by_a_ball() {
    let mesh = shape("box", "size = [2.0, 3.0, 1.0]\nbevel = 0.2\nbevel_segments = 8").unwrap();
    let (found, characteristic) = check_closed(&mesh);
    // Steiner's formula for the inner box of 1.6 × 2.6 × 0.6 and radius 0.2.
    let (x, y, z, r) = (1.6, 2.6, 0.6, 0.2);
    let expected = x * y * z
        + 2.0 * r * (x * y + y * z + z * x)
        + PI * r * r * (x + y + z)
        + 4.0 / 3.0 * PI * r * r * r;
    assert_close(found, expected, 1e-3);
    assert_eq!(characteristic, 2);
    // A bevel of half the length makes a ball.
    let ball = shape("box", "size = [2.0, 2.0, 2.0]\nbevel = 1.0\nbevel_segments = 12");
    assert_close(check_closed(&ball.unwrap()).0, 4.0 / 3.0 * PI, 5e-3);
}

#[test]
fn surfaces_of_revolution_have_their_volumes() {
    let sphere = shape("sphere", "radius = 2.0\nsegments = 128").unwrap();
    assert_eq!(check_closed(&sphere).1, 2);
    assert_close(check_closed(&sphere).0, 4.0 / 3.0 * PI * 8.0, 2e-3);
    for (position, normal) in sphere.positions.iter().zip(&sphere.normals) {
        let radial = Vec3::from_array(*position).normalize();
        assert!(radial.dot(Vec3::from_array(*normal)) > 1.0 - 1e-6);
    }

    let cylinder = shape("cylinder", "radius = 0.5\nheight = 3.0\nsegments = 256").unwrap();
    assert_eq!(check_closed(&cylinder).1, 2);
    assert_close(check_closed(&cylinder).0, PI * 0.25 * 3.0, 1e-3);
    let rounded = shape("cylinder", "radius = 0.5\nheight = 3.0\nbevel = 0.1").unwrap();
    assert_eq!(check_closed(&rounded).1, 2);
    let ball = shape("cylinder", "radius = 0.5\nheight = 1.0\nbevel = 0.5\nsegments = 128");
    assert_close(check_closed(&ball.unwrap()).0, 4.0 / 3.0 * PI * 0.125, 2e-2);

    let cone = shape("cone", "radius = 1.0\nheight = 3.0\nsegments = 256").unwrap();
    assert_eq!(check_closed(&cone).1, 2);
    assert_close(check_closed(&cone).0, PI, 1e-3);
    let frustum = shape("cone", "radius = 2.0\ntop_radius = 1.0\nheight = 3.0\nsegments = 256");
    assert_close(check_closed(&frustum.unwrap()).0, 7.0 * PI, 1e-3);

    let torus =
        shape("torus", "radius = 2.0\ntube_radius = 0.5\nsegments = 128\ntube_segments = 64");
    let (found, characteristic) = check_closed(&torus.unwrap());
    assert_close(found, 2.0 * PI * PI * 2.0 * 0.25, 3e-3);
    assert_eq!(characteristic, 0);
}

#[test]
fn lathe_caps_open_ends_and_takes_profiles_either_way() {
    // Pappus: area 0.5 × 2, its centroid at radius 1.25.
    let expected = 2.0 * PI * 1.25;
    for profile in [
        "[[1.0, 0.0], [1.5, 0.0], [1.5, 2.0], [1.0, 2.0]]",
        "[[1.0, 2.0], [1.5, 2.0], [1.5, 0.0], [1.0, 0.0]]",
    ] {
        let keys = format!("closed = true\nsegments = 256\nprofile = {profile}");
        let (found, characteristic) = check_closed(&shape("lathe", &keys).unwrap());
        assert_close(found, expected, 1e-3);
        assert_eq!(characteristic, 0);
    }
    for profile in ["[[1.0, 0.0], [1.0, 3.0]]", "[[1.0, 3.0], [1.0, 0.0]]"] {
        let keys = format!("segments = 256\nprofile = {profile}");
        let (found, characteristic) = check_closed(&shape("lathe", &keys).unwrap());
        assert_close(found, 3.0 * PI, 1e-3);
        assert_eq!(characteristic, 2);
    }
}

#[test]
fn lathe_splines_are_smooth_but_for_their_corners() {
    let vase = "smooth = 8\nprofile = [[0.5, 0.0], [0.5, 0.0], [0.8, 0.5], [0.3, 1.0], [0.5, 1.2]]";
    let mesh = shape("lathe", vase).unwrap();
    assert_eq!(check_closed(&mesh).1, 2);
    assert!(mesh.positions.contains(&[0.5, 0.0, 0.0]), "control points are on the curve");
    // A profile that is the same from both ends makes a shape that is.
    let spindle = "smooth = 4\nprofile = [[0.3, 0], [0.6, 0.25], [0.6, 0.75], [0.3, 1]]";
    let positions = shape("lathe", spindle).unwrap().positions;
    for [x, y, z] in &positions {
        let is_mirrored = |other: &[f32; 3]| {
            (other[0] - x).abs() + (other[1] + y - 1.0).abs() + (other[2] - z).abs() < 1e-5
        };
        assert!(positions.iter().any(is_mirrored), "{x} {y} {z}");
    }
    // On a straight wall, every spline point keeps its radius.
    let wall = "smooth = 8\nprofile = [[0.5, 0.0], [0.5, 0.7], [0.5, 1.0]]";
    let (found, _) = check_closed(&shape("lathe", wall).unwrap());
    assert_close(found, PI * 0.25, 2e-3);
}

#[test]
fn extrusions_of_either_turn_and_with_bevel_are_closed() {
    for outline in
        ["[[0,0],[2,0],[2,1],[1,1],[1,3],[0,3]]", "[[0,3],[1,3],[1,1],[2,1],[2,0],[0,0]]"]
    {
        let keys = format!("depth = 0.5\noutline = {outline}");
        let (found, characteristic) = check_closed(&shape("extrude", &keys).unwrap());
        assert_close(found, 2.0, 1e-6);
        assert_eq!(characteristic, 2);
        let keys = format!("{keys}\nbevel = 0.1");
        let (rounded, characteristic) = check_closed(&shape("extrude", &keys).unwrap());
        assert!((1.85..2.0).contains(&rounded), "{rounded}");
        assert_eq!(characteristic, 2);
    }
    let corners: Vec<_> =
        (0..12).map(|corner| DVec2::from_angle(PI * f64::from(corner) / 6.0)).collect();
    let disk = format!("smooth = 16\ndepth = 1.0\noutline = {corners:?}")
        .replace("DVec2(", "[")
        .replace(')', "]");
    let (found, _) = check_closed(&shape("extrude", &disk).unwrap());
    assert_close(found, PI, 2e-2);
    let half_disk = "smooth = 16\ndepth = 1.0\noutline = [[1,0],[1,0],[0,1],[-1,0],[-1,0]]";
    let (found, characteristic) = check_closed(&shape("extrude", half_disk).unwrap());
    assert!((1.0..PI / 2.0).contains(&found), "{found}");
    assert_eq!(characteristic, 2);
}

#[test]
fn tubes_have_the_volume_of_their_path() {
    let straight = "radius = 0.1\nsegments = 128\npath = [[0,0,0],[0,2,0]]";
    let (found, characteristic) = check_closed(&shape("tube", straight).unwrap());
    assert_close(found, PI * 0.01 * 2.0, 1e-3);
    assert_eq!(characteristic, 2);
    let capsule = shape("tube", &format!("round = true\n{straight}")).unwrap();
    assert_close(check_closed(&capsule).0, PI * 0.01 * 2.0 + 4.0 / 3.0 * PI * 0.001, 5e-3);
    let tapered = "radius = [0.1, 0.2]\nsegments = 128\npath = [[0,0,0],[2,0,0]]";
    let tapered = shape("tube", tapered).unwrap();
    assert_close(check_closed(&tapered).0, PI * 0.14 / 3.0, 1e-3);
    let lean = -0.05 / 1.0_f32.hypot(0.05);
    let is_side_or_end = |n: &[f32; 3]| n[0].abs() > 0.999 || (n[0] - lean).abs() < 1e-5;
    assert!(tapered.normals.iter().all(is_side_or_end), "{:?}", tapered.normals);
    // Rings that leave their plane: the frame has to close.
    let ring = "radius = 0.1\nclosed = true\nsmooth = 24\n\
        path = [[1,0.2,0],[0,-0.2,1],[-1,0.2,0],[0,-0.2,-1]]";
    assert_eq!(check_closed(&shape("tube", ring).unwrap()).1, 0);
    let ring: Vec<DVec3> = (0..96)
        .map(|at| TAU * f64::from(at) / 96.0)
        .map(|turn| DVec3::new(turn.cos(), 0.2 * (2.0 * turn).cos(), turn.sin()))
        .collect();
    let length: f64 = (0..96).map(|at| ring[at].distance(ring[(at + 1) % 96])).sum();
    let path: Vec<String> = ring.iter().map(|point| list(*point)).collect();
    let keys = format!(
        "radius = 0.1\nclosed = true\nsegments = 128\nsmooth = 1\npath = [{}]",
        path.join(",")
    );
    let (found, characteristic) = check_closed(&shape("tube", &keys).unwrap());
    assert_close(found, PI * 0.01 * length, 1e-2);
    assert_eq!(characteristic, 0);
    // The first point may be given again as the last, with its radius.
    for smooth in [1, 8] {
        let of = |path: &str| {
            let keys = "radius = 0.1\nclosed = true\npath = [[1,0,0],[0,0,1],[-1,0,0]";
            shape("tube", &format!("smooth = {smooth}\n{keys}{path}]")).unwrap().positions
        };
        assert!(of("") == of(",[1,0,0]"), "smooth = {smooth}");
    }
    let bent = "radius = 0.05\nround = true\npath = [[0,0,0],[0,1,0],[1,1,0],[1,1,1]]";
    assert_eq!(check_closed(&shape("tube", bent).unwrap()).1, 2);
    let sharp = "radius = 0.05\nsmooth = 1\npath = [[0,0,0],[0,1,0],[1,1,0],[1,1,1]]";
    assert_eq!(check_closed(&shape("tube", sharp).unwrap()).1, 2);
    // A spline through these radii falls to 0.05 in the middle. The ends have a vertex on the axis.
    let waist = "radius = [0.5, 0.1, 0.1, 0.5]\npath = [[0,0,0],[1,0,0],[2,0,0],[3,0,0]]";
    let waist = shape("tube", waist).unwrap();
    let radii = waist.positions.iter().map(|[_, y, z]| y.hypot(*z));
    let least = radii.filter(|radius| *radius > 0.01).fold(f32::INFINITY, f32::min);
    assert!((least - 0.1).abs() < 1e-6, "{least}");
}

#[test]
fn blobs_lie_on_the_surface_and_melt_together() {
    // A capsule of no length is a ball.
    for to in ["", ", to = [1, 2, 3]"] {
        let ball = format!("cells = 48\nballs = [{{ at = [1, 2, 3]{to}, radius = 0.5 }}]");
        let ball = shape("blobs", &ball).unwrap();
        let (found, characteristic) = check_closed(&ball);
        assert_close(found, 4.0 / 3.0 * PI * 0.125, 1e-2);
        assert_eq!(characteristic, 2);
        for position in &ball.positions {
            let radius = Vec3::from_array(*position).distance(Vec3::new(1.0, 2.0, 3.0));
            assert!((radius - 0.5).abs() < 1e-3, "{radius}");
        }
    }
    let egg = "cells = 64\nballs = [{ at = [0, 0, 0], radius = [0.5, 1.0, 0.25] }]";
    assert_close(check_closed(&shape("blobs", egg).unwrap()).0, PI / 6.0, 2e-2);
    let capsule = "cells = 96\nballs = [{ at = [0, 0, 0], to = [0, 1, 0], radius = 0.2 }]";
    let expected = PI * 0.04 + 4.0 / 3.0 * PI * 0.008;
    assert_close(check_closed(&shape("blobs", capsule).unwrap()).0, expected, 1e-2);

    let pair = "balls = [{ at = [0, 0, 0], radius = 0.5 }, { at = [1.1, 0, 0], radius = 0.5 }]";
    assert_eq!(check_closed(&shape("blobs", pair).unwrap()).1, 4, "two surfaces");
    let melted = shape("blobs", &format!("blend = 0.15\n{pair}")).unwrap();
    assert_eq!(check_closed(&melted).1, 2, "one surface");

    let shell = "cells = 64\nballs = [{ at = [0, 0, 0], radius = 0.5 }, \
        { at = [0, 0, 0], radius = 0.3, carve = true }]";
    let (found, characteristic) = check_closed(&shape("blobs", shell).unwrap());
    assert_close(found, 4.0 / 3.0 * PI * (0.125 - 0.027), 1e-2);
    assert_eq!(characteristic, 4);
}

/// Part of `blobs`: the radii of an ellipsoid, or the other end of a cone with the radii of both.
#[derive(Clone, Copy)]
enum Part {
    Ball(DVec3, DVec3),
    Cone(DVec3, DVec3, [f64; 2]),
}

impl Part {
    fn keys(self) -> String {
        match self {
            Self::Ball(at, radii) => format!("at = {}, radius = {}", list(at), list(radii)),
            Self::Cone(at, to, [radius, to_radius]) => {
                let ends = format!("at = {}, to = {}", list(at), list(to));
                format!("{ends}, radius = {radius}, to_radius = {to_radius}")
            }
        }
    }

    /// Signed distance, of an ellipsoid by Quilez's bound.
    fn distance(self, point: DVec3) -> f64 {
        match self {
            Self::Ball(center, radii) => {
                let scaled = (point - center) / radii;
                scaled.length() * (scaled.length() - 1.0) / (scaled / radii).length()
            }
            Self::Cone(from, to, [radius, to_radius]) => {
                let axis = to - from;
                let along = ((point - from).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
                point.distance(from + along * axis) - radius - along * (to_radius - radius)
            }
        }
    }
}

fn list(vector: DVec3) -> String {
    format!("[{}, {}, {}]", vector.x, vector.y, vector.z)
}

/// Vertices lie where the joined distance of all parts is 0, along whose gradient their normals point,
/// although blocks of the grid look at the parts near them alone.
#[test]
fn vertices_of_blobs_are_where_all_parts_say() {
    let ball = |at: DVec3, radii: [f64; 3]| Part::Ball(at, radii.into());
    let pair = [ball(DVec3::X, [0.5, 0.2, 0.3]), Part::Cone(DVec3::ZERO, DVec3::Y, [0.3, 0.1])];
    let ring = (0..40).map(|index| {
        let direction = DVec2::from_angle(f64::from(index));
        let at = DVec3::new(direction.x, 0.02 * f64::from(index), direction.y);
        if index % 2 == 0 {
            ball(at, [0.3, 0.06, 0.15])
        } else {
            Part::Cone(at, DVec3::Y, [0.1, 0.05])
        }
    });
    for (added, carved, blend) in [
        (pair.to_vec(), ball(DVec3::Z, [0.8; 3]), 0.1),
        (ring.collect(), ball(DVec3::Y, [0.3; 3]), 0.02),
    ] {
        let joined = |distances: &[f64]| {
            let sum: f64 = distances.iter().map(|distance| (-distance / blend).exp()).sum();
            -blend * sum.ln()
        };
        let distance = |point: DVec3| {
            let all: Vec<_> = added.iter().map(|part| part.distance(point)).collect();
            -joined(&[-joined(&all), carved.distance(point)])
        };
        let keys: String = added.iter().map(|part| format!("{{ {} }},\n", part.keys())).collect();
        let carved_keys = format!("{{ {}, carve = true }}", carved.keys());
        let keys = format!("cells = 80\nblend = {blend}\nballs = [\n{keys}{carved_keys} ]");
        let mesh = shape("blobs", &keys).unwrap();
        let axis = |at: usize| (at as f64 + 0.5) / 20.0 - 2.0;
        let cells = (0..80_usize.pow(3)).map(|at| [at % 80, at / 80 % 80, at / 6400].map(axis));
        let inside = cells.filter(|at| distance(DVec3::from(*at)) < 0.0).count();
        assert_close(volume(&mesh), inside as f64 / 20.0_f64.powi(3), 0.03);
        let mut far = 0;
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            let [at, normal] = [position, normal].map(|v| DVec3::from(v.map(f64::from)));
            let slope = |axis: DVec3| distance(at + 1e-4 * axis) - distance(at - 1e-4 * axis);
            let gradient = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
            let is_there = distance(at).abs() < 1e-3 && gradient.normalize().dot(normal) > 0.999;
            far += usize::from(!is_there);
        }
        // Newton steps stay in their cells, which keeps a few vertices off sharp folds.
        assert!(far * 100 < mesh.positions.len(), "{far} of {}", mesh.positions.len());
    }
}

#[test]
fn grids_are_sheets_of_their_thickness() {
    let flat = shape("grid", "size = [2.0, 3.0]\nthickness = 0.1\ncells = [8, 8]").unwrap();
    let (found, characteristic) = check_closed(&flat);
    assert_close(found, 0.6, 1e-5);
    assert_eq!(characteristic, 2);
    let folded = "size = [2.0, 2.0]\nthickness = 0.004\ncells = [200, 4]\n\
        waves = [{ amplitude = 0.05, wavelength = 0.25 }]";
    let mesh = shape("grid", folded).unwrap();
    assert_eq!(check_closed(&mesh).1, 2);
    let highest = mesh.positions.iter().map(|position| position[1]).fold(0.0, f32::max);
    assert!((highest - 0.052).abs() < 1e-3, "{highest}");
    let crest = shape("grid", &folded.replace("0.25 }", "0.25, phase_deg = 90 }")).unwrap();
    let middle = crest.positions.iter().filter(|position| position[0].abs() < 1e-5);
    let highest = middle.map(|position| position[1]).fold(0.0, f32::max);
    assert!((highest - 0.052).abs() < 1e-4, "{highest}");
    // The steepest slope of the wave is 2π · 0.05 / 0.25, along x or z.
    let across =
        folded.replace("[200, 4]", "[4, 200]").replace("0.25 }", "0.25, direction_deg = 90 }");
    for (mesh, axis) in [(&mesh, 0), (&shape("grid", &across).unwrap(), 2)] {
        let top = mesh.normals.iter().filter(|normal| normal[1] > 0.1);
        let steepest = top.map(|normal| normal[axis]).fold(0.0, f32::max);
        assert!((steepest - (0.4 * PI as f32).atan().sin()).abs() < 1e-2, "{axis}: {steepest}");
        // Heights rise along the direction where the phase is 0.
        let is_middle = |at: &[f32; 3]| at[axis].abs() < 3e-3;
        let mut vertices = mesh.positions.iter().zip(&mesh.normals);
        let (_, normal) = vertices.find(|(at, n)| is_middle(at) && n[1] > 0.1).unwrap();
        assert!(normal[axis] < -0.7, "{axis}: {normal:?}");
    }
    let hill = "size = [1.0, 1.0]\nthickness = 0.002\nheights = [[0,0,0],[0,0.3,0],[0,0,0]]";
    let mesh = shape("grid", hill).unwrap();
    assert_eq!(check_closed(&mesh).1, 2);
    let middle =
        mesh.positions.iter().find(|p| p[0].abs() < 1e-6 && p[2].abs() < 1e-6 && p[1] > 0.3);
    assert!((middle.unwrap()[1] - 0.301).abs() < 1e-5);
    // Rows run from −z to +z, each from −x to +x.
    let corner = "size = [1.0, 1.0]\ncells = [1, 1]\nheights = [[0, 0.3], [0, 0]]";
    let mesh = shape("grid", corner).unwrap();
    let highest = mesh.positions.iter().max_by(|a, b| a[1].total_cmp(&b[1])).unwrap();
    assert!(highest[0] > 0.49 && highest[2] < -0.49, "{highest:?}");
}

#[test]
fn splines_of_too_many_triangles_are_refused_before_they_are_built() {
    let points: Vec<_> = (0..40).map(|y| format!("[1, {y}]")).collect();
    let profile = points.join(",");
    let lathe = format!("profile = [{profile}]\nsmooth = 256\nsegments = 4096");
    let message = shape("lathe", &lathe).unwrap_err();
    assert!(message.contains("may have 33554432 triangles together, found "), "{message}");
}

#[test]
fn impossible_parameters_name_the_key_and_the_value() {
    let message = |result: Result<Geometry, String>| result.unwrap_err();
    let negative = shape("box", "size = [1, -2, 1]");
    assert!(message(negative).ends_with("size: expected a finite number above 0, found -2"));
    let wide = shape("box", "size = [1, 1, 1]\nbevel = 0.6");
    assert!(
        message(wide).ends_with("bevel: expected a number from 0 to 0.5, found 0.6000000238418579")
    );
    let infinite = shape("sphere", "radius = inf");
    assert!(message(infinite).ends_with("radius: expected a finite number above 0, found inf"));
    let many = shape("sphere", "radius = 1\nsegments = 1000000");
    assert!(message(many).ends_with("segments: expected 3 to 4096, found 1000000"));
    let thick = shape("cylinder", "radius = 1\nheight = 0.5\nbevel = 0.3");
    assert!(message(thick).contains("bevel: expected a number from 0 to 0.25"));
    let fat = shape("torus", "radius = 1\ntube_radius = 1");
    assert!(message(fat).contains("tube_radius: expected less than radius (1), found 1"));
    let flat = shape("lathe", "profile = [[0, 0], [0, 1]]");
    assert!(message(flat).contains("off the axis"));
    let lost = shape("lathe", "profile = [[1, nan], [1, 1]]");
    assert!(message(lost).ends_with("profile: expected finite numbers, found NaN"));
    let inside_out = shape("lathe", "profile = [[-1, 0], [1, 1]]");
    assert!(message(inside_out).contains("radii of 0 or more, found -1"));
    let bow_tie = shape("extrude", "depth = 1\noutline = [[0,0],[1,1],[1,0],[0,1]]");
    assert!(message(bow_tie).contains("does not cross"));
    let spike = shape("extrude", "depth = 1\noutline = [[0,0],[2,0],[1,0],[1,1]]");
    assert!(message(spike).contains("does not cross"));
    let narrow =
        shape("extrude", "depth = 1\nbevel = 0.2\noutline = [[0,0],[1,0],[1,0.1],[0,0.1]]");
    assert!(message(narrow).contains("too large for the narrow parts"));
    let lists = shape("tube", "path = [[0,0,0],[0,1,0]]\nradius = [0.1, 0.2, 0.3]");
    assert!(message(lists).contains("expected one number or 2, one per point of path, found 3"));
    let point = shape("tube", "path = [[0,0,0],[0,0,0]]\nradius = 0.1");
    assert!(message(point).contains("points that differ"));
    let hollow = shape("blobs", "balls = [{ at = [0,0,0], radius = 1, carve = true }]");
    assert!(message(hollow).contains("expected one to carve from"));
    let ragged = shape("grid", "size = [1, 1]\nheights = [[0, 0], [0]]");
    assert!(message(ragged).contains("expected rows of 2 numbers, found 1"));
    // The first number of each key.
    for (kind, keys) in [
        ("box", "size = [1, 1, 1]|bevel = 0.1|bevel_segments = 2"),
        ("sphere", "radius = 1|segments = 8"),
        ("cylinder", "radius = 1|height = 1|bevel = 0.1|segments = 8"),
        ("cone", "radius = 1|top_radius = 0.5|height = 1|segments = 8"),
        ("torus", "radius = 1|tube_radius = 0.2|segments = 8|tube_segments = 8"),
        ("lathe", "profile = [[1, 0], [1, 1]]|smooth = 2|crease_deg = 30|segments = 8"),
        (
            "extrude",
            "outline = [[0, 0], [1, 0], [0, 1]]|depth = 1|bevel = 0.1|bevel_segments = 2|smooth = 2|\
             crease_deg = 30",
        ),
        ("tube", "path = [[0, 0, 0], [0, 1, 0]]|radius = 0.1|smooth = 2|segments = 8"),
        ("grid", "size = [1, 1]|thickness = 0.1|cells = [2, 2]"),
        ("blobs", "balls = [{ at = [0, 0, 0], radius = 1 }]|blend = 0.1|cells = 48"),
    ] {
        assert!(shape(kind, &keys.replace('|', "\n")).is_ok(), "{kind}");
        for key in keys.split('|') {
            let name = key.split(' ').next().unwrap();
            let start = key.find(|c: char| c.is_ascii_digit()).unwrap();
            let number = key[start..].split([',', ']']).next().unwrap();
            let is_count = ["segments", "smooth", "cells"].iter().any(|end| name.ends_with(end));
            let wrong = if is_count { "1000000" } else { "nan" };
            let stated = format!("{}{wrong}{}", &key[..start], &key[start + number.len()..]);
            let found = message(shape(kind, &keys.replace(key, &stated).replace('|', "\n")));
            let named = if name == "balls" { "at: " } else { &format!(" {name}: ") };
            assert!(found.contains(named), "{kind}: {found}");
        }
    }
}

/// Asserts that no triangle shows images mirrored, and returns the most and the least stretch: the
/// ratio of an area in texture coordinates to that in metres, both of triangles facing `toward`.
fn check_uvs(mesh: &Geometry, toward: Vec3) -> [f32; 2] {
    assert_eq!(mesh.uvs[0].len(), mesh.positions.len());
    let mut stretch = [f32::INFINITY, 0.0_f32];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|index| Vec3::from_array(mesh.positions[index as usize]));
        let [p, q, r] = triangle.map(|index| glam::Vec2::from_array(mesh.uvs[0][index as usize]));
        let face = (b - a).cross(c - a);
        let image = (q - p).perp_dot(r - p);
        assert!(image > -1e-6, "mirrored by {image}");
        if face.normalize().dot(toward) > 0.999 {
            stretch =
                [stretch[0].min(image / face.length()), stretch[1].max(image / face.length())];
        }
    }
    stretch
}

#[test]
fn texture_coordinates_are_metres_and_not_mirrored() {
    let close = |[low, high]: [f32; 2]| assert!(low > 0.99 && high < 1.01, "{low} to {high}");
    let cuboid = shape("box", "size = [2.0, 3.0, 0.5]").unwrap();
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        close(check_uvs(&cuboid, axis));
        close(check_uvs(&cuboid, -axis));
    }
    // The face +Z has (0, 0) at its lower left corner and (2, 3) at its upper right one.
    for (position, uv) in [([-1.0, -1.5, 0.25], [0.0, 0.0]), ([1.0, 1.5, 0.25], [2.0, 3.0])] {
        let is_there = |index: &usize| mesh_at(&cuboid, *index) == (position, [0.0, 0.0, 1.0]);
        let index = (0..cuboid.positions.len()).find(is_there).unwrap();
        assert_eq!(cuboid.uvs[0][index], uv);
    }
    let sheet = shape("grid", "size = [2.0, 3.0]\ncells = [4, 4]").unwrap();
    close(check_uvs(&sheet, Vec3::Y));
    close(check_uvs(&sheet, Vec3::NEG_Y));
    let prism = shape("extrude", "outline = [[0, 0], [2, 0], [2, 1], [0, 1]]\ndepth = 0.5");
    let prism = prism.unwrap();
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        close(check_uvs(&prism, axis));
        close(check_uvs(&prism, -axis));
    }
    // u runs once around a lathe, either way its profile runs, and v along the profile.
    for profile in ["[[0, 0], [1, 0], [1, 2], [0, 2]]", "[[0, 2], [1, 2], [1, 0], [0, 0]]"] {
        let lathe = shape("lathe", &format!("profile = {profile}\nsegments = 256")).unwrap();
        check_uvs(&lathe, Vec3::X);
        let range = |axis: usize| {
            let values = || lathe.uvs[0].iter().map(|uv| uv[axis]);
            values().fold(f32::MIN, f32::max) - values().fold(f32::MAX, f32::min)
        };
        assert_eq!([range(0), range(1)], [1.0, 4.0]);
    }
    let tube = shape("tube", "path = [[0, 0, 0], [0, 2, 0]]\nradius = 0.1").unwrap();
    check_uvs(&tube, Vec3::X);
    assert!(tube.uvs[0].contains(&[1.0, 2.0]));
    let blobs = shape("blobs", "balls = [{ at = [0, 0, 0], radius = 1.0 }]\ncells = 8");
    assert!(blobs.unwrap().uvs[0].is_empty());
}

fn mesh_at(mesh: &Geometry, index: usize) -> ([f32; 3], [f32; 3]) {
    (mesh.positions[index], mesh.normals[index])
}
