//! Reflection models: reciprocity, conservation of energy, and samples that follow their density.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::{FRAC_PI_2, PI};

use fenestra::{
    brdf::{MaterialTables, evaluate, fresnel, ggx},
    math::colour::luminance,
    scene::material::{Anisotropy, MaterialKind, Principled},
    scene::measured::lookup::cosine_table,
    shader::{constants::*, structs},
};
use glam::{DVec2, DVec3, Vec3, vec3};
use rayon::prelude::*;

use crate::{
    support::{
        assert_error,
        materials::{cases, direction, hemisphere, tables, uniform},
        statistics,
    },
    twin::brdf,
};

/// Polar angles of the outgoing direction, in degrees.
const ANGLES_DEG: [f64; 6] = [0.0, 20.0, 50.0, 75.0, 85.0, 89.5];

/// Returns an outgoing direction of this polar angle, away from the axes.
fn outgoing(angle_deg: f64) -> Vec3 {
    direction(angle_deg.to_radians(), 0.7)
}

/// Iterates over all pairs of case and angle.
fn case_angles() -> impl ParallelIterator<Item = (usize, f64)> {
    // Make the tables first: a worker that makes them with others could be given work that needs them.
    tables();
    (0..cases().len() * ANGLES_DEG.len())
        .into_par_iter()
        .map(|index| (index / ANGLES_DEG.len(), ANGLES_DEG[index % ANGLES_DEG.len()]))
}

#[test]
fn values_are_reciprocal() {
    for (material, case) in cases().iter().enumerate() {
        for index in 0..20_000 {
            let a = hemisphere(index, 1);
            // Sample half of the pairs from the BRDF to hit its lobes.
            let b = if index % 2 == 0 {
                hemisphere(index, 2)
            } else {
                brdf::sample(tables(), material, a, uniform(index, 2))
            };
            let (there, back) =
                (evaluate(tables(), material, a, b), evaluate(tables(), material, b, a));
            let difference = (there - back).abs().max_element();
            assert!(
                difference <= 1e-4 * there.max_element(),
                "{}: {there} against {back} for {a}, {b}",
                case.material.name
            );
        }
    }
}

#[test]
fn nothing_is_reflected_below_the_surface() {
    for material in 0..cases().len() {
        for (a, b) in [
            (vec3(0.6, 0.0, 0.8), vec3(-0.6, 0.0, -0.8)),
            (vec3(0.6, 0.0, -0.8), vec3(-0.6, 0.0, 0.8)),
            (vec3(0.6, 0.0, 0.8), vec3(1.0, 0.0, 0.0)),
        ] {
            let found = brdf::evaluate_and_pdf(tables(), material, a, b);
            // Seen from its other side, a sheet shows light.
            let is_sheet = tables().materials[material].kind == MATERIAL_DIFFUSE_TRANSMISSION;
            if is_sheet && a.z < 0.0 {
                let found = found.0 * PI as f32;
                assert!(found.abs_diff_eq(vec3(0.8, 0.5, 0.2), 1e-6), "{found}");
                continue;
            }
            assert_eq!(found, (Vec3::ZERO, 0.0));
            let below = brdf::sample(tables(), material, vec3(0.6, 0.0, -0.8), uniform(0, 3));
            assert_eq!(below.z > 0.0, is_sheet, "from below the surface: {below}");
        }
    }
}

/// Estimates the directional albedo, the mean of BRDF·cosine/pdf, and its standard error.
fn sampled_albedo(material: usize, outgoing: Vec3, count: u32) -> (DVec3, DVec3) {
    let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
    for index in 0..count {
        let incident = brdf::sample(tables(), material, outgoing, uniform(index, 4));
        if incident.z > 0.0 {
            let (value, pdf) = brdf::evaluate_and_pdf(tables(), material, outgoing, incident);
            let weight = (value * incident.z / pdf).as_dvec3();
            assert!(
                weight.is_finite() && weight.min_element() >= 0.0,
                "{}: weight {weight} at {incident} seen from {outgoing}",
                cases()[material].material.name
            );
            sum += weight;
            squares += weight * weight;
        }
    }
    let mean = sum / f64::from(count);
    let variance = (squares / f64::from(count) - mean * mean).max(DVec3::ZERO);
    let error = variance / f64::from(count);
    (mean, DVec3::new(error.x.sqrt(), error.y.sqrt(), error.z.sqrt()))
}

