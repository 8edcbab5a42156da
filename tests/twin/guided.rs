//! Directions of arriving light: twin of `glsl/guided/arriving.glsl`.

use fenestra::shader::rooms::guided::GUIDE_ARRIVAL_SIDE;
use glam::{Vec2, Vec3};

/// Index below `ARRIVAL_DIRECTIONS` of the direction of a unit vector, in a grid over the
/// octahedron (Cigolle et al. 2014).
pub fn arrival_direction(direction: Vec3) -> usize {
    let place = direction.truncate() / (direction.x.abs() + direction.y.abs() + direction.z.abs());
    let sign = |value: f32| if value < 0.0 { -1.0 } else { 1.0 };
    let folded =
        Vec2::new((1.0 - place.y.abs()) * sign(place.x), (1.0 - place.x.abs()) * sign(place.y));
    let place = if direction.z < 0.0 { folded } else { place };
    let side = GUIDE_ARRIVAL_SIDE as f32;
    let cell = |place: f32| ((0.5 * place + 0.5) * side).clamp(0.0, side - 1.0) as usize;
    cell(place.y) * GUIDE_ARRIVAL_SIDE as usize + cell(place.x)
}
