//! Sums that the device's film holds after `n` samples of every pixel.

use std::{array, collections::BTreeSet};

use super::{
    layers::{Aov, COUNTS, COVERAGES, Coverage, GroupSums, TRIPLES},
    reconstruction::{falloff, weights},
};
use crate::shader::constants::FILM_BLOCK;

/// A sweep over the film that was stopped on its way: the first blocks have one more sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ahead {
    /// Number of blocks of 8×8 pixels, row by row from the top.
    pub blocks: u32,
    /// Offset of the sample from the centre of every pixel, where all share it, in pixels.
    pub offset: Option<[f32; 2]>,
}

impl Ahead {
    /// Tests whether no pixel has more samples than another.
    pub fn is_none(self) -> bool {
        self.blocks == 0
    }
}

/// Sums over the samples of every pixel of the rendered window, row by row from the top.
///
/// `sum` and `compensation` are the two parts of a two-float sum: the value is their sum taken in
/// 64-bit floats, and it stays exact to about 2⁻⁴⁸ however many samples are added. So are `squares` and
/// `squares_compensation`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sums {
    /// Width of the rendered window in pixels.
    pub width: u32,
    /// Height of the rendered window in pixels.
    pub height: u32,
    /// Upper left pixel of the rendered window in the whole film.
    pub origin: [u32; 2],
    /// Width and height of the whole film in pixels.
    pub film_size: [u32; 2],
    /// Samples (camera paths) of every pixel.
    pub sample_count: u32,
    /// Pixels with a further sample.
    pub ahead: Ahead,
    /// Radiance of that sample, unfiltered: what the sums lack; empty if no pixel is ahead.
    pub pending: Vec<[f32; 3]>,
    /// Leading part of Σ radiance, W·sr⁻¹·m⁻².
    pub sum: Vec<[f32; 3]>,
    /// Rest of Σ radiance.
    pub compensation: Vec<[f32; 3]>,
    /// Leading part of Σ radiance², per sample.
    pub squares: Vec<[f32; 3]>,
    /// Rest of Σ radiance².
    pub squares_compensation: Vec<[f32; 3]>,
    /// Σ radiance of the pixel's own samples; empty if not asked for.
    pub unfiltered: Vec<[f32; 3]>,
    /// Σ albedo of surfaces, as [`Aov::Albedo`], 0 without one; empty if not asked for.
    pub albedo: Vec<[f32; 3]>,
    /// Σ shading normal of these surfaces, 0 without one; empty if not asked for.
    pub normal: Vec<[f32; 3]>,
    /// Σ position of the first hit, 0 without one; empty if not asked for.
    pub position: Vec<[f32; 3]>,
    /// Shadow rays that reached the environment, and all that were traced; empty if not asked for.
    pub visible: Vec<[u32; 2]>,
    /// Directions in the visibility caches after the last ray of every hit, and the number of those
    /// hits; empty if not asked for.
    pub cache_entries: Vec<[u32; 2]>,
    /// Σ colour of the guide's cell at the first hit, 0 without one; empty if not asked for.
    pub guide_cell: Vec<[f32; 3]>,
    /// Numbers of first hits whose cell was that of their face, a coarse one, a fine one; empty if
    /// not asked for.
    pub guide_level: Vec<[f32; 3]>,
    /// Samples by object, by [`identifier`](super::cryptomatte::identifier); empty if not asked for.
    pub objects: Vec<Coverage>,
    /// Samples by material; empty if not asked for.
    pub materials: Vec<Coverage>,
    /// Groups of lights in the order of [`LightGroups`](crate::scene::light_group::LightGroups); empty if not
    /// asked for.
    pub groups: Vec<GroupSums>,
}

/// Defines a method that returns all layers of a table, and one to change them.
macro_rules! layers {
    ($all:ident $all_mut:ident $table:ident $sum:ty: $($layer:ident)*) => {
        pub(crate) fn $all(&self) -> [&Vec<$sum>; $table.len()] {
            [$(&self.$layer),*]
        }

        pub(crate) fn $all_mut(&mut self) -> [&mut Vec<$sum>; $table.len()] {
            [$(&mut self.$layer),*]
        }
    };
}

impl Sums {
    layers!(triples triples_mut TRIPLES [f32; 3]:
        sum compensation squares squares_compensation unfiltered albedo normal position guide_cell
        guide_level);
    layers!(counts counts_mut COUNTS [u32; 2]: visible cache_entries);
    layers!(coverages coverages_mut COVERAGES Coverage: objects materials);

