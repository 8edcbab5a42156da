//! Records, and one shadow ray among candidates with a control variate: twin of `records.glsl` and
//! `controlled.glsl` in `glsl/control_variates`, where the estimate is explained.

use fenestra::{
    math::{colour::luminance, equal_area::square_from_direction, random::hash_4d},
    sampler::{
        control_variates::{ControlVariatesParameters, RecordGrid},
        regions::{FACE_COUNT, face_normal},
    },
    shader::rooms::control_variates::VISIBILITY_RECORDS,
};
use glam::Vec3;

/// Index of the record for a place on a surface.
pub fn record_of(grid: RecordGrid, position: Vec3, normal: Vec3, camera: Vec3) -> u32 {
    let wanted = grid.largest_edge.min(grid.edge_per_distance * position.distance(camera));
    let edge = f32::from_bits(wanted.max(1e-9).to_bits() & 0x7f80_0000);
    let cube = (position / edge).floor().clamp(Vec3::splat(-1e9), Vec3::splat(1e9)).as_ivec3();
    // The first of the faces that a normal points at most.
    let along = |face: &usize| face_normal(*face).dot(normal);
    let face =
        (1..FACE_COUNT).fold(0, |best, face| if along(&face) > along(&best) { face } else { best });
    let kind = (face as u32) << 8 | edge.to_bits() >> 23;
    let [x, y, z] = cube.to_array().map(|place| place as u32);
    hash_4d([x, y, z, kind])[0] & (VISIBILITY_RECORDS - 1)
}

/// Index of a direction's entry in a record, among those of all records.
pub fn entry(grid: RecordGrid, record: u32, direction: Vec3) -> u32 {
    let at = square_from_direction(direction) * grid.side as f32;
    let [column, row] = at.to_array().map(|place| (place as u32).min(grid.side - 1));
    (record * grid.side + row) * grid.side + column
}

/// Least mean square of V − h.
const LEAST_DOUBT: f32 = 0.01;

/// A direction that a shadow ray may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Integrand without occlusion over the density of the direction.
    pub weight: Vec3,
    /// Expected visibility.
    pub visibility: f32,
}

/// The chosen ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Controlled {
    /// Index of the candidate; `None` if none of them brings light.
    pub chosen: Option<usize>,
    /// Light of the ray if it is visible.
    pub contribution: Vec3,
    /// Light that is added, visible or not; may be negative.
    pub rest: Vec3,
}

/// Returns the control h of a candidate.
pub fn control_of(parameters: &ControlVariatesParameters, candidate: &Candidate) -> f32 {
    let bit = if candidate.visibility >= 0.5 { 1.0 } else { 0.0 };
    parameters.control_share * if parameters.control_bits { bit } else { candidate.visibility }
}

/// Returns what a candidate is chosen in proportion to.
pub fn target_of(parameters: &ControlVariatesParameters, candidate: &Candidate) -> f32 {
    let (visibility, control) = (candidate.visibility, control_of(parameters, candidate));
    let left = 1.0 - control;
    let square = visibility * (left * left) + (1.0 - visibility) * (control * control);
    let doubt = if parameters.control_choice { square.max(LEAST_DOUBT).sqrt() } else { 1.0 };
    luminance(candidate.weight) * doubt
}

/// Chooses one of the candidates by `u` in \[0, 1).
pub fn choose(
    parameters: &ControlVariatesParameters,
    candidates: &[Candidate],
    mut u: f32,
) -> Controlled {
    let count = candidates.len() as f32;
    let (mut sum, mut control) = (0.0, Vec3::ZERO);
    let mut chosen = None;
    for (index, candidate) in candidates.iter().enumerate() {
        control += candidate.weight * control_of(parameters, candidate);
        let target = target_of(parameters, candidate);
        sum += target;
        if target > 0.0 {
            let probability = target / sum;
            if u < probability {
                u /= probability;
                chosen = Some((index, target));
            } else {
                u = (u - probability) / (1.0 - probability);
            }
        }
    }
    let Some((index, target)) = chosen else {
        return Controlled { chosen: None, contribution: Vec3::ZERO, rest: control / count };
    };
    let contribution = candidates[index].weight * (sum / (count * target));
    let expected = contribution * control_of(parameters, &candidates[index]);
    Controlled { chosen: Some(index), contribution, rest: control / count - expected }
}
