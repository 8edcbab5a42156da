//! Scenes whose picture is known in closed form, rendered with every sampler.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::sync::Arc;

use fenestra::{
    film::Sums,
    pass::Roulette,
    sampler::{Parameters, Sampler, product::ProductParameters},
    scene::{
        EnvironmentMap, Filter, Geometry, Portal, Scene,
        lamp::LampKind,
        material::{Anisotropy, ConductorFresnel, Emission, Material, MaterialKind},
        texture::{Encoding, Texels, Texture, TextureUse},
    },
    session::Settings,
};
use glam::{DVec3, Vec3};

use crate::support::{
    self, materials,
    replicates::{film_mean, mean_and_error},
    scenes::{self, diffuse},
};

fn render(scene: &Scene, settings: Settings, samples: u32) -> Sums {
    let (sums, totals) = support::render(scene, settings, samples);
    assert_eq!(totals.dropped_samples, 0);
    sums
}

/// Fails if a mean is seven errors or more from what is expected, and not `close` to it relative to it, or if
/// the error is too large to judge. With 11 degrees of freedom a channel's |t| > 7 has a chance of 2.3e-5.
fn assert_mean(
    name: &str,
    [mean, error]: [DVec3; 2],
    expected: DVec3,
    close: f64,
    largest_error: f64,
) {
    eprintln!("{name}: {:.5} ± {:.5}", mean / expected, error / expected);
    let z = (mean - expected) / error;
    let is_close = (mean / expected - 1.0).abs().max_element() < close;
    assert!(z.abs().max_element() < 7.0 || is_close, "{name}: {mean}, not {expected}, z {z}");
    assert!((error / expected).max_element() < largest_error, "{name}: error {error}");
}

