//! Runs and what they found, stored in `runs/` and in `results.json`.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{
    contender::Contender,
    metrics::{Errors, Metrics},
    plan::Rule,
    reference::{OwnErrors, OwnParts, Reference, is_judged},
    reference_check::ReferenceCheck,
    statistics::mean_standard_error,
    surfaces::{Parts, Surfaces},
};
use crate::{
    error::Result,
    film::RgbImage,
    session::{Figures, Session},
};

/// Conditions of a run besides its sampler, rule and seed; a run is reused only if all agree.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Conditions {
    pub version: String,
    pub scene_hash: String,
    pub film: [u32; 2],
    pub device: String,
    pub driver: String,
    /// Directions traced at every vertex.
    pub shadow_rays: u32,
    /// Path vertices at which environment light is gathered.
    pub depth: u32,
    /// Reference that the errors were measured against.
    pub reference: String,
    /// Parameters as text, by name; those of overhead rounds by sampler's label.
    pub parameters: BTreeMap<String, String>,
}

impl Conditions {
    /// Lists differing conditions as "name: ours there, theirs asked for".
    pub(crate) fn differences(&self, asked: &Self) -> Vec<String> {
        let facts = |of: &Self| {
            let parameters = match of.parameters.is_empty() {
                true => "default".to_owned(),
                false => assignments(&of.parameters, " "),
            };
            [
                ("version", of.version.clone()),
                // The first digits tell scenes apart.
                ("scene hash", of.scene_hash.chars().take(12).collect()),
                ("film", format!("{}x{}", of.film[0], of.film[1])),
                ("device", of.device.clone()),
                ("driver", of.driver.clone()),
                ("shadow rays", of.shadow_rays.to_string()),
                ("depth", of.depth.to_string()),
                ("reference", of.reference.clone()),
                ("parameters", parameters),
            ]
        };
        let both = facts(self).into_iter().zip(facts(asked));
        let differing = both.filter(|(ours, theirs)| ours != theirs);
        differing
            .map(|((what, ours), (_, theirs))| format!("{what}: {ours} there, {theirs} asked for"))
            .collect()
    }
}

/// Joins parameters, written `name=value`.
pub(super) fn assignments(parameters: &BTreeMap<String, String>, separator: &str) -> String {
    let pairs: Vec<String> =
        parameters.iter().map(|(name, value)| format!("{name}={value}")).collect();
    pairs.join(separator)
}

/// Lists values in the order in which they first occur.
pub(super) fn distinct<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut found = Vec::new();
    for value in values {
        if !found.contains(&value) {
            found.push(value);
        }
    }
    found
}

/// Errors of a film after some samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    pub spp: u32,
    /// Wall time of the passes so far, seconds.
    pub seconds: f64,
    /// Device time of the passes so far, seconds.
    pub gpu_seconds: f64,
    /// Rays of every kind so far.
    pub rays: u64,
    /// Errors over all pixels; they may be negative, see [`super::metrics`].
    #[serde(flatten)]
    pub errors: Errors,
    /// Mean of the picture over that of the reference.
    pub mean_ratio: f64,
    /// Difference of the two means in its standard errors; absent below two samples, or if the
    /// standard error of the reference's mean is unknown.
    pub mean_deviation: Option<f64>,
    /// True if `mse` is well above the reference's own.
    pub mse_judged: bool,
    /// True if both relative errors are well above the reference's own.
    pub relmse_judged: bool,
    /// Errors over lit surfaces and over the environment seen directly.
    pub parts: Parts,
    /// Mean FLIP of the display picture (`metrics::flip`), of pictures that are kept.
    pub flip: Option<f64>,
    /// Path in the report folder, if the picture is kept.
    pub image: Option<String>,
}

impl Measurement {
    /// Compares the film of `session` with `reference`, as a whole and in the parts that `surfaces`
    /// tells apart. Fails if a pixel is not finite.
    pub(crate) fn of(
        session: &Session,
        reference: &Reference,
        surfaces: &Surfaces,
    ) -> Result<(Self, RgbImage)> {
        let sums = session.renderer.sums()?;
        let pixels = 0..sums.pixel_count();
        let picture = RgbImage {
            width: sums.width,
            height: sums.height,
            pixels: pixels.map(|pixel| sums.mean(pixel).map(|value| value as f32)).collect(),
        };
        let metrics = Metrics::of_halves(&picture, &reference.first, &reference.second)?;
        let variances = (0..sums.pixel_count()).map(|pixel| sums.variance_of_mean(pixel));
        let error = (sums.sample_count > 1).then(|| {
            mean_standard_error(
                variances.map(|v| v.map(f64::sqrt)),
                session.renderer.runner.scene.filter(),
            )
        });
        let totals = session.renderer.totals();
        let own = &reference.own;
        let measurement = Self {
            spp: sums.sample_count,
            seconds: session.seconds(),
            gpu_seconds: totals.gpu_ms.values().sum::<f64>() * 1e-3,
            rays: totals.rays(),
            errors: metrics.errors,
            mean_ratio: metrics.mean_ratio,
            mean_deviation: error.zip(own.mean_standard_error).map(|(error, theirs)| {
                let deviation = (metrics.mean_ratio - 1.0) * own.mean;
                deviation / error.hypot(theirs).max(f64::MIN_POSITIVE)
            }),
            mse_judged: is_judged(metrics.errors.mse, own.mse),
            relmse_judged: own.judges_relative(&metrics.errors),
            parts: surfaces.errors(&picture, reference)?,
            flip: None,
            image: None,
        };
        Ok((measurement, picture))
    }
}

