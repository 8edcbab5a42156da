//! Materials of every kind, and directions, for the tests of the reflection models.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{
    path::PathBuf,
    sync::{Arc, OnceLock},
};

use fenestra::{
    brdf::{self, MaterialTables},
    math::random::hash_4d,
    scene::{
        material::{
            Anisotropy, ConductorFresnel, Distribution, Material, MaterialKind, Principled,
        },
        measured::MeasuredTable,
    },
    shader::structs,
};
use glam::{Vec3, vec3};

/// A test material and the angular scale of its narrowest lobe.
pub struct Case {
    pub material: Material,
    pub lobe_width: f32,
}

fn case(name: &str, lobe_width: f32, kind: MaterialKind) -> Case {
    Case { material: Material::new(name, kind), lobe_width }
}

fn plastic(diffuse: Vec3, alpha: f32, ior: f32) -> MaterialKind {
    MaterialKind::Plastic { diffuse, alpha, ior }
}

/// Makes a principled material of index 1.5 without a tint of the specular part.
pub fn principled(base_color: Vec3, metallic: f32, roughness: f32) -> MaterialKind {
    let own = Principled { base_color, metallic, roughness, ..Principled::default() };
    MaterialKind::Principled(own)
}

/// A principled material below a coat: metallic, specular, roughness, weight and roughness of the coat.
fn coated(
    base_color: Vec3,
    [metallic, specular, roughness, coat_weight, coat_roughness]: [f32; 5],
) -> MaterialKind {
    MaterialKind::Principled(Principled {
        base_color,
        metallic,
        roughness,
        specular,
        coat_weight,
        coat_roughness,
        ..Principled::default()
    })
}

/// A principled material below a sheen.
fn cloth(base_color: Vec3, specular: f32, sheen_color: Vec3, sheen_roughness: f32) -> MaterialKind {
    let rest = Principled { metallic: 0.0, roughness: 0.8, specular, ..Principled::default() };
    MaterialKind::Principled(Principled { base_color, sheen_color, sheen_roughness, ..rest })
}

/// A case whose highlights are stretched: strength, and angle from the tangent in radians.
fn brushed(mut case: Case, strength: f32, rotation: f32) -> Case {
    case.material.surface.anisotropy = Anisotropy { strength, rotation, direction: None };
    case
}

/// A case with Beckmann's normals.
fn beckmann(mut case: Case) -> Case {
    case.material.surface.distribution = Distribution::Beckmann;
    case
}

/// Gold near 600, 550 and 450 nm.
const GOLD: ConductorFresnel = ConductorFresnel::Exact {
    reflectance: vec3(0.9, 1.0, 0.8),
    eta: vec3(0.18, 0.42, 1.37),
    k: vec3(3.42, 2.35, 1.77),
};

/// Tabulates a plastic, so that energy, reciprocity and every cell are known.
fn synthetic_table(diffuse: Vec3, alpha: f32) -> Arc<MeasuredTable> {
    let model = MaterialTables::new(&[case("model", alpha, plastic(diffuse, alpha, 1.5)).material])
        .unwrap();
    let table =
        MeasuredTable::tabulate(|outgoing, incident| brdf::evaluate(&model, 0, outgoing, incident));
    Arc::new(table.unwrap())
}

fn measured(diffuse: Vec3, alpha: f32) -> MaterialKind {
    MaterialKind::Measured {
        path: PathBuf::from("synthetic"),
        table: synthetic_table(diffuse, alpha),
    }
}

/// Returns a brushed metal, stretched at half a radian from its tangent, and the same from a table of all
/// turns.
pub fn brushed_and_measured() -> [Material; 2] {
    static BOTH: OnceLock<[Material; 2]> = OnceLock::new();
    let both = BOTH.get_or_init(|| {
        let fresnel = ConductorFresnel::Schlick { reflectance: vec3(0.9, 0.7, 0.5) };
        let metal = case("metal", 0.2, MaterialKind::Conductor { alpha: 0.2, fresnel });
        let metal = brushed(metal, 0.6, 0.5).material;
        let model = MaterialTables::new(std::slice::from_ref(&metal)).unwrap();
        let value = |outgoing, incident| brdf::evaluate(&model, 0, outgoing, incident);
        let table = Arc::new(MeasuredTable::tabulate_turns(value).unwrap());
        let kind = MaterialKind::Measured { path: PathBuf::from("synthetic"), table };
        [metal, brushed(case("measured brushed", 0.2, kind), 1.0, 0.0).material]
    });
    both.clone()
}