    /// Creates sums of no samples, without extra layers.
    pub fn new(origin: [u32; 2], width: u32, height: u32, film_size: [u32; 2]) -> Self {
        let zeros = vec![[0.0; 3]; width as usize * height as usize];
        Self {
            width,
            height,
            origin,
            film_size,
            sum: zeros.clone(),
            compensation: zeros.clone(),
            squares: zeros.clone(),
            squares_compensation: zeros,
            ..Self::default()
        }
    }

    /// Extra layers of which `asked` has sums that these lack.
    pub(crate) fn lacks(&self, asked: &Self) -> BTreeSet<Aov> {
        let both = self.extra_layers().into_iter().zip(asked.extra_layers());
        let lacking = both.filter(|((_, is_ours), (_, is_asked))| *is_asked && !is_ours);
        let lacks_group = asked.groups.iter().any(|group| self.group(&group.name).is_none());
        let groups = lacks_group.then_some(Aov::LightGroups);
        lacking.map(|((aov, _), _)| aov).chain(groups).collect()
    }

    /// Finds the sums of a group of lights.
    pub fn group(&self, name: &str) -> Option<&GroupSums> {
        self.groups.iter().find(|group| group.name == name)
    }

    /// Layers that not every film has, and true for those that are there.
    fn extra_layers(&self) -> Vec<(Aov, bool)> {
        let triples = TRIPLES.iter().map(|layer| layer.aov).zip(self.triples().map(Vec::is_empty));
        let counts = COUNTS.iter().map(|layer| layer.aov).zip(self.counts().map(Vec::is_empty));
        let coverages = COVERAGES.iter().map(|layer| Some(layer.0));
        let coverages = coverages.zip(self.coverages().map(Vec::is_empty));
        let all = triples.chain(counts).chain(coverages);
        all.filter_map(|(aov, is_empty)| Some((aov?, !is_empty))).collect()
    }

