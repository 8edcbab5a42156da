//! Order of the passes in one wave, as data.

use super::{
    geometry::{Schedule, Traversal},
    kernel::{Dispatch, Domain, Kernel},
    roulette::Roulette,
    sharing::Sharing,
    steps::Steps,
    surfaces::Surfaces,
};
use crate::shader::{
    constants::{
        AOV_ALBEDO, AOV_NORMAL, AOV_POSITION, CONSTANT_ONLY_SPECULAR, PATH_LISTS, TRAINING_WAVE,
    },
    structs::Wave,
};

/// Bits of [`Wave::aovs`] that the pass `features` writes.
const FEATURES: u32 = AOV_ALBEDO | AOV_NORMAL | AOV_POSITION;

/// When the passes of later vertices walk lists of the paths that are still alive. The picture is the same
/// to the bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PathLists {
    /// Where most paths end early: `docs/experiments/lists_of_living_paths.md`.
    #[default]
    WherePathsEnd,
    /// Everywhere.
    Always,
    /// Nowhere.
    Never,
}

/// Settings of a render that shape its passes, apart from the technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassSettings {
    /// Shadow rays per hit; 0 renders only the environment that the camera sees.
    pub shadow_rays: u32,
    /// Path vertices at which environment light is gathered.
    pub depth: u32,
    /// Bits `AOV_…`.
    pub aovs: u32,
    /// Where paths end by chance.
    pub roulette: Roulette,
    /// Edge of the tiles whose pixels share second vertices: 2, 4, 8, or 1 for none.
    pub tile_edge: u32,
    /// Specialization by the surfaces of the scene.
    pub surfaces: Surfaces,
    /// Specialization of the passes that traverse.
    pub traversal: Traversal,
    /// Schedule of incoherent rays.
    pub incoherent: Schedule,
    /// When passes walk lists of living paths instead of all.
    pub path_lists: PathLists,
    /// Most bytes of one buffer of the film.
    pub film_page_bytes: u64,
    /// Most paths in flight.
    pub most_paths: u32,
}

