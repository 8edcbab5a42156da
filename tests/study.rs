//! The study command from its options to its report: runs, figures, continuation, and the messages
//! for bad input.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{fs, path::Path, process::Command};

use fenestra::{
    film::{Attribute, Checkpoint, Image, Metadata},
    sampler::Parameters,
    scene::Scene,
    study::{
        file::{StudyFile, is_study},
        metrics::Metrics,
        plan::{Options, Plan},
    },
};
use serde_json::Value;

use crate::support::{
    c_library,
    command::{self, Folder, Run, Running, program, words},
};

fn small() -> Vec<&'static str> {
    words(
        "study yard.toml --samplers=mis,ris --spp=4,6 --seeds=2 --reference-spp=128 --shadow-rays=2 \
         -o report --quiet",
    )
}

/// Formats a scene file of a box on a floor under the sky.
fn yard(diffuse: &str) -> String {
    let clay = format!("type = \"plastic\"\ndiffuse = {diffuse}\nalpha = 0.2");
    let object = "shape = \"box\"\nsize = [0.6, 0.6, 0.6]\ntranslate = [0.0, 0.3, 0.0]";
    command::yard([24, 16], command::SKY, &clay, object)
}

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("yard.toml", yard("[0.6, 0.4, 0.3]"));
    folder
}

fn with<'a>(options: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    options.iter().chain(more).copied().collect()
}

/// The options whose beginnings are not listed.
fn all_but<'a>(options: &[&'a str], beginnings: &[&str]) -> Vec<&'a str> {
    let is_kept = |option: &&str| !beginnings.iter().any(|beginning| option.starts_with(beginning));
    options.iter().copied().filter(is_kept).collect()
}

fn json(folder: &Folder, name: &str) -> Value {
    folder.json(&format!("report/{name}"))
}

/// Cuts what lies between two marks, wherever they are.
fn without(page: &str, start: &str, end: &str) -> String {
    let mut parts = page.split(start);
    let mut rest = parts.next().unwrap().to_owned();
    for part in parts {
        rest += part.split_once(end).unwrap().1;
    }
    rest
}

/// Checks that a page is whole, closes what it opens, and fetches nothing.
#[track_caller]
fn check_page(page: &str) {
    assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
    // Base 64 may hold any word, and the script has words of its own.
    let page = without(&without(page, "url(data:", ")"), "<script", "</script>");
    for text in ["{{", "NaN", "http:", "https:", "src=", "@import", "<link"] {
        assert!(!page.contains(text), "{text}");
    }
    for name in ["section", "table", "figure", "svg", "div", "ul", "select", "details", "dl", "p"] {
        let opened =
            page.matches(&format!("<{name}>")).count() + page.matches(&format!("<{name} ")).count();
        assert_eq!(opened, page.matches(&format!("</{name}>")).count(), "<{name}>");
    }
}

/// Uses a page in Chromium, where there is one: exposure, keys, values, flip, sorting, at two widths.
#[track_caller]
fn use_in_browser(page: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("page.html");
    let probe = include_str!("support/report_page.js");
    fs::write(&path, page.replace("</body>", &format!("<script>{probe}</script></body>"))).unwrap();
    for width in [1400, 500] {
        let output = Command::new("chromium")
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=4000"])
            .args(["--run-all-compositor-stages-before-draw", "--dump-dom"])
            .arg(format!("--window-size={width},900"))
            .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
            .arg(&path)
            .output();
        let Ok(output) = output else {
            eprintln!("note: no chromium here; the report's viewer was not tried in a browser");
            return;
        };
        let dom = String::from_utf8_lossy(&output.stdout).into_owned();
        let title = dom.split("<title>").nth(1).unwrap().split("</title>").next().unwrap();
        let seen: Value = serde_json::from_str(&title.replace("&amp;", "&"))
            .unwrap_or_else(|error| panic!("{error}: {title}"));
        assert!(seen["error"].is_null(), "{seen}");
        assert_eq!(seen["left"], "reference");
        assert_eq!(seen["flipped"], seen["right"]);
        assert_ne!(seen["right"], seen["left"]);
        let values = seen["values"].as_str().unwrap();
        assert!(values.contains(" · reference: ") && !values.contains("NaN"), "{seen}");
        assert_ne!(seen["moved"], seen["values"]);
        assert_eq!(seen["sorted"][0], "descending");
        assert_eq!((&seen["restored"], &seen["developed"]), (&true.into(), &true.into()), "{seen}");
        assert!(seen["wide"].as_i64().unwrap() <= 0, "wider than the window: {seen}");
    }
}