/// Returns the most that a material may reflect. The specification of principled materials weights
/// their base by 1 − F of the half vector, whereas the specular part reflects more toward the horizon:
/// there the base comes on top.
fn largest_albedo(material: usize) -> f64 {
    match cases()[material].material.kind {
        MaterialKind::Principled(Principled { base_color, metallic, .. }) => {
            f64::from(1.0 + (1.0 - metallic) * base_color.max_element())
        }
        _ => 1.0,
    }
}

/// White furnace: no material reflects more light than it receives, principled bases at the horizon
/// apart, and the albedo shown in the image is the reflected share.
#[test]
fn no_material_creates_energy() {
    case_angles().for_each(|(material, angle)| {
        let (albedo, error) = sampled_albedo(material, outgoing(angle), 40_000);
        let name = &cases()[material].material.name;
        assert!(
            (albedo - 4.0 * error).max_element() <= largest_albedo(material) + 2e-3,
            "{name} at {angle}° reflects {albedo} ± {error}"
        );
        let shown = brdf::albedo(tables(), material, outgoing(angle)).as_dvec3();
        // A stretched highlight is shown as one of the mean width.
        let is_round = cases()[material].material.surface.anisotropy.strength == 0.0;
        let tolerance = DVec3::splat(if is_round { 0.015 } else { 0.16 }) + 5.0 * error;
        assert!(
            (shown - albedo.min(DVec3::ONE)).abs().cmple(tolerance).all(),
            "{name} at {angle}°: albedo {shown} shown, {albedo} ± {error} reflected"
        );
    });
}

/// Coat and white base together reflect everything, at every angle.
#[test]
fn white_below_a_coat_loses_nothing() {
    let white: Vec<usize> = (0..cases().len())
        .filter(|&index| cases()[index].material.name.ends_with("-like plastic"))
        .chain((0..cases().len()).filter(|&index| {
            ["rough plastic", "coated white", "white cloth", "white plastic of Beckmann's"]
                .contains(&cases()[index].material.name.as_str())
        }))
        .collect();
    assert_eq!(white.len(), 5);
    for material in white {
        for angle in ANGLES_DEG {
            let (albedo, error) = sampled_albedo(material, outgoing(angle), 100_000);
            assert!(
                (albedo - DVec3::ONE).abs().cmple(DVec3::splat(3e-3) + 4.0 * error).all(),
                "{} at {angle}° reflects {albedo} ± {error}",
                cases()[material].material.name
            );
        }
    }
}

/// A lossless mirror-like conductor loses only what masking hides.
#[test]
fn smooth_white_conductor_loses_nothing() {
    let material = cases().iter().position(|case| case.material.name.ends_with("-like conductor"));
    for angle in [0.0, 20.0, 50.0, 75.0, 85.0] {
        let (albedo, _) = sampled_albedo(material.unwrap(), outgoing(angle), 20_000);
        assert!((albedo - DVec3::ONE).abs().max_element() < 1e-3, "{angle}°: {albedo}");
    }
}

/// Sums the light that a principled material reflects by the formulas of glTF 2.0, appendix B, and of
/// its extensions for index, specular and anisotropy, written out for one pair of directions. The x axis is
/// the tangent.
fn principled_by_the_book(
    material: Principled,
    Anisotropy { strength, rotation, .. }: &Anisotropy,
    view: DVec3,
    light: DVec3,
) -> DVec3 {
    let Principled { base_color, metallic, roughness, ior, specular, specular_color, .. } =
        material;
    let half_vector = (view + light).normalize();
    let (alpha, base_color) = (f64::from(roughness).powi(2), base_color.as_dvec3());
    let along = alpha + (1.0 - alpha) * f64::from(*strength).powi(2);
    let tangent = DVec2::from_angle(f64::from(*rotation));
    // Lengths along the tangent and across, each times a width, and along the normal.
    let scaled = |direction: DVec3, along: f64, across: f64, normal: f64| {
        let [x, y] = [tangent, tangent.perp()].map(|axis| axis.dot(direction.truncate()));
        DVec3::new(along * x, across * y, normal * direction.z)
    };
    let area = along * alpha;
    let inverse = area / scaled(half_vector, alpha, along, area).length_squared();
    let distribution = area * inverse * inverse / PI;
    let [out, into] = [view, light].map(|way| scaled(way, along, alpha, 1.0).length());
    let visibility = 0.5 / (light.z * out + view.z * into);
    let specular_brdf = distribution * visibility;
    let rise = (1.0 - view.dot(half_vector)).powi(5);
    let metal = specular_brdf * (base_color + (DVec3::ONE - base_color) * rise);
    let f0 = ((1.0 - f64::from(ior)) / (1.0 + f64::from(ior))).powi(2) * specular_color.as_dvec3();
    let f0 = f0.min(DVec3::ONE);
    let fr = f0 + (DVec3::ONE - f0) * rise;
    let specular = f64::from(specular);
    let dielectric =
        (1.0 - specular * fr.max_element()) * base_color / PI + specular * fr * specular_brdf;
    dielectric.lerp(metal, f64::from(metallic))
}

