//! The candidates that `guided` resamples follow the density that they are divided by, and that
//! density integrates to one: for 4 and 8 candidates, untrained and trained tables, and every kind
//! of material.
//!
//! One probe puts a path in front of a surface. Another draws the candidates of many shadow rays with
//! the functions of the sampling pass, and evaluates the density at the points of a quadrature. There
//! is room for the cells of faces only. `tests/guided_density.rs` tests what becomes of the
//! candidates. Seeds are fixed; others would raise a false alarm once in some hundred runs.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::f64::consts::PI;

use bytemuck::{Pod, Zeroable};
use fenestra::{
    pass::{PathDemand, SceneBuffers, Surfaces, WaveBuffers},
    sampler::{
        Parameters, Sampler,
        guided::{GuideBuffers, GuideSize, GuideState, GuidedParameters},
    },
    scene::Scene,
    session::{Renderer, Settings, window_of},
    shader::{
        constants::{CONSTANT_CANDIDATES, CONSTANT_MATERIAL_KINDS},
        rooms::guided::CONSTANT_BRDF_CANDIDATES,
        structs::Wave,
    },
};
use glam::{DMat3, DVec3, Vec3, dvec3};

use crate::support::{
    self, PathInput,
    guide::Guide as _,
    hemisphere::{self, BINS},
    scenes, statistics,
};