/// Returns the time of a run record's last change, which tells if it was made again.
fn changed(folder: &Folder, name: &str) -> std::time::SystemTime {
    fs::metadata(folder.path().join("report").join(name)).unwrap().modified().unwrap()
}

#[test]
fn a_study_has_every_figure() {
    let folder = folder();
    let run = folder.run(&with(&small(), &["--time=100ms", "--json", "--validate"]));
    run.assert(0, &[]);
    let results = json(&folder, "results.json");
    let printed: Value = serde_json::from_str(&run.output).unwrap();
    assert_eq!(printed, results);

    // Two samplers, two seeds, by samples and by time.
    let runs = results["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 8);
    for run in runs {
        let measurements = run["measurements"].as_array().unwrap();
        let last = measurements.last().unwrap();
        assert!(last["seconds"].as_f64().unwrap() > 0.0);
        assert!((last["mean_ratio"].as_f64().unwrap() - 1.0).abs() < 0.2, "{last}");
        // One sample, all that a busy machine renders in 100 ms, has no standard error.
        let deviation = last["mean_deviation"].as_f64();
        assert!(deviation.map_or(last["spp"] == 1, |sigmas| sigmas.abs() < 5.0), "{last}");
        let [p999, max] = ["relmse_p999", "relmse_max"].map(|name| last[name].as_f64().unwrap());
        assert!(max > 0.0 && p999 <= max && last["relmse_trimmed"].as_f64() < Some(p999), "{last}");
        assert!(run["visible_share"].as_f64().unwrap() > 0.2);
        assert!(run["gpu_ms_per_sample"]["sample"].as_f64().unwrap() > 0.0);
        let passes = run["gpu_ms_per_sample"].as_object().unwrap().values();
        let per_sample: f64 = passes.map(|ms| ms.as_f64().unwrap()).sum();
        let [seconds, spp] = ["gpu_seconds", "spp"].map(|name| last[name].as_f64().unwrap());
        assert!((1e3 * seconds / (spp * per_sample) - 1.0).abs() < 1e-6, "{last}");
        if run["rule"]["spp"].is_number() {
            let counts: Vec<_> = measurements.iter().map(|m| m["spp"].as_u64().unwrap()).collect();
            assert_eq!(counts, [1, 2, 4, 6]);
            assert!(last["rmse"].as_f64().unwrap() > 0.0, "{last}");
            assert_eq!(run["rays"]["camera"], 24 * 16 * 6);
        } else {
            // A run by time ends with the sample that is nearest.
            assert!(last["seconds"].as_f64().unwrap() > 0.05, "{last}");
        }
    }
    // Two levels of samples and one time, for two samplers.
    assert_eq!(results["summaries"].as_array().unwrap().len(), 6);
    assert_eq!(results["curves"].as_array().unwrap().len(), 2);
    // Two samplers, two figures, two thresholds.
    let times = results["times_to_quality"].as_array().unwrap();
    assert_eq!(times.len(), 8);
    for time in times {
        assert_eq!(time["runs"], 2);
        assert_ne!(time["seconds"].is_null(), time["extrapolated_seconds"].is_null(), "{time}");
    }
    let reference = &results["scenes"][0]["reference"];
    assert_eq!(reference["spp"], 128);
    assert!(reference["mse"].as_f64().unwrap() > 0.0);
    let check = &results["scenes"][0]["reference_check"];
    let half_spp = check["spp"].as_u64().unwrap() / 2;
    assert_eq!(check["description"], format!("env, two halves of {half_spp} spp,"));
    assert_ne!(check["verdict"], "disagrees", "{check}");
    assert!(check["spp"].as_u64().unwrap() >= 2 && check["seconds"].as_f64().unwrap() > 0.0);
    let halves = [1, 2].map(|half| {
        let path = folder.path().join(format!("report/images/yard/reference_check_{half}.exr"));
        Metadata::load(&Image::read_exr(&path).unwrap(), &path).unwrap()
    });
    let [first, second] = &halves;
    assert_ne!(first.sample_ranges[0].seed, second.sample_ranges[0].seed);
    let seconds = check["seconds"].as_f64().unwrap();
    assert!((seconds / (first.seconds + second.seconds) - 1.0).abs() < 1e-6, "{check}");
    assert!(results["circumstances"]["device"].is_string());
    let share = results["scenes"][0]["parts"]["surface_share"].as_f64().unwrap();
    assert!(share > 0.0 && share < 1.0, "the sky is in the frame: {share}");
    for summary in results["summaries"].as_array().unwrap() {
        assert!(summary["parts"]["surfaces"]["relmse"].as_f64().unwrap() > 0.0, "{summary}");
        assert!(summary["parts"]["environment"]["mse"].is_number(), "{summary}");
        assert!((0.0..1.0).contains(&summary["flip"].as_f64().unwrap()), "{summary}");
    }

    let table = fs::read_to_string(folder.path().join("report/results.csv")).unwrap();
    let mut lines = table.lines();
    let columns: Vec<&str> = lines.next().unwrap().split(',').collect();
    let expected = words(
        "scene sampler parameters seed spp seconds rays visible_share rmse mse relmse relmse_trimmed \
         relmse_p999 relmse_max mean_ratio surfaces_relmse_trimmed environment_mse flip \
         seconds_to_relmse_0.1_of_run gpu_ms_per_sample_sample",
    );
    for column in expected {
        assert!(columns.contains(&column), "{column}: {columns:?}");
    }
    let rows: Vec<&str> = lines.collect();
    // Eight rows by samples, four by time.
    assert_eq!(rows.len(), 12);
    for row in rows {
        assert_eq!(row.split(',').count(), columns.len(), "{row}");
    }

    let page = fs::read_to_string(folder.path().join("report/index.html")).unwrap();
    check_page(&page);
    use_in_browser(&page);
    for part in [
        "At a glance",
        "At equal time ",
        "relMSE against time",
        "efficiency against samples",
        "href=\"results.csv\"",
        "href=\"images/yard/ris-6spp-seed1.exr\"",
        "Seconds until relMSE falls",
        "id=\"scene-0\"",
        "mis, 6 spp",
        "ris, 0.1 s: error",
        "RMSE against samples",
        "RMSE against time",
        "two halves of 64 spp",
        "2 shadow rays per path vertex",
        "1 to 2;",
        "--samplers=mis,ris",
        "Definitions",
    ] {
        assert!(page.contains(part), "{part}");
    }
    // One reference, and two samplers at three rules with their errors.
    assert_eq!(page.matches("{background-image:url(data:image/png;base64,").count(), 1 + 2 * 6);

    // Each picture as halves, 24×16 pixels of three times two bytes in base 64.
    let halves: Vec<&str> = page.split("class=\"halves\"").skip(1).collect();
    assert_eq!(halves.len(), 1 + 6);
    for text in halves {
        let data = text.split_once('>').unwrap().1.split('<').next().unwrap();
        assert_eq!(data.len(), 24 * 16 * 6 / 3 * 4);
    }

    for name in ["mis-4spp-seed1", "mis-6spp-seed2", "ris-0.1s-seed1", "reference_1"] {
        let path = folder.path().join(format!("report/images/yard/{name}.exr"));
        let image = Image::read_exr(&path).unwrap();
        assert_eq!((image.width, image.height), (24, 16));
        Metadata::load(&image, &path).unwrap();
    }
    assert!(folder.path().join("report/images/yard/ris-6spp-seed1.png").exists());
    assert!(folder.path().join("report/images/yard/reference.png").exists());
    assert!(folder.path().join("report/images/yard/mis-4spp-error.png").exists());
}

#[test]
fn the_same_seed_has_the_same_error() {
    let folder = folder();
    folder.run(&small()).assert(0, &[]);
    let first = json(&folder, "results.json");
    folder.run(&with(&small(), &["--redo", "--depth=8"])).assert(0, &[]);
    let kept = changed(&folder, "runs/yard/mis-6spp-seed1.json");
    assert_eq!(json(&folder, "results.json")["runs"], first["runs"], "nothing was redone");
    fs::remove_dir_all(folder.path().join("report/runs")).unwrap();
    folder.run(&small()).assert(0, &[]);
    assert!(changed(&folder, "runs/yard/mis-6spp-seed1.json") > kept);
    let second = json(&folder, "results.json");
    for (a, b) in first["runs"].as_array().unwrap().iter().zip(second["runs"].as_array().unwrap()) {
        let errors = |run: &Value| -> Vec<Value> {
            run["measurements"].as_array().unwrap().iter().map(|m| m["mse"].clone()).collect()
        };
        assert_eq!(errors(a), errors(b));
    }
    // In its standard errors a mean is as far off, however bright the light is.
    let bright = yard("[0.6, 0.4, 0.3]").replace("[environment]", "[environment]\nscale = 4.0");
    folder.write("yard.toml", bright);
    fs::remove_dir_all(folder.path().join("report")).unwrap();
    folder.run(&small()).assert(0, &[]);
    let bright = json(&folder, "results.json");
    let deviations = |results: &Value| -> Vec<f64> {
        let runs = results["runs"].as_array().unwrap().iter();
        let last = runs.map(|run| run["measurements"].as_array().unwrap().last().unwrap());
        last.map(|last| last["mean_deviation"].as_f64().unwrap()).collect()
    };
    for (one, other) in deviations(&first).into_iter().zip(deviations(&bright)) {
        assert!((one - other).abs() < 1e-3 * one.abs(), "{one} {other}");
    }
}

/// A run ends with the sample that is nearest to its time, which may be the one before.
#[test]
fn runs_by_time_end() {
    let folder = folder();
    let options = all_but(&small(), &["--spp", "--seeds"]);
    folder.run(&with(&options, &["--time=30ms", "--seeds=16"])).assert(0, &[]);
    let results = json(&folder, "results.json");
    let runs = results["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 2 * 16);
    for run in runs {
        let measurements = run["measurements"].as_array().unwrap();
        let samples: Vec<u64> = measurements.iter().map(|m| m["spp"].as_u64().unwrap()).collect();
        assert!(samples.is_sorted_by(|one, next| one < next), "{samples:?}");
    }
}

#[test]
fn finished_runs_are_kept_and_new_ones_added() {
    let folder = folder();
    folder.run(&small()).assert(0, &[]);
    let record = "runs/yard/mis-6spp-seed1.json";
    let before = changed(&folder, record);
    let more = ["--samplers=mis,ris,env", "--seeds=3"];
    folder.run(&with(&all_but(&small(), &["--samplers", "--seeds"]), &more)).assert(0, &[]);
    assert_eq!(changed(&folder, record), before);
    assert_eq!(json(&folder, "results.json")["runs"].as_array().unwrap().len(), 9);
}

#[test]
fn runs_made_under_other_conditions_are_not_mixed_in() {
    let folder = folder();
    folder.run(&small()).assert(0, &[]);
    let record = "runs/yard/mis-6spp-seed1.json";
    let before = changed(&folder, record);
    let other = with(&all_but(&small(), &["--shadow-rays"]), &["--shadow-rays=3"]);
    folder.run(&other).assert(1, &["shadow rays: 2 there, 3", "one of 4 such runs", "--redo"]);
    assert_eq!(changed(&folder, record), before);
    folder.run(&with(&other, &["--redo"])).assert(0, &[]);
    assert_eq!(json(&folder, record)["conditions"]["shadow_rays"], 3);
    folder.write("yard.toml", yard("[0.5, 0.4, 0.3]"));
    folder.run(&other).assert(1, &["scene hash: ", "--redo"]);
}

#[test]
fn overhead_is_measured_in_rounds() {
    let folder = folder();
    let options = words(
        "study yard.toml --samplers=mis,tiles,ris:candidates=8 --overhead --repetitions=3 -o report \
         --quiet",
    );
    folder.run(&options).assert(0, &[]);
    let results = json(&folder, "results.json");
    assert_eq!(results["rounds"].as_array().unwrap().len(), 3);
    let overheads = results["overheads"].as_array().unwrap();
    let names: Vec<_> = overheads.iter().map(|o| o["sampler"].as_str().unwrap()).collect();
    assert_eq!(names, ["tiles", "ris:candidates=8"]);
    for repetition in 1..=3 {
        let round = json(&folder, &format!("runs/yard/overhead-{repetition}.json"));
        for timing in round["timings"].as_array().unwrap() {
            let has_tiles = timing["gpu_ms_per_sample"].get("sample_tiles").is_some();
            assert_eq!(has_tiles, timing["sampler"] == "tiles", "round {repetition}: {timing}");
        }
    }
    for overhead in overheads {
        assert_eq!(overhead["baseline"], "mis");
        assert_eq!(overhead["rounds"], 3);
        assert!(overhead["total"]["middle"].as_f64().unwrap() > 0.3, "{overhead}");
        let blocked = overhead["blocked_share"].as_f64().unwrap();
        assert!((0.0..1.0).contains(&blocked), "{blocked}");
        let passes: Vec<_> = overhead["passes"]
            .as_array()
            .unwrap()
            .iter()
            .map(|pass| pass["pass"].as_str().unwrap())
            .collect();
        assert!(passes.contains(&"sample") && passes.contains(&"shadow"), "{passes:?}");
    }
    let page = fs::read_to_string(folder.path().join("report/index.html")).unwrap();
    check_page(&page);
    assert!(page.contains("Overhead over mis against blocked shadow rays"));
    assert!(page.contains("ris:candidates=8 in yard, pass by pass"));
    assert!(!page.contains("At a glance"), "nothing was compared");
    let record = "runs/yard/overhead-2.json";
    let before = changed(&folder, record);
    folder.run(&options).assert(0, &[]);
    assert_eq!(changed(&folder, record), before);
    // A round of other samples is measured again.
    let path = folder.path().join("report").join(record);
    let text = fs::read_to_string(&path).unwrap();
    let other = text.replace("\"spp\": 16", "\"spp\": 8");
    assert_ne!(other, text);
    fs::write(&path, other).unwrap();
    folder.run(&options).assert(0, &[]);
    assert_eq!(json(&folder, record)["spp"], 16);
}

#[test]
#[cfg(unix)]
fn an_interrupted_study_keeps_its_runs_and_continues() {
    let folder = folder();
    let few = ["study", "yard.toml", "--samplers=mis,ris", "--spp=4", "--seeds=1"];
    let few = with(&few, &["--reference-spp=16", "-o", "report"]);
    let long = with(&few, &["--time=60s"]);
    let run = Running::start(folder.path(), &long, "yard: ris, 4 spp").interrupt();
    run.assert(130, &["interrupted"]);
    let results = json(&folder, "results.json");
    assert_eq!(results["runs"].as_array().unwrap().len(), 2);
    assert_eq!(results["is_complete"], false);
    let page = fs::read_to_string(folder.path().join("report/index.html")).unwrap();
    assert!(page.contains("This study ended early"));

    let record = "runs/yard/ris-4spp-seed1.json";
    let before = changed(&folder, record);
    folder.run(&few).assert(0, &["study: in", "(finished)"]);
    assert_eq!(changed(&folder, record), before);
    assert_eq!(json(&folder, "results.json")["is_complete"], true);
}

/// Interrupts a study within its reference, continues it, and compares the first half with an
/// uninterrupted render.
#[cfg(unix)]
fn interrupt_reference(sampler: &str) {
    let folder = folder();
    let options = format!(
        "study yard.toml --samplers=mis --spp=1 --seeds=1 --reference-spp=24000 --depth=1 \
         --shadow-rays=5 --reference-sampler={sampler} -o report"
    );
    let options = words(&options);
    let running = Running::start(folder.path(), &options, "yard: reference 1 of 2");
    std::thread::sleep(std::time::Duration::from_millis(300));
    running.interrupt().assert(130, &[]);
    let images = folder.path().join("report/images/yard");
    let checkpoint = ["reference_1", "reference_2"]
        .map(|half| images.join(format!("{half}.checkpoint.exr")))
        .into_iter()
        .find(|path| path.exists())
        .expect("what was rendered is kept");
    let samples = Checkpoint::read(&checkpoint).unwrap().sums.sample_count;
    assert!((1..12000).contains(&samples), "{samples}");

    folder.run(&options).assert(0, &[]);
    assert!(!checkpoint.exists());
    let seed = u32::MAX - 1;
    let whole = format!(
        "render yard.toml --spp=12000 --depth=1 --shadow-rays=5 --seed={seed} --aov=variance \
         --sampler={sampler} -o whole.exr --quiet"
    );
    folder.run(&words(&whole)).assert(0, &[]);
    let image = |path: &Path| Image::read_exr(path).unwrap().channels;
    assert_eq!(image(&images.join("reference_1.exr")), image(&folder.path().join("whole.exr")));
}

#[test]
#[cfg(unix)]
fn an_interrupted_reference_continues_to_the_bit() {
    interrupt_reference("mis");
}

#[test]
#[cfg(unix)]
fn an_interrupted_reference_by_guided_continues_to_the_bit() {
    // The yard is open, so no number of candidates is measured that could differ.
    interrupt_reference("guided");
}

#[test]
fn a_study_file_gives_scenes_and_settings() {
    let folder = folder();
    folder.write(
        "study.toml",
        "study = \"Yards <&>\"\nnotes = [\"A <b>note</b>.\"]\nscenes = [\"yard.toml\"]\n[settings]\n\
         samplers = [\"mis\", \"ris\"]\n\
         spp = [64]\nseeds = 5\nreference_spp = 128\n[quick]\nspp = [2]\nseeds = 1\n\
         [[published.errors]]\nscene = \"yard\"\nsource = \"Table 7\"\nspp = 2\n\
         values = { mis = 0.5, ris = 0.25 }\n",
    );
    folder.write("other.toml", yard("[0.6, 0.4, 0.3]"));
    let options = ["study", "study.toml", "--quick", "--size=12x8", "-o", "report", "--quiet"];
    folder.run(&options).assert(0, &[]);
    let results = json(&folder, "results.json");
    assert_eq!(results["title"], "Yards <&>");
    let page = fs::read_to_string(folder.path().join("report/index.html")).unwrap();
    check_page(&page);
    assert!(page.contains("<h1>Yards &lt;&amp;&gt;</h1>") && page.contains("A &lt;b&gt;note"));
    assert!(page.contains("Table 7 beside this study: yard"), "the published figures are shown");
    assert!(page.contains("<td>0.500000</td><td>0.250000</td><td>0.500</td>"));
    assert_eq!(results["runs"].as_array().unwrap().len(), 2);
    assert_eq!(results["scenes"][0]["width"], 12);
    folder.run(&with(&options, &["other.toml"])).assert(0, &[]);
    assert_eq!(json(&folder, "results.json")["scenes"][0]["name"], "other");
}

#[test]
fn the_studies_that_ship_can_be_run() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/studies");
    let mut count = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if !is_study(&path).unwrap() {
            Scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
            continue;
        }
        count += 1;
        let study =
            StudyFile::load(&path, Parameters::default()).unwrap_or_else(|error| panic!("{error}"));
        for scene in &study.scenes {
            assert!(scene.exists(), "{}: {}", path.display(), scene.display());
        }
        for options in [study.settings.clone(), study.quick.clone().over(study.settings.clone())] {
            let description = study.description.clone();
            let plan = Plan::new(study.scenes.clone(), description, options, Vec::new());
            plan.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        }
        assert_ne!(study.quick, Options::default(), "{}: --quick", path.display());
    }
    assert!(count > 0);
}

