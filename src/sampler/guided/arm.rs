//! Arms: settings of the estimator between which `guided` chooses by measurement, and what their work costs.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{cost::GUIDED_CANDIDATES, parameters::GuidedParameters, steps::GuidedSteps};
use crate::{
    error::Result,
    gpu::Capabilities,
    pass::{PassSettings, Roulette, Steps},
    sampler::{Parameters, basic, rays::RaySteps},
    shader::constants::SURFACES_TEXTURED,
};

/// Throughputs below which the paths of an arm may end. Others from 0.02 to 1.5 gained nothing in six scenes.
const ROULETTE_THROUGHPUTS: [f32; 2] = [0.1, 0.2];

/// Settings of the estimator. All have the same expectation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Arm {
    /// True if shadow rays follow learned visibility; else they are those of `mis`.
    pub is_guided: bool,
    /// True if bounces follow the light that cells expect.
    pub guides_bounces: bool,
    /// True if shadow rays of later vertices are guided too; bounces are guided only then.
    pub guides_later: bool,
    /// True if the pixels of a cohort share paths.
    pub shares_paths: bool,
    /// Candidates for each shadow ray, if it is guided.
    pub candidates: u32,
    /// Most shadow rays at the first vertex, and at each later one.
    pub rays: [u32; 2],
    /// Throughput below which paths may end.
    pub roulette_throughput: f32,
}

impl Arm {
    /// True if every number is one that a render can have chosen.
    pub(super) fn is_possible(&self) -> bool {
        GUIDED_CANDIDATES.contains(&self.candidates)
            && (self.guides_later || !self.guides_bounces)
            && self.rays.iter().all(|rays| *rays <= 4096)
            && self.roulette_throughput >= 0.0
            && self.roulette_throughput.is_finite()
    }
}

/// Work of some paths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Work {
    pub(super) paths: f64,
    /// Camera and bounce rays.
    pub(super) rays: f64,
    pub(super) shadow_rays: f64,
}

/// Times for parts of the work, of which only the ratios count. A clock would know the machine better, but
/// not be the same in every run.
pub(super) struct Prices {
    ray: f64,
    /// Extra for its hit in a scene with textures.
    texture: f64,
    shadow_ray: f64,
    /// Direction chosen as by `mis`.
    direction: f64,
    /// Candidate for a guided direction, of the first one and of the others.
    guided_candidates: [f64; 2],
    guided_bounce: f64,
    /// Connections of a path to its cohort.
    cohort: f64,
}

/// Microseconds of a core on lavapipe with Embree in eight scenes.
const SOFTWARE_PRICES: Prices = Prices {
    ray: 0.35,
    texture: 0.3,
    shadow_ray: 0.22,
    direction: 0.07,
    guided_candidates: [0.12, 0.09],
    guided_bounce: 0.2,
    cohort: 0.65,
};

/// Nanoseconds of an H100 in five scenes: rays are dear, and choosing their directions is cheap.
const GPU_PRICES: Prices = Prices {
    ray: 1.8,
    texture: 0.0,
    shadow_ray: 0.56,
    direction: 0.11,
    guided_candidates: [0.13, 0.06],
    guided_bounce: 0.12,
    cohort: 2.9,
};

impl Prices {
    /// Returns the time that a path of `arm` takes on average.
    pub(super) fn time(&self, arm: &Arm, work: Work) -> f64 {
        let [first, later] = arm.rays.map(f64::from);
        let (rays, shadow_rays) = (work.rays / work.paths, work.shadow_rays / work.paths);
        let direction = |is_guided| {
            let [one, more] = self.guided_candidates;
            let guided = one + more * f64::from(arm.candidates - 1);
            if is_guided { guided } else { self.direction }
        };
        let directions = first * direction(arm.is_guided)
            + (rays - 1.0) * later * direction(arm.is_guided && arm.guides_later);
        let bounce = if arm.guides_bounces { self.guided_bounce } else { 0.0 };
        let cohort = if arm.shares_paths { self.cohort } else { 0.0 };
        rays * (self.ray + bounce) + shadow_rays * self.shadow_ray + directions + cohort
    }
}