/// White sheen by the formulas of `KHR_materials_sheen`.
fn sheen_by_the_book(roughness: f32, view: DVec3, light: DVec3) -> f64 {
    let alpha = f64::from(roughness).powi(2);
    let half_vector = (view + light).normalize();
    let sine = (1.0 - half_vector.z * half_vector.z).sqrt();
    let distribution = (2.0 + 1.0 / alpha) * sine.powf(1.0 / alpha) / (2.0 * PI);
    let weight = (1.0 - alpha).powi(2);
    let between = |rough: f64, smooth: f64| rough + (smooth - rough) * weight;
    let fit = |cosine: f64| {
        between(21.5473, 25.3245)
            / (1.0 + between(3.82987, 3.32435) * cosine.powf(between(0.19823, 0.16801)))
            + between(-1.9776, -1.27393) * cosine
            + between(-4.32054, -4.85967)
    };
    let lambda = |cosine: f64| match cosine < 0.5 {
        true => fit(cosine).exp(),
        false => (2.0 * fit(0.5) - fit(1.0 - cosine)).exp(),
    };
    let masking = (1.0 + lambda(view.z) + lambda(light.z)) * 4.0 * view.z * light.z;
    distribution * masking.recip().min(1.0)
}

#[test]
fn principled_materials_follow_the_specification() {
    let mut seen = 0;
    for (material, case) in cases().iter().enumerate() {
        // The formulas of the specification cancel for the narrowest lobes.
        if let MaterialKind::Principled(book) = case.material.kind
            && book.roughness > 0.1
            && (book.coat_weight == 0.0 || book.coat_roughness > 0.1)
        {
            seen += 1;
            // A coat is the dielectric of index 1.5 on black; `white_below_a_coat_loses_nothing` judges how
            // it dims the rest.
            let (roughness, base_color) = (book.coat_roughness, Vec3::ZERO);
            let coat = Principled { base_color, metallic: 0.0, roughness, ..Principled::default() };
            let table = tables().materials[material].cover_table + COAT_TRANSMISSION_OFFSET;
            let through =
                |direction: Vec3| f64::from(cosine_table(&tables().words, table, 1, direction.z));
            for index in 0..2_000 {
                let (view, light) = (hemisphere(index, 21), hemisphere(index, 22));
                let [out, into] = [view, light].map(|way| way.as_dvec3().normalize());
                let anisotropy = &case.material.surface.anisotropy;
                let mut expected = principled_by_the_book(book, anisotropy, out, into);
                if book.coat_weight > 0.0 {
                    expected *= through(view) * through(light);
                    expected += f64::from(book.coat_weight)
                        * principled_by_the_book(coat, &Anisotropy::default(), out, into);
                }
                if book.sheen_color != Vec3::ZERO {
                    expected *= through(view) * through(light);
                    expected += book.sheen_color.as_dvec3()
                        * sheen_by_the_book(book.sheen_roughness, out, into);
                }
                let found = evaluate(tables(), material, view, light).as_dvec3();
                assert!(
                    (found - expected).abs().max_element() < 1e-4 * expected.max_element() + 1e-6,
                    "{}: {found} against {expected} for {view}, {light}",
                    case.material.name
                );
            }
        }
    }
    assert_eq!(seen, 14);
}