/// Seen along its normal, a metal with widths a and b has 2/π · atan(a/b) of its light from the two quadrants
/// in the middle of which a lies.
#[test]
fn stretched_highlights_lie_where_the_tangent_says() {
    let _alone = support::alone();
    // Where x and z differ in sign.
    let quadrants = |direction: Vec3| Vec3::splat(f32::from(direction.x * direction.z < 0.0));
    let environment = EnvironmentMap { rotation_rad: 0.0, ..scenes::environment(512, quadrants) };
    let mut scene = scenes::plane(Vec3::ONE, environment);
    scene.geometry = Geometry::default();
    scenes::add_square(&mut scene.geometry, Vec3::ZERO, 1.0, 0);
    (scene.camera.position, scene.camera.vertical_fov_deg) = (Vec3::new(0.0, 5.0, 1e-3), 0.1);
    let (alpha, strength) = (0.02_f32, 0.3_f32);
    let fresnel = ConductorFresnel::Schlick { reflectance: Vec3::ONE };
    scene.materials = vec![Material::new("brushed", MaterialKind::Conductor { alpha, fresnel })];
    let ratio = f64::from((alpha + (1.0 - alpha) * strength * strength) / alpha);
    let inside = 2.0 / std::f64::consts::PI * ratio.atan();
    let texture = |[r, g, b]: [f32; 3]| {
        let texel = [r, g, b, 1.0].map(half::f16::from_f32);
        Some(TextureUse {
            encoding: Encoding::Linear,
            image_from_uv: [[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]],
            ..TextureUse::new(Arc::new(Texture {
                name: "direction".into(),
                width: 1,
                height: 1,
                texels: Texels::Halves(vec![texel]),
            }))
        })
    };
    let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]];
    let straight = corners.map(|[x, z]: [f32; 2]| [x, -z]);
    let turned = corners.map(|[x, z]: [f32; 2]| [-z, -x]);
    let mirrored = corners.map(|[x, z]: [f32; 2]| [x, z]);
    let eighth = std::f32::consts::FRAC_PI_4;
    let flat = texture([0.5, 0.5, 1.0]);
    for (name, uvs, rotation, direction, normal, expected) in [
        ("toward v", straight, eighth, None, None, inside),
        ("away from v", straight, -eighth, None, None, 1.0 - inside),
        ("u along −z", turned, eighth, None, None, 1.0 - inside),
        ("v along z", mirrored, eighth, None, None, 1.0 - inside),
        ("texel up", straight, -eighth, texture([0.5, 1.0, 1.0]), None, inside),
        ("texel askew", straight, 0.0, texture([0.25, 0.25, 1.0]), None, inside),
        ("a flat normal map", straight, eighth, None, flat.clone(), inside),
        ("both", straight, 0.0, texture([0.25, 0.25, 1.0]), flat, inside),
        ("no strength", straight, eighth, texture([1.0, 0.5, 0.0]), None, 0.5),
    ] {
        scene.geometry.uvs[0] = uvs.to_vec();
        scene.materials[0].surface.anisotropy = Anisotropy { strength, rotation, direction };
        scene.materials[0].surface.normal = normal;
        // Lines lie where they are whichever side is seen, and as well where tangents are those of a file.
        let stored = if uvs == straight { vec![[1.0, 0.0, 0.0, 1.0]; 4] } else { Vec::new() };
        for (height, tangents) in [(5.0, Vec::new()), (5.0, stored.clone()), (-5.0, stored)] {
            (scene.camera.position.y, scene.geometry.tangents) = (height, tangents);
            let settings = Settings { sampler: Sampler::Brdf, ..Settings::default() };
            let found = film_mean(&render(&scene, settings, 64)).x;
            let name = format!("{name} from {height} m");
            assert!((found - expected).abs() < 0.02, "{name}: {found}, expected {expected}");
        }
    }
    let mut narrow = scene.materials[0].clone();
    narrow.surface.anisotropy = Anisotropy { strength, ..Anisotropy::default() };
    // The table of a brushed metal turns as the metal does.
    let [metal, measured] = materials::brushed_and_measured();
    let means = [(0.2, 5.0), (-1.2, -5.0)].map(|(turn, height)| {
        scene.camera.position.y = height;
        let [expected, found] = [&metal, &measured].map(|material| {
            scene.materials[0] = material.clone();
            scene.materials[0].surface.anisotropy.rotation += turn;
            let settings = Settings { sampler: Sampler::Brdf, ..Settings::default() };
            film_mean(&render(&scene, settings, 64)).x
        });
        assert!((found / expected - 1.0).abs() < 0.03, "{turn}: {found}, expected {expected}");
        found
    });
    assert!(means[0] > means[1] + 0.1, "{means:?}");
    // Lines along x stay there where a map bends the normals to it, as where triangles do.
    let quadrants = |to: Vec3| Vec3::splat(f32::from((to.x - 0.484) * to.z < 0.0));
    scene.environment = EnvironmentMap { rotation_rad: 0.0, ..scenes::environment(512, quadrants) };
    scene.camera.position.y = 5.0;
    scene.materials = vec![narrow];
    let bent = texture([0.625, 0.5, 0.984]);
    for (map, normal) in [(bent, Vec3::Y), (None, Vec3::new(0.25, 0.968, 0.0))] {
        scene.materials[0].surface.normal = map;
        scene.geometry.normals.fill(normal.to_array());
        let settings = Settings { sampler: Sampler::Brdf, ..Settings::default() };
        let found = film_mean(&render(&scene, settings, 64)).x;
        assert!((found - 0.5).abs() < 0.03, "{normal}: {found}");
    }
}

#[test]
fn without_shadow_rays_only_the_environment_is_seen() {
    let _alone = support::alone();
    let scene = scenes::convex_furnace(diffuse(Vec3::splat(0.5)), Vec3::new(1.0, 2.0, 3.0));
    let sums = render(&scene, Settings { shadow_rays: 0, ..Settings::default() }, 1);
    let background = sums.mean(0);
    assert!((DVec3::from(background) - DVec3::new(1.0, 2.0, 3.0)).abs().max_element() < 1e-5);
    assert_eq!(sums.mean(sums.pixel_count() / 2 + 12), [0.0; 3]);
}

/// Shadow rays come in groups of eight, then in groups to lamps: the sky behind is added once.
#[test]
fn groups_of_shadow_rays_see_the_environment_once() {
    let _alone = support::alone();
    let mut scene = scenes::convex_furnace(diffuse(Vec3::splat(0.5)), Vec3::new(1.0, 2.0, 3.0));
    let kind = LampKind::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE };
    scenes::add_lamp(&mut scene, kind);
    let sums = render(&scene, Settings { shadow_rays: 9, ..Settings::default() }, 1);
    assert!((DVec3::from(sums.mean(0)) - DVec3::new(1.0, 2.0, 3.0)).abs().max_element() < 1e-5);
}

