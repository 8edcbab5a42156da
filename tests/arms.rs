//! Arms of the sampler `guided`: measured, recorded, kept by renders that go on, without influence on the
//! expectation.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
};

use fenestra::{
    film::{Attribute, Statistics, Sums},
    sampler::{
        Parameters, Sampler,
        guided::{Arm, GuideState, cost::ArmCost},
    },
    scene::Scene,
    session::Settings,
};
use glam::Vec3;
use serde_json::Value;

use crate::support::{
    self,
    command::Folder,
    guide::Guide as _,
    renderer,
    replicates::{BLOCK, REPLICATES, assert_near, replicates, rows},
    scenes,
    statistics::estimates,
};

fn guided(candidates: Option<u32>) -> Settings {
    let parameters = Parameters { candidates, ..Parameters::default() };
    Settings {
        sampler: Sampler::Guided,
        parameters,
        shadow_rays: 8,
        depth: 3,
        ..Settings::default()
    }
}

/// An arm that guides nothing.
const LEAN: Arm = Arm {
    is_guided: false,
    guides_bounces: false,
    guides_later: false,
    shares_paths: false,
    candidates: 1,
    rays: [1, 1],
    roulette_throughput: 0.1,
};

/// A film large enough for several blocks.
fn room() -> Scene {
    let mut scene = scenes::mixed_room();
    (scene.film.width, scene.film.height) = (64, 48);
    scene
}

fn costs(figures: &BTreeMap<String, Value>) -> Vec<ArmCost> {
    serde_json::from_value(figures["arms"].clone()).unwrap()
}

fn assert_same(a: &Sums, b: &Sums) {
    assert_eq!(a.sample_count, b.sample_count);
    assert!((0..a.pixel_count()).all(|pixel| a.mean(pixel) == b.mean(pixel)), "bits differ");
}

#[test]
fn the_arm_is_measured_and_told() {
    let _alone = support::alone();
    let mut auto = renderer(&room(), guided(None));
    assert_eq!((auto.report().candidates, auto.report().choice), (None, None));
    auto.render_pass(9).unwrap();
    let report = auto.report();
    let found = costs(&report.figures);
    eprintln!("{:?} of {found:#?}", report.choice);
    let state = auto.guide_state().unwrap().unwrap();
    let arm = state.arm.unwrap();
    assert_eq!(report.figures["arm"], arm.to_string());
    assert!(report.choice.unwrap().contains(&arm.to_string()));
    assert_eq!(report.candidates, arm.is_guided.then_some(arm.candidates));
    // Techniques race before the first sample, all else as soon as so small a film can afford it.
    assert!(state.races == 1 && found.iter().all(|cost| cost.at_samples == 0), "{found:?}");
    let names: Vec<&str> = found.iter().map(|cost| cost.arm.as_str()).collect();
    for (name, expected) in names.iter().zip([
        "guided, 8 + 2 rays, guided bounces, shared paths, roulette below 0.1",
        "mis, 2 + 1 rays, shared paths, roulette below 0.1",
        "guided, 8 + 2 rays, shared paths, roulette below 0.1",
        "guided, 4 + 1 rays, later ones as mis, shared paths, roulette below 0.1",
    ]) {
        assert_eq!(*name, expected);
    }
    assert_eq!(names.len(), 4);
    assert!(found.iter().all(|cost| cost.ms_per_sample > 0.0 && cost.rounds > 0), "{found:?}");
    assert_eq!(found.iter().filter(|cost| cost.is_chosen).count(), 1);
    let chosen = found.iter().find(|cost| cost.is_chosen).unwrap();
    // The sentence compares the race's choice with the best of the others.
    let others = found.iter().filter(|cost| !cost.is_chosen);
    let second = others.map(|cost| cost.relative_cost).reduce(f64::min).unwrap();
    let told = format!("with {:.2} times", second / chosen.relative_cost);
    assert!(auto.report().choice.unwrap().contains(&told), "{told}: {:?}", auto.report().choice);
    assert!(auto.host_ms()["choice of an arm"] > 0.0);
    // Measured rays teach nothing: the guide has learned of the last sample since, at two vertices.
    let taught: u32 = state.pending_arrivals.iter().map(|[rays, _]| rays).sum();
    assert!((1..=2 * 64 * 48).contains(&taught), "{taught}");
    // No clock takes part.
    let mut again = renderer(&room(), guided(None));
    again.render_pass(9).unwrap();
    assert_same(&auto.sums().unwrap(), &again.sums().unwrap());
    support::assert_silent();
}

