//! `candidates=auto` of the sampler `guided`: the choice is measured, recorded and kept by renders
//! that go on, and has no other influence on the picture.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::collections::BTreeMap;

use fenestra::{
    film::{Attribute, Checkpoint, Image, Statistics, Sums},
    sampler::{
        Parameters, Sampler,
        guided::{
            GuideState,
            cost::{CandidateCost, GUIDED_CANDIDATES, choose_candidates},
        },
    },
    session::Settings,
};
use glam::Vec3;
use serde_json::Value;

use crate::support::{self, command::Folder, guide::Guide as _, renderer, scenes};

fn guided(candidates: Option<u32>) -> Settings {
    let parameters = Parameters { candidates, ..Parameters::default() };
    Settings { sampler: Sampler::Guided, parameters, ..Settings::default() }
}

fn costs(figures: &BTreeMap<String, Value>) -> Vec<CandidateCost> {
    serde_json::from_value(figures["candidate_costs"].clone()).unwrap()
}

fn assert_same(a: &Sums, b: &Sums) {
    assert_eq!(a.sample_count, b.sample_count);
    assert!((0..a.pixel_count()).all(|pixel| a.mean(pixel) == b.mean(pixel)), "bits differ");
}

#[test]
fn the_choice_is_measured_and_changes_nothing_else() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let mut auto = renderer(&scene, guided(None));
    assert_eq!((auto.report().candidates, costs(&auto.report().figures).len()), (None, 0));
    auto.render_pass(5).unwrap();
    let chosen = auto.report().candidates.unwrap();
    let found = costs(&auto.report().figures);
    eprintln!("{chosen} of {found:?}");
    assert_eq!(chosen, choose_candidates(&found));
    let tried: Vec<u32> = found.iter().map(|cost| cost.candidates).collect();
    assert_eq!(tried, GUIDED_CANDIDATES[..tried.len()]);
    assert!(tried.len() == 3 || chosen == 1, "8 are tried where 4 are worth it");
    assert!(found.iter().all(|cost| cost.ms_per_sample > 0.0));
    // So few samples say little, but both variances are those of the same picture.
    let gain = found[0].relative_variance / found[1].relative_variance;
    assert!((0.2..5.0).contains(&gain), "{gain}");
    assert_eq!(auto.guide_state().unwrap().unwrap().candidates, Some(chosen));
    assert!(auto.host_ms()["choice of candidates"] > 0.0);

    // Training draws with one candidate, so that a choice of 1 gives the picture of `candidates=1`
    // to the bit.
    let mut one = renderer(&scene, guided(Some(1)));
    one.render_pass(5).unwrap();
    assert_eq!((one.report().candidates, costs(&one.report().figures).len()), (Some(1), 0));
    if chosen == 1 {
        assert_same(&one.sums().unwrap(), &auto.sums().unwrap());
        assert!(one.guide_state().unwrap() == auto.guide_state().unwrap(), "the same was learned");
    }
    assert!(auto.totals().camera_rays > one.totals().camera_rays, "measuring is work, and counted");
    support::assert_silent();
}

#[test]
fn whoever_goes_on_takes_the_recorded_choice() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let mut first = renderer(&scene, guided(None));
    first.render_pass(5).unwrap();
    let (sums, state) = (first.sums().unwrap(), first.guide_state().unwrap().unwrap());
    let go_on = |settings: Settings, state: &GuideState| {
        let mut second = renderer(&scene, settings);
        second.restore(&sums).unwrap();
        second.restore_guide(state).unwrap();
        second.render_pass(4).unwrap();
        second
    };
    let second = go_on(guided(None), &state);
    assert_eq!(second.report().candidates, first.report().candidates);
    assert!(costs(&second.report().figures).is_empty(), "nothing was measured");
    first.render_pass(4).unwrap();
    assert_same(&first.sums().unwrap(), &second.sums().unwrap());
    // The recorded number is taken, and 1 and 8 give different pictures.
    let other = GuideState { candidates: Some(8), ..state.clone() };
    let mut eight = go_on(guided(None), &other);
    assert_eq!(eight.report().candidates, Some(8));
    let pinned = go_on(guided(Some(8)), &state);
    assert_same(&eight.sums().unwrap(), &pinned.sums().unwrap());
    let one = go_on(guided(Some(1)), &other);
    assert_eq!(one.report().candidates, Some(1), "what is asked for is not overruled");
    assert!(one.sums().unwrap() != eight.sums().unwrap());
    // Without a record, the choice is measured.
    let none = go_on(guided(None), &GuideState { candidates: None, ..state });
    assert!(none.report().candidates.is_some() && costs(&none.report().figures).len() >= 2);
    // A restart forgets the choice.
    eight.restart(0).unwrap();
    assert_eq!(eight.report().candidates, None);
    eight.render_pass(1).unwrap();
    assert!(eight.report().candidates.is_some() && costs(&eight.report().figures).len() >= 2);
    support::assert_silent();
}