impl fmt::Display for Arm {
    /// Formats "guided, 8 + 2 rays, later ones as mis, 4 candidates, shared paths, roulette below 0.2".
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [first, later] = self.rays;
        write!(
            formatter,
            "{}, {first} + {later} rays",
            if self.is_guided { "guided" } else { "mis" }
        )?;
        if self.is_guided && !self.guides_later {
            write!(formatter, ", later ones as mis")?;
        }
        if self.is_guided && self.guides_bounces {
            write!(formatter, ", guided bounces")?;
        }
        if self.is_guided && self.candidates > 1 {
            write!(formatter, ", {} candidates", self.candidates)?;
        }
        if self.shares_paths {
            write!(formatter, ", shared paths")?;
        }
        write!(formatter, ", roulette below {}", self.roulette_throughput)
    }
}

/// The arms of one render: settings that are given, and those that a measurement may decide.
pub(super) struct Arms {
    pub(super) prices: Prices,
    guided: GuidedSteps,
    mis: RaySteps,
    roulette: Roulette,
    /// The first arm, and that of open scenes.
    first: [Arm; 2],
    /// False where the candidates are given, so that directions are guided.
    chooses_technique: bool,
    chooses_bounces: bool,
    chooses_later: bool,
    chooses_sharing: bool,
    chooses_rays: bool,
    chooses_roulette: bool,
}

impl Arms {
    /// Returns the arms of a render. Fails for candidates that `guided` does not support.
    pub(super) fn new(
        parameters: &Parameters,
        settings: &PassSettings,
        capabilities: &Capabilities,
    ) -> Result<Self> {
        let mut prices = if capabilities.is_software() { SOFTWARE_PRICES } else { GPU_PRICES };
        if settings.surfaces.features & SURFACES_TEXTURED != 0 {
            prices.ray += prices.texture;
        }
        let own = parameters.guided;
        let candidates = first_candidates(parameters)?;
        let (most, has_paths) = (settings.shadow_rays, settings.depth > 1);
        let guides_bounces = own.guides_bounces(settings.depth);
        let chooses_technique = parameters.candidates.is_none() && most > 0;
        let chooses_sharing = parameters.share_paths.is_none() && settings.cohort_edge > 1;
        let shares_paths = settings.cohort_edge > 1;
        let has_own_bounces =
            own.bounce_candidates != GuidedParameters::default().bounce_candidates;
        let chooses_bounces = chooses_technique && guides_bounces && !has_own_bounces;
        let chooses_rays =
            chooses_technique && has_paths && own.later_rays.is_none() && own.open_rays.is_none();
        let first = Arm {
            is_guided: true,
            guides_bounces,
            guides_later: true,
            shares_paths: shares_paths && (most > 0 || !chooses_sharing),
            candidates,
            rays: [most, own.later_rays_of(most)],
            roulette_throughput: settings.roulette.throughput,
        };
        let open = Arm {
            is_guided: false,
            guides_bounces: false,
            guides_later: false,
            // Most paths leave an open scene before others can use them, but not one that lamps alone light.
            shares_paths: shares_paths
                && (!chooses_sharing || settings.surfaces.has_black_environment && most > 0),
            rays: own.rays_in_the_open(most, settings.depth),
            ..first
        };
        Ok(Self {
            prices,
            guided: GuidedSteps::new(candidates, own, settings),
            mis: basic::MIS.steps(parameters, settings.surfaces)?,
            roulette: settings.roulette,
            first: [first, open],
            chooses_technique,
            chooses_bounces,
            chooses_later: chooses_technique && has_paths && !(guides_bounces && has_own_bounces),
            chooses_sharing: chooses_sharing && most > 0,
            chooses_rays,
            chooses_roulette: chooses_technique
                && has_paths
                && settings.roulette == Roulette::default(),
        })
    }

    /// The arm before any measurement.
    pub(super) fn first(&self, is_open: bool) -> Arm {
        self.first[usize::from(is_open)]
    }

    pub(super) fn steps(&self, arm: &Arm) -> Box<dyn Steps> {
        let roulette = Roulette { throughput: arm.roulette_throughput, ..self.roulette };
        if arm.is_guided {
            Box::new(GuidedSteps {
                candidates: arm.candidates,
                shares_paths: arm.shares_paths,
                rays: arm.rays,
                guides_bounces: arm.guides_bounces && arm.guides_later,
                later: (!arm.guides_later).then(|| self.mis.clone()),
                roulette,
                ..self.guided.clone()
            })
        } else {
            Box::new(RaySteps {
                rays: Some(arm.rays),
                shares_paths: arm.shares_paths,
                roulette: Some(roulette),
                ..self.mis.clone()
            })
        }
    }

