//! `glsl/include/brdf.glsl` against its Rust twin, over all kinds of materials.

use bytemuck::{Pod, Zeroable};
use fenestra::shader::{
    bindings::scene,
    constants::{
        CONSTANT_SURFACES, MATERIAL_DIELECTRIC, MATERIAL_MEASURED, MATERIAL_MIRROR,
        MATERIAL_ROUGH_PANE, SURFACES_ANISOTROPIC, SURFACES_BECKMANN,
    },
};
use glam::Vec3;

use crate::{
    support::{
        self,
        materials::{cases, direction, hemisphere, specular, tables, uniform},
    },
    twin::{brdf, specular},
};

/// Twin of `BrdfQuery` in `glsl/test/brdf.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct BrdfQuery {
    outgoing_local: Vec3,
    incident_local: Vec3,
    u: Vec3,
    material: u32,
}

/// Twin of `BrdfAnswer` in `glsl/test/brdf.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct BrdfAnswer {
    value: Vec3,
    pdf: f32,
    sampled_local: Vec3,
    albedo: Vec3,
}

/// Takes directions over the hemisphere, in lobes, retro-reflected, below the surface and grazing.
fn query(index: u32) -> BrdfQuery {
    let material = index % cases().len() as u32;
    let u = uniform(index, 7);
    let outgoing_local = match index % 5 {
        0 => Vec3::Z,
        // From the other side, which sheets show.
        2 => -hemisphere(index, 8),
        1 => direction(f64::from(1.5 + 0.07 * u.x), f64::from(6.0 * u.y)),
        _ => hemisphere(index, 8),
    };
    let incident_local = match index % 7 {
        0 => outgoing_local,
        1 => -hemisphere(index, 9),
        2 | 3 => hemisphere(index, 9),
        _ => brdf::sample(tables(), material as usize, outgoing_local, uniform(index, 9)),
    };
    BrdfQuery { outgoing_local, incident_local, u: uniform(index, 10), material }
}

/// Returns the largest difference of two vectors, relative to the second plus an absolute part.
fn difference(found: Vec3, expected: Vec3, absolute: f32) -> f32 {
    (found - expected).abs().max_element() / (expected.abs().max_element() + absolute)
}

#[test]
fn shader_agrees_with_its_twin() {
    let queries: Vec<BrdfQuery> = (0..20_000).map(query).collect();
    let answers: Vec<BrdfAnswer> = support::run_probe(
        "brdf",
        &[(CONSTANT_SURFACES, SURFACES_ANISOTROPIC | SURFACES_BECKMANN)],
        &[
            (scene::MATERIALS, bytemuck::cast_slice(&tables().materials)),
            (scene::BRDF_TABLE, bytemuck::cast_slice(&tables().words)),
            (scene::BRDF_CELLS, bytemuck::cast_slice(&tables().words)),
        ],
        &queries,
    );

    // In rare cases, rounding moves a direction into the next bin of a sampling table, where the
    // density is another.
    let mut other_bins = 0;
    for (query, answer) in queries.iter().zip(&answers) {
        let material = query.material as usize;
        let name = &cases()[material].material.name;
        let is_measured = tables().materials[material].kind == MATERIAL_MEASURED;
        let (value, pdf) =
            brdf::evaluate_and_pdf(tables(), material, query.outgoing_local, query.incident_local);
        assert!(
            difference(answer.value, value, 1e-6) < 2e-3,
            "{name}: value {} in the shader, {value} in its twin, for {query:?}",
            answer.value
        );
        if difference(Vec3::splat(answer.pdf), Vec3::splat(pdf), 1e-6) >= 2e-3 {
            assert!(
                is_measured,
                "{name}: pdf {} in the shader, {pdf} in its twin, for {query:?}",
                answer.pdf
            );
            other_bins += 1;
        }
        let sampled = brdf::sample(tables(), material, query.outgoing_local, query.u);
        assert!(
            difference(answer.sampled_local, sampled, 0.0) < 3e-4,
            "{name}: sample {} in the shader, {sampled} in its twin, for {query:?}",
            answer.sampled_local
        );
        let albedo = brdf::albedo(tables(), material, query.outgoing_local);
        assert!(
            difference(answer.albedo, albedo, 0.0) < 1e-4,
            "{name}: albedo {} in the shader, {albedo} in its twin, for {query:?}",
            answer.albedo
        );
    }
    assert!(other_bins < queries.len() / 500, "{other_bins} densities differ");
    assert!(answers.iter().filter(|answer| answer.pdf > 0.0).count() > queries.len() / 2);
}

