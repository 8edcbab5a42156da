//! The same seed gives the same bits, however samples are grouped, cropped, stopped and resumed.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::time::Duration;

use fenestra::{
    film::{Aov, Sums, Window},
    pass::{PathLists, Roulette},
    sampler::{Parameters, Sampler},
    scene::{Filter, Scene},
    session::{Event, Flag, Limit, Observer, Rules, Session, Settings, StopReason},
};
use glam::Vec3;

use crate::support::{self, assert_error, command::Folder, renderer, scenes};

/// A room on a film whose pixels share samples.
fn scene() -> Scene {
    let materials =
        vec![scenes::diffuse(Vec3::splat(0.7)), scenes::plastic(0.1), scenes::copper(0.2)];
    let mut scene = scenes::room(materials);
    scene.film.filter = Filter::Gaussian;
    scenes::add_point(&mut scene, Vec3::new(0.3, 2.0, 0.4), Vec3::splat(0.2));
    scene.lamps[0].light_group = Some("key".into());
    scene
}

/// Fixes `candidates`, since `auto` is measured and may differ from run to run.
fn settings(sampler: Sampler) -> Settings {
    let mut aovs = vec![Aov::Unfiltered, Aov::Albedo, Aov::Normal, Aov::Position, Aov::Visible];
    match sampler {
        Sampler::Visibility => aovs.push(Aov::CacheEntries),
        Sampler::Guided => aovs.push(Aov::GuideCell),
        _ => {}
    }
    // `guided` shares paths here, which do not keep groups of lights apart.
    if sampler != Sampler::Guided {
        aovs.push(Aov::LightGroups);
    }
    let candidates = (sampler == Sampler::Guided).then_some(1);
    let parameters = Parameters { candidates, ..Parameters::default() };
    Settings { sampler, parameters, depth: 3, seed: 7, aovs, ..Settings::default() }
}

/// One sampler of each order of passes whose samples depend on no other sample of the film; the records of
/// `control-variates` and the cache of `tiles` are those of a pilot, which is repeated. `guided` learns from
/// all of them: `tests/faults.rs` resumes it with its guide.
const WITHOUT_LEARNING: [Sampler; 6] = [
    Sampler::Mis,
    Sampler::Product,
    Sampler::Visibility,
    Sampler::Portal,
    Sampler::ControlVariates,
    Sampler::Tiles,
];

fn render(settings: Settings, passes: &[u32]) -> Sums {
    support::render_passes(&scene(), settings, passes)
}

#[test]
fn one_pass_equals_passes_of_one_sample() {
    let _alone = support::alone();
    for &sampler in Sampler::ALL {
        // `guided` learns between samples, ever more seldom.
        let samples: u32 = if sampler == Sampler::Guided { 64 } else { 12 };
        let together = render(settings(sampler), &[samples]);
        let apart = render(settings(sampler), &vec![1; samples as usize]);
        assert!(together == apart, "{} differs", sampler.name());
        assert_eq!(together.sample_count, samples);
    }
}

/// Many places look for cells of their own at once, and the table of missing cells has 64 slots.
#[test]
fn a_full_table_of_missing_cells_gives_the_same_bits() {
    let _alone = support::alone();
    let mut small = settings(Sampler::Guided);
    small.parameters.guided.guide_memory = 256 * 24 * 20;
    let mut scene = scene();
    (scene.film.width, scene.film.height) = (128, 96);
    let render = || support::render_passes(&scene, small.clone(), &[4]);
    let first = render();
    for repetition in 1..4 {
        assert!(first == render(), "repetition {repetition} differs");
    }
}

#[test]
fn another_seed_gives_another_picture() {
    let _alone = support::alone();
    for sampler in WITHOUT_LEARNING {
        let mut one = renderer(&scene(), settings(sampler));
        one.render_pass(2).unwrap();
        let other = render(Settings { seed: 8, ..settings(sampler) }, &[2]);
        assert_ne!(one.sums().unwrap().sum, other.sum);
        // It is the picture of a renderer that starts again, too.
        one.restart(8).unwrap();
        one.render_pass(2).unwrap();
        assert!(one.sums().unwrap() == other, "{} differs", sampler.name());
    }
}

#[test]
fn a_resumed_render_equals_an_uninterrupted_one() {
    let _alone = support::alone();
    for sampler in WITHOUT_LEARNING {
        let uninterrupted = render(settings(sampler), &[5]);
        let half = render(settings(sampler), &[2]);
        let resumed = support::resume(&scene(), settings(sampler), &half, 3);
        assert!(resumed == uninterrupted, "{} differs", sampler.name());
    }
}