/// Coats of plastics are sampled as often as light is reflected by them, whatever the colour below.
#[test]
fn coats_are_sampled_by_their_share_of_the_light() {
    let mut seen = 0;
    for (case, converted) in cases().iter().zip(&tables().materials) {
        let MaterialKind::Plastic { diffuse, .. } = case.material.kind else { continue };
        for angle in ANGLES_DEG {
            let cosine = outgoing(angle).z;
            let at = |offset| {
                let table = converted.table_offset + offset;
                f64::from(cosine_table(&tables().words, table, 1, cosine))
            };
            let coat = at(0);
            let base = f64::from(luminance(diffuse)) * (1.0 - coat);
            let (share, expected) = (at(PLASTIC_SPECULAR_SHARE_OFFSET), coat / (coat + base));
            let name = &case.material.name;
            assert!(
                (share / expected - 1.0).abs() < 0.02,
                "{name} at {angle}°: {share}, {expected}"
            );
        }
        seen += 1;
    }
    assert!(seen > 1);
}

/// Coloured textures replace the colour of a material but not its tables: values, samples and albedo
/// follow the colour at hand.
#[test]
fn albedo_follows_the_colour_of_the_hit() {
    for (material, case) in cases().iter().enumerate() {
        let mut textured = tables().materials[material];
        let is_replaced = match case.material.kind {
            MaterialKind::Diffuse { .. }
            | MaterialKind::DiffuseTransmission { .. }
            | MaterialKind::Plastic { .. } => true,
            MaterialKind::Conductor { .. } => textured.ior == 0.0,
            MaterialKind::Principled(_) => {
                textured.alpha = 0.5;
                textured.ior = 0.7;
                true
            }
            _ => false,
        };
        if !is_replaced {
            continue;
        }
        textured.reflectance = [0.6, 0.1, 0.3];
        let outgoing = outgoing(40.0);
        let words = &tables().words;
        let (mut sum, count) = (DVec3::ZERO, 40_000);
        for index in 0..count {
            let incident = brdf::brdf_sample(words, &textured, outgoing, uniform(index, 23));
            if incident.z > 0.0 {
                let (value, pdf) =
                    brdf::brdf_evaluate_and_pdf(words, &textured, outgoing, incident);
                sum += (value * incident.z / pdf).as_dvec3();
            }
        }
        let expected = sum / f64::from(count);
        let shown = brdf::brdf_albedo(words, &textured, outgoing).as_dvec3();
        let is_round = case.material.surface.anisotropy.strength == 0.0;
        assert!(
            (shown - expected).abs().max_element() < if is_round { 0.01 } else { 0.05 },
            "{}: {shown} shown, {expected} reflected",
            case.material.name
        );
    }
}

#[test]
#[should_panic(expected = "unknown kind 4711")]
fn unknown_kinds_are_refused() {
    let material = structs::Material { kind: 4711, ..tables().materials[1] };
    brdf::brdf_evaluate_and_pdf(&tables().words, &material, Vec3::Z, Vec3::Z);
}

/// Bins over half vectors, logarithmic in θ_h from a tenth of the lobe's width, and the mass of the
/// density in each.
struct HalfVectorBins {
    /// Edges in θ_h.
    edges: Vec<f64>,
    /// ∫ pdf dω_i of each bin, θ_h outermost.
    masses: Vec<f64>,
}

/// Bins in azimuth.
const AZIMUTH_BINS: usize = 12;

impl HalfVectorBins {
    fn new(material: usize, outgoing: Vec3, lobe_width: f32) -> Self {
        const POLAR_BINS: i32 = 24;
        const POINTS: usize = 24;
        let smallest = 0.1 * f64::from(lobe_width);
        let edges: Vec<f64> = std::iter::once(0.0)
            .chain((0..=POLAR_BINS).map(|bin| {
                smallest * (FRAC_PI_2 / smallest).powf(f64::from(bin) / f64::from(POLAR_BINS))
            }))
            .collect();
        let mass = |polar: usize, azimuth: usize| -> f64 {
            let (lower, upper) = (edges[polar], edges[polar + 1]);
            let mut sum = 0.0;
            for index in 0..POINTS * POINTS {
                let middle = |index: usize| (index as f64 + 0.5) / POINTS as f64;
                let theta = lower + (upper - lower) * middle(index % POINTS);
                let phi =
                    (azimuth as f64 + middle(index / POINTS)) / AZIMUTH_BINS as f64 * 2.0 * PI;
                let half_vector = direction(theta, phi);
                let cosine = outgoing.dot(half_vector);
                let incident = 2.0 * cosine * half_vector - outgoing;
                if cosine > 0.0 && incident.z > 0.0 {
                    let incident = incident.normalize();
                    let (_, pdf) = brdf::evaluate_and_pdf(tables(), material, outgoing, incident);
                    sum += f64::from(pdf) * 4.0 * f64::from(cosine) * theta.sin();
                }
            }
            sum * (upper - lower) * 2.0 * PI / (AZIMUTH_BINS * POINTS * POINTS) as f64
        };
        let masses = (0..(edges.len() - 1) * AZIMUTH_BINS)
            .map(|cell| mass(cell / AZIMUTH_BINS, cell % AZIMUTH_BINS))
            .collect();
        Self { edges, masses }
    }