#[test]
fn mistakes_in_study_files_have_line_and_column() {
    let folder = folder();
    let start = "study = \"T\"\nscenes = [\"yard.toml\"]\n[settings]\n";
    let refuse = |text: &str, parts: &[&str]| {
        folder.write("study.toml", format!("{start}{text}"));
        folder.run(&["study", "study.toml"]).assert(1, parts);
    };
    refuse("samplers = [\"mis\", \"best\"]", &["study.toml:4:12: ", "\"best\"", "known: uniform"]);
    refuse("colour = 1", &["study.toml:4:1: ", "colour", "samplers"]);
    refuse("time = \"soon\"", &["study.toml:4:8: ", "expected a duration"]);
    refuse("size = \"big\"", &["study.toml:4:8: ", "expected WIDTHxHEIGHT"]);
    refuse("spp = = 3", &["study.toml:4:7: "]);
    folder.write("study.toml", "title = \"neither\"\n");
    folder
        .run(&["study", "study.toml"])
        .assert(1, &["study.toml: expected a scene", "found neither"]);
    folder.run(&["study", "absent.toml"]).assert(1, &["absent.toml: cannot read"]);
    let start = start.replace("yard", "absent");
    folder.write("study.toml", start);
    folder.run(&["study", "study.toml"]).assert(1, &["absent.toml: cannot read"]);
}

