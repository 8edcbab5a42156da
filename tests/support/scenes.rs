//! Small scenes made of boxes and spheres, for tests of the renderer.

use std::{path::PathBuf, sync::Arc};

use fenestra::scene::{
    Camera, EnvironmentMap, FilmSettings, Filter, Geometry, Lamp, Scene,
    lamp::LampKind,
    material::{ConductorFresnel, Emission, Material, MaterialKind},
    texture::{Texels, Texture, TextureUse},
};
use glam::Vec3;

use super::materials;

/// Makes a diffuse material.
pub fn diffuse(reflectance: Vec3) -> Material {
    Material::new("diffuse", MaterialKind::Diffuse { reflectance })
}

/// Makes a glossy coat over a blue base.
pub fn plastic(alpha: f32) -> Material {
    let diffuse = Vec3::new(0.2, 0.3, 0.6);
    Material::new("plastic", MaterialKind::Plastic { diffuse, alpha, ior: 1.5 })
}

/// Makes copper (Johnson & Christy 1972, refractive index near 630, 532 and 465 nm).
pub fn copper(alpha: f32) -> Material {
    let fresnel = ConductorFresnel::Exact {
        reflectance: Vec3::ONE,
        eta: Vec3::new(0.27, 1.03, 1.17),
        k: Vec3::new(3.41, 2.58, 2.42),
    };
    Material::new("copper", MaterialKind::Conductor { alpha, fresnel })
}

/// Makes a camera that looks from `position` to `look_at`.
fn camera(position: Vec3, look_at: Vec3) -> Camera {
    Camera {
        position,
        look_at,
        up: Vec3::Y,
        vertical_fov_deg: 50.0,
        aperture_radius: 0.0,
        focus_distance: 1.0,
        shift: [0.0; 2],
        mirrored: false,
    }
}

fn scene(
    name: &str,
    camera: Camera,
    size: [u32; 2],
    environment: EnvironmentMap,
    materials: Vec<Material>,
    geometry: Geometry,
) -> Scene {
    Scene {
        name: name.into(),
        path: PathBuf::from(format!("{name}.toml")),
        camera,
        film: FilmSettings { width: size[0], height: size[1], filter: Filter::Box },
        environment,
        lamps: Vec::new(),
        portals: Vec::new(),
        materials,
        geometry,
        inputs: Vec::new(),
        variants: Vec::new(),
        asked: Default::default(),
        warnings: Vec::new(),
        hash: name.into(),
    }
}

/// Adds a box of full lengths `size` around `centre`, flat-shaded, normals outward.
pub fn add_box(geometry: &mut Geometry, centre: Vec3, size: Vec3, material: u32) {
    let first = u32::try_from(geometry.positions.len()).unwrap_or(u32::MAX);
    for corner in 0..8_u8 {
        let sign = |bit: u8| if corner >> bit & 1 == 0 { -0.5 } else { 0.5 };
        let position = centre + size * Vec3::new(sign(0), sign(1), sign(2));
        geometry.positions.push(position.into());
        geometry.normals.push([0.0; 3]);
    }
    let quads =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    for [a, b, c, d] in quads {
        for triangle in [[a, b, c], [a, c, d]] {
            geometry.triangles.push(triangle.map(|corner: u32| first + corner));
            geometry.materials.push(material);
        }
    }
}

/// Adds a horizontal square, seen from above, with half edges of `half`.
pub fn add_square(geometry: &mut Geometry, centre: Vec3, half: f32, material: u32) {
    let first = geometry.positions.len() as u32;
    for [x, z] in [[-half, -half], [-half, half], [half, half], [half, -half]] {
        geometry.positions.push((centre + Vec3::new(x, 0.0, z)).into());
        geometry.normals.push([0.0; 3]);
    }
    geometry.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    geometry.materials.extend([material; 2]);
}

/// Adds a sphere of `rings` × 2 `rings` quads with smooth normals.
pub fn add_sphere(geometry: &mut Geometry, centre: Vec3, radius: f32, rings: u32, material: u32) {
    let first = u32::try_from(geometry.positions.len()).unwrap_or(u32::MAX);
    let segments = 2 * rings;
    for ring in 0..=rings {
        for segment in 0..=segments {
            let theta = std::f32::consts::PI * ring as f32 / rings as f32;
            let phi = std::f32::consts::TAU * segment as f32 / segments as f32;
            let normal = Vec3::new(theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin());
            geometry.positions.push((centre + radius * normal).into());
            geometry.normals.push(normal.into());
        }
    }
    for ring in 0..rings {
        for segment in 0..segments {
            let corner = |r: u32, s: u32| first + (ring + r) * (segments + 1) + segment + s;
            let (a, b, c, d) = (corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1));
            for triangle in [[a, b, c], [a, c, d]] {
                geometry.triangles.push(triangle);
                geometry.materials.push(material);
            }
        }
    }
}

