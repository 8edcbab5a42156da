//! The order of the passes of a wave, for every technique: a list that needs no device.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write,
};

use fenestra::{
    pass::{
        Dispatch, PassSettings, PathLists, Roulette, Schedule, Steps, Surfaces,
        geometry::Traversal, wave_order,
    },
    sampler::{
        Parameters, basic,
        control_variates::{self, RecordGrid},
        guided::{GuidedParameters, GuidedSteps},
        haar::HaarSteps,
        portal,
        product::{FitSizes, ProductParameters, ProductSteps},
        tiles,
        visibility::{CacheScope, VisibilityParameters, VisibilitySteps},
    },
    shader::{
        constants::{
            AOV_ALBEDO, AOV_CACHE_ENTRIES, AOV_GUIDE_CELL, AOV_OBJECTS, MATERIAL_PLASTIC,
            SURFACES_EMITTING, SURFACES_ROUGH_GLASS, SURFACES_SPECULAR, SURFACES_TEXTURED,
            TRAINING_WAVE,
        },
        spirv::PASSES,
        structs::Wave,
    },
};

use crate::support::page;

const FITS: FitSizes =
    FitSizes { environment_lobes: 100, strongest_environment_lobe: 0.0, brdf_lobes: 20, views: 32 };

const TRAVERSAL: Traversal =
    Traversal { page_count: 1, page_shift: 20, is_instanced: false, is_on_host: false };

/// Settings of a render with all layers.
fn settings(shadow_rays: u32, depth: u32) -> PassSettings {
    PassSettings {
        shadow_rays,
        depth,
        aovs: AOV_ALBEDO | AOV_CACHE_ENTRIES | AOV_GUIDE_CELL,
        light_groups: 0,
        roulette: Roulette::default(),
        cohort_edge: 1,
        surfaces: Surfaces::default(),
        traversal: TRAVERSAL,
        incoherent: Schedule { rays_per_invocation: 16, refill_lanes: 3 },
        path_lists: PathLists::Never,
        film_page_bytes: u64::MAX,
        most_paths: u32::MAX,
    }
}

/// A wave of `sample_count` samples of ten pixels, `first_sample` samples after the last rebuild.
fn wave(first_sample: u32, sample_count: u32) -> Wave {
    Wave { pixel_count: 10, first_sample, sample_count, pixel_stride: 1, ..Wave::default() }
}

fn mis() -> impl Steps {
    basic::MIS.steps(&Parameters::default(), Surfaces::default()).unwrap()
}

fn product() -> impl Steps {
    ProductSteps::new(ProductParameters::default(), FITS, Surfaces::default())
}

fn visibility(cache: CacheScope, shadow_rays: u32) -> impl Steps {
    let parameters = VisibilityParameters { cache, ..VisibilityParameters::default() };
    VisibilitySteps::new(
        parameters,
        ProductParameters::default(),
        FITS,
        Surfaces::default(),
        TRAVERSAL,
        shadow_rays,
    )
}

fn guided(settings: &PassSettings) -> impl Steps {
    GuidedSteps::new(4, GuidedParameters::default(), settings)
}

fn haar(cache: &str) -> impl Steps {
    let mut parameters = Parameters::default();
    parameters.set(cache).unwrap();
    HaarSteps::new(&parameters, 8, Surfaces::default(), 2)
}

fn order(settings: &PassSettings, steps: &dyn Steps, wave: Wave) -> Vec<Dispatch> {
    wave_order(settings, steps, wave, settings.depth).all()
}

/// Names of the passes in their order, separated by spaces.
fn names(order: &[Dispatch]) -> String {
    order.iter().map(|dispatch| dispatch.kernel.shader).collect::<Vec<_>>().join(" ")
}

#[test]
fn simple_samplers_trace_groups_of_eight_rays() {
    let direct = settings(9, 1);
    let listed = order(&direct, &mis(), wave(0, 2));
    assert_eq!(
        names(&listed),
        "camera trace sample shadow gather sample shadow gather features deposit"
    );
    let counts: Vec<_> = listed.iter().map(|dispatch| dispatch.wave.shadow_ray_count).collect();
    assert_eq!(counts, [0, 0, 8, 8, 8, 1, 1, 1, 1, 1]);
    assert!(listed[2..].iter().all(|dispatch| dispatch.wave.total_shadow_rays == 9));
    // A path, a pixel or a shadow ray for each invocation; rays that part share invocations.
    let invocations = |pass: usize| listed[pass].kernel.invocations(&listed[pass].wave, None);
    assert_eq!((invocations(0), invocations(2), invocations(8)), (20, 20, 20));
    assert_eq!(invocations(3), 64, "160 shadow rays, 16 for each invocation");
}