/// The weights of the filter add up to one in every pixel and sample: constant light has no noise.
#[test]
fn the_filter_adds_no_noise() {
    let _alone = support::alone();
    let mut scene = scenes::convex_furnace(diffuse(Vec3::splat(0.5)), Vec3::new(1.0, 2.0, 3.0));
    scene.film.filter = Filter::Gaussian;
    (scene.camera.position, scene.camera.look_at) = (Vec3::NEG_Z * 10.0, Vec3::NEG_Z * 20.0);
    let sums = render(&scene, Settings { shadow_rays: 0, ..Settings::default() }, 64);
    for pixel in 0..sums.pixel_count() {
        let difference = DVec3::from(sums.mean(pixel)) / DVec3::new(1.0, 2.0, 3.0) - 1.0;
        assert!(difference.abs().max_element() < 1e-6, "pixel {pixel}: {difference}");
        assert!(sums.variance_of_mean(pixel)[2] < 1e-8, "pixel {pixel}");
    }
}

/// A Gaussian of ½ spreads every sample over 4π σ² = π pixels: their independent noise has 1/π of its
/// variance, as the film estimates it and as seeds differ.
#[test]
fn pixels_that_share_samples_have_a_third_of_the_variance() {
    let _alone = support::alone();
    let mut scene = scenes::room(vec![diffuse(Vec3::splat(0.7))]);
    let mut variances = |filter: Filter| {
        scene.film.filter = filter;
        let settings =
            Settings { sampler: Sampler::Cosine, shadow_rays: 1, depth: 1, ..Settings::default() };
        let mut renderer = support::renderer(&scene, settings);
        let films = [1, 2, 3, 4, 5, 6, 7, 8].map(|seed| {
            renderer.restart(seed).unwrap();
            renderer.render_pass(16).unwrap();
            renderer.sums().unwrap()
        });
        let pixels = 0..films[0].pixel_count();
        let estimated = |film: &Sums| {
            pixels.clone().map(|pixel| film.variance_of_mean(pixel)[1]).sum::<f64>() / 8.0
        };
        let found = |pixel: usize| {
            let values = films.each_ref().map(|film| film.mean(pixel)[1]);
            let mean = values.iter().sum::<f64>() / 8.0;
            values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 7.0
        };
        [films.iter().map(estimated).sum::<f64>(), pixels.clone().map(found).sum()]
    };
    let (own, shared) = (variances(Filter::Box), variances(Filter::Gaussian));
    for kind in 0..2 {
        let share = shared[kind] / own[kind] * std::f64::consts::PI;
        assert!((share - 1.0).abs() < 0.1, "{shared:?} of {own:?}");
    }
}

