//! Passes by which the pixels of a tile share the second vertices of their paths: Bekaert, Sbert &
//! Halton 2002, "Accelerating path tracing by re-using paths" (`docs/shading.md`).

use super::{
    kernel::{Dispatch, Domain, Kernel},
    order::PassSettings,
    steps::SHADOW_RAYS_PER_GROUP,
};
use crate::shader::{
    constants::{CONSTANT_TILE_EDGE, MATERIAL_PLASTIC, MATERIAL_PRINCIPLED},
    structs::Wave,
};

/// Edges of tiles, pixels; 1 shares nothing. A tile lies in a block of the film.
pub const TILE_EDGES: [u32; 4] = [1, 2, 4, 8];

/// Bits of the kinds of material that reflect more than a diffuse base (`glsl/include/base.glsl`).
const WITH_BASE_AND_REST: u32 = 1 << MATERIAL_PLASTIC | 1 << MATERIAL_PRINCIPLED;

/// Keeps the first vertices, before their paths go on.
pub fn keep_first(settings: &PassSettings) -> Kernel {
    Kernel::new("keep_first", Domain::Paths, &settings.surfaces.constants())
}

/// Keeps the second vertices, before light is gathered there.
pub fn keep_second(settings: &PassSettings) -> Kernel {
    Kernel::new("keep_second", Domain::Paths, &settings.surfaces.constants())
}

/// Adds the light of shadow rays that the base of second vertices reflects, where it is not all.
pub fn gather_base(settings: &PassSettings) -> Option<Kernel> {
    let has_rest = settings.surfaces.material_kinds & WITH_BASE_AND_REST != 0;
    let constants = settings.surfaces.constants();
    has_rest.then(|| Kernel::new("gather_base", Domain::Paths, &constants))
}

/// Parts the light of the second vertices, once their paths have bounced.
pub fn keep_third(settings: &PassSettings) -> Kernel {
    Kernel::new("keep_third", Domain::Paths, &settings.surfaces.constants())
}

/// Connects the vertices of a finished `wave` in groups of shadow rays, and shares the light.
pub fn connect_and_share(settings: &PassSettings, wave: &Wave) -> Vec<Dispatch> {
    let PassSettings { surfaces, traversal, incoherent, tile_edge, .. } = *settings;
    let edge = (CONSTANT_TILE_EDGE, tile_edge);
    let constants = [&surfaces.constants()[..], &[edge]].concat();
    let pixels = tile_edge * tile_edge;
    let mut wave = Wave { to_lamps: 1, total_shadow_rays: pixels, ..*wave };
    let mut order =
        vec![Dispatch { kernel: Kernel::new("offer", Domain::Paths, &constants), wave }];
    for first in (0..pixels).step_by(SHADOW_RAYS_PER_GROUP as usize) {
        wave.first_shadow_ray = first;
        wave.shadow_ray_count = SHADOW_RAYS_PER_GROUP.min(pixels - first);
        for kernel in [
            Kernel::new("connect", Domain::Paths, &constants),
            traversal.shadow(incoherent, surfaces),
            Kernel::new("admit", Domain::Paths, &[]),
        ] {
            order.push(Dispatch { kernel, wave });
        }
    }
    for shader in ["weigh", "share"] {
        order.push(Dispatch { kernel: Kernel::new(shader, Domain::Paths, &[edge]), wave });
    }
    order
}
