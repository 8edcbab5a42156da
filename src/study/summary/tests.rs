//! Summaries and curves of made-up runs with known answers.

use super::*;
use crate::session::Figures;
use crate::study::{
    plan::{Description, Options},
    reference::{OwnErrors, OwnParts},
    runs::Conditions,
};

fn scene(own_mse: f64) -> StudiedScene {
    StudiedScene {
        name: "room".into(),
        reference: Some(OwnErrors { mse: Some(own_mse), mean: 1.0, ..OwnErrors::default() }),
        ..StudiedScene::default()
    }
}

fn plan() -> Plan {
    let samplers =
        crate::study::contender::Contender::parse_all(&["mis", "ris"], Default::default());
    let options = Options { samplers: samplers.ok(), spp: Some(vec![2, 4]), ..Options::default() };
    Plan::new(vec!["room.toml".into()], Description::default(), options, Vec::new()).unwrap()
}

/// A run whose MSE is `variance` / samples, at 1, 2 and 4 samples, a tenth of a second each.
fn run(sampler: &str, seed: u32, variance: f64) -> Run {
    let measurement = |spp: u32| Measurement {
        spp,
        seconds: 0.1 * f64::from(spp),
        gpu_seconds: 0.09 * f64::from(spp),
        errors: Errors {
            mse: variance / f64::from(spp),
            relmse: 1.0,
            relmse_trimmed: if sampler == "ris" { 0.49 } else { 1.0 },
            ..Errors::default()
        },
        mean_ratio: 1.0 + 0.01 * f64::from(seed),
        mean_deviation: Some(-f64::from(seed)),
        parts: Parts {
            surfaces: Some(PartErrors {
                mse: 1.0,
                relmse: 1.0,
                relmse_trimmed: if sampler == "ris" { 0.25 } else { 1.0 } / f64::from(spp),
            }),
            ..Parts::default()
        },
        ..Measurement::default()
    };
    Run {
        scene: "room".into(),
        sampler: sampler.into(),
        rule: Rule::Spp(4),
        seed,
        conditions: Conditions::default(),
        measurements: [1, 2, 4].map(measurement).to_vec(),
        figures: Figures {
            gpu_ms_per_sample: BTreeMap::from([("sample".into(), 3.0)]),
            visible_share: Some(0.1 * f64::from(seed)),
            statistics: BTreeMap::from([("rebuilds".into(), f64::from(seed))]),
            ..Figures::default()
        },
    }
}

fn runs() -> Vec<Run> {
    // `ris` has a quarter of the variance under either seed, at the same time.
    vec![run("mis", 1, 8.0), run("ris", 1, 2.0), run("mis", 2, 16.0), run("ris", 2, 4.0)]
}

#[test]
fn ratios_are_of_pairs_of_one_seed() {
    let all = summaries(&plan(), &[scene(0.01)], &runs());
    let order: Vec<(&str, Rule)> =
        all.iter().map(|summary| (summary.sampler.as_str(), summary.rule)).collect();
    let expected = [
        ("mis", Rule::Spp(2)),
        ("ris", Rule::Spp(2)),
        ("mis", Rule::Spp(4)),
        ("ris", Rule::Spp(4)),
    ];
    assert_eq!(order, expected);
    let ris = &all[3];
    assert!(
        (ris.errors.mse - 0.75).abs() < 1e-12 && (ris.errors.rmse - 0.75_f64.sqrt()).abs() < 1e-12
    );
    let (ratio, efficiency) = (ris.rmse_ratio.unwrap(), ris.efficiency.unwrap());
    for value in [ratio.low, ratio.middle, ratio.high] {
        assert!((value - 0.5).abs() < 1e-9, "{ratio:?}");
    }
    assert!((efficiency.middle - 4.0).abs() < 1e-9);
    assert!((ris.relative_ratio.unwrap().middle - 0.7).abs() < 1e-9);
    assert!((ris.mean_ratio.middle - 1.015).abs() < 1e-12);
    assert_eq!(ris.mean_deviation, Some(-2.0));
    assert!((ris.visible_share.unwrap() - 0.15).abs() < 1e-12);
    assert_eq!((ris.statistics["rebuilds"], ris.gpu_ms_per_sample["sample"]), (1.5, 3.0));
}