/// Adds a lamp.
pub fn add_lamp(scene: &mut Scene, kind: LampKind) {
    scene.lamps.push(Lamp { name: "lamp".into(), kind, light_group: None });
}

/// Adds a lamp that shines from a point.
pub fn add_point(scene: &mut Scene, position: Vec3, intensity: Vec3) {
    add_lamp(scene, LampKind::Point { position, intensity });
}

/// Tabulates a function of the direction in a map of `width` × `width / 2` texels.
pub fn environment(width: u32, radiance: impl Fn(Vec3) -> Vec3) -> EnvironmentMap {
    let height = width / 2;
    let map = map(width, height, |column, row| {
        let u = (column as f32 + 0.5) / width as f32;
        let v = (row as f32 + 0.5) / height as f32;
        let (azimuth, theta) = ((u - 0.5) * std::f32::consts::TAU, v * std::f32::consts::PI);
        let sine = theta.sin();
        radiance(Vec3::new(sine * azimuth.sin(), theta.cos(), -sine * azimuth.cos()))
    });
    EnvironmentMap { rotation_rad: 0.3, ..map }
}

/// Makes a map of the texels at every column and row.
pub fn map(width: u32, height: u32, texel: impl Fn(u32, u32) -> Vec3) -> EnvironmentMap {
    let texels = (0..width * height).map(|index| texel(index % width, index / width)).collect();
    EnvironmentMap { width, height, texels, rotation_rad: 0.0, source: "test".into() }
}

/// Makes a sky with a bright patch low in the west, a blue zenith and a dim ground.
pub fn sky() -> EnvironmentMap {
    let sun = Vec3::new(-0.8, 0.45, 0.3).normalize();
    environment(64, move |direction| {
        let base = if direction.y < 0.0 {
            Vec3::new(0.1, 0.08, 0.05)
        } else {
            Vec3::new(0.4, 0.6, 1.0) * (0.3 + direction.y)
        };
        base + 200.0 * Vec3::new(1.0, 0.9, 0.7) * ((direction.dot(sun) - 1.0) * 80.0).exp()
    })
}

/// Makes a convex box under a constant environment: pixels see reflectance × radiance, or radiance.
pub fn convex_furnace(material: Material, radiance: Vec3) -> Scene {
    let mut geometry = Geometry::default();
    add_box(&mut geometry, Vec3::ZERO, Vec3::new(1.0, 1.0, 1.0), 0);
    scene(
        "convex_furnace",
        camera(Vec3::new(1.2, 1.5, 2.0), Vec3::ZERO),
        [24, 16],
        environment(16, |_| radiance),
        vec![material],
        geometry,
    )
}

/// Makes a white sphere with a white box beside it under a constant environment of 1: with enough
/// vertices every pixel is 1.
pub fn concave_furnace() -> Scene {
    let mut geometry = Geometry::default();
    add_sphere(&mut geometry, Vec3::ZERO, 0.5, 12, 0);
    add_box(&mut geometry, Vec3::new(0.7, 0.0, 0.0), Vec3::new(0.5, 1.0, 1.0), 0);
    scene(
        "concave_furnace",
        camera(Vec3::new(0.3, 0.6, 2.5), Vec3::new(0.3, 0.0, 0.0)),
        [24, 16],
        environment(16, |_| Vec3::ONE),
        vec![diffuse(Vec3::ONE)],
        geometry,
    )
}

/// Makes a horizontal plane that fills the image, under `environment`.
pub fn plane(reflectance: Vec3, environment: EnvironmentMap) -> Scene {
    let mut geometry = Geometry::default();
    add_box(&mut geometry, Vec3::new(0.0, -0.5, 0.0), Vec3::new(100.0, 1.0, 100.0), 0);
    let mut camera = camera(Vec3::new(0.0, 5.0, 0.1), Vec3::ZERO);
    camera.vertical_fov_deg = 30.0;
    scene("plane", camera, [16, 8], environment, vec![diffuse(reflectance)], geometry)
}

/// Makes three spheres on the ground under the sky, with `materials` in turn.
pub fn open(materials: Vec<Material>) -> Scene {
    let mut geometry = Geometry::default();
    add_box(&mut geometry, Vec3::new(0.0, -0.5, 0.0), Vec3::new(20.0, 1.0, 20.0), 0);
    let count = u32::try_from(materials.len()).unwrap_or(1);
    for index in 0..3 {
        let centre = Vec3::new(index as f32 - 1.0, 0.4, 0.0);
        add_sphere(&mut geometry, centre, 0.4, 12, (index + 1) % count);
    }
    scene(
        "open",
        camera(Vec3::new(0.5, 1.6, 3.0), Vec3::new(0.0, 0.3, 0.0)),
        [32, 24],
        sky(),
        materials,
        geometry,
    )
}

/// Makes a diffuse, a coated, a glossy and a measured material.
pub fn every_kind() -> Vec<Material> {
    let dull = diffuse(Vec3::new(0.5, 0.4, 0.3));
    vec![dull, plastic(0.25), copper(0.3), materials::measured_plastic()]
}