#[test]
fn nothing_is_measured_where_there_is_nothing_to_choose() {
    let _alone = support::alone();
    let open = scenes::open(vec![scenes::diffuse(Vec3::splat(0.5))]);
    let mut auto = renderer(&open, guided(None));
    auto.render_pass(2).unwrap();
    let state = auto.guide_state().unwrap().unwrap();
    assert!(state.is_open);
    assert_eq!((auto.report().candidates, state.candidates), (None, None));
    let mut dark = renderer(&scenes::mixed_room(), Settings { shadow_rays: 0, ..guided(None) });
    dark.render_pass(2).unwrap();
    assert_eq!((dark.report().candidates, costs(&dark.report().figures).len()), (Some(1), 0));
    let mut mis = renderer(&open, Settings::default());
    mis.render_pass(1).unwrap();
    assert_eq!(mis.report().candidates, None);
    support::assert_silent();
}

#[test]
fn files_and_figures_tell_the_choice() {
    let _alone = support::alone();
    let folder = Folder::new();
    let scene = format!("{}/scenes/meeting_room.toml", env!("CARGO_MANIFEST_DIR"));
    let render = |output: &str, options: &[&str]| {
        let fixed = ["--size", "48x36", "--sampler", "guided", "--stats", "stats.json"];
        let arguments = [&["render", &scene, "-o", output][..], &fixed, options].concat();
        folder.run(&arguments).assert(0, &[]);
        let text = std::fs::read_to_string(folder.path().join("stats.json")).unwrap();
        let statistics: Statistics = serde_json::from_str(&text).unwrap();
        (Image::read_exr(&folder.path().join(output)).unwrap(), statistics)
    };
    let keep = ["--spp", "3", "--checkpoint-interval", "1h", "--save-guide", "room.guide"];
    let (image, statistics) = render("a.exr", &keep);
    let chosen = statistics.candidates.unwrap();
    assert_eq!(chosen, choose_candidates(&costs(&statistics.sampler_figures)));
    let text = |image: &Image, name: &str| match &image.attributes[name] {
        Attribute::Text(text) => text.clone(),
        other => panic!("{other:?}"),
    };
    assert_eq!(text(&image, "fenestra.candidates"), chosen.to_string());
    assert_eq!(text(&image, "fenestra.sampler_parameters.candidates"), "auto");
    let info = folder.run(&["info", "a.exr"]);
    assert!(
        info.output.contains(&format!("fenestra.candidates = \"{chosen}\"")),
        "{}",
        info.output
    );

    // Record another number, as another machine may have chosen it.
    let other = if chosen == 4 { 8 } else { 4 };
    let with_other = |state: GuideState| {
        assert_eq!(state.candidates, Some(chosen));
        GuideState { candidates: Some(other), ..state }
    };
    let path = folder.path().join("room.guide");
    with_other(GuideState::read(&path).unwrap()).write(&path).unwrap();
    let path = folder.path().join("a.checkpoint.exr");
    let (checkpoint, guide) = Checkpoint::read_with_guide(&path).unwrap();
    let (guide_path, bytes) = guide.unwrap();
    let guide = with_other(GuideState::from_bytes(&bytes, &guide_path).unwrap());
    checkpoint.write_with_guide(&path, Some(&guide.to_bytes().unwrap())).unwrap();
    let (image, statistics) = render("a.exr", &["--spp", "5", "--resume"]);
    assert_eq!((statistics.candidates, costs(&statistics.sampler_figures).len()), (Some(other), 0));
    assert_eq!(text(&image, "fenestra.candidates"), other.to_string());
    let (_, statistics) = render("b.exr", &["--spp", "2", "--load-guide", "room.guide"]);
    assert_eq!((statistics.candidates, costs(&statistics.sampler_figures).len()), (Some(other), 0));
    let pinned = ["--spp", "2", "--load-guide", "room.guide", "--set", "candidates=1"];
    assert_eq!(render("c.exr", &pinned).1.candidates, Some(1));
}