    fn cell(&self, outgoing: Vec3, incident: Vec3) -> usize {
        let half_vector = (outgoing.as_dvec3() + incident.as_dvec3()).normalize();
        let theta = half_vector.truncate().length().atan2(half_vector.z);
        let phi = half_vector.y.atan2(half_vector.x).rem_euclid(2.0 * PI);
        let polar =
            self.edges.partition_point(|edge| *edge <= theta).clamp(1, self.edges.len() - 1);
        let azimuth = ((phi / (2.0 * PI) * AZIMUTH_BINS as f64) as usize).min(AZIMUTH_BINS - 1);
        (polar - 1) * AZIMUTH_BINS + azimuth
    }
}

/// Tests samples against their density by χ², for every material from normal to grazing incidence.
/// The mass that the density lacks is the share of samples below the surface.
#[test]
fn samples_follow_their_density() {
    const SAMPLES: u32 = 100_000;
    case_angles().for_each(|(material, angle)| {
        let case = &cases()[material];
        let outgoing = outgoing(angle);
        let bins = HalfVectorBins::new(material, outgoing, case.lobe_width);
        let mut observed = vec![0.0; bins.masses.len()];
        let mut below = 0;
        for index in 0..SAMPLES {
            let incident = brdf::sample(tables(), material, outgoing, uniform(index, 5));
            if incident.z > 0.0 {
                observed[bins.cell(outgoing, incident)] += 1.0;
            } else {
                below += 1;
            }
        }
        let name = &case.material.name;
        let mass: f64 = bins.masses.iter().sum();
        let lost = f64::from(below) / f64::from(SAMPLES);
        assert!(
            (mass + lost - 1.0).abs() < 0.01,
            "{name} at {angle}°: the density integrates to {mass}, {lost} fall below the surface"
        );
        // A bin almost wholly below the surface may have no point of the quadrature above it.
        let ([counts, expected], [few, few_expected]) =
            statistics::part_rare_bins(&observed, &bins.masses, SAMPLES);
        assert!(
            few <= few_expected + 6.0 * few_expected.max(1.0).sqrt(),
            "{name} at {angle}°: {few} samples where {few_expected} are expected"
        );
        let p_value = statistics::chi_square_p_value(&counts, &expected);
        assert!(p_value > 1e-5, "{name} at {angle}°: p = {p_value:e}");
    });
}

/// The bounded cap wastes few samples, even on rough surfaces at grazing angles.
#[test]
fn few_samples_fall_below_the_surface() {
    case_angles().for_each(|(material, angle)| {
        let below = (0..10_000)
            .filter(|&index| {
                brdf::sample(tables(), material, outgoing(angle), uniform(index, 6)).z <= 0.0
            })
            .count();
        assert!(below < 2_000, "{} at {angle}°: {below}", cases()[material].material.name);
    });
}

/// Compares Fresnel reflectance with its closed forms: normal, Brewster's angle, grazing.
#[test]
fn fresnel_has_its_closed_forms() {
    for ior in [1.0_f32, 1.33, 1.5, 2.4] {
        let normal = ((ior - 1.0) / (ior + 1.0)).powi(2);
        assert!((fresnel::fresnel_dielectric(1.0, ior) - normal).abs() < 1e-6, "{ior}");
        // At tanθ = n only the perpendicular part remains: ½((n² − 1)/(n² + 1))².
        let brewster = 0.5 * ((ior * ior - 1.0) / (ior * ior + 1.0)).powi(2);
        let cosine = 1.0 / (1.0 + ior * ior).sqrt();
        assert!((fresnel::fresnel_dielectric(cosine, ior) - brewster).abs() < 1e-6, "{ior}");
        if ior > 1.0 {
            assert!((fresnel::fresnel_dielectric(0.0, ior) - 1.0).abs() < 1e-6, "{ior}");
        }
        // A conductor without extinction is a dielectric.
        for cosine in [0.05, 0.3, 0.7, 0.95] {
            let conductor = fresnel::fresnel_conductor(cosine, Vec3::splat(ior), Vec3::ZERO).x;
            let dielectric = fresnel::fresnel_dielectric(cosine, ior);
            assert!((conductor - dielectric).abs() < 1e-4, "{ior}, {cosine}: {conductor}");
        }
    }
    let (eta, k) = (0.2_f32, 3.9_f32);
    let normal = ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k);
    let found = fresnel::fresnel_conductor(1.0, Vec3::splat(eta), Vec3::splat(k)).x;
    assert!((found - normal).abs() < 1e-5, "{found} against {normal}");
}