/// Candidates per surface and state.
const DRAWN: u32 = 1 << 15;
/// Rows of the quadrature over the sphere about the normal.
const ROWS: usize = 384;
/// Part of the candidates that sample the BRDF.
const BRDF_PART: f64 = 0.25;
/// Part of the one-sample model on a diffuse surface, by which these candidates are not divided.
const OTHER_BRDF_PART: f64 = 26.0 / 256.0;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CandidateQuery {
    draws: u32,
    ray: u32,
    candidate: u32,
    direction: [f32; 3],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CandidateAnswer {
    direction: [f32; 3],
    pdf: f32,
    brdf_pdf: f32,
    guided_pdf: f32,
}

/// A surface before the camera that points at a face which the room's picture sees. `theta` is the
/// angle between normal and outgoing direction.
struct Surface {
    name: &'static str,
    material: u32,
    normal: DVec3,
    theta: f64,
}

impl Surface {
    fn world_from_local(&self) -> DMat3 {
        let tangent = self.normal.cross(dvec3(0.31, -0.7, 0.64)).normalize();
        DMat3::from_cols(tangent, self.normal.cross(tangent), self.normal)
    }

    fn outgoing(&self) -> Vec3 {
        let (sine, cosine) = self.theta.sin_cos();
        let local = dvec3(sine * 0.4_f64.cos(), sine * 0.4_f64.sin(), cosine);
        (self.world_from_local() * local).as_vec3()
    }

    fn bin(&self, direction: [f32; 3]) -> usize {
        let direction = Vec3::from(direction).as_dvec3();
        hemisphere::bin(self.world_from_local().transpose() * direction)
    }
}

fn surfaces() -> [Surface; 4] {
    let surface = |name, material, normal: DVec3, theta| Surface {
        name,
        material,
        normal: normal.normalize(),
        theta,
    };
    [
        surface("diffuse", 0, dvec3(0.1, 1.0, 0.2), 0.5),
        surface("plastic", 1, dvec3(-0.6, 0.3, 1.0), 1.1),
        surface("copper", 2, dvec3(-0.5, 0.8, -0.4), 0.8),
        surface("measured", 3, dvec3(0.0, 1.0, 0.0), 0.9),
    ]
}

fn parameters() -> Parameters {
    // Leave room for the cells of faces only.
    let guided = GuidedParameters { guide_memory: 1, ..GuidedParameters::default() };
    Parameters { guided, candidates: Some(4), ..Parameters::default() }
}

/// Renders and returns what was learned.
fn trained(scene: &Scene) -> GuideState {
    let parameters = parameters();
    let settings = Settings { sampler: Sampler::Guided, parameters, ..Settings::default() };
    let mut renderer = Renderer::new(support::device(), scene, settings).unwrap();
    renderer.render_pass(64).unwrap();
    renderer.guide_state().unwrap().unwrap()
}

const SIZE: GuideSize = GuideSize { pixels: 64, paths: 64, shadow_rays: 1, has_bounces: false };

/// Buffers around one path.
struct Paths {
    scene: SceneBuffers,
    guide: GuideBuffers,
    waves: WaveBuffers,
}

impl Paths {
    fn new(scene: &Scene) -> Self {
        let device = support::device();
        let window = window_of(&Settings::default(), scene);
        Self {
            scene: SceneBuffers::new(device, scene, window).unwrap(),
            guide: GuideBuffers::new(device, scene, &parameters().guided, SIZE).unwrap(),
            waves: WaveBuffers::new(
                device,
                64,
                u32::MAX,
                1,
                PathDemand::default(),
                Surfaces::default(),
            )
            .unwrap(),
        }
    }

    /// Writes the ray and the hit of the path.
    fn put(&self, surface: &Surface) {
        let normal = surface.normal.as_vec3();
        let input = PathInput::new(surface.material, normal, surface.outgoing());
        PathInput::put(&[input], &self.waves);
    }

    fn probe(&self, candidates: u32, queries: &[CandidateQuery]) -> Vec<CandidateAnswer> {
        let constants = [
            (CONSTANT_CANDIDATES, candidates),
            (CONSTANT_BRDF_CANDIDATES, candidates / 4),
            (CONSTANT_MATERIAL_KINDS, self.scene.surfaces.material_kinds),
        ];
        let wave = Wave {
            pixel_count: 1,
            sample_count: 1,
            shadow_ray_count: 1,
            total_shadow_rays: 1,
            epoch_seed: 0x5eed + candidates,
            ..Wave::default()
        };
        let sets = [&self.scene.set, &self.guide.set, &self.waves.set];
        support::run_probe_with(
            "guided_candidates",
            &constants,
            &sets,
            bytemuck::bytes_of(&wave),
            queries,
        )
    }

    /// Draws the candidates of many rays and counts them by bin.
    fn observed(&self, surface: &Surface, candidates: u32) -> Vec<f64> {
        let query = |index: u32| CandidateQuery {
            draws: 1,
            ray: index / candidates,
            candidate: index % candidates,
            direction: [0.0; 3],
        };
        let mut counts = vec![0.0; BINS];
        for answer in self.probe(candidates, &(0..DRAWN).map(query).collect::<Vec<_>>()) {
            counts[surface.bin(answer.direction)] += 1.0;
        }
        counts
    }

    /// Integrates the candidates' density, and those of BRDF and guide, over every bin.
    fn integrals(&self, surface: &Surface, candidates: u32) -> [Vec<f64>; 3] {
        let world_from_local = surface.world_from_local();
        let query = |local: DVec3| {
            let direction = (world_from_local * local).as_vec3().into();
            CandidateQuery { draws: 0, ray: 0, candidate: 0, direction }
        };
        let queries: Vec<CandidateQuery> = hemisphere::quadrature(ROWS).map(query).collect();
        let solid_angle = 4.0 * PI / queries.len() as f64;
        let mut integrals = [(); 3].map(|()| vec![0.0; BINS]);
        for (query, answer) in queries.iter().zip(self.probe(candidates, &queries)) {
            let bin = surface.bin(query.direction);
            let densities = [answer.pdf, answer.brdf_pdf, answer.guided_pdf];
            for (integral, density) in integrals.iter_mut().zip(densities) {
                integral[bin] += solid_angle * f64::from(density);
            }
        }
        integrals
    }
}

#[test]
fn candidates_follow_the_density_that_they_are_divided_by() {
    let scene = scenes::room(scenes::every_kind());
    let state = trained(&scene);
    let mut paths = Paths::new(&scene);
    // Expectations by surface and number of candidates.
    let mut untrained: Vec<Vec<f64>> = Vec::new();
    for is_trained in [false, true] {
        if is_trained {
            assert!(!paths.guide.restore(&state).unwrap(), "the same scene");
        }
        let mut known = untrained.into_iter();
        let mut now = Vec::new();
        for surface in &surfaces() {
            paths.put(surface);
            for candidates in [4, 8] {
                let name =
                    format!("{}, {candidates} candidates, trained: {is_trained}", surface.name);
                let [mut expected, brdf, guided] = paths.integrals(surface, candidates);
                let [whole, of_brdf, of_guide] =
                    [&expected, &brdf, &guided].map(|integral| integral.iter().sum::<f64>());
                assert!((of_guide - 1.0).abs() < 3e-3, "{name}: guided {of_guide}");
                assert!((0.5..1.003).contains(&of_brdf), "{name}: BRDF {of_brdf}");
                // BRDF samples that its density leaves out are below the horizon.
                let lost = BRDF_PART * (1.0 - of_brdf);
                assert!((whole + lost - 1.0).abs() < 3e-3, "{name}: {whole} and {lost} lost");
                expected[BINS - 1] += lost.max(0.0);
                let observed = paths.observed(surface, candidates);
                let p = statistics::chi_square_p_value(&observed, &expected);
                eprintln!("{name}: integral {whole:.5}, {lost:.5} lost, p {p:.3}");
                assert!(p > 1e-4, "{name}: p = {p}");

                // The test rejects another share of the BRDF, and the untrained density.
                let mut other: Vec<f64> = brdf
                    .iter()
                    .zip(&guided)
                    .map(|(a, b)| OTHER_BRDF_PART * a + (1.0 - OTHER_BRDF_PART) * b)
                    .collect();
                other[BINS - 1] += OTHER_BRDF_PART * (1.0 - of_brdf).max(0.0);
                let p = statistics::chi_square_p_value(&observed, &other);
                assert!(p < 1e-6, "{name}: by another share, p = {p}");
                if let Some(before) = known.next() {
                    let p = statistics::chi_square_p_value(&observed, &before);
                    assert!(p < 1e-6, "{name}: as if untrained, p = {p}");
                }
                now.push(expected);
            }
        }
        untrained = now;
    }
}