/// Makes a [`room`] with a diffuse, a glossy and a coated material.
pub fn mixed_room() -> Scene {
    room(vec![diffuse(Vec3::splat(0.6)), copper(0.15), plastic(0.3)])
}

/// Makes a room with one window to the west, a box and a sphere, with `materials` in turn.
pub fn room(materials: Vec<Material>) -> Scene {
    let mut geometry = Geometry::default();
    let count = u32::try_from(materials.len()).unwrap_or(1);
    let mut slab = |centre: [f32; 3], size: [f32; 3]| {
        add_box(&mut geometry, Vec3::from(centre), Vec3::from(size), 0);
    };
    slab([0.0, -0.1, 0.0], [4.4, 0.2, 4.4]);
    slab([0.0, 2.6, 0.0], [4.4, 0.2, 4.4]);
    slab([2.1, 1.25, 0.0], [0.2, 2.5, 4.4]);
    slab([0.0, 1.25, -2.1], [4.4, 2.5, 0.2]);
    slab([0.0, 1.25, 2.1], [4.4, 2.5, 0.2]);
    slab([-2.1, 0.4, 0.0], [0.2, 0.8, 4.0]);
    slab([-2.1, 2.25, 0.0], [0.2, 0.5, 4.0]);
    slab([-2.1, 1.4, -1.3], [0.2, 1.2, 1.4]);
    slab([-2.1, 1.4, 1.3], [0.2, 1.2, 1.4]);
    add_box(&mut geometry, Vec3::new(0.6, 0.5, -0.8), Vec3::new(0.8, 1.0, 0.8), 1 % count);
    add_sphere(&mut geometry, Vec3::new(-0.5, 0.5, 0.0), 0.5, 12, 2 % count);
    scene(
        "room",
        camera(Vec3::new(1.2, 1.4, 1.9), Vec3::new(-0.4, 0.8, -0.5)),
        [32, 24],
        sky(),
        materials,
        geometry,
    )
}

/// Takes the ceiling off a [`room`].
pub fn without_ceiling(mut scene: Scene) -> Scene {
    // Its slab comes after that of the floor, each of twelve triangles.
    scene.geometry.triangles.drain(12..24);
    scene.geometry.materials.drain(12..24);
    scene.name += "_without_ceiling";
    scene.hash = scene.name.clone();
    scene
}

/// Makes a [`room`] of chequered walls whose window has a pane, with a glass sphere, a mirror box, a
/// lamp under the ceiling, a glowing box of glossy paint and a sheet that is half opaque.
pub fn glazed_room() -> Scene {
    let glass = MaterialKind::Dielectric {
        ior: 1.5,
        alpha: 0.0,
        reflectance: Vec3::ONE,
        transmittance: Vec3::splat(0.9),
        absorption: Vec3::new(2.0, 0.5, 1.0),
    };
    let pane = MaterialKind::pane(1.5, Vec3::new(0.8, 0.9, 0.85));
    let paint = materials::principled(Vec3::new(0.7, 0.4, 0.3), 0.3, 0.5);
    let mut glowing = Material::new("paint", paint);
    let radiance = Vec3::new(6.0, 4.0, 2.0);
    glowing.surface.emission = Some(Emission { radiance, texture: None, two_sided: false });
    let mut sheet = diffuse(Vec3::new(0.2, 0.6, 0.3));
    sheet.surface.opacity.factor = 0.5;
    let texels = vec![[230, 230, 230, 255], [90, 120, 200, 255], [90, 120, 200, 255], [230; 4]];
    let texture =
        Texture { name: "chequers".into(), width: 2, height: 2, texels: Texels::Bytes(texels) };
    let mut walls = diffuse(Vec3::splat(0.8));
    walls.surface.color = Some(TextureUse::new(Arc::new(texture)));
    let mut scene = room(vec![
        walls,
        Material::new("mirror", MaterialKind::Mirror { reflectance: Vec3::splat(0.9) }),
        Material::new("glass", glass),
        Material::new("pane", pane),
        glowing,
        sheet,
    ]);
    add_box(&mut scene.geometry, Vec3::new(-2.1, 1.4, 0.0), Vec3::new(0.02, 1.2, 1.2), 3);
    add_box(&mut scene.geometry, Vec3::new(1.2, 0.2, 0.6), Vec3::splat(0.2), 4);
    add_box(&mut scene.geometry, Vec3::new(-1.0, 1.0, 0.9), Vec3::new(0.6, 0.6, 0.01), 5);
    let uvs = scene.geometry.positions.iter().map(|&[x, y, z]| [x + y, z - y]);
    scene.geometry.uvs[0] = uvs.collect();
    add_point(&mut scene, Vec3::new(0.3, 2.3, 0.4), Vec3::splat(1.5));
    scene.name = "glazed_room".into();
    scene.hash = scene.name.clone();
    scene
}