/// The second race, in a film of this size at 512 samples per pixel.
#[test]
fn no_arm_has_more_rays_than_asked_for() {
    let _alone = support::alone();
    let raced = |arm: Arm| {
        let mut later = renderer(&room(), guided(None));
        let sums = Sums { sample_count: 512, ..later.sums().unwrap() };
        let empty = later.guide_state().unwrap().unwrap();
        later.restore(&sums).unwrap();
        let state = GuideState { samples: 512, arm: Some(arm), races: 1, ..empty };
        later.restore_guide(&state).unwrap();
        later.render_pass(1).unwrap();
        // A new arm has random numbers of its own from here on.
        let state = later.guide_state().unwrap().unwrap();
        let since = if state.arm == Some(arm) { 0 } else { 512 };
        assert_eq!((state.races, state.arm_since), (2, since));
        let found = costs(&later.report().figures);
        assert!(found.iter().all(|cost| cost.at_samples == 512), "{found:?}");
        found.into_iter().map(|cost| cost.arm).collect::<BTreeSet<_>>()
    };
    let rays = |names: &BTreeSet<String>| {
        let rays = names.iter().filter_map(|name| name.strip_prefix("guided, ")?.split_once(','));
        rays.map(|(rays, _)| rays.to_owned()).collect::<Vec<_>>()
    };
    let names = raced(Arm { is_guided: true, rays: [5, 1], ..LEAN });
    // Bounces are guided where shadow rays are.
    let is_as_mis = |name: &&String| name.contains("later ones as mis");
    let are_guided = |name: &&String| name.contains("guided bounces");
    assert!(names.iter().any(|name| are_guided(&name) && !is_as_mis(&name)), "{names:?}");
    assert!(!names.iter().any(|name| are_guided(&name) && is_as_mis(&name)), "{names:?}");
    let mut expected = vec!["3 + 1 rays"];
    expected.extend([["5 + 1 rays"; 5].as_slice(), &["8 + 2 rays"; 2]].concat());
    assert_eq!(rays(&names), expected, "{names:?}");
    // All that are asked for are not doubled.
    let names = raced(Arm { is_guided: true, guides_later: true, rays: [8, 8], ..LEAN });
    let expected = [["4 + 4 rays"; 2].as_slice(), &["8 + 8 rays"; 5]].concat();
    assert_eq!(rays(&names), expected, "{names:?}");
    support::assert_silent();
}

#[test]
fn whoever_goes_on_takes_the_recorded_arm() {
    let _alone = support::alone();
    let scene = room();
    let mut first = renderer(&scene, guided(None));
    first.render_pass(9).unwrap();
    let (sums, state) = (first.sums().unwrap(), first.guide_state().unwrap().unwrap());
    let go_on = |settings: Settings, state: &GuideState| {
        let mut second = renderer(&scene, settings);
        second.restore(&sums).unwrap();
        second.restore_guide(state).unwrap();
        second.render_pass(4).unwrap();
        second
    };
    let second = go_on(guided(None), &state);
    assert!(costs(&second.report().figures).is_empty(), "nothing was measured");
    first.render_pass(4).unwrap();
    assert_same(&first.sums().unwrap(), &second.sums().unwrap());
    // The recorded arm is taken, as far as the settings leave a choice.
    let other = GuideState { arm: Some(LEAN), arm_since: 8, ..state.clone() };
    // So is the sample from which it has random numbers of its own, also if it is the arm of the start.
    for arm in [LEAN, state.arm.unwrap()] {
        let later = GuideState { arm: Some(arm), ..other.clone() };
        let second = go_on(guided(None), &later);
        assert_eq!(second.guide_state().unwrap().unwrap().arm_since, 8, "{arm}");
    }
    let recorded = |settings| go_on(settings, &other).guide_state().unwrap().unwrap().arm.unwrap();
    assert_eq!(recorded(guided(None)), LEAN);
    let mut settings = guided(None);
    settings.parameters.guided.later_rays = Some(2);
    assert_eq!(recorded(settings), Arm { rays: [2, 2], ..LEAN });
    let pinned = recorded(guided(Some(8)));
    assert!(pinned.is_guided && pinned.guides_bounces && pinned.candidates == 8);
    assert_eq!((pinned.rays, pinned.roulette_throughput), ([8, 2], 0.1));
    // A restart forgets the arm.
    let mut again = go_on(guided(None), &other);
    again.restart(0).unwrap();
    assert_eq!(again.guide_state().unwrap().unwrap().arm, None);
    again.render_pass(1).unwrap();
    assert!(costs(&again.report().figures).len() >= 2);
    support::assert_silent();
}

/// Every arm has the expectation of `mis`, though the choice knows the guide, which knows earlier samples.
/// One of 36 values exceeds the limit with a chance of 3e-6.
#[test]
fn the_picture_is_unbiased_whatever_is_chosen() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let mis = Settings { depth: 3, shadow_rays: 16, ..Settings::default() };
    let reference = replicates(&scene, &mis, 500, 32);
    assert_near("auto", &replicates(&scene, &guided(None), 500, 18), &reference, 0.03);
}