/// Distributions of normals project to 1, ∫ D cosθ dω = 1, down to the narrowest lobe.
#[test]
fn normals_project_to_one() {
    for (alpha, is_beckmann) in [1e-3_f32, 0.01, 0.1, 0.5, 1.0]
        .into_iter()
        .flat_map(|alpha| [(alpha, false), (alpha, true)])
    {
        let width = ggx::GgxWidth { is_beckmann, ..ggx::GgxWidth::round(alpha) };
        // With tanθ = α√(t/(1−t)) the integrand of GGX is 1 for all t.
        let points = 1000;
        let sum: f64 = (0..points)
            .map(|point| {
                let t = (f64::from(point) + 0.5) / f64::from(points);
                let alpha = f64::from(alpha);
                let theta = (alpha * (t / (1.0 - t)).sqrt()).atan();
                let normal = direction(theta, 0.3);
                // dθ/dt from tanθ = α√(t/(1−t)).
                let tangent = theta.tan();
                let slope = alpha * alpha
                    / (2.0 * tangent * (1.0 - t) * (1.0 - t))
                    / (1.0 + tangent * tangent);
                let density = f64::from(ggx::normal_density(normal, width));
                density * theta.cos() * theta.sin() * 2.0 * PI * slope
            })
            .sum();
        let mean = sum / f64::from(points);
        assert!((mean - 1.0).abs() < 1e-3, "α = {alpha}: {mean}");
    }
}

/// Visible normals cover a surface as the viewer sees it, G₁ ∫ max(0, o·h) D dω = cosθ_o [Heitz 2014];
/// Beckmann's by a fit good to 0.35%.
#[test]
fn visible_normals_cover_the_surface() {
    for (is_beckmann, tolerance) in [(false, 2e-3), (true, 5e-3)] {
        let width = ggx::GgxWidth { is_beckmann, ..ggx::GgxWidth::round(0.5) };
        for angle in ANGLES_DEG {
            let view = outgoing(angle);
            let points = 400;
            let share = |point: u32| (f64::from(point) + 0.5) / f64::from(points);
            let seen: f64 = (0..points * points)
                .map(|index| {
                    let (t, turn) = (share(index / points), share(index % points));
                    let normal = direction(0.5 * PI * t, 2.0 * PI * turn);
                    let solid_angle = PI * PI * (0.5 * PI * t).sin();
                    let density = f64::from(ggx::normal_density(normal, width));
                    f64::from(view.dot(normal).max(0.0)) * density * solid_angle
                })
                .sum::<f64>()
                / f64::from(points * points);
            let cosine = f64::from(view.z);
            let length = f64::from(ggx::masked_length(view, width));
            let visible = 2.0 * cosine / (cosine + length) * seen / cosine;
            assert!((visible - 1.0).abs() < tolerance, "{width:?} at {angle}°: {visible}");
        }
    }
}

#[test]
fn materials_that_share_a_table_share_its_words() {
    let material = &cases()[9].material;
    let one = MaterialTables::new(std::slice::from_ref(material)).unwrap();
    let two = MaterialTables::new(&[material.clone(), material.clone()]).unwrap();
    assert_eq!(one.words.len(), two.words.len());
    assert_eq!(two.materials[0], two.materials[1]);
}

#[test]
fn tables_beyond_one_buffer_are_refused_by_name() {
    use std::sync::Arc;

    let original = &cases()[9].material;
    let materials: Vec<_> = (0..12)
        .map(|index| {
            let mut material = original.clone();
            material.name = format!("paint {index}");
            if let MaterialKind::Measured { table, .. } = &mut material.kind {
                *table = Arc::new(table.as_ref().clone());
            }
            material
        })
        .collect();
    assert!(MaterialTables::new(&materials[..11]).is_ok());
    let parts = ["128 MiB", "paint 0 (11.2 MiB)", "paint 11"];
    assert_error(MaterialTables::new(&materials), &parts);
}
