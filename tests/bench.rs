//! `fenestra bench` on a small scene: every figure is there, and device and CPU see the same hits.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use serde_json::Value;

use crate::support::command::Folder;

fn folder() -> Folder {
    let object = "shape = \"box\"\nsize = [1.0, 1.0, 1.0]\ntranslate = [0.0, 0.5, 0.0]";
    Folder::with_yard([61, 47], object)
}

#[test]
fn every_figure_is_there() {
    let folder = folder();
    let run = folder.run(&["bench", "scene.toml", "--repetitions", "3", "--json"]);
    run.assert(0, &[]);
    let report: Value = serde_json::from_str(&run.output).unwrap();
    assert_eq!(report["triangles"], 24);
    assert_eq!(report["film"], serde_json::json!([61, 47]));
    let rates = report["rays"].as_array().unwrap();
    let kinds: Vec<_> = rates.iter().map(|rate| rate["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["camera", "shadow", "bounce"]);
    for rate in rates {
        assert!(rate["rays"].as_u64().unwrap() > 500, "{rate}");
        for figure in ["device_mrays", "obvhs_mrays", "ratio"] {
            assert!(rate[figure]["median"].as_f64().unwrap() > 0.0, "{rate}");
        }
        // Rays along edges are decided by rounding.
        assert!(rate["disagreements"].as_u64().unwrap() <= 5, "{rate}");
    }
    // Camera rays: one per pixel and no more.
    assert_eq!(rates[0]["rays"], 61 * 47);
    for pass in ["camera", "trace", "sample", "shadow", "gather", "accumulate"] {
        assert!(report["pass_ms"][pass].as_f64().unwrap() > 0.0, "{pass}");
    }
    // All passes of one sample take as long as its shadow rays by their rate.
    let ms: f64 = report["pass_ms"].as_object().unwrap().values().filter_map(Value::as_f64).sum();
    let at = |rate: &str| {
        rates[1]["rays"].as_f64().unwrap() * 1e-3
            / report["all_passes_mrays"][rate].as_f64().unwrap()
    };
    assert!((0.9 * at("most")..1.1 * at("least")).contains(&ms), "{ms} ms");
    assert!(report["compile_ms"]["pipelines"].as_f64().unwrap() > 0.0);
    assert_eq!(report["buffer_bytes"]["triangles 0"], 24 * 48);
    assert!(report["shadow_pass_share"]["median"].as_f64().unwrap() < 1.0);

    let options = ["bench", "scene.toml", "--repetitions=1", "--sampler=guided", "--depth=2"];
    let text = folder.run(&options);
    text.assert_output(&["ratio", "triangles 0", "2 vertices: ", "bounce_guided "]);
}

#[test]
fn what_cannot_be_measured_is_said() {
    let folder = folder();
    let run = folder.run(&["bench", "scene.toml", "--sampler", "ris"]);
    run.assert(2, &["ris", "mis"]);
    let run = folder.run(&["bench", "nowhere.toml"]);
    run.assert(1, &["nowhere.toml"]);
    let run = folder.run(&["bench", "scene.toml", "--device", "no such device"]);
    run.assert(75, &["no such device"]);
}