#[test]
fn without_shadow_rays_the_camera_still_gathers() {
    for steps in [&mis() as &dyn Steps, &product(), &visibility(CacheScope::Hit, 0)] {
        let listed = order(&settings(0, 2), steps, wave(0, 1));
        assert_eq!(names(&listed), "camera trace gather features bounce trace gather deposit");
    }
}

#[test]
fn product_multiplies_lobes_once_per_vertex() {
    assert_eq!(
        names(&order(&settings(9, 2), &product(), wave(0, 1))),
        "camera trace multiply_lobes sample_lobes shadow gather sample_lobes shadow gather features \
         bounce trace multiply_lobes sample_lobes shadow gather sample_lobes shadow gather deposit"
    );
}

#[test]
fn visibility_draws_and_traces_groups_of_eight_rays_in_one_pass() {
    assert_eq!(
        names(&order(&settings(9, 1), &visibility(CacheScope::Hit, 9), wave(0, 1))),
        "camera trace multiply_lobes sample_and_trace gather sample_and_trace gather count_entries \
         features deposit"
    );
    // The next sample of a pixel begins with the cache that the one before left.
    assert_eq!(
        names(&order(&settings(2, 1), &visibility(CacheScope::Pixel, 2), wave(0, 1))),
        "camera trace multiply_lobes reweight sample_and_trace gather count_entries features \
         deposit"
    );
}

#[test]
fn guided_counts_rays_and_bounces_where_samples_teach() {
    let deep = settings(5, 2);
    let listed = order(&deep, &guided(&deep), wave(0, 1));
    assert_eq!(
        names(&listed),
        "camera trace sample_guided shadow learn gather show_cells features bounce_guided trace \
         sample_guided learn_arrivals shadow learn gather deposit"
    );
    let rays: Vec<_> = [2, 10].map(|pass| listed[pass].wave.total_shadow_rays).into();
    assert_eq!(rays, [5, 2], "half of the rays at later vertices");
    // Every fourth of the late samples teaches.
    let learns =
        |first, count| names(&order(&deep, &guided(&deep), wave(first, count))).contains("learn");
    assert!(learns(15, 1) && learns(16, 1) && !learns(17, 3) && learns(17, 4) && learns(20, 1));
    // Training shows no cells and writes no layers.
    let training = Wave { is_training: 1, ..wave(0, 1) };
    let listed = names(&order(&deep, &guided(&deep), training));
    assert!(!listed.contains("show_cells") && !listed.contains("features"), "{listed}");
    let direct = settings(5, 1);
    assert!(!names(&order(&direct, &guided(&direct), wave(0, 1))).contains("arrivals"));
}

/// Every technique as the page shows it.
fn shown() -> Vec<(&'static str, Vec<Dispatch>)> {
    let deep = settings(2, 2);
    let training = Wave { is_training: TRAINING_WAVE, ..wave(0, 1) };
    let aovs = AOV_ALBEDO | AOV_OBJECTS;
    let furnished = PassSettings { surfaces: everything(), aovs, ..settings(2, 1) };
    let mut shown = vec![
        ("uniform … ris", order(&deep, &mis(), wave(0, 1))),
        ("product", order(&deep, &product(), wave(0, 1))),
        ("visibility", order(&deep, &visibility(CacheScope::Hit, 2), wave(0, 1))),
        (
            "visibility with caches of pixels",
            order(&settings(2, 1), &visibility(CacheScope::Pixel, 2), wave(0, 1)),
        ),
        ("guided", order(&deep, &guided(&deep), wave(0, 1))),
        ("haar", order(&deep, &haar("haar-cache=off"), wave(0, 1))),
        ("haar with a cache", order(&settings(2, 1), &haar("haar-cache=on"), wave(0, 1))),
        ("one vertex, textures, lamps", order(&furnished, &mis(), wave(0, 1))),
        ("shared paths", order(&shared(2), &mis(), wave(0, 1))),
        ("lists of living paths", order(&listed(settings(2, 2)), &mis(), wave(0, 1))),
    ];
    let (parameters, surfaces) = (Parameters::default(), deep.surfaces);
    let grid = RecordGrid { side: 16, edge_per_distance: 0.1, largest_edge: 1.0 };
    let controlled = control_variates::steps(&parameters, grid, surfaces).unwrap();
    let of_records = control_variates::pilot_steps(&parameters, grid, surfaces).unwrap();
    let tiles = |learns| tiles::steps(1, learns, surfaces);
    let of_rays = [
        ("portal", portal::steps(&parameters, 1, surfaces), wave(0, 1)),
        ("control-variates", controlled, wave(0, 1)),
        ("pilot of control-variates", of_records, training),
        ("tiles", tiles(false), wave(0, 1)),
        ("pilot of tiles", tiles(true), training),
    ];
    shown.extend(of_rays.map(|(name, steps, wave)| (name, order(&deep, &steps, wave))));
    shown
}