/// The border between a dark and a bright half of the sky: pixels left and right of it average what
/// their filter and the lens see of either half.
#[test]
fn an_edge_has_the_blur_of_filter_and_lens() {
    let _alone = support::alone();
    const STEPS: u32 = 200;
    let mut scene = scenes::convex_furnace(diffuse(Vec3::ONE), Vec3::ONE);
    let is_right = |direction: Vec3| if direction.x > 0.0 { Vec3::ONE } else { Vec3::ZERO };
    scene.environment = scenes::environment(512, is_right);
    scene.environment.rotation_rad = 0.0;
    // The box of the scene lies behind the camera, and the border in the middle of a column.
    (scene.camera.position, scene.camera.look_at) = (Vec3::NEG_Z * 10.0, Vec3::NEG_Z * 20.0);
    scene.camera.vertical_fov_deg = 50.0;
    (scene.film.width, scene.film.height) = (21, 7);
    // The lens is shifted to the right by three pixels.
    scene.camera.shift[0] = 3.0 / 7.0;
    let pixel = 2.0 * 25_f64.to_radians().tan() / 7.0;
    // Share of a disk left of the line at `x` of its radius.
    let disk = |x: f64| {
        let x = x.clamp(-1.0, 1.0);
        0.5 + (x * (1.0 - x * x).sqrt() + x.asin()) / std::f64::consts::PI
    };
    // Weights of all samples that lie at one place of their pixels add up to one.
    let gaussian = |offset: f64| (-2.0 * offset * offset).exp();
    let shared = |offset: f64| {
        let [before, after] = [(offset + 0.5).floor(), (offset - 0.5).ceil()];
        let within = offset - 0.5 * (before + after);
        let sum: f64 = [-1.0, 0.0, 1.0].map(|pixel| gaussian(within + pixel)).iter().sum();
        gaussian(offset) / sum
    };
    for (filter, radius, focus) in
        [(Filter::Box, 0.0_f32, 1.0_f32), (Filter::Box, 1.5, 3.0), (Filter::Gaussian, 0.0, 1.0)]
    {
        scene.film.filter = filter;
        let reach = if filter == Filter::Box { 0.5 } else { 1.5 };
        (scene.camera.aperture_radius, scene.camera.focus_distance) = (radius, focus);
        let sums = render(&scene, Settings { shadow_rays: 0, ..Settings::default() }, 4096);
        for column in 0..21 {
            let bright = |step: u32| {
                let offset = ((f64::from(step) + 0.5) / f64::from(STEPS) * 2.0 - 1.0) * reach;
                let weight = if filter == Filter::Box { 1.0 } else { 3.0 * shared(offset) };
                let at = (f64::from(column) - 7.0 + offset) * pixel;
                let sharp = if radius > 0.0 { f64::from(focus / radius) } else { 1e6 };
                weight * disk(at * sharp)
            };
            let expected = (0..STEPS).map(bright).sum::<f64>() / f64::from(STEPS);
            let rows = (0..7).map(|row| sums.mean((row * 21 + column) as usize)[0]);
            let found = rows.sum::<f64>() / 7.0;
            // Interpolation between texels rounds the border off, evenly on both sides.
            let name = format!("{filter:?}, lens of {radius} m, column {column}");
            assert!((found - expected).abs() < 5e-3, "{name}: {found}, not {expected}");
            if filter == Filter::Gaussian {
                continue;
            }
            // A sample is 0 or 1, but for the texels of the border.
            let variance = sums.variance_of_mean((3 * 21 + column) as usize)[0] * 4095.0;
            let of_coin = expected * (1.0 - expected);
            assert!((variance - of_coin).abs() < 0.02, "{name}: {variance}, not {of_coin}");
        }
    }
    // A lens is round: the border across the film has the same blur.
    (scene.camera.up, scene.camera.shift) = (Vec3::X, [0.0; 2]);
    (scene.camera.aperture_radius, scene.camera.focus_distance) = (1.5, 3.0);
    scene.film.filter = Filter::Box;
    let sums = render(&scene, Settings { shadow_rays: 0, ..Settings::default() }, 512);
    for row in 0..7 {
        let at =
            |step: u32| 3.0 - f64::from(row) + (f64::from(step) + 0.5) / f64::from(STEPS) - 0.5;
        let expected = (0..STEPS).map(|step| disk(2.0 * pixel * at(step))).sum::<f64>();
        let columns = (0..21).map(|column| sums.mean((row * 21 + column) as usize)[0]);
        let difference = columns.sum::<f64>() / 21.0 - expected / f64::from(STEPS);
        assert!(difference.abs() < 0.03, "row {row}: {difference}");
    }
    // In the middle of its lowest row.
    (scene.camera.aperture_radius, scene.camera.shift) = (0.0, [0.0, 3.0 / 7.0]);
    let sums = render(&scene, Settings { shadow_rays: 0, ..Settings::default() }, 64);
    let dark = (0..sums.pixel_count()).filter(|pixel| sums.mean(*pixel)[0] < 0.75);
    assert_eq!(dark.collect::<Vec<_>>(), (6 * 21..7 * 21).collect::<Vec<_>>());
    // The mirror image is bright to the left of the border.
    let camera = &mut scene.camera;
    (camera.up, camera.shift, camera.mirrored) = (Vec3::Y, [3.0 / 7.0, 0.0], true);
    let sums = render(&scene, Settings { shadow_rays: 0, ..Settings::default() }, 64);
    let bright = (0..21).filter(|column| sums.mean(3 * 21 + column)[0] > 0.75);
    assert_eq!(bright.collect::<Vec<_>>(), (0..7).collect::<Vec<_>>());
}

#[test]
fn a_convex_diffuse_body_in_a_furnace_is_its_reflectance() {
    let _alone = support::alone();
    let reflectance = Vec3::new(0.2, 0.5, 1.0);
    let radiance = Vec3::new(3.0, 2.0, 1.0);
    let scene = scenes::convex_furnace(diffuse(reflectance), radiance);
    // Samplers proportional to the cosine have no variance here, in any pixel with any seed.
    for sampler in [Sampler::Cosine, Sampler::Brdf] {
        let sums = render(&scene, Settings { sampler, ..Settings::default() }, 2);
        let expected = (reflectance * radiance).as_dvec3();
        for pixel in 0..sums.pixel_count() {
            let mean = DVec3::from(sums.mean(pixel));
            let is_background = (mean - radiance.as_dvec3()).abs().max_element() < 1e-4;
            let is_body = (mean - expected).abs().max_element() < 1e-4;
            // A pixel on the silhouette is the mean of both, by a box filter over two samples.
            let is_edge =
                (mean - 0.5 * (expected + radiance.as_dvec3())).abs().max_element() < 1e-4;
            assert!(is_background || is_body || is_edge, "{} {pixel}: {mean}", sampler.name());
        }
        assert!((DVec3::from(sums.mean(8 * 24 + 12)) - expected).abs().max_element() < 1e-4);
    }
}