/// Makes a rough measured material from a plastic.
pub fn measured_plastic() -> Material {
    case("measured", 0.3, measured(vec3(0.3, 0.2, 0.1), 0.3)).material
}

/// Returns every kind over its range of parameters.
pub fn cases() -> &'static [Case] {
    static CASES: OnceLock<Vec<Case>> = OnceLock::new();
    CASES.get_or_init(|| {
        let grey = ConductorFresnel::Schlick { reflectance: vec3(0.9, 0.7, 0.5) };
        let white = ConductorFresnel::Schlick { reflectance: Vec3::ONE };
        vec![
            case("diffuse", 1.0, MaterialKind::Diffuse { reflectance: vec3(0.8, 0.5, 0.2) }),
            case("mirror-like plastic", 1e-3, plastic(Vec3::ONE, 1e-3, 1.5)),
            case("glossy plastic", 0.1, plastic(vec3(0.1, 0.4, 0.7), 0.1, 1.5)),
            case("rough plastic", 0.5, plastic(Vec3::ONE, 0.5, 1.8)),
            case("black plastic", 0.3, plastic(Vec3::ZERO, 0.3, 1.33)),
            case(
                "mirror-like conductor",
                1e-3,
                MaterialKind::Conductor { alpha: 1e-3, fresnel: white },
            ),
            case("gold", 0.1, MaterialKind::Conductor { alpha: 0.1, fresnel: GOLD }),
            case("rough conductor", 0.5, MaterialKind::Conductor { alpha: 0.5, fresnel: grey }),
            case("roughest conductor", 1.0, MaterialKind::Conductor { alpha: 1.0, fresnel: GOLD }),
            case("measured glossy", 0.05, measured(vec3(0.1, 0.2, 0.05), 0.05)),
            case("measured rough", 0.3, measured(vec3(0.6, 0.5, 0.4), 0.3)),
            case("principled", 0.25, principled(vec3(0.8, 0.4, 0.1), 0.0, 0.5)),
            case("polished principled", 1e-3, principled(vec3(0.1, 0.3, 0.9), 0.0, 0.0)),
            case("rough white principled", 1.0, principled(Vec3::ONE, 0.0, 1.0)),
            case("black principled", 0.09, principled(Vec3::ZERO, 0.0, 0.3)),
            case("principled metal", 0.09, principled(vec3(1.0, 0.7, 0.3), 1.0, 0.3)),
            case("half metal", 0.16, principled(vec3(0.9, 0.6, 0.3), 0.5, 0.4)),
            case(
                "principled with specular",
                0.2,
                MaterialKind::Principled(Principled {
                    base_color: vec3(0.2, 0.5, 0.3),
                    metallic: 0.2,
                    roughness: 0.2_f32.sqrt(),
                    ior: 1.8,
                    specular: 0.6,
                    specular_color: vec3(1.0, 2.0, 20.0),
                    ..Principled::default()
                }),
            ),
            case("polished paint", 1e-3, coated(vec3(0.6, 0.1, 0.05), [0.0, 1.0, 0.5, 1.0, 0.0])),
            case("coated white", 0.06, coated(Vec3::ONE, [0.0, 0.0, 1.0, 1.0, 0.25])),
            case("coated metal", 0.1, coated(vec3(1.0, 0.7, 0.3), [1.0, 1.0, 0.5, 0.7, 0.2])),
            case("rough coat", 0.04, coated(vec3(0.8, 0.4, 0.2), [0.4, 1.0, 0.2, 1.0, 0.6])),
            case("coated black", 0.06, coated(Vec3::ZERO, [0.0, 0.0, 1.0, 1.0, 0.25])),
            case("velvet", 0.2, cloth(vec3(0.2, 0.02, 0.05), 1.0, vec3(0.9, 0.3, 0.5), 0.35)),
            case("white cloth", 0.5, cloth(Vec3::ONE, 0.0, Vec3::ONE, 0.6)),
            brushed(
                case("brushed gold", 0.1, MaterialKind::Conductor { alpha: 0.1, fresnel: GOLD }),
                0.5,
                0.6,
            ),
            brushed(
                case("brushed half metal", 0.09, principled(vec3(0.9, 0.6, 0.3), 0.5, 0.3)),
                0.6,
                -1.1,
            ),
            brushed(
                case("brushed lacquer", 0.07, coated(Vec3::ONE, [1.0, 1.0, 0.3, 0.5, 0.25])),
                0.4,
                2.0,
            ),
            case(
                "sheet",
                1.0,
                MaterialKind::DiffuseTransmission {
                    reflectance: 0.25 * vec3(0.8, 0.5, 0.2),
                    transmittance: 0.75 * vec3(0.8, 0.5, 0.2),
                },
            ),
            beckmann(case("white plastic of Beckmann's", 0.4, plastic(Vec3::ONE, 0.4, 1.5))),
            beckmann(brushed(
                case(
                    "gold of Beckmann's",
                    0.1,
                    MaterialKind::Conductor { alpha: 0.1, fresnel: GOLD },
                ),
                0.5,
                0.6,
            )),
            beckmann(case(
                "metal of Beckmann's",
                0.3,
                MaterialKind::Conductor { alpha: 0.3, fresnel: grey },
            )),
            Case { material: brushed_and_measured()[1].clone(), lobe_width: 0.2 },
        ]
    })
}