#[test]
fn wrong_options_exit_with_2() {
    let folder = folder();
    folder.write("study.toml", "study = \"T\"\nscenes = [\"yard.toml\"]\n");
    let refuse = |options: &[&str], message: &str| {
        folder.run(&with(&["study", "yard.toml"], options)).assert(2, &[message]);
    };
    refuse(&["--samplers=mis,best"], "--samplers: there is no sampler \"best\"; known: uniform");
    refuse(&["--samplers=ris:colour=1"], "known: bounce-candidates");
    refuse(&["--samplers=mis,mis"], "sampler \"mis\" is listed twice");
    refuse(&["--reference-sampler=best"], "there is no sampler \"best\"");
    refuse(&["--reference-check=best"], "--reference-check best: there is no sampler \"best\"");
    refuse(&["--baseline=best"], "there is no sampler \"best\"");
    refuse(&["--spp=0"], "--spp: expected 1 to");
    refuse(&["--seeds=0"], "--seeds: expected 1 to");
    refuse(&["--depth=65"], "--depth: expected 1 to 64");
    refuse(&["--time=soon"], "expected a duration");
    refuse(&["--reference-spp=1"], "--reference-spp: expected 2 to");
    refuse(&["--overhead", "--samplers=mis"], "besides the baseline mis");
    refuse(&["study.toml", "study.toml"], "expected one study file at most");
    folder.run(&["study"]).assert(2, &["<SCENE|STUDY>"]);
    folder.run(&["study", "yard.toml", "yard.toml"]).assert(2, &["both named \"yard\""]);
    assert!(!folder.path().join("report/runs").exists());
}