/// Integrates the map itself over the upper hemisphere in f64, bilinear as the renderer sees it, and
/// returns what a diffuse surface below it shows per reflectance. `seen` is the share of the film that
/// sees a direction. Good to 1e-4.
fn reflected_by_a_plane(scene: &Scene, seen: impl Fn(DVec3) -> f64) -> DVec3 {
    let steps = 1024;
    let mut sum = DVec3::ZERO;
    for i in 0..steps {
        for j in 0..steps {
            let cos_theta = ((f64::from(i) + 0.5) / f64::from(steps)).sqrt();
            let phi = std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(steps);
            let sin_theta = (1.0 - cos_theta * cos_theta).sqrt();
            let direction = DVec3::new(sin_theta * phi.cos(), cos_theta, sin_theta * phi.sin());
            let radiance = scene.environment.radiance(direction.as_vec3());
            sum += radiance.as_dvec3() * seen(direction);
        }
    }
    sum / f64::from(steps * steps)
}

#[test]
fn irradiance_of_a_plane_is_the_integral_of_the_map() {
    let _alone = support::alone();
    let reflectance = Vec3::new(0.3, 0.6, 0.9);
    let scene = scenes::plane(reflectance, scenes::sky());
    let expected = reflectance.as_dvec3() * reflected_by_a_plane(&scene, |_| 1.0);
    for &sampler in Sampler::ALL {
        let settings = Settings { sampler, ..Settings::default() };
        let found = mean_and_error(&scene, &settings, 16, 12);
        assert_mean(sampler.name(), found, expected, 2e-4, 0.03);
    }
}

/// A bright red patch in a dim blue sky: who resamples among candidates, or weighs techniques, by other
/// shares than they have gives one colour too much. Luminance alone would not show it, since the choice
/// of a candidate goes by luminance.
#[test]
fn bright_and_dim_light_keep_their_colours() {
    let _alone = support::alone();
    let patch = Vec3::new(0.6, 0.7, 0.4).normalize();
    let sky = scenes::environment(64, |direction| {
        if direction.dot(patch) > 0.95 {
            Vec3::new(20.0, 1.0, 0.5)
        } else {
            Vec3::new(0.1, 0.2, 1.0)
        }
    });
    let scene = scenes::plane(Vec3::splat(0.5), sky);
    let expected = 0.5 * reflected_by_a_plane(&scene, |_| 1.0);
    for (sampler, samples) in [(Sampler::Ris, 64), (Sampler::Mis, 16)] {
        let settings = Settings { sampler, ..Settings::default() };
        let found = mean_and_error(&scene, &settings, samples, 12);
        assert_mean(sampler.name(), found, expected, 2e-4, 2e-3);
    }
}

/// Where nothing hides a grey sky, a ray brings the mean weight of its candidates, which draw numbers of
/// their own: four times as many have a quarter of the variance, or less.
#[test]
fn candidates_of_a_ray_are_independent() {
    let _alone = support::alone();
    let grey = scenes::environment(64, |direction| Vec3::splat(1.0 + 8.0 * direction.x.powi(8)));
    let scene = scenes::plane(Vec3::splat(0.5), grey);
    for sampler in [Sampler::Ris, Sampler::ControlVariates] {
        let variance = |candidates: u32| {
            let parameters = Parameters { candidates: Some(candidates), ..Parameters::default() };
            let settings = Settings { sampler, parameters, shadow_rays: 1, ..Settings::default() };
            let sums = render(&scene, settings, 64);
            (0..sums.pixel_count()).map(|pixel| sums.variance_of_mean(pixel)[1]).sum::<f64>()
        };
        let ratio = variance(2) / variance(8);
        assert!(ratio > 3.2, "{}: {ratio}", sampler.name());
    }
}

