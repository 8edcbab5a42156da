//! One shadow ray among candidates with a control variate, on the host: twin of
//! `glsl/control_variates/controlled.glsl`, where the estimate is explained.

use glam::Vec3;

use super::parameters::ControlVariatesParameters;
use crate::math::colour::luminance;

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

impl ControlVariatesParameters {
    /// Returns the control h of a candidate.
    pub fn control(&self, candidate: &Candidate) -> f32 {
        let bit = if candidate.visibility >= 0.5 { 1.0 } else { 0.0 };
        self.control_share * if self.control_bits { bit } else { candidate.visibility }
    }

    /// Returns what a candidate is chosen in proportion to.
    pub fn target(&self, candidate: &Candidate) -> f32 {
        let (visibility, control) = (candidate.visibility, self.control(candidate));
        let left = 1.0 - control;
        let square = visibility * (left * left) + (1.0 - visibility) * (control * control);
        let doubt = if self.control_choice { square.max(LEAST_DOUBT).sqrt() } else { 1.0 };
        luminance(candidate.weight) * doubt
    }

    /// Chooses one of the candidates by `u` in \[0, 1).
    pub fn choose(&self, candidates: &[Candidate], mut u: f32) -> Controlled {
        let count = candidates.len() as f32;
        let (mut sum, mut control) = (0.0, Vec3::ZERO);
        let mut chosen = None;
        for (index, candidate) in candidates.iter().enumerate() {
            control += candidate.weight * self.control(candidate);
            let target = self.target(candidate);
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
        let expected = contribution * self.control(&candidates[index]);
        Controlled { chosen: Some(index), contribution, rest: control / count - expected }
    }
}