#[test]
fn a_folder_that_holds_something_else_is_refused() {
    let folder = folder();
    fs::create_dir(folder.path().join("report")).unwrap();
    folder.write("report/thesis.txt", "precious");
    folder.run(&small()).assert(1, &["error: report: ", "something else", "thesis.txt", "-o"]);
    assert_eq!(fs::read_dir(folder.path().join("report")).unwrap().count(), 1);
    folder.write("file", "precious");
    let options = ["study", "yard.toml", "--spp=2", "-o", "file"];
    folder.run(&options).assert(1, &["error: file: ", "found a file"]);
    assert_eq!(fs::read_to_string(folder.path().join("file")).unwrap(), "precious");
}

/// Renders `yard.toml` as a reference.
fn reference(folder: &Folder, name: &str, options: &[&str]) {
    let render = ["render", "yard.toml", "--spp=64", "--aov=variance", "--quiet", "-o", name];
    folder.run(&with(&render, options)).assert(0, &[]);
}

const WITH_REFERENCE: [&str; 7] =
    ["study", "yard.toml", "--samplers=mis", "--spp=2", "-o", "report", "--quiet"];

#[test]
fn references_can_be_given() {
    let folder = folder();
    reference(&folder, "a.exr", &["--seed=100"]);
    reference(&folder, "b.exr", &["--seed=101"]);
    let halves = ["--reference=a.exr", "--reference=b.exr"];
    folder.run(&with(&WITH_REFERENCE, &halves)).assert(0, &[]);
    let own = json(&folder, "results.json")["scenes"][0]["reference"].clone();
    assert_eq!(own["spp"], 128);
    assert!(own["mse"].as_f64().unwrap() > 0.0 && own["relmse"].as_f64().unwrap() > 0.0);

    // The error of a single image comes from its variances.
    let one = ["study", "yard.toml", "--samplers=mis", "--spp=2", "--reference=a.exr", "-o", "one"];
    folder.run(&one).assert(0, &[]);
    let results: Value = folder.json("one/results.json");
    let single = &results["scenes"][0]["reference"];
    assert!(single["mse"].as_f64().unwrap() > own["mse"].as_f64().unwrap());
    // The error of a mean of two is half their difference, and that of its mean less by the root of 2.
    let [a, b] = ["a.exr", "b.exr"].map(|name| {
        let path = folder.path().join(name);
        Image::read_exr(&path).unwrap().rgb(&path).unwrap()
    });
    let halves = Metrics::of_halves(&a, &b, &b).unwrap();
    for (name, difference) in [("mse", halves.errors.mse), ("relmse", halves.errors.relmse)] {
        let found = own[name].as_f64().unwrap();
        assert!((found / (0.25 * difference) - 1.0).abs() < 1e-6, "{name}: {found} {difference}");
    }
    let [single_error, both] = [single, &own].map(|of| of["mean_standard_error"].as_f64().unwrap());
    assert!((both * 2_f64.sqrt() / single_error - 1.0).abs() < 0.05, "{both} {single_error}");
    assert!(single["relmse"].is_null());
    let image = Image::read_exr(&folder.path().join("a.exr")).unwrap();
    let variances = ["R", "G", "B"].map(|channel| &image.channels[&format!("Variance.{channel}")]);
    let mean = variances.into_iter().flatten().map(|value| f64::from(*value)).sum::<f64>()
        / (3.0 * 24.0 * 16.0);
    let found = single["mse"].as_f64().unwrap();
    assert!((found / mean - 1.0).abs() < 1e-6, "{found} {mean}");

    // Take the references of another study.
    let more = words("study yard.toml --samplers=ris --spp=2 --reference=report -o more");
    folder.run(&more).assert(0, &[]);
    let results: Value = folder.json("more/results.json");
    assert_eq!(results["scenes"][0]["reference"]["mean"], own["mean"]);
}