#[test]
fn what_drowns_in_the_references_noise_is_not_judged() {
    // At 4 samples `ris` has a mean squared error of 0.75, `mis` of 3.
    let all = summaries(&plan(), &[scene(0.5)], &runs());
    assert!(all[2].mse_judged && !all[3].mse_judged);
    assert_eq!((all[3].rmse_ratio, all[3].efficiency), (None, None));
    // Nor is a ratio to what drowns.
    let swapped = [run("mis", 1, 2.0), run("ris", 1, 8.0), run("mis", 2, 4.0), run("ris", 2, 16.0)];
    let all = summaries(&plan(), &[scene(0.5)], &swapped);
    assert!(!all[2].mse_judged && all[3].mse_judged);
    assert_eq!((all[3].rmse_ratio, all[3].efficiency), (None, None));
    let all = summaries(&plan(), &[scene(0.75 / 4.0)], &runs());
    assert!(all[3].mse_judged && all[3].rmse_ratio.is_some());
}

#[test]
fn independent_samples_have_a_slope_of_minus_one_half() {
    let all = curves(&plan(), &[scene(0.01)], &runs());
    assert_eq!(all.len(), 2);
    for curve in &all {
        assert_eq!(curve.points.iter().map(|point| point.spp).collect::<Vec<_>>(), [1, 2, 4]);
        assert!((curve.slope_spp.unwrap() + 0.5).abs() < 1e-9);
        assert!((curve.slope_seconds.unwrap() + 0.5).abs() < 1e-9);
        for CurvePoint { rmse, .. } in &curve.points {
            assert!(rmse.low < rmse.middle && rmse.middle < rmse.high);
            assert!((rmse.low * rmse.high / rmse.middle.powi(2) - 1.0).abs() < 1e-9, "{rmse:?}");
        }
    }
    // Runs by time are no part of a curve where there are some by samples.
    let by_time = Run { rule: Rule::Seconds(0.4), ..run("mis", 1, 80.0) };
    let mixed = [runs(), vec![by_time]].concat();
    assert_eq!(curves(&plan(), &[scene(0.01)], &mixed), all);
    // 12/n falls below 4·0.8 after the second point.
    let judged = &curves(&plan(), &[scene(0.8)], &runs())[0];
    assert_eq!(judged.points.len(), 2);
}

#[test]
fn a_mean_that_is_off_is_pointed_out() {
    let mut runs = runs();
    runs[1].measurements[2].mean_deviation = Some(4.5);
    let all = summaries(&plan(), &[scene(0.01)], &runs);
    assert!(all[3].is_suspicious() && !all[1].is_suspicious());
}

#[test]
fn errors_on_surfaces_have_their_own_ratio_and_curve() {
    let runs: Vec<Run> = [1, 2]
        .into_iter()
        .flat_map(|seed| [run("mis", seed, 1.0), run("ris", seed, 1.0)])
        .collect();
    let own = summaries(&plan(), &[scene(1e-9)], &runs);
    let ris = own.iter().find(|s| s.sampler == "ris" && s.rule == Rule::Spp(4)).unwrap();
    assert!((ris.surfaces_ratio.unwrap().middle - 0.25).abs() < 1e-12);
    assert!(ris.parts.environment.is_none() && ris.flip.is_none());
    // At 4 samples those of `mis` have 0.25, which drowns, and those of `ris` a quarter.
    let ratio = |scale: f64| {
        let mut runs = runs.clone();
        for run in runs.iter_mut().filter(|run| run.sampler == "ris") {
            run.measurements[2].parts.surfaces.as_mut().unwrap().relmse_trimmed *= scale;
        }
        let surfaces = Some(PartErrors { relmse_trimmed: 0.07, ..PartErrors::default() });
        let parts = Some(OwnParts { surfaces, ..OwnParts::default() });
        let own = summaries(&plan(), &[StudiedScene { parts, ..scene(1e-9) }], &runs);
        (own[3].parts.surfaces_judged, own[3].surfaces_ratio)
    };
    assert_eq!(ratio(1.0), (false, None));
    assert_eq!(ratio(100.0), (true, None));
    let curves = curves(&plan(), &[scene(1e-9)], &runs);
    let point = curves[1].points[2];
    assert!((point.relmse.unwrap().middle - 0.0625).abs() < 1e-12);
    // 1 / (0.0625 * 0.4 s), the same at every point.
    for point in &curves[1].points {
        assert!((point.efficiency.unwrap().middle - 40.0).abs() < 1e-9);
    }
}