/// Returns the device tables of [`cases`].
pub fn tables() -> &'static MaterialTables {
    static TABLES: OnceLock<MaterialTables> = OnceLock::new();
    TABLES.get_or_init(|| {
        let materials: Vec<Material> = cases().iter().map(|case| case.material.clone()).collect();
        MaterialTables::new(&materials).unwrap()
    })
}

/// Returns every specular kind: tinted and not, smooth and rough, of indices above
/// and below 1.
pub fn specular_materials() -> Vec<Material> {
    let tint = vec3(0.9, 0.6, 0.3);
    let kinds = [
        MaterialKind::Mirror { reflectance: tint },
        MaterialKind::glass(1.5, 0.0),
        MaterialKind::glass(1.5, 0.2),
        MaterialKind::glass(1.33, 0.5),
        MaterialKind::glass(2.4, 0.35),
        MaterialKind::glass(0.75, 0.3),
        MaterialKind::Dielectric {
            ior: 1.5,
            alpha: 0.3,
            reflectance: 0.5 * tint,
            transmittance: tint,
            absorption: 2.0 * tint,
        },
        MaterialKind::pane(1.5, tint),
    ];
    let glass = beckmann(case("specular", 0.4, MaterialKind::glass(1.5, 0.4)));
    let all = kinds.map(|kind| Material::new("specular", kind)).into_iter();
    let pane = MaterialKind::ThinDielectric {
        ior: 1.5,
        alpha: 0.3,
        reflectance: Vec3::ONE,
        transmittance: tint,
    };
    all.chain([glass.material, Material::new("rough pane", pane)]).collect()
}

/// Returns the device's materials of [`specular_materials`].
pub fn specular() -> &'static [structs::Material] {
    static MATERIALS: OnceLock<Vec<structs::Material>> = OnceLock::new();
    MATERIALS.get_or_init(|| MaterialTables::new(&specular_materials()).unwrap().materials)
}

/// Returns three reproducible numbers in [0, 1).
pub fn uniform(index: u32, stream: u32) -> Vec3 {
    let [x, y, z, _] = hash_4d([index, stream, 17, 4711]);
    let unit = |bits: u32| (bits >> 8) as f32 / 16_777_216.0;
    vec3(unit(x), unit(y), unit(z))
}

/// Returns the unit vector of polar angle θ and azimuth φ, in radians.
pub fn direction(theta: f64, phi: f64) -> Vec3 {
    glam::dvec3(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()).as_vec3()
}

/// Returns a direction above the surface, uniform over the hemisphere.
pub fn hemisphere(index: u32, stream: u32) -> Vec3 {
    let u = uniform(index, stream);
    direction(f64::from(1.0 - u.x).acos(), f64::from(u.y) * std::f64::consts::TAU)
}