/// Twin of `SpecularQuery` in `glsl/test/specular.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct SpecularQuery {
    outgoing_local: Vec3,
    u: Vec3,
    material: u32,
    is_back: u32,
    distance: f32,
    incident_local: Vec3,
}

/// Twin of `SpecularAnswer` in `glsl/test/specular.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct SpecularAnswer {
    direction_local: Vec3,
    is_transmitted: u32,
    weight: Vec3,
    pdf: f32,
    reflectance: Vec3,
    transmittance: Vec3,
    toward_weight: Vec3,
    toward_pdf: f32,
}

#[test]
fn scattering_in_the_shader_agrees_with_its_twin() {
    let query = |index: u32| {
        let material = index % specular().len() as u32;
        let (outgoing_local, u) = (hemisphere(index, 11), uniform(index, 12));
        let distance = uniform(index, 13).x;
        let mut incident_local = hemisphere(index, 14);
        incident_local.z *= if (index / 6).is_multiple_of(2) { 1.0 } else { -1.0 };
        let is_back = index / 3 % 2;
        SpecularQuery { outgoing_local, u, material, is_back, distance, incident_local }
    };
    let queries: Vec<SpecularQuery> = (0..20_000).map(query).collect();
    let answers: Vec<SpecularAnswer> = support::run_probe(
        "specular",
        &[(CONSTANT_SURFACES, SURFACES_BECKMANN)],
        &[(scene::MATERIALS, bytemuck::cast_slice(specular()))],
        &queries,
    );

    // In rare cases, rounding moves a number across the probability of reflection, or a direction
    // across the horizon.
    let mut other_choices = 0;
    let mut densities = 0;
    for (query, answer) in queries.iter().zip(&answers) {
        let material = &specular()[query.material as usize];
        let is_back = query.is_back == 1;
        let mut found = specular::scatter(material, query.outgoing_local, is_back, query.u);
        found.weight *= specular::inside_transmittance(material, is_back, query.distance);
        let is_other = found.is_transmitted != (answer.is_transmitted == 1)
            || (found.weight == Vec3::ZERO) != (answer.weight == Vec3::ZERO);
        other_choices += u32::from(is_other);
        if !is_other {
            assert!(
                difference(answer.direction_local, found.direction_local, 0.0) < 1e-3,
                "{answer:?} in the shader, {found:?} in its twin, for {query:?}"
            );
            assert!(
                difference(answer.weight, found.weight, 1e-3) < 5e-3,
                "{answer:?} in the shader, {found:?} in its twin, for {query:?}"
            );
        }
        let toward = |incident_local: Vec3| {
            let outgoing_local = query.outgoing_local;
            specular::dielectric_evaluate_and_pdf(material, outgoing_local, incident_local, is_back)
        };
        if matches!(material.kind, MATERIAL_DIELECTRIC | MATERIAL_ROUGH_PANE) {
            let (value, pdf) = toward(query.incident_local);
            let (found, found_pdf) = (answer.toward_weight * answer.toward_pdf, answer.toward_pdf);
            let expected = value * query.incident_local.z.abs();
            assert!(
                difference(found, expected, 1e-3) < 5e-3
                    && (found_pdf - pdf).abs() <= 5e-3 * pdf + 1e-3,
                "{found} and {found_pdf} in the shader, {expected} and {pdf} in its twin, for {query:?}"
            );
            // Grazing directions amplify rounding.
            let sampled = answer.direction_local;
            if answer.weight != Vec3::ZERO && sampled.z.abs().min(query.outgoing_local.z) > 0.05 {
                let pdf = toward(sampled.normalize()).1;
                assert!(
                    (answer.pdf - pdf).abs() <= 0.03 * pdf,
                    "{answer:?}, not {pdf}, for {query:?}"
                );
                densities += u32::from(pdf > 0.0);
            }
        }
        let cosine = query.outgoing_local.z;
        let pane = [
            specular::pane_reflectance(material, cosine),
            specular::pane_transmittance(material, cosine),
        ];
        // A mirror has no index, and its answers no meaning.
        if material.kind != MATERIAL_MIRROR {
            assert!(difference(answer.reflectance, pane[0], 0.0) < 1e-3, "{answer:?} {pane:?}");
            assert!(difference(answer.transmittance, pane[1], 1e-3) < 1e-3, "{answer:?} {pane:?}");
        }
    }
    assert!(other_choices < 20, "{other_choices} choices differ");
    assert!(densities > queries.len() as u32 / 4, "{densities} densities are not 0");
}