/// Pages of one row of blocks each, in a film and in a window that no block fits.
#[test]
fn pages_of_the_film_make_no_difference() {
    let _alone = support::alone();
    let window = Some(Window { x: 3, y: 5, width: 21, height: 19 });
    for (sampler, window) in
        [(Sampler::Mis, window), (Sampler::Visibility, None), (Sampler::Guided, None)]
    {
        let one_page = Settings { window, ..settings(sampler) };
        let pages = Settings { film_page_bytes: 1, ..one_page.clone() };
        let whole = render(one_page, &[2, 3]);
        assert!(render(pages.clone(), &[2, 3]) == whole, "{} differs", sampler.name());
        if sampler == Sampler::Mis {
            let half = render(pages.clone(), &[2]);
            let resumed = support::resume(&scene(), pages, &half, 3);
            assert!(resumed == whole, "the resumed film differs");
        }
    }
}

/// A device need not dispatch more than 65,535 groups of 64 invocations at once.
#[test]
fn a_film_may_have_more_pixels_than_a_dispatch() {
    let _alone = support::alone();
    let [width, height] = [2056, 2048];
    let mut scene = scene();
    [scene.film.width, scene.film.height] = [width, height];
    let sums = |window| {
        // Other layers would divide the film into pages.
        let aovs = Vec::new();
        let one_page = Settings { window, depth: 1, aovs, ..settings(Sampler::Mis) };
        support::render_passes(&scene, one_page, &[1])
    };
    let whole = sums(None);
    let [x, y] = [width - 24, height - 16];
    let corner = sums(Some(Window { x, y, width: 24, height: 16 }));
    for pixel in 0..corner.pixel_count() {
        let at = (y + pixel as u32 / 24) * width + x + pixel as u32 % 24;
        assert_eq!(whole.mean(at as usize), corner.mean(pixel), "pixel {at}");
    }
}

/// Every page of the film, of three, is a wave of its own.
#[test]
fn a_sweep_that_was_stopped_goes_on_to_the_bit() {
    let _alone = support::alone();
    let scene = scene();
    for sampler in [Sampler::Mis, Sampler::Tiles, Sampler::Guided] {
        let settings = Settings { film_page_bytes: 1, ..settings(sampler) };
        let whole = render(settings.clone(), &[5]);
        let half = render(settings.clone(), &[2]);
        let folder = Folder::new();
        let path = folder.path().join("room.checkpoint.exr");
        let mut stopped = Session::new(support::device(), &scene, settings.clone()).unwrap();
        for _ in 0..2 {
            stopped.pass(1, 1.0).unwrap();
        }
        stopped.renderer.set_watch(Box::new(|wave| wave.is_training == 0));
        stopped.renderer.render_pass(1).unwrap();
        let sums = stopped.renderer.sums().unwrap();
        let last = sums.pixel_count() - 1;
        assert_eq!([sums.samples(0), sums.samples(last)], [3, 2], "{:?}", sums.ahead);
        if sampler == Sampler::Mis {
            // The host filters with 64 bits. Beside the edge a pixel lacks a part of the sample.
            let next = render(settings.clone(), &[3]);
            let difference = |of: &Sums, pixel: usize| {
                let means = sums.mean(pixel).into_iter().zip(of.mean(pixel));
                means.map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
            };
            assert!(difference(&next, 0) < 1e-6 && difference(&half, 0) > 1e-4);
            assert_eq!(sums.mean(last), half.mean(last));
            let edge = (8 * sums.width) as usize;
            assert!(difference(&next, edge) > 1e-4 && difference(&half, edge) > 1e-4);
        }
        stopped.write_checkpoint(&path, sums).unwrap().unwrap();
        let mut resumed = Session::new(support::device(), &scene, settings.clone()).unwrap();
        resumed.resume(&path).unwrap();
        assert_eq!(resumed.seconds(), stopped.seconds());
        assert_eq!(resumed.renderer.ahead(), stopped.renderer.ahead());
        // A sweep may be stopped again.
        resumed.renderer.set_watch(Box::new(|wave| wave.is_training == 0));
        resumed.renderer.render_pass(1).unwrap();
        assert!(resumed.renderer.ahead().blocks > stopped.renderer.ahead().blocks);
        let sums = resumed.renderer.sums().unwrap();
        resumed.write_checkpoint(&path, sums).unwrap().unwrap();
        let mut again = Session::new(support::device(), &scene, settings).unwrap();
        again.resume(&path).unwrap();
        for Session { renderer, .. } in [&mut resumed, &mut stopped, &mut again] {
            renderer.set_watch(Box::new(|_| false));
            renderer.render_pass(3).unwrap();
            assert!(renderer.sums().unwrap() == whole, "{} differs", sampler.name());
        }
        // Light of a sweep that was stopped is light, though no pixel's sample is whole.
        stopped.restart(7).unwrap();
        stopped.renderer.set_watch(Box::new(|wave| wave.is_training == 0));
        stopped.renderer.render_pass(1).unwrap();
        let sums = stopped.sums().unwrap();
        assert!(sums.sample_count == 0 && sums.mean(0)[1] > 0.0, "{:?}", sums.ahead);
        assert_eq!(stopped.warnings(&scene), Vec::<String>::new());
    }
}