#[test]
fn a_biased_reference_is_found() {
    let folder = folder();
    reference(&folder, "a.exr", &["--seed=100"]);
    reference(&folder, "b.exr", &["--seed=101"]);
    // A third of the picture is a tenth too bright in both halves.
    for name in ["a.exr", "b.exr"] {
        let path = folder.path().join(name);
        let mut image = Image::read_exr(&path).unwrap();
        for channel in ["R", "G", "B"] {
            for (index, value) in image.channels.get_mut(channel).unwrap().iter_mut().enumerate() {
                *value *= if index % 24 < 8 { 1.1 } else { 1.0 };
            }
        }
        image.write_exr(&path).unwrap();
    }
    let loud = all_but(&WITH_REFERENCE, &["--quiet"]);
    reference(&folder, "c.exr", &["--seed=102", "--sampler=ris"]);
    let outside = ["--reference=a.exr", "--reference=b.exr", "--reference-check=c.exr"];
    folder.run(&with(&loud, &outside)).assert(0, &["DISAGREES"]);
    let check = json(&folder, "results.json")["scenes"][0]["reference_check"].clone();
    assert_eq!(check["verdict"], "disagrees", "{check}");
    assert!(check["block"][0].as_u64().unwrap() < 8, "{check}");
    let page = fs::read_to_string(folder.path().join("report/index.html")).unwrap();
    check_page(&page);
    assert!(page.contains("is in doubt"));
    let off = ["--reference=a.exr", "--reference=b.exr", "--reference-check=off"];
    folder.run(&with(&loud, &off)).assert(0, &[]);
    assert!(json(&folder, "results.json")["scenes"][0]["reference_check"].is_null());
}