/// The same beside a wall that hides the brightest light: else `guided` samples as `mis` does.
#[test]
fn guided_keeps_colours_beside_a_wall() {
    let _alone = support::alone();
    let patch = Vec3::new(-0.6, 0.7, 0.4).normalize();
    let hidden = Vec3::new(0.8, 0.45, 0.4).normalize();
    let sky = scenes::environment(64, |direction| {
        if direction.dot(hidden) > 0.95 {
            Vec3::splat(100.0)
        } else if direction.dot(patch) > 0.95 {
            Vec3::new(20.0, 1.0, 0.5)
        } else {
            Vec3::new(0.1, 0.2, 1.0)
        }
    });
    let mut scene = scenes::plane(Vec3::splat(0.5), sky);
    scene.environment.rotation_rad = 0.0;
    let (distance, height, half) = (8.0, 16.0, 100.0);
    let size = Vec3::new(1.0, height, 2.0 * half);
    scenes::add_box(&mut scene.geometry, Vec3::new(distance + 0.5, 0.5 * height, 0.0), size, 0);
    // Places that the camera sees from 5 m above, 16 columns by 8 rows, all with z near 0.
    let pixel = 2.0 * 5.0 * 15_f64.to_radians().tan() / 8.0;
    let [distance, height, half] = [distance, height, half].map(f64::from);
    let expected = 0.5
        * reflected_by_a_plane(&scene, |direction| {
            let passes = |column: &u32| {
                let to_wall = (distance - (f64::from(*column) - 7.5) * pixel) / direction.x;
                let is_beside = (direction.z * to_wall).abs() > half;
                direction.x <= 0.0 || direction.y * to_wall > height || is_beside
            };
            (0..16).filter(passes).count() as f64 / 16.0
        });
    for (candidates, samples) in [(1, 256), (4, 128)] {
        let parameters = Parameters { candidates: Some(candidates), ..Parameters::default() };
        let settings = Settings { sampler: Sampler::Guided, parameters, ..Settings::default() };
        let found = mean_and_error(&scene, &settings, samples, 12);
        // The places are those of pixel centres, good to 1e-3.
        assert_mean(&format!("{candidates} candidates"), found, expected, 1e-3, 3e-3);
    }
}

/// A small bright light in an even sky, with a single lobe at a hit: the shares of BRDF and map see the
/// rest of the sky.
#[test]
fn a_single_lobe_leaves_the_sky_beside_it_as_it_is() {
    let _alone = support::alone();
    let light = Vec3::new(0.3, 0.9, 0.2).normalize();
    let scene_under = |sky: f32| {
        let radiance = |to: Vec3| Vec3::splat(if to.dot(light) > 0.99 { 200.0 } else { sky });
        scenes::plane(Vec3::splat(0.5), scenes::environment(128, radiance))
    };
    let scene = scene_under(1.0);
    let truth = 0.5 * reflected_by_a_plane(&scene, |_| 1.0).x;
    let of_light = 0.5 * reflected_by_a_plane(&scene_under(0.0), |_| 1.0).x;
    assert!(truth > 1.2 * of_light, "{truth}, {of_light} from the light");
    let product =
        ProductParameters { environment_lobes: 8, kept_lobes: 1, ..ProductParameters::default() };
    let parameters = Parameters { product, ..Parameters::default() };
    let settings = Settings { sampler: Sampler::Product, parameters, ..Settings::default() };
    let [mean, error] = mean_and_error(&scene, &settings, 16, 12).map(|value| value.x);
    // 11 degrees of freedom: |t| > 7 has a chance of 2e-5.
    assert!((mean - truth).abs() < 7.0 * error, "{mean} ± {error}, not {truth}");
}

/// A portal overhead through which nearly all light of an even sky comes.
#[test]
fn a_portal_leaves_the_mean_as_it_is() {
    let _alone = support::alone();
    let mut scene = scenes::plane(Vec3::splat(0.5), scenes::environment(16, |_| Vec3::ONE));
    let corner = Vec3::new(-30.0, 8.0, -30.0);
    let axes = [Vec3::X, Vec3::Z];
    scene.portals.push(Portal { name: "lid".into(), corner, axes, size: [60.0; 2] });
    for shadow_rays in [2, 9] {
        let settings = Settings { sampler: Sampler::Portal, shadow_rays, ..Settings::default() };
        let found = mean_and_error(&scene, &settings, 64, 12);
        assert_mean(&format!("{shadow_rays} rays"), found, DVec3::splat(0.5), 1e-4, 2e-3);
    }
}