/// Pages of one row of blocks each: the first has room for 17 × 12 pixels, in more blocks than its own.
#[test]
fn a_smaller_film_lies_in_the_first_page() {
    let _alone = support::alone();
    let mut scene = scene();
    let settings = Settings { film_page_bytes: 1, ..settings(Sampler::Mis) };
    let mut large = renderer(&scene, settings.clone());
    [scene.film.width, scene.film.height] = [17, 12];
    large.look(&scene.camera, [17, 12], settings.seed, true).unwrap();
    let mut small = renderer(&scene, settings);
    for renderer in [&mut large, &mut small] {
        renderer.render_pass(2).unwrap();
    }
    assert!(large.sums().unwrap() == small.sums().unwrap());
}

/// A window does not keep the samples around it, without which a stopped sweep cannot go on.
#[test]
fn the_sweep_of_a_window_ends() {
    let _alone = support::alone();
    let window = Some(Window { x: 5, y: 3, width: 13, height: 9 });
    let settings = Settings { film_page_bytes: 1, window, ..settings(Sampler::Mis) };
    let whole = render(settings.clone(), &[2]);
    let mut stopped = renderer(&scene(), settings);
    for _ in 0..2 {
        stopped.set_watch(Box::new(|_| true));
        stopped.render_pass(1).unwrap();
    }
    assert!(stopped.sums().unwrap() == whole, "the window differs");
}

/// The first pass does not count, since it learns too.
#[test]
fn a_run_by_time_ends_with_the_nearest_sample() {
    let _alone = support::alone();
    let mut session = Session::new(support::device(), &scene(), settings(Sampler::Mis)).unwrap();
    // Later passes have two samples or more.
    for reason in [None, Some(StopReason::Time), Some(StopReason::Time)] {
        let before = session.renderer.sample_count();
        let took = session.pass(4, 1.0).unwrap();
        let took = took / f64::from(session.renderer.sample_count() - before);
        let met = |share: f64| {
            session
                .met(&Rules { seconds: Some(session.seconds() + share * took), ..Rules::default() })
        };
        assert_eq!([met(0.6), met(0.4), met(0.0)], [None, reason, Some(StopReason::Time)]);
    }
    // Each frame of an animation has its own time.
    session.next_frame(&scene(), 8).unwrap();
    assert_eq!(session.seconds(), 0.0);
}