#[test]
fn references_that_do_not_fit_are_refused() {
    let folder = folder();
    let refuse = |options: &[&str], parts: &[&str]| -> Run {
        let run = folder.run(&with(&WITH_REFERENCE, options));
        run.assert(1, parts);
        run
    };
    reference(&folder, "wide.exr", &["--size=32x16"]);
    refuse(&["--reference=wide.exr"], &["wide.exr shows 32x16", "24x16", "--size 32x16"]);
    reference(&folder, "part.exr", &["--size=48x32", "--crop=5,3,29,19"]);
    refuse(&["--reference=part.exr"], &["part.exr shows 24x16 pixels at 5,3"]);
    reference(&folder, "a.exr", &[]);
    let twice = ["--reference=a.exr", "--reference=a.exr"];
    refuse(&twice, &["share samples (0:0+64)", "different seeds"]);
    let path = folder.path().join("a.exr");
    let mut image = Image::read_exr(&path).unwrap();
    let hash = image.attributes.insert("fenestra.scene_hash".into(), Attribute::Text("0".into()));
    image.write_exr(&path).unwrap();
    refuse(&["--reference=a.exr"], &["a.exr shows another scene than yard.toml"]);
    image.attributes.insert("fenestra.scene_hash".into(), hash.unwrap());
    image.channels.get_mut("G").unwrap()[24 * 3 + 5] = f32::NAN;
    image.write_exr(&path).unwrap();
    refuse(&["--reference=a.exr"], &["a.exr has 1 pixels that are not finite, the first at 5,3"]);
    for channel in image.channels.values_mut() {
        channel.fill(0.0);
    }
    image.write_exr(&path).unwrap();
    refuse(&["--reference=a.exr"], &["a.exr is black"]);
    refuse(&["--reference=absent.exr"], &["absent.exr: cannot read"]);
    fs::create_dir(folder.path().join("empty")).unwrap();
    refuse(&["--reference=empty"], &["empty: expected the report folder of a study"]);
}