/// Bounces from guided vertices bring no light of the environment, those from later ones do.
#[test]
fn later_vertices_may_be_sampled_as_by_mis() {
    let _alone = support::alone();
    let arm = Arm { is_guided: true, shares_paths: true, rays: [8, 2], ..LEAN };
    let half_open = scenes::open(vec![scenes::diffuse(Vec3::splat(0.8)), scenes::plastic(0.3)]);
    for scene in [scenes::mixed_room(), half_open] {
        let mut teacher = renderer(&scene, guided(None));
        teacher.render_pass(4).unwrap();
        let learned = teacher.guide_state().unwrap().unwrap();
        // As if from another film, so that it is rebuilt, with all races behind it.
        let (samples, races) = (u32::MAX, 40);
        let state = GuideState { samples, is_open: false, arm: Some(arm), races, ..learned };
        let values = rows(&scene, &guided(None), 600..600 + REPLICATES, 18, BLOCK, |renderer| {
            renderer.restore_guide(&state).unwrap();
            assert_eq!(renderer.report().figures["arm"], arm.to_string());
        });
        let mis = Settings { depth: 3, shadow_rays: 16, ..Settings::default() };
        let reference = replicates(&scene, &mis, 500, 32);
        assert_near(&scene.name, &estimates(&values), &reference, 0.03);
    }
}

#[test]
fn nothing_is_measured_where_there_is_nothing_to_choose() {
    let _alone = support::alone();
    let open = scenes::open(vec![scenes::diffuse(Vec3::splat(0.5))]);
    let direct = Settings { depth: 1, ..guided(None) };
    let mut auto = renderer(&open, direct.clone());
    auto.render_pass(5).unwrap();
    assert!(auto.guide_state().unwrap().unwrap().is_open);
    assert_eq!(auto.report().candidates, None);
    assert!(costs(&auto.report().figures).is_empty());
    let mut mis = renderer(&open, Settings { sampler: Sampler::Mis, ..direct });
    mis.render_pass(5).unwrap();
    assert_same(&auto.sums().unwrap(), &mis.sums().unwrap());
    let mut lit = scenes::mixed_room();
    lit.environment = scenes::environment(8, |_| Vec3::ZERO);
    scenes::add_point(&mut lit, Vec3::new(0.1, 0.9, 0.1), Vec3::ONE);
    let mut by_lamps = renderer(&lit, guided(None));
    by_lamps.render_pass(2).unwrap();
    let report = by_lamps.report();
    assert!(by_lamps.guide_state().unwrap().unwrap().is_open);
    // How many rays, and what paths share, is raced at once.
    let names: Vec<String> = costs(&report.figures).into_iter().map(|cost| cost.arm).collect();
    let expected = ["2 + 1 rays, shared paths", "2 + 1 rays", "1 + 1 rays, shared paths"];
    assert_eq!(names[..3], expected.map(|arm| format!("mis, {arm}, roulette below 0.1")));
    let mut dark = renderer(&scenes::mixed_room(), Settings { shadow_rays: 0, ..guided(None) });
    dark.render_pass(2).unwrap();
    assert!(costs(&dark.report().figures).is_empty());
    // Given candidates leave only sharing to a choice.
    let mut pinned = renderer(&room(), guided(Some(4)));
    pinned.render_pass(3).unwrap();
    let arms = costs(&pinned.report().figures);
    assert!(arms.iter().all(|arm| arm.arm.contains("guided") && arm.arm.contains("4 candidates")));
    support::assert_silent();
}

#[test]
fn files_and_figures_tell_the_arm() {
    let _alone = support::alone();
    let folder = Folder::new();
    let scene = format!("{}/scenes/meeting_room.toml", env!("CARGO_MANIFEST_DIR"));
    let render = |output: &str, options: &[&str]| {
        let fixed = ["--size", "48x36", "--depth", "2", "--stats", "stats.json"];
        let arguments = [&["render", &scene, "-o", output][..], &fixed, options].concat();
        let run = folder.run(&arguments);
        run.assert(0, &[]);
        let statistics: Statistics = folder.json("stats.json");
        (run.output + &run.messages, folder.image(output), statistics)
    };
    let keep = ["--spp", "3", "--save-guide", "room.guide"];
    let (output, image, statistics) = render("a.exr", &keep);
    let arm = statistics.sampler_figures["arm"].as_str().unwrap().to_owned();
    assert!(output.contains(&format!("chose {arm}")), "{output}");
    let candidates = statistics.candidates.map(|count| Attribute::Text(count.to_string()));
    assert_eq!(image.attributes.get("fenestra.candidates"), candidates.as_ref());

    // Record another arm, as another machine may have chosen it.
    let path = folder.path().join("room.guide");
    let state = GuideState::from_bytes(&fs::read(&path).unwrap(), &path).unwrap();
    let found = state.arm.unwrap();
    assert_eq!(found.to_string(), arm);
    let other = Arm { is_guided: true, candidates: 8, ..found };
    let changed = GuideState { arm: Some(other), ..state };
    fs::write(&path, changed.to_bytes().unwrap()).unwrap();
    let (_, image, statistics) = render("b.exr", &["--spp", "2", "--load-guide", "room.guide"]);
    assert_eq!(statistics.candidates, Some(8));
    assert_eq!(image.attributes["fenestra.candidates"], Attribute::Text("8".to_owned()));
    assert!(costs(&statistics.sampler_figures).is_empty());
    let pinned = ["--spp", "2", "--load-guide", "room.guide", "--set", "candidates=1"];
    assert_eq!(render("c.exr", &pinned).2.candidates, Some(1));
}