    /// Returns an arm chosen by another render, as far as the settings of this one leave a choice.
    pub(super) fn conform(&self, arm: Arm, is_open: bool) -> Arm {
        let mut taken = self.first(is_open || self.chooses_technique && !arm.is_guided);
        if self.chooses_technique {
            taken.candidates = arm.candidates;
        }
        if self.chooses_bounces && taken.is_guided {
            taken.guides_bounces = arm.guides_bounces;
        }
        if self.chooses_later && taken.is_guided {
            taken.guides_later = arm.guides_later || taken.guides_bounces;
        }
        if self.chooses_sharing {
            taken.shares_paths = arm.shares_paths;
        }
        if self.chooses_rays {
            taken.rays = arm.rays;
        }
        if self.chooses_roulette {
            taken.roulette_throughput = arm.roulette_throughput;
        }
        taken
    }

    /// Returns the arms that race with `arm`, itself first: other techniques in the first race, all that
    /// differ by one setting in others and in the open, which has one technique. Later vertices as by `mis`
    /// teach nothing, so rays are half as many.
    pub(super) fn contenders(&self, is_first: bool, arm: Arm, is_open: bool) -> Vec<Arm> {
        let Arm { shares_paths, roulette_throughput, .. } = arm;
        let most = self.first(false).rays[0];
        let half = arm.rays.map(|rays| rays.div_ceil(2));
        let twice = arm.rays.map(|rays| (2 * rays).min(most));
        let techniques = [
            (
                self.chooses_technique && !is_open,
                Arm { shares_paths, roulette_throughput, ..self.first(arm.is_guided) },
            ),
            (
                self.chooses_bounces && arm.is_guided,
                Arm { guides_bounces: !arm.guides_bounces, guides_later: true, ..arm },
            ),
            (
                self.chooses_later && arm.is_guided,
                Arm {
                    guides_bounces: false,
                    guides_later: !arm.guides_later,
                    rays: match (self.chooses_rays, arm.guides_later) {
                        (false, _) => arm.rays,
                        (true, true) => half,
                        (true, false) => twice,
                    },
                    ..arm
                },
            ),
        ];
        let with_rays = |rays| (self.chooses_rays && rays != arm.rays, Arm { rays, ..arm });
        let [low, high] = ROULETTE_THROUGHPUTS;
        let other_throughput = if roulette_throughput == low { high } else { low };
        let others = [
            (self.chooses_sharing, Arm { shares_paths: !shares_paths, ..arm }),
            with_rays(half),
            with_rays(twice),
            (self.chooses_roulette, Arm { roulette_throughput: other_throughput, ..arm }),
        ];
        let place = GUIDED_CANDIDATES.iter().position(|count| *count == arm.candidates);
        let place = place.filter(|_| self.chooses_technique && arm.is_guided);
        let candidates = GUIDED_CANDIDATES.iter().enumerate().map(|(index, count)| {
            let is_next = place.is_some_and(|place| place.abs_diff(index) == 1);
            (is_next, Arm { candidates: *count, ..arm })
        });
        let others = others.into_iter().chain(candidates).filter(|_| !is_first || is_open);
        let free = techniques.into_iter().chain(others).filter(|(is_free, _)| *is_free);
        [arm].into_iter().chain(free.map(|(_, other)| other)).collect()
    }
}

/// Returns the candidates per shadow ray that are given, or those before a measurement.
pub(super) fn first_candidates(parameters: &Parameters) -> Result<u32> {
    parameters.candidates_among("guided", &GUIDED_CANDIDATES, GUIDED_CANDIDATES[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_a_path_is_that_of_its_parts() {
        let mis = Arm {
            is_guided: false,
            guides_bounces: false,
            guides_later: false,
            shares_paths: false,
            candidates: 3,
            rays: [4, 2],
            roulette_throughput: 0.1,
        };
        let guided = Arm { is_guided: true, ..mis };
        let all = Arm { guides_bounces: true, guides_later: true, shares_paths: true, ..guided };
        // Three rays and five shadow rays a path: one vertex of four directions, two of two.
        let work = Work { paths: 10.0, rays: 30.0, shadow_rays: 50.0 };
        let traced = 3.0 * 0.35 + 5.0 * 0.22;
        let candidates = 0.12 + 2.0 * 0.09;
        for (arm, expected) in [
            (mis, traced + 8.0 * 0.07),
            (guided, traced + 4.0 * candidates + 4.0 * 0.07),
            (all, traced + 8.0 * candidates + 3.0 * 0.2 + 0.65),
        ] {
            let found = SOFTWARE_PRICES.time(&arm, work);
            assert!((found - expected).abs() < 1e-9, "{arm}: {found} instead of {expected}");
        }
    }
}