#[test]
fn a_sampler_below_the_references_noise_is_not_judged() {
    let folder = folder();
    let options = words(
        "study yard.toml --samplers=mis,ris --spp=64 --seeds=1 --reference-spp=2 -o report --quiet",
    );
    folder.run(&options).assert(0, &[]);
    let results = json(&folder, "results.json");
    let summary = &results["summaries"][1];
    assert_eq!(summary["mse_judged"], false, "{summary}");
    assert!(summary["rmse_ratio"].is_null() && summary["efficiency"].is_null());
    let page = fs::read_to_string(folder.path().join("report/index.html")).unwrap();
    check_page(&page);
    assert!(page.contains("Figures that are not judged") && page.contains("--reference-spp"));
}

#[test]
#[cfg(target_os = "linux")]
fn no_space_is_an_error_and_finished_runs_stay() {
    let folder = folder();
    folder.run(&small()).assert(0, &[]);
    let record = "runs/yard/mis-6spp-seed1.json";
    let before = changed(&folder, record);
    let mut study = program(folder.path());
    c_library::fail_in(&mut study, folder.path(), ("FAULTY_BYTES", 512));
    study.args(small().iter().map(|o| if o.starts_with("--seeds") { "--seeds=3" } else { o }));
    let run = Run::of(&study.output().unwrap());
    run.assert(75, &["error: report/", ": cannot write: No space left on device"]);
    assert_eq!(changed(&folder, record), before);
    let results = json(&folder, "results.json");
    assert_eq!(results["runs"].as_array().unwrap().len(), 4, "the old results stand");
    folder.run(&small()).assert(0, &[]);
}