/// Settings of a render of plastic in which the pixels of a cohort share paths.
fn shared(depth: u32) -> PassSettings {
    let surfaces = Surfaces { material_kinds: 1 << MATERIAL_PLASTIC, ..Surfaces::default() };
    PassSettings { cohort_edge: 2, surfaces, ..settings(2, depth) }
}

#[test]
fn paths_are_shared_from_the_second_vertex_on() {
    let listed = |settings: &PassSettings, wave| names(&order(settings, &mis(), wave));
    let start = "camera trace sample shadow gather features keep_first bounce trace keep_second sample \
                 shadow gather gather_shared";
    let end = "offer connect shadow admit weigh share deposit";
    assert_eq!(listed(&shared(2), wave(0, 1)), format!("{start} keep_third {end}"));
    assert_eq!(
        listed(&shared(3), wave(0, 1)),
        format!("{start} bounce keep_third trace sample shadow gather {end}")
    );
    // Diffuse surfaces need no choice, and what other lamps bring is parted too.
    let diffuse = PassSettings { surfaces: Surfaces::default(), ..shared(2) };
    assert!(!listed(&diffuse, wave(0, 1)).contains("gather_shared"));
    let lit = PassSettings { surfaces: everything(), ..shared(2) };
    assert!(
        listed(&lit, wave(0, 1)).contains("emit keep_second sample_lamps shadow gather sample")
    );
    assert!(
        listed(&lit, wave(0, 1))
            .contains("bounce keep_third trace emit texture features gather offer")
    );
    // Sixteen connections in groups of eight.
    let larger = order(&PassSettings { cohort_edge: 4, ..shared(2) }, &mis(), wave(0, 1));
    let rays: Vec<_> = larger
        .iter()
        .filter(|dispatch| dispatch.kernel.shader == "connect")
        .map(|dispatch| (dispatch.wave.first_shadow_ray, dispatch.wave.shadow_ray_count))
        .collect();
    assert_eq!(rays, [(0, 8), (8, 8)]);
    let training = Wave { is_training: 1, ..wave(0, 1) };
    for shares_nothing in [listed(&shared(1), wave(0, 1)), listed(&shared(2), training)] {
        assert!(!shares_nothing.contains("keep") && !shares_nothing.contains("share"));
    }
}

fn listed(settings: PassSettings) -> PassSettings {
    PassSettings { path_lists: PathLists::Always, ..settings }
}

#[test]
fn later_vertices_walk_lists_of_living_paths() {
    let walked = |order: &[Dispatch]| -> Vec<(&'static str, u32)> {
        let of = |dispatch: &Dispatch| (dispatch.kernel.shader, dispatch.wave.path_list);
        order.iter().map(of).filter(|(_, list)| *list > 0).collect()
    };
    let deep = order(&listed(settings(1, 3)), &mis(), wave(0, 1));
    assert_eq!(
        walked(&deep),
        [
            ("sample", 2),
            ("shadow", 2),
            ("bounce", 2),
            ("trace", 2),
            ("list_paths", 2),
            ("sample", 3),
            ("shadow", 3),
            ("gather", 2),
        ]
    );
    // Where the host knows how long lists are, passes that walk them have no more invocations.
    for Dispatch { kernel, wave } in &deep {
        let counts = [None, Some(3), Some(99)].map(|most| kernel.invocations(wave, most));
        let listed = if kernel.per_invocation == 1 { [10, 3, 10] } else { [64; 3] };
        let expected = if wave.path_list == 0 { [counts[0]; 3] } else { listed };
        assert_eq!(counts, expected, "{}", kernel.shader);
    }
    // Cohorts keep second vertices of all paths, and connect the first ones of all.
    let cohorts = order(&listed(shared(3)), &mis(), wave(0, 1));
    assert_eq!(walked(&cohorts), [("sample", 3), ("shadow", 3)]);
    // Lobes lie at places of all paths.
    assert!(walked(&order(&listed(settings(1, 3)), &product(), wave(0, 1))).is_empty());
}

