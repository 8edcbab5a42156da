//! Measured materials of the shared folder, where it lies beside the repository: their albedos
//! against known figures, and the variance of their samples.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::{
    f64::consts::{FRAC_PI_2, PI},
    path::{Path, PathBuf},
    sync::Arc,
};

use fenestra::math::colour::luminance;
use fenestra::{
    brdf::{self, MaterialTables},
    scene::{
        material::{Material, MaterialKind},
        measured::MeasuredTable,
    },
};
use glam::{DVec3, Vec3, dvec3};
use rayon::prelude::*;

use crate::{support::materials::direction, twin::brdf::evaluate_and_pdf};

/// Returns the path of a file, or `None` where there is no shared folder.
fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes/brdf").join(name);
    path.exists().then_some(path)
}

/// Integrates f(incident) dω over the hemisphere by the midpoint rule over half vectors, dense in
/// θ_h near 0, with dω_i = 4 ω_o·h dω_h.
fn integrate(outgoing: Vec3, f: impl Fn(Vec3) -> DVec3 + Sync) -> DVec3 {
    const POLAR: u32 = 400;
    const AZIMUTH: u32 = 240;
    let ring = |polar: u32| -> DVec3 {
        let root = (f64::from(polar) + 0.5) / f64::from(POLAR);
        let theta = root * root * FRAC_PI_2;
        let sum: DVec3 = (0..AZIMUTH)
            .map(|index| {
                let phi = (f64::from(index) + 0.5) / f64::from(AZIMUTH) * 2.0 * PI;
                let half_vector = direction(theta, phi);
                let cosine = outgoing.dot(half_vector);
                let incident = 2.0 * cosine * half_vector - outgoing;
                if cosine > 0.0 && incident.z > 0.0 {
                    f(incident) * f64::from(4.0 * cosine)
                } else {
                    DVec3::ZERO
                }
            })
            .sum();
        sum * theta.sin() * root * PI
    };
    let sum: DVec3 = (0..POLAR).into_par_iter().map(ring).reduce(|| DVec3::ZERO, |a, b| a + b);
    sum / f64::from(POLAR) * (2.0 * PI / f64::from(AZIMUTH))
}

fn tables(path: &Path) -> MaterialTables {
    let table = Arc::new(MeasuredTable::load(path).unwrap());
    let kind = MaterialKind::Measured { path: path.to_path_buf(), table };
    MaterialTables::new(&[Material::new("measured", kind)]).unwrap()
}

/// Compares cosine-weighted albedos at 15° and, for the Cornell files, 60° with those of pbrt-v2's
/// interpolation of the same samples. At 60° the two coated paints get a third of their albedo from
/// one sample in the highlight. pbrt-v2 spreads it over ten degrees and we do not, so ours may be
/// darker by that much, but not brighter.
#[test]
fn albedos_are_as_known() {
    let known = [
        ("mystique.brdf", 15.0, [0.003, 0.018, 0.017], 0.12, 0.12),
        ("mystique.brdf", 60.0, [0.097, 0.079, 0.080], 0.45, 0.1),
        ("garnet_red.brdf", 15.0, [0.197, 0.046, 0.046], 0.12, 0.12),
        ("garnet_red.brdf", 60.0, [0.218, 0.096, 0.095], 0.12, 0.12),
        ("cayman.brdf", 15.0, [0.0, 0.050, 0.076], 0.12, 0.12),
        ("cayman.brdf", 60.0, [0.047, 0.075, 0.096], 0.45, 0.1),
        ("orange-paint.binary", 15.0, [0.436, 0.146, 0.018], 0.01, 0.01),
        ("teflon.binary", 15.0, [0.339, 0.335, 0.331], 0.01, 0.01),
        ("white-paint.binary", 15.0, [0.351, 0.340, 0.329], 0.015, 0.015),
        ("fruitwood-241.binary", 15.0, [0.063, 0.048, 0.033], 0.02, 0.02),
    ];
    let mut loaded: Option<(PathBuf, MaterialTables)> = None;
    for (name, angle_deg, albedo, darker, brighter) in known {
        let Some(path) = shared(name) else {
            eprintln!("{name}: not present, skipped");
            continue;
        };
        let tables = match loaded.take() {
            Some((previous, tables)) if previous == path => tables,
            _ => tables(&path),
        };
        let outgoing = direction(f64::to_radians(angle_deg), 0.3);
        let found = integrate(outgoing, |incident| {
            (brdf::evaluate(&tables, 0, outgoing, incident) * incident.z).as_dvec3()
        });
        let expected = DVec3::from(albedo);
        eprintln!("{name} at {angle_deg}°: albedo {found:.3}");
        let (lowest, highest) = (
            expected * (1.0 - darker) - DVec3::splat(0.002),
            expected * (1.0 + brighter) + DVec3::splat(0.002),
        );
        assert!(
            found.cmpge(lowest).all() && found.cmple(highest).all(),
            "{name} at {angle_deg}°: {found} against {expected}"
        );
        loaded = Some((path, tables));
    }
}

/// Limits the relative variance of f·cos/pdf, in luminance, to 1 from normal to grazing incidence
/// and to 0.1 for the smooth tables. Cosine sampling of the same materials reaches 50,000.
#[test]
fn measured_materials_are_sampled_well() {
    for name in [
        "mystique.brdf",
        "garnet_red.brdf",
        "cayman.brdf",
        "orange-paint.binary",
        "teflon.binary",
        "white-paint.binary",
        "fruitwood-241.binary",
    ] {
        let Some(path) = shared(name) else {
            eprintln!("{name}: not present, skipped");
            continue;
        };
        let tables = tables(&path);
        for angle_deg in [0.0_f64, 45.0, 75.0, 88.0] {
            let outgoing = direction(angle_deg.to_radians(), 0.3);
            let moments = integrate(outgoing, |incident| {
                let (value, pdf) = evaluate_and_pdf(&tables, 0, outgoing, incident);
                let reflected = f64::from(luminance(value) * incident.z);
                let second =
                    if reflected > 0.0 { reflected * reflected / f64::from(pdf) } else { 0.0 };
                dvec3(reflected, second, f64::from(pdf))
            });
            let variance = moments.y / (moments.x * moments.x) - 1.0;
            eprintln!("{name} {angle_deg}°: variance {variance:.3}, pdf mass {:.3}", moments.z);
            assert!((moments.z - 1.0).abs() < 0.04, "{name} at {angle_deg}°: {}", moments.z);
            let allowed = if name.ends_with(".brdf") { 1.0 } else { 0.1 };
            assert!(variance < allowed, "{name} at {angle_deg}°: relative variance {variance}");
        }
    }
}