    /// `width * height`.
    pub fn pixel_count(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Σ radiance of one pixel in 64-bit floats.
    pub fn total(&self, pixel: usize) -> [f64; 3] {
        joined(self.sum[pixel], self.compensation[pixel])
    }

    /// Σ radiance² of one pixel in 64-bit floats.
    pub fn total_squares(&self, pixel: usize) -> [f64; 3] {
        joined(self.squares[pixel], self.squares_compensation[pixel])
    }

    /// Samples of one pixel.
    pub fn samples(&self, pixel: usize) -> u32 {
        if self.ahead.is_none() {
            return self.sample_count;
        }
        self.sample_count + u32::from(self.is_ahead(self.place(pixel)))
    }

    /// Column and row of a pixel of the window.
    fn place(&self, pixel: usize) -> [u32; 2] {
        [pixel % self.width as usize, pixel / self.width as usize].map(|at| at as u32)
    }

    fn is_ahead(&self, place: [u32; 2]) -> bool {
        let [column, row] = place.map(|at| at / FILM_BLOCK);
        row * self.width.div_ceil(FILM_BLOCK) + column < self.ahead.blocks
    }

    /// Clears what is pending of pixels that are not ahead.
    pub(crate) fn clear_behind(&mut self) {
        for pixel in 0..self.pixel_count() {
            if !self.is_ahead(self.place(pixel)) {
                self.pending[pixel] = [0.0; 3];
                self.groups.iter_mut().for_each(|group| group.pending[pixel] = [0.0; 3]);
            }
        }
    }

    /// Mean radiance of one pixel; 0 before the first sample.
    pub fn mean(&self, pixel: usize) -> [f64; 3] {
        self.means()(pixel)
    }

    /// Mean radiance of pixels.
    pub(crate) fn means(&self) -> impl Fn(usize) -> [f64; 3] + Sync {
        self.means_of(|pixel| self.total(pixel), &self.pending)
    }

    /// Mean radiance of pixels in the layer of a group of lights.
    pub fn group_means(&self, group: &GroupSums) -> impl Fn(usize) -> [f64; 3] + Sync {
        let total = |pixel: usize| joined(group.sum[pixel], group.compensation[pixel]);
        self.means_of(total, &group.pending)
    }

    fn means_of(
        &self,
        total: impl Fn(usize) -> [f64; 3] + Sync,
        pending: &[[f32; 3]],
    ) -> impl Fn(usize) -> [f64; 3] + Sync {
        let falloffs = self.ahead.offset.map_or([[0.0, 1.0, 0.0]; 2], |offset| offset.map(falloff));
        move |pixel| {
            let (pending, more) = match self.ahead.is_none() {
                true => ([0.0; 3], 0.0),
                false => self.pending_at(pixel, pending, &falloffs),
            };
            let weight = f64::from(self.sample_count) + more;
            let weight = if weight > 0.0 { weight } else { 1.0 };
            let total = total(pixel);
            array::from_fn(|channel| (total[channel] + pending[channel]) / weight)
        }
    }

    /// The filtered sample of a stopped sweep at a pixel: Σ weight · radiance over the pixels that have
    /// one, and the sum of these weights, up to 1. `falloffs` are those of the filter along both axes.
    fn pending_at(
        &self,
        pixel: usize,
        pending: &[[f32; 3]],
        falloffs: &[[f64; 3]; 2],
    ) -> ([f64; 3], f64) {
        let place = self.place(pixel);
        let rows_ahead = self.ahead.blocks.div_ceil(self.width.div_ceil(FILM_BLOCK)) * FILM_BLOCK;
        if place[1] > rows_ahead {
            return ([0.0; 3], 0.0);
        }
        let ends = [self.width, self.height];
        let weights: [[f64; 3]; 2] = array::from_fn(|axis| {
            let at = place[axis];
            weights(falloffs[axis], [at > 0, true, at + 1 < ends[axis]])
        });
        let (mut value, mut sum) = ([0.0; 3], 0.0);
        for (y, row) in weights[1].into_iter().enumerate() {
            for (x, column) in weights[0].into_iter().enumerate() {
                let weight = row * column;
                let [Some(column), Some(row)] =
                    [(place[0], x), (place[1], y)].map(|(at, by)| (at + by as u32).checked_sub(1))
                else {
                    continue;
                };
                if weight > 0.0 && self.is_ahead([column, row]) {
                    let radiance = pending[(row * self.width + column) as usize];
                    sum += weight;
                    for channel in 0..3 {
                        value[channel] += weight * f64::from(radiance[channel]);
                    }
                }
            }
        }
        (value, sum)
    }

    /// Tests whether any sample found light.
    pub(crate) fn found_light(&self) -> bool {
        let found = |values: &[[f32; 3]]| values.as_flattened().iter().any(|&value| value != 0.0);
        found(&self.sum) || found(&self.pending)
    }

    /// Unbiased estimate of the variance of the pixel's mean, (Σx² − (Σx)²/n) / (n (n − 1)).
    ///
    /// The estimate treats samples as independent. Stratification lowers the true variance, so this
    /// is an upper estimate. It is 0 below two samples, as in pbrt.
    pub fn variance_of_mean(&self, pixel: usize) -> [f64; 3] {
        let samples = self.sample_count;
        if samples < 2 {
            return [0.0; 3];
        }
        let count = f64::from(samples);
        let (total, squares) = (self.total(pixel), self.total_squares(pixel));
        array::from_fn(|channel| {
            let deviation = squares[channel] - total[channel] * total[channel] / count;
            deviation.max(0.0) / (count * (count - 1.0))
        })
    }

    /// Mean over the pixels of s / √(m² + 0.01·M²): m the mean over RGB of the pixel's mean
    /// radiance, M the mean of m over the image, s the mean over RGB of the pixel's standard errors
    /// (an upper bound on the standard error of m, reached if all channels share one noise).
    ///
    /// The denominator is that of relMSE (`study::metrics`), so the square of this figure compares
    /// with it. Infinite below two samples, 0 for a black image. A pixel that no sample has lit yet
    /// counts as free of error, so rare bright events make the figure too low.
    pub fn relative_standard_error(&self) -> f64 {
        if self.sample_count < 2 || self.pixel_count() == 0 {
            return f64::INFINITY;
        }
        let average = |value: [f64; 3]| (value[0] + value[1] + value[2]) / 3.0;
        let pixel_count = self.pixel_count();
        let means = self.means();
        let image_mean =
            (0..pixel_count).map(|pixel| average(means(pixel))).sum::<f64>() / pixel_count as f64;
        let floor = 0.01 * image_mean * image_mean;
        let relative = |pixel: usize| {
            let mean = average(means(pixel));
            let error = average(self.variance_of_mean(pixel).map(f64::sqrt));
            if error == 0.0 { 0.0 } else { error / (mean * mean + floor).sqrt() }
        };
        (0..pixel_count).map(relative).sum::<f64>() / pixel_count as f64
    }

    /// Counts pixels with a non-finite sum in any layer. Passes drop such samples, so anything but 0
    /// is a defect.
    pub fn non_finite_count(&self) -> usize {
        let groups = self.groups.iter().flat_map(GroupSums::parts);
        let layers: Vec<_> =
            self.triples().into_iter().chain([&self.pending]).chain(groups).collect();
        let is_bad = |value: &[f32; 3]| value.iter().any(|component| !component.is_finite());
        let has_bad =
            |pixel: &usize| layers.iter().any(|sums| sums.get(*pixel).is_some_and(is_bad));
        (0..self.pixel_count()).filter(has_bad).count()
    }

    /// Adds the samples of `other`, which must show the same window of the same film; neither may be
    /// [`Ahead`] anywhere.
    ///
    /// Adds sums in 64-bit floats and splits them again. Drops a layer that one side lacks.
    ///
    /// # Panics
    /// The windows differ.
    pub fn add(&mut self, other: &Self) {
        assert_eq!(
            (self.origin, self.width, self.height, self.film_size),
            (other.origin, other.width, other.height, other.film_size),
            "sums of one window are added"
        );
        add_joined([&mut self.sum, &mut self.compensation], [&other.sum, &other.compensation]);
        add_joined(
            [&mut self.squares, &mut self.squares_compensation],
            [&other.squares, &other.squares_compensation],
        );
        // The parts of radiance and of its squares are added.
        for (ours, theirs) in self.triples_mut().into_iter().zip(other.triples()).skip(4) {
            add_layer(ours, theirs, |sum, more| {
                sum.iter_mut().zip(more).for_each(|(value, more)| *value += more);
            });
        }
        for (ours, theirs) in self.counts_mut().into_iter().zip(other.counts()) {
            add_layer(ours, theirs, |count, more| {
                *count = [0, 1].map(|part| count[part].saturating_add(more[part]));
            });
        }
        for (ours, theirs) in self.coverages_mut().into_iter().zip(other.coverages()) {
            add_layer(ours, theirs, add_coverage);
        }
        self.groups.retain(|group| other.group(&group.name).is_some());
        for group in &mut self.groups {
            if let Some(more) = other.group(&group.name) {
                let ours = [&mut group.sum, &mut group.compensation];
                add_joined(ours.map(Vec::as_mut_slice), [&more.sum, &more.compensation]);
            }
        }
        self.sample_count = self.sample_count.saturating_add(other.sample_count);
    }
}

/// Adds a layer pixel by pixel, or drops it where it lacks those of the other.
fn add_layer<T>(ours: &mut Vec<T>, theirs: &[T], add: impl Fn(&mut T, &T)) {
    if theirs.is_empty() {
        ours.clear();
    }
    ours.iter_mut().zip(theirs).for_each(|(own, more)| add(own, more));
}

/// Adds the samples of another coverage of a pixel. Drops those that find no slot left, as the device does.
fn add_coverage(coverage: &mut Coverage, other: &Coverage) {
    for &[id, count] in other.iter().filter(|[_, count]| *count > 0) {
        if let Some(own) = coverage.iter_mut().find(|own| own[1] == 0 || own[0] == id) {
            *own = [id, own[1].saturating_add(count)];
        }
    }
}

/// The value of a two-float sum.
fn joined(leading: [f32; 3], rest: [f32; 3]) -> [f64; 3] {
    array::from_fn(|channel| f64::from(leading[channel]) + f64::from(rest[channel]))
}

/// Adds other two-float sums to those of every pixel.
fn add_joined([leading, rest]: [&mut [[f32; 3]]; 2], other: [&[[f32; 3]]; 2]) {
    for (pixel, (leading, rest)) in leading.iter_mut().zip(rest).enumerate() {
        let (ours, theirs) = (joined(*leading, *rest), joined(other[0][pixel], other[1][pixel]));
        for channel in 0..3 {
            (leading[channel], rest[channel]) = split(ours[channel] + theirs[channel]);
        }
    }
}

/// Splits `value` into the two floats whose sum is nearest to it: its rounding and the rest.
pub fn split(value: f64) -> (f32, f32) {
    let leading = value as f32;
    (leading, (value - f64::from(leading)) as f32)
}