/// A scene with textures, glass, an emitting surface and a lamp.
fn everything() -> Surfaces {
    let features = SURFACES_TEXTURED | SURFACES_SPECULAR | SURFACES_EMITTING;
    Surfaces { features, lamp_count: 2, ..Surfaces::default() }
}

#[test]
fn paths_end_at_light_that_is_not_sampled() {
    let direct = |features, lamp_count| PassSettings {
        surfaces: Surfaces { features, lamp_count, ..Surfaces::default() },
        ..settings(1, 1)
    };
    let listed = |settings: &PassSettings, wave| names(&order(settings, &mis(), wave));
    let glass = direct(SURFACES_SPECULAR, 0);
    assert_eq!(
        listed(&glass, wave(0, 1)),
        "camera trace sample shadow gather features bounce trace features gather deposit"
    );
    let rough = direct(SURFACES_SPECULAR | SURFACES_ROUGH_GLASS, 0);
    assert_eq!(
        listed(&rough, wave(0, 1)),
        "camera trace sample_lamps shadow gather sample shadow gather features bounce trace features \
         gather deposit"
    );
    let lamp = direct(0, 1);
    assert_eq!(
        listed(&lamp, wave(0, 1)),
        "camera trace sample_lamps shadow gather sample shadow gather features deposit"
    );
    let all = PassSettings { surfaces: everything(), ..settings(1, 1) };
    assert_eq!(
        listed(&all, wave(0, 1)),
        "camera trace texture emit sample_lamps shadow gather sample shadow gather features bounce \
         trace emit texture features gather deposit"
    );
    let surfaces = Surfaces { has_black_environment: true, ..everything() };
    assert_eq!(
        listed(&PassSettings { surfaces, ..all }, wave(0, 1)),
        "camera trace texture emit sample_lamps shadow gather features bounce trace emit texture \
         features deposit"
    );
    let training = Wave { is_training: 1, ..wave(0, 1) };
    assert_eq!(listed(&all, training), "camera trace texture sample shadow gather deposit");
    // The last ray gathers at a vertex of its own, without shadow rays.
    let order = order(&all, &mis(), wave(0, 1));
    let last = &order[order.len() - 2].wave;
    assert_eq!((last.vertex, last.shadow_ray_count, last.to_lamps), (1, 0, 0));
}

#[test]
fn every_pass_is_in_an_order() {
    let orders = shown();
    for (pass, _) in PASSES {
        let is_used = |(_, order): &(_, Vec<Dispatch>)| {
            order.iter().any(|dispatch: &Dispatch| dispatch.kernel.shader == *pass)
        };
        // Passes over a film, not over a wave.
        let is_of_film = ["accumulate", "show", "compose"].contains(pass);
        assert!(is_of_film || orders.iter().any(is_used), "{pass}: no technique runs it");
    }
}

#[test]
fn the_page_lists_every_pass() {
    let mut domains: BTreeMap<String, BTreeSet<&str>> = BTreeMap::new();
    let mut text = String::from("```text\n");
    for (name, order) in shown() {
        let (mut line, mut indent) = (format!("{name}:"), 0);
        for Dispatch { kernel, .. } in &order {
            let domain = format!("{:?}", kernel.domain).replace("ShadowRays", "shadow rays");
            domains.entry(domain.to_lowercase()).or_default().insert(kernel.shader);
            if indent + line.len() + kernel.shader.len() > 92 {
                writeln!(text, "{}{line}", " ".repeat(indent)).unwrap();
                (line, indent) = (String::new(), 4);
            }
            let space = if line.is_empty() { "" } else { " " };
            write!(line, "{space}{}", kernel.shader).unwrap();
        }
        writeln!(text, "{}{line}", " ".repeat(indent)).unwrap();
    }
    text += "```\n\n| one invocation for each of the | passes |\n|---|---|\n";
    for (domain, passes) in domains {
        let passes: Vec<_> = passes.iter().map(|pass| format!("`{pass}`")).collect();
        writeln!(text, "| {domain} | {} |", passes.join(", ")).unwrap();
    }
    page::check("architecture.md", "passes", &text);
}