/// Samples of a seed have numbers of 32 bits.
#[test]
fn a_run_ends_with_the_last_sample_of_its_seed() {
    let _alone = support::alone();
    let settings = Settings { first_sample: u32::MAX - 3, ..settings(Sampler::Mis) };
    let mut session = Session::new(support::device(), &scene(), settings).unwrap();
    let rules = Rules { samples: Some(5), ..Rules::default() };
    let reason = session.run(&rules, &mut |_: &Event<'_>| ()).unwrap();
    assert_eq!((reason, session.renderer.sample_count()), (StopReason::LastSample, 3));
}

/// Who interrupts waits for no checkpoint and no look that is due.
#[test]
fn an_interrupt_comes_before_all_else_that_is_due() {
    struct Impatient;
    impl Observer for Impatient {
        fn interrupt(&self) -> Flag {
            let flag = Flag::default();
            flag.raise();
            flag
        }

        fn notice(&mut self, event: &Event<'_>) {
            assert!(!matches!(event, Event::Look(_)));
        }
    }
    let _alone = support::alone();
    let folder = Folder::new();
    let path = folder.path().join("room.checkpoint.exr");
    let mut session = Session::new(support::device(), &scene(), settings(Sampler::Mis)).unwrap();
    let checkpoints = Some((path.clone(), Duration::ZERO));
    let rules = Rules { checkpoints, error: Some(0.0), ..Rules::default() };
    assert_eq!(session.run(&rules, &mut Impatient).unwrap(), StopReason::Interrupt);
    assert!(session.renderer.sample_count() > 0 && !path.exists());
}

/// The error falls with the root of the samples: at twice the error asked for, a quarter is done.
#[test]
fn a_run_by_error_tells_how_far_it_is() {
    let _alone = support::alone();
    let mut session = Session::new(support::device(), &scene(), settings(Sampler::Mis)).unwrap();
    let rules = |error, samples| Rules { error, samples: Some(samples), ..Rules::default() };
    session.run(&rules(Some(1e-9), 4), &mut |_: &Event<'_>| ()).unwrap();
    let error = session.standing(&rules(Some(1e-9), 4)).relative_error.unwrap();
    let standing = session.standing(&Rules { error: Some(0.5 * error), ..Rules::default() });
    assert!((standing.fraction - 0.25).abs() < 1e-9, "{standing:?}");
    assert!(matches!(standing.limit, Some(Limit::Error(_))));
}

/// A checkpoint holds half of the samples, which took no time of this run.
#[test]
fn a_resumed_run_tells_how_far_it_is() {
    let _alone = support::alone();
    let folder = Folder::new();
    let path = folder.path().join("room.checkpoint.exr");
    let session = |throughput| {
        let roulette = Roulette { vertex: 1, throughput };
        let settings = Settings { roulette, ..settings(Sampler::Mis) };
        Session::new(support::device(), &scene(), settings).unwrap()
    };
    let mut first = session(0.5);
    first.pass(1, 1.0).unwrap();
    first.renderer.render_pass(31).unwrap();
    let sums = first.sums().unwrap();
    first.write_checkpoint(&path, sums).unwrap().unwrap();
    let differs = "sampler parameter roulette-throughput: 0.5 against 0.25";
    assert_error(session(0.25).resume(&path), &[differs]);
    let mut again = session(0.5);
    again.resume(&path).unwrap();
    let rules = Rules { samples: Some(64), seconds: Some(1e9), ..Rules::default() };
    let standing = again.standing(&rules);
    assert_eq!((standing.fraction, standing.limit), (0.5, Some(Limit::Samples(64))));
    // Its first sample alone tells the rate of the 31 others.
    let took = again.pass(1, 1.0).unwrap();
    let left = again.standing(&rules).seconds_left.unwrap();
    assert!((left / (31.0 * took) - 1.0).abs() < 1e-9, "{left} s left, {took} s a sample");
    // A limit of time counts the seconds before the checkpoint too.
    let rules = Rules { seconds: Some(2.0 * again.seconds()), ..Rules::default() };
    assert_eq!(again.standing(&rules).fraction, 0.5);
    let totals = again.renderer.totals();
    let rays = (totals.camera_rays + totals.bounce_rays + totals.shadow_rays_traced) as f64;
    let rate = again.standing(&rules).rays_per_second;
    assert!((rate * took / rays - 1.0).abs() < 1e-9, "{rate} rays a second, {rays} in {took} s");
    let statistics = again.statistics(&scene(), StopReason::Samples);
    assert!(first.seconds() > 0.0 && statistics.seconds == first.seconds() + took);
    // By samples or by time, what the run does besides passes counts.
    let mut third = session(0.5);
    third.run(&Rules { samples: Some(1), ..Rules::default() }, &mut |_: &Event<'_>| ()).unwrap();
    let left = |rules| third.standing(&rules).seconds_left.unwrap();
    let by_samples = left(Rules { samples: Some(3), ..Rules::default() });
    let by_time = left(Rules { seconds: Some(3.0 * third.seconds()), ..Rules::default() });
    assert!((by_samples / by_time - 1.0).abs() < 1e-9, "{by_samples} s or {by_time} s");
    // Another film has no rate as yet.
    third.restart(1).unwrap();
    let rules = Rules { samples: Some(3), ..Rules::default() };
    assert_eq!(third.standing(&rules).seconds_left, None);
}

/// In a room with lamps, panes, mirrors and sheets, and with roulette, so that paths end for every reason.
#[test]
fn lists_of_living_paths_make_no_difference() {
    let _alone = support::alone();
    let scene = scenes::glazed_room();
    for (sampler, sharing) in [(Sampler::Mis, "off"), (Sampler::Guided, "4")] {
        let mut settings = Settings { depth: 6, ..settings(sampler) };
        settings.roulette = Roulette { vertex: 1, throughput: 0.5 };
        settings.parameters.set(&format!("share-paths={sharing}")).unwrap();
        let sums = |path_lists| {
            support::render_passes(&scene, Settings { path_lists, ..settings.clone() }, &[2, 6])
        };
        let all = sums(PathLists::Never);
        assert!(sums(PathLists::Always) == all, "{} {sharing} differs", sampler.name());
        if sharing == "off" {
            assert!(sums(PathLists::WherePathsEnd) == all, "{} differs", sampler.name());
        }
    }
}

#[test]
fn waves_end_with_their_last_path_where_the_host_traces() {
    let _alone = support::alone();
    let scene = scenes::glazed_room();
    for sampler in [Sampler::Mis, Sampler::Product, Sampler::Guided] {
        let mut settings = Settings { depth: 40, ..settings(sampler) };
        settings.roulette = Roulette { vertex: 1, throughput: 0.5 };
        let render = |path_lists| {
            let mut renderer = renderer(&scene, Settings { path_lists, ..settings.clone() });
            renderer.render_pass(2).unwrap();
            renderer.render_pass(2).unwrap();
            support::assert_silent();
            let is_on_host = renderer.tracer() != "device";
            (renderer.sums().unwrap(), renderer.totals().passes, is_on_host)
        };
        let (all, most, is_on_host) = render(PathLists::Never);
        let (sums, passes, _) = render(PathLists::WherePathsEnd);
        let name = sampler.name();
        assert!(sums == all, "{name} differs");
        assert!(!is_on_host || 4 * passes < 3 * most, "{name} takes {passes} of {most} passes");
    }
}

#[test]
fn sums_of_another_window_are_refused() {
    let _alone = support::alone();
    let mut sums = render(settings(Sampler::Mis), &[1]);
    sums.origin = [1, 0];
    let mut renderer = renderer(&scene(), settings(Sampler::Mis));
    assert_error(renderer.restore(&sums), &["[1, 0]"]);
}

#[test]
fn a_crop_window_shows_the_same_pixels() {
    let _alone = support::alone();
    let window = Window { x: 5, y: 3, width: 13, height: 9 };
    // A pilot goes over the window.
    let alone = |sampler: &Sampler| !matches!(sampler, Sampler::ControlVariates | Sampler::Tiles);
    for sampler in WITHOUT_LEARNING.into_iter().filter(alone) {
        let whole = render(settings(sampler), &[2]);
        let crop = render(Settings { window: Some(window), ..settings(sampler) }, &[2]);
        for y in 0..window.height {
            for x in 0..window.width {
                let inner = (y * window.width + x) as usize;
                let outer = ((y + window.y) * whole.width + x + window.x) as usize;
                let name = sampler.name();
                assert_eq!(crop.sum[inner], whole.sum[outer], "{name}: pixel {x},{y}");
                assert_eq!(crop.unfiltered[inner], whole.unfiltered[outer], "{name}");
                assert_eq!(crop.normal[inner], whole.normal[outer], "{name}: pixel {x},{y}");
                for (ours, theirs) in crop.groups.iter().zip(&whole.groups) {
                    assert_eq!(ours.sum[inner], theirs.sum[outer], "{name}: pixel {x},{y}");
                }
            }
        }
    }
}

#[test]
fn sample_ranges_add_up() {
    let _alone = support::alone();
    for sampler in WITHOUT_LEARNING {
        let whole = render(settings(sampler), &[4]);
        let mut first = render(settings(sampler), &[1]);
        let rest = render(Settings { first_sample: 1, ..settings(sampler) }, &[3]);
        first.add(&rest);
        for pixel in 0..whole.pixel_count() {
            let means = |sums: &Sums| {
                let groups = sums.groups.iter().flat_map(|group| sums.group_means(group)(pixel));
                sums.total(pixel).into_iter().chain(groups).collect::<Vec<_>>()
            };
            for (a, b) in means(&first).into_iter().zip(means(&whole)) {
                let name = sampler.name();
                assert!((a - b).abs() <= 1e-12 * b.abs(), "{name}, pixel {pixel}: {a} against {b}");
            }
        }
    }
}