/// A narrow lobe in a wide sky: where the BRDF samples, hardly any other ray goes. There `mis` must weigh
/// its techniques by the shares of rays that they really have, with the bounce ray among them and
/// without.
#[test]
fn techniques_are_weighed_by_the_rays_they_have() {
    let _alone = support::alone();
    let mut scene = scenes::plane(Vec3::ONE, scenes::environment(16, |_| Vec3::ONE));
    scene.materials = vec![scenes::copper(0.1)];
    let brdf = Settings { sampler: Sampler::Brdf, ..Settings::default() };
    let [expected, expected_error] = mean_and_error(&scene, &brdf, 64, 12);
    for (shadow_rays, depth) in [(1, 1), (5, 1), (5, 2)] {
        let settings = Settings { shadow_rays, depth, ..Settings::default() };
        let [mean, error] = mean_and_error(&scene, &settings, 64, 12);
        let error = (error * error + expected_error * expected_error).map(f64::sqrt);
        let name = format!("{shadow_rays} rays, depth {depth}");
        // Densities are rounded.
        assert_mean(&name, [mean, error], expected, 1e-4, 1e-3);
    }
}

/// Light from one side alone: where the number that chooses a lobe chose its directions too, each lobe would
/// leave out a part of the sky.
#[test]
fn lobes_are_chosen_by_a_number_of_their_own() {
    let _alone = support::alone();
    let side = Vec3::new(0.6, 0.0, 0.8);
    let sky = scenes::environment(32, |to| Vec3::splat(if to.dot(side) > 0.0 { 2.0 } else { 0.1 }));
    let mut scene = scenes::plane(Vec3::ONE, sky);
    scene.materials = vec![scenes::plastic(0.3)];
    scene.camera.position = Vec3::new(4.0, 5.0, 3.0);
    let product = ProductParameters {
        environment_lobes: 4,
        brdf_lobes: 2,
        views: 1,
        brdf_share: 0.9,
        environment_share: 0.05,
        ..ProductParameters::default()
    };
    let mean = |sampler| {
        let parameters = Parameters { product, ..Parameters::default() };
        let settings = Settings { sampler, parameters, ..Settings::default() };
        mean_and_error(&scene, &settings, 16, 12)
    };
    let [expected, expected_error] = mean(Sampler::Cosine);
    for sampler in [Sampler::Brdf, Sampler::Mis, Sampler::Product] {
        let [mean, error] = mean(sampler);
        let error = (error * error + expected_error * expected_error).map(f64::sqrt);
        assert_mean(sampler.name(), [mean, error], expected, 1e-4, 4e-3);
    }
}

#[test]
fn a_concave_white_body_vanishes_in_the_furnace() {
    let _alone = support::alone();
    let scene = scenes::concave_furnace();
    let settings = Settings { depth: 24, roulette: Roulette::NEVER, ..Settings::default() };
    for sampler in [Sampler::Cosine, Sampler::Mis, Sampler::Ris] {
        let sums = render(&scene, Settings { sampler, ..settings.clone() }, 64);
        let mean = film_mean(&sums);
        // The crevice between sphere and box holds a little light beyond 24 vertices.
        assert!((mean - 1.0).abs().max_element() < 4e-3, "{}: {mean}", sampler.name());
        for pixel in 0..sums.pixel_count() {
            let value = sums.mean(pixel)[1];
            assert!((0.7..1.3).contains(&value), "{} pixel {pixel}: {value}", sampler.name());
        }
    }
    // With direct light alone the crevice is dark, so the test above depends on bounces.
    let direct = film_mean(&render(&scene, Settings::default(), 64));
    assert!(direct.x < 0.99, "{direct}");
}

/// A closed box of mirrors that glow takes every path to all of its vertices. Without roulette each sample is
/// Σ ρᵏ, and all chance is that of roulette, whose numbers differ from vertex to vertex.
#[test]
fn roulette_keeps_the_mean() {
    let _alone = support::alone();
    let reflectance = Vec3::new(0.8, 0.5, 0.2);
    let mut mirror = Material::new("mirror", MaterialKind::Mirror { reflectance });
    let emission = Emission { radiance: Vec3::ONE, texture: None, two_sided: true };
    mirror.surface.emission = Some(emission);
    let mut scene = scenes::convex_furnace(mirror, Vec3::ZERO);
    scene.camera.position = Vec3::new(0.1, 0.2, 0.3);
    (scene.film.width, scene.film.height) = (1, 1);
    let depth = 8;
    let expected: DVec3 =
        (0..=depth).map(|bounces| reflectance.as_dvec3().powf(f64::from(bounces))).sum();
    let roulette = Roulette { vertex: 2, throughput: 1.0 };
    for (roulette, samples, tolerance) in [(Roulette::NEVER, 1, 1e-5), (roulette, 1024, 0.02)] {
        let settings = Settings { depth, roulette, ..Settings::default() };
        let mean = film_mean(&render(&scene, settings, samples));
        let off = (mean / expected - 1.0).abs().max_element();
        eprintln!("{roulette:?}: off by {off:.5}");
        assert!(off < tolerance, "{roulette:?}: {mean}, not {expected}");
    }
}

