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

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    /// Mean of the estimate over the choice, for every way in which the candidates may be visible.
    #[test]
    fn the_mean_is_the_light_of_the_visible_candidates() {
        let candidates = [
            Candidate { weight: vec3(1.0, 0.5, 0.2), visibility: 0.9 },
            Candidate { weight: vec3(0.2, 0.1, 3.0), visibility: 0.0 },
            Candidate { weight: Vec3::ZERO, visibility: 0.5 },
            Candidate { weight: vec3(0.0, 2.0, 0.1), visibility: 0.4 },
        ];
        const NUMBERS: u32 = 40_000;
        for (control_share, control_bits, control_choice) in
            [(1.0, true, true), (1.0, true, false), (0.5, false, true), (0.0, false, true)]
        {
            let own = ControlVariatesParameters {
                control_share,
                control_bits,
                control_choice,
                ..ControlVariatesParameters::default()
            };
            let outcomes: Vec<Controlled> = (0..NUMBERS)
                .map(|index| own.choose(&candidates, (index as f32 + 0.5) / NUMBERS as f32))
                .collect();
            for seen in 0..16_u32 {
                let is_seen = |index: usize| seen >> index & 1 == 1;
                let light = |outcome: &Controlled| {
                    let is_seen = outcome.chosen.is_some_and(is_seen);
                    outcome.rest + if is_seen { outcome.contribution } else { Vec3::ZERO }
                };
                let mean = |light: &dyn Fn(&Controlled) -> Vec3| {
                    let sum: glam::DVec3 =
                        outcomes.iter().map(|outcome| light(outcome).as_dvec3()).sum();
                    sum / f64::from(NUMBERS)
                };
                let seen_ones = candidates.iter().enumerate().filter(|(index, _)| is_seen(*index));
                let expected = 0.25
                    * seen_ones
                        .map(|(_, candidate)| candidate.weight.as_dvec3())
                        .sum::<glam::DVec3>();
                let off = (mean(&light) - expected).abs().max_element();
                assert!(off < 1e-3, "{own:?}, {seen:04b}: off by {off}");
                // An estimate that takes back too little of the control has another mean.
                let wrong = |outcome: &Controlled| {
                    let control =
                        outcome.chosen.map_or(0.0, |index| own.control(&candidates[index]));
                    light(outcome) + 0.05 * control * outcome.contribution
                };
                let off = (mean(&wrong) - expected).abs().max_element();
                assert!(control_share == 0.0 || off > 5e-3, "{own:?}, {seen:04b}: {off}");
            }
        }
    }

    #[test]
    fn certain_candidates_leave_no_variance() {
        let certain = |visibility| Candidate { weight: Vec3::ONE, visibility };
        let candidates = [certain(1.0), certain(0.0), certain(0.0), certain(1.0)];
        let own = ControlVariatesParameters::default();
        for index in 0..100 {
            let outcome = own.choose(&candidates, (index as f32 + 0.5) / 100.0);
            let visibility = candidates[outcome.chosen.unwrap_or(0)].visibility;
            let light = outcome.rest + outcome.contribution * visibility;
            assert!((light - 0.5).abs().max_element() < 1e-6, "{outcome:?}");
        }
    }

    #[test]
    fn darkness_has_no_ray() {
        let dark = [Candidate { weight: Vec3::ZERO, visibility: 0.5 }; 4];
        let outcome = ControlVariatesParameters::default().choose(&dark, 0.3);
        assert_eq!((outcome.chosen, outcome.rest), (None, Vec3::ZERO));
    }
}