/// One finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    pub scene: String,
    /// Contender's label.
    pub sampler: String,
    /// Rule that ended it.
    pub rule: Rule,
    pub seed: u32,
    pub conditions: Conditions,
    /// Measurements by ascending samples; the last is of the finished film.
    pub measurements: Vec<Measurement>,
    /// Figures of the whole run.
    #[serde(flatten)]
    pub figures: Figures,
}

impl Run {
    /// Returns the finished film's measurement.
    pub(crate) fn last(&self) -> Option<&Measurement> {
        self.measurements.last()
    }

    /// Returns the measurement at the rule's number of samples, or the last of a run by time.
    pub(crate) fn at(&self, rule: Rule) -> Option<&Measurement> {
        match (rule, self.rule) {
            (Rule::Spp(spp), Rule::Spp(_)) => {
                self.measurements.iter().find(|measurement| measurement.spp == spp)
            }
            _ => (rule == self.rule).then(|| self.last()).flatten(),
        }
    }
}

/// Device time of one sampler in one round of overhead measurements.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Contender's label.
    pub sampler: String,
    /// Wall milliseconds of the passes per sample.
    pub wall_ms_per_sample: f64,
    /// Device milliseconds per sample, by pass.
    pub gpu_ms_per_sample: BTreeMap<String, f64>,
    /// Share of shadow rays that reached the environment; absent if none was traced.
    pub visible_share: Option<f64>,
    /// Other figures of the sampler, by name.
    pub statistics: BTreeMap<String, f64>,
}

impl Timing {
    /// Device milliseconds per sample of all passes.
    pub(crate) fn total_ms(&self) -> f64 {
        self.gpu_ms_per_sample.values().sum()
    }
}

/// One round of overhead measurements: every sampler once, one after the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Round {
    pub scene: String,
    /// Number of the round from 1, also the seed.
    pub repetition: u32,
    /// Samples per pixel of each measurement.
    pub spp: u32,
    pub conditions: Conditions,
    /// In the order of measurement, which rotates by one from round to round.
    pub timings: Vec<Timing>,
}

/// A scene of a study.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StudiedScene {
    pub name: String,
    pub path: String,
    pub hash: String,
    pub width: u32,
    pub height: u32,
    pub triangles: u64,
    /// The reference's own errors, if errors were compared.
    pub reference: Option<OwnErrors>,
    /// Comparison of the reference with an independent picture, if it was checked.
    pub reference_check: Option<ReferenceCheck>,
    /// The reference's own errors over lit surfaces and the environment seen directly.
    pub parts: Option<OwnParts>,
}

/// Returns the part of a file name that identifies its run.
pub(crate) fn run_stem(contender: &Contender, rule: Rule, seed: u32) -> String {
    format!("{}-{}-seed{seed}", contender.file_stem(), rule.file_stem())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differing_conditions_are_listed() {
        let there = Conditions {
            scene_hash: "0123456789abcdef".into(),
            shadow_rays: 5,
            ..Conditions::default()
        };
        assert!(there.differences(&there.clone()).is_empty());
        let parameters = BTreeMap::from([("candidates".to_owned(), "8".to_owned())]);
        let asked = Conditions {
            version: "2".into(),
            scene_hash: "9876543210fedcba".into(),
            film: [4, 3],
            device: "GPU".into(),
            driver: "new".into(),
            shadow_rays: 4,
            depth: 2,
            reference: "whole".into(),
            parameters,
        };
        assert_eq!(
            there.differences(&asked),
            [
                "version:  there, 2 asked for",
                "scene hash: 0123456789ab there, 9876543210fe asked for",
                "film: 0x0 there, 4x3 asked for",
                "device:  there, GPU asked for",
                "driver:  there, new asked for",
                "shadow rays: 5 there, 4 asked for",
                "depth: 0 there, 2 asked for",
                "reference:  there, whole asked for",
                "parameters: default there, candidates=8 asked for"
            ]
        );
    }
}