/// Returns the dispatches of one wave for the first `vertices` vertices of its paths.
pub fn wave_order(
    settings: &PassSettings,
    steps: &dyn Steps,
    wave: Wave,
    vertices: u32,
) -> Vec<Dispatch> {
    let PassSettings { surfaces, traversal, incoherent, tile_edge, .. } = *settings;
    let constants = surfaces.constants();
    // Training teaches the visibility of the environment; other light is not needed.
    let is_lit = wave.is_training != TRAINING_WAVE;
    let follows_last = is_lit && surfaces.emits();
    let escape = steps.escape();
    let gather = || Kernel::new("gather", Domain::Arrivals, escape.as_deref().unwrap_or_default());
    let sharing = Sharing { tile_edge, surfaces, traversal, schedule: incoherent };
    let shares = is_lit && tile_edge > 1 && vertices > 1 && steps.shares_paths();
    let mut order = Vec::new();
    // Tiles keep the second vertices of all paths.
    let walks_lists = steps.walks_lists() && settings.path_lists != PathLists::Never;
    let first_listed = if walks_lists { 1 + u32::from(shares) } else { u32::MAX };
    let mut add = |kernel: Kernel, wave: &Wave| {
        let path_list = path_list(kernel.domain, wave.vertex, first_listed);
        order.push(Dispatch { kernel, wave: Wave { path_list, ..*wave } });
    };
    let mut wave = Wave { aovs: settings.aovs, ..wave };

    add(Kernel::new("camera", Domain::Paths, &[]), &wave);
    for vertex in 0..vertices {
        wave.vertex = vertex;
        wave.arriving_shadow_rays = wave.bounce_rays * wave.total_shadow_rays;
        wave.total_shadow_rays = steps.shadow_rays_at(vertex, settings.shadow_rays);
        let is_counted = escape.is_some() && wave.total_shadow_rays > 0;
        wave.bounce_rays = u32::from(is_counted && (vertex + 1 < vertices || follows_last));
        // Camera rays stay coherent, bounce rays do not.
        let schedule = if vertex == 0 { Schedule::SINGLE } else { incoherent };
        add(traversal.trace(schedule, surfaces), &wave);
        if vertex >= first_listed {
            add(Kernel::new("list_paths", Domain::Arrivals, &[]), &wave);
        }
        if surfaces.is_textured() {
            add(Kernel::new("texture", Domain::Surfaces, &constants), &wave);
        }
        if is_lit {
            if surfaces.emits() {
                add(Kernel::new("emit", Domain::Surfaces, &constants), &wave);
            }
            if shares && vertex == 1 {
                add(sharing.keep_second(), &wave);
            }
            if surfaces.lamp_count > 0 {
                let rays = rays_to_lamps(wave.total_shadow_rays);
                for ray in 0..rays {
                    let to_lamps = Wave {
                        shadow_ray_count: 1,
                        first_shadow_ray: ray,
                        total_shadow_rays: rays,
                        to_lamps: 1,
                        ..wave
                    };
                    add(Kernel::new("sample_lamps", Domain::Surfaces, &constants), &to_lamps);
                    add(traversal.shadow(incoherent, surfaces), &to_lamps);
                    add(Kernel::new("gather", Domain::Arrivals, &[]), &to_lamps);
                    if shares
                        && vertex == 1
                        && let Some(kernel) = sharing.gather_base()
                    {
                        add(kernel, &to_lamps);
                    }
                }
            }
        }

        wave.first_shadow_ray = 0;
        if wave.total_shadow_rays > 0 {
            for kernel in steps.prepare(&wave) {
                add(kernel, &wave);
            }
        }
        loop {
            let left = wave.total_shadow_rays - wave.first_shadow_ray;
            wave.shadow_ray_count = left.min(steps.rays_per_group());
            if wave.shadow_ray_count > 0 {
                for kernel in steps.sample(&wave) {
                    add(kernel, &wave);
                }
                if !steps.traces() {
                    add(traversal.shadow(incoherent, surfaces), &wave);
                }
                for kernel in steps.after_shadow_rays(&wave) {
                    add(kernel, &wave);
                }
            }
            add(gather(), &wave);
            if shares
                && vertex == 1
                && let Some(kernel) = sharing.gather_base()
            {
                add(kernel, &wave);
            }
            if wave.first_shadow_ray + wave.shadow_ray_count >= wave.total_shadow_rays {
                break;
            }
            wave.first_shadow_ray += wave.shadow_ray_count;
        }
        for kernel in steps.finish(&wave) {
            add(kernel, &wave);
        }
        if vertex == 0 && wave.aovs & FEATURES != 0 && wave.is_training == 0 {
            add(Kernel::new("features", Domain::Pixels, &constants), &wave);
        }
        if shares && vertex == 0 {
            add(sharing.keep_first(), &wave);
        }
        if vertex + 1 < vertices {
            let guided = if wave.total_shadow_rays > 0 { steps.bounce(&wave) } else { None };
            add(guided.unwrap_or_else(|| bounce(settings, false)), &wave);
        }
        if shares && vertex == 1 && vertex + 1 < vertices {
            add(sharing.keep_third(), &wave);
        }
    }
    let ends_at_second = shares && vertices == 2;
    let goes_on = follows_last || is_lit && surfaces.has_specular();
    if ends_at_second && !goes_on {
        add(sharing.keep_third(), &wave);
    }
    if goes_on {
        // Follow the last vertices to light that is not sampled, or not sampled alone.
        add(bounce(settings, !surfaces.emits()), &wave);
        if ends_at_second {
            add(sharing.keep_third(), &wave);
        }
        wave.arriving_shadow_rays = wave.bounce_rays * wave.total_shadow_rays;
        wave = Wave { vertex: vertices, shadow_ray_count: 0, total_shadow_rays: 0, ..wave };
        wave.first_shadow_ray = 0;
        add(traversal.trace(incoherent, surfaces), &wave);
        if surfaces.emits() {
            add(Kernel::new("emit", Domain::Arrivals, &constants), &wave);
        }
        add(gather(), &wave);
    }
    if shares {
        order.extend(sharing.connect_and_share(&wave));
    }
    order.push(Dispatch { kernel: Kernel::new("accumulate", Domain::Pixels, &[]), wave });
    order
}

/// Returns the list of paths that a pass walks at a vertex, as in [`Wave::path_list`].
fn path_list(domain: Domain, vertex: u32, first_listed: u32) -> u32 {
    let listed_at = match domain {
        Domain::Surfaces | Domain::ShadowRays => Some(vertex),
        Domain::Arrivals => vertex.checked_sub(1),
        Domain::Paths | Domain::Pixels => None,
    };
    listed_at.filter(|vertex| *vertex >= first_listed).map_or(0, |vertex| 1 + vertex % PATH_LISTS)
}

/// Number of rays to lamps at a vertex with `shadow_rays` rays to the environment: half as many, at
/// least one (docs/experiments/rays_to_lamps.md).
fn rays_to_lamps(shadow_rays: u32) -> u32 {
    shadow_rays.div_ceil(2).max(1)
}

/// The pass that continues paths by the BRDF's own sampling; `only_specular` ends all others.
fn bounce(settings: &PassSettings, only_specular: bool) -> Kernel {
    let mut constants = settings.surfaces.constants();
    constants.extend(settings.roulette.constants());
    constants.push((CONSTANT_ONLY_SPECULAR, u32::from(only_specular)));
    Kernel::new("bounce", Domain::Surfaces, &constants)
}