const MILLION: u32 = 1_000_000;

/// A white sky over a plane of this reflectance, in a film of 4×4.
fn tiny_plane(reflectance: Vec3) -> Scene {
    let mut scene = scenes::plane(reflectance, scenes::environment(16, |_| Vec3::ONE));
    (scene.film.width, scene.film.height) = (4, 4);
    scene
}

/// Sums of floats that did not carry their rounding errors would drift by 1e-3 and stop growing at 2²⁴
/// times a sample.
#[test]
#[ignore = "takes minutes: cargo test --release closed_form:: -- --ignored --nocapture"]
fn a_million_samples_do_not_drift() {
    let _alone = support::alone();
    let reflectance = Vec3::new(0.2, 0.5, 0.9);
    // No variance: what differs from the reflectance is rounding.
    let settings = Settings { sampler: Sampler::Cosine, ..Settings::default() };
    let sums = render(&tiny_plane(reflectance), settings, MILLION);
    let expected = reflectance.as_dvec3();
    let drift = (0..sums.pixel_count())
        .map(|pixel| (DVec3::from(sums.mean(pixel)) / expected - 1.0).abs().max_element())
        .fold(0.0, f64::max);
    eprintln!("cosine, constant map: largest drift {drift:.1e}");
    assert!(drift < 1e-6, "{drift}");
}

/// A float alone would drift by 1e-4 after so many samples.
#[test]
fn squares_do_not_drift() {
    let _alone = support::alone();
    let settings = Settings { sampler: Sampler::Cosine, shadow_rays: 1, ..Settings::default() };
    let sums = render(&tiny_plane(Vec3::new(0.2, 0.5, 0.9)), settings, 1 << 14);
    for pixel in 0..sums.pixel_count() {
        // No variance: the mean of the squares is the square of the mean.
        let mean = DVec3::from(sums.mean(pixel));
        let squares = DVec3::from(sums.total_squares(pixel)) / f64::from(sums.sample_count);
        let drift = (squares / (mean * mean) - 1.0).abs().max_element();
        assert!(drift < 2e-6, "{drift}");
    }
}

/// Compares a million samples of `sampler` with those of `cosine`. A wall hides half of the sky: else
/// `guided` samples as `mis` does.
fn million_samples_keep_the_mean(sampler: Sampler) {
    let _alone = support::alone();
    let mut scene = tiny_plane(Vec3::new(0.2, 0.5, 0.9));
    let wall = (Vec3::new(8.5, 50.0, 0.0), Vec3::new(1.0, 100.0, 200.0));
    scenes::add_box(&mut scene.geometry, wall.0, wall.1, 0);
    let mean_and_variance = |sampler, seed| {
        let sums = render(&scene, Settings { sampler, seed, ..Settings::default() }, MILLION);
        let pixels = sums.pixel_count();
        let variance: DVec3 =
            (0..pixels).map(|pixel| DVec3::from(sums.variance_of_mean(pixel))).sum();
        (film_mean(&sums), variance / (pixels * pixels) as f64)
    };
    let (expected, expected_variance) = mean_and_variance(Sampler::Cosine, 0);
    let (mean, variance) = mean_and_variance(sampler, 1);
    // Samples are stratified: their spread overestimates the error.
    let error = (variance + expected_variance).map(f64::sqrt);
    let z = (mean - expected) / error;
    eprintln!("{}: {:.7} ± {:.7}, z {z:.2}", sampler.name(), mean / expected, error / expected);
    assert!(z.abs().max_element() < 5.0, "{}: {mean}, z {z}", sampler.name());
    assert!((error / expected).max_element() < 1e-3, "{}: {error}", sampler.name());
}

#[test]
#[ignore = "takes minutes: cargo test --release closed_form:: -- --ignored --nocapture"]
fn a_million_samples_of_mis_keep_the_mean() {
    million_samples_keep_the_mean(Sampler::Mis);
}

#[test]
#[ignore = "takes minutes: cargo test --release closed_form:: -- --ignored --nocapture"]
fn a_million_samples_of_guided_keep_the_mean() {
    million_samples_keep_the_mean(Sampler::Guided);
}
