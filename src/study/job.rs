//! One run: a sampler with one seed, rendered to its end and compared with the reference.

use super::{
    contender::Contender,
    folder::Folder,
    metrics::flip::mean_flip,
    reference::Reference,
    rule::Rule,
    runs::{Conditions, Measurement, Run, run_stem},
    statistics::percentile,
    surfaces::Surfaces,
    watch::Watch,
};
use crate::{
    error::Result,
    film::{
        Image, RgbImage,
        png::{preview, write_preview},
    },
    scene::Scene,
    session::{Figures, Rules, Session},
};

/// Seed whose pictures are also written as PNG.
pub(crate) const SHOWN_SEED: u32 = 1;

/// A run to render and measure.
pub(super) struct RunJob<'a> {
    pub(super) scene: &'a Scene,
    pub(super) reference: &'a Reference,
    pub(super) surfaces: &'a Surfaces,
    /// Exposure of previews, stops.
    pub(super) exposure: f32,
    pub(super) contender: &'a Contender,
    pub(super) rule: Rule,
    pub(super) seed: u32,
    /// Samples at which a run that ends by samples keeps its picture; ascending.
    pub(super) levels: &'a [u32],
    pub(super) conditions: Conditions,
    pub(super) folder: &'a Folder,
}

impl RunJob<'_> {
    /// Renders the run and compares the film at powers of two of samples and at the levels. Reading
    /// and comparing it does not count as time of the passes.
    pub(super) fn execute(self, session: &mut Session, watch: &mut Watch<'_>) -> Result<Run> {
        session.restart(self.seed)?;
        let limit = match self.rule {
            Rule::Spp(_) => None,
            Rule::Seconds(seconds) => Some(seconds),
        };
        let by_time = Rules { seconds: limit, ..Rules::default() };
        let mut measurements: Vec<Measurement> = Vec::new();
        loop {
            let samples = Some(self.next_stop(session.renderer.sample_count()));
            let rules = Rules { samples, ..by_time.clone() };
            watch.run(session, &rules, limit.is_some())?;
            let (mut measurement, picture) =
                Measurement::of(session, self.reference, self.surfaces)?;
            let spp = measurement.spp;
            let is_level = match self.rule {
                Rule::Spp(_) => self.levels.contains(&spp),
                Rule::Seconds(_) => session.met(&by_time).is_some(),
            };
            if is_level {
                let level = if limit.is_some() { self.rule } else { Rule::Spp(spp) };
                measurement.flip = Some(self.flip(&picture));
                measurement.image = Some(self.keep(&picture, session, level)?);
            }
            measurements.push(measurement);
            let done = match self.rule {
                Rule::Spp(end) => spp >= end,
                Rule::Seconds(_) => is_level,
            };
            if done {
                break;
            }
        }
        Ok(Run {
            scene: self.scene.name.clone(),
            sampler: self.contender.label.clone(),
            rule: self.rule,
            seed: self.seed,
            conditions: self.conditions,
            measurements,
            figures: Figures::of(&session.renderer, session.seconds()),
        })
    }

    /// Samples at the next comparison: the next power of two or level.
    fn next_stop(&self, samples: u32) -> u32 {
        let power = samples.checked_add(1).and_then(u32::checked_next_power_of_two);
        let power = power.unwrap_or(u32::MAX);
        match self.rule {
            Rule::Spp(end) => {
                let level = self.levels.iter().copied().find(|level| *level > samples);
                power.min(level.unwrap_or(end)).min(end)
            }
            Rule::Seconds(_) => power,
        }
    }

    /// Compares display pictures at the exposure of the previews.
    fn flip(&self, picture: &RgbImage) -> f64 {
        let shown = preview(&self.reference.mean(), self.exposure);
        mean_flip(&preview(picture, self.exposure), &shown, picture.width as usize)
    }

    /// Writes the picture; returns its path inside the report folder.
    fn keep(&self, picture: &RgbImage, session: &Session, level: Rule) -> Result<String> {
        let mut image = Image::of_rgb(picture.width, picture.height, &picture.pixels);
        session.metadata().store(&mut image);
        let stem = run_stem(self.contender, level, self.seed);
        let path = self.folder.image(&self.scene.name, &stem);
        image.write_exr(&path)?;
        if self.seed == SHOWN_SEED {
            write_preview(&path.with_extension("png"), picture, self.exposure)?;
        }
        Ok(Folder::image_name(&self.scene.name, &stem))
    }
}

/// Exposure in stops at which 85% of the pixels stay below white, by their brightest channel.
pub(crate) fn exposure(picture: &RgbImage) -> f32 {
    let brightest = |pixel: &[f32; 3]| f64::from(pixel[0].max(pixel[1]).max(pixel[2]));
    let white = percentile(picture.pixels.iter().map(brightest).collect(), 85);
    white.filter(|white| *white > 0.0).map_or(0.0, |white| -(white as f32).log2())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn most_pixels_are_below_white() {
        let pixels: Vec<[f32; 3]> = (1..=100u8).map(|value| [f32::from(value), 0.0, 1.0]).collect();
        let picture = RgbImage { width: 10, height: 10, pixels };
        assert!((exposure(&picture) + 85.0_f32.log2()).abs() < 1e-6);
        let black = RgbImage { width: 1, height: 1, pixels: vec![[0.0; 3]] };
        assert_eq!(exposure(&black), 0.0);
    }
}
