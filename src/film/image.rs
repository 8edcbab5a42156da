//! Sums → the image that they give.

use rayon::prelude::*;

use super::{
    Aov, GroupSums, Image, Sums,
    cryptomatte::{self, MATERIALS, OBJECTS},
    layers::TRIPLES,
};

impl Sums {
    /// Converts to an image of `R`, `G`, `B` and those of `aovs` whose sums exist.
    ///
    /// Albedo, normal and position are means over all samples of the pixel; a sample that leaves
    /// the scene counts as 0. Deviation: pbrt divides by the weight of the samples that hit
    /// something, which could not be merged exactly from image files.
    pub fn to_image(&self, aovs: &[Aov]) -> Image {
        let mut image = Image::new(self.width, self.height);
        image.origin = self.origin.map(|value| i32::try_from(value).unwrap_or(i32::MAX));
        image.film_size = self.film_size;
        let pixels = || (0..self.pixel_count()).into_par_iter();
        let narrow = |value: [f64; 3]| value.map(|component| component as f32);
        let mean = self.means();
        let means: Vec<[f32; 3]> = pixels().map(|pixel| narrow(mean(pixel))).collect();
        image.insert_triple(["R", "G", "B"], &means);
        let insert_means = |image: &mut Image, names: [&str; 3], sums: &[[f32; 3]]| {
            if !sums.is_empty() {
                let count = |pixel: usize| f64::from(self.samples(pixel).max(1));
                let mean =
                    |pixel: usize| narrow(sums[pixel].map(|sum| f64::from(sum) / count(pixel)));
                image.insert_triple(names, &pixels().map(mean).collect::<Vec<_>>());
            }
        };
        for aov in aovs {
            match aov {
                Aov::Variance => {
                    let variances: Vec<[f32; 3]> =
                        pixels().map(|pixel| narrow(self.variance_of_mean(pixel))).collect();
                    image.insert_triple(["Variance.R", "Variance.G", "Variance.B"], &variances);
                }
                Aov::SampleCount => {
                    let counts = pixels().map(|pixel| self.samples(pixel) as f32).collect();
                    image.channels.insert("SampleCount.Y".to_owned(), counts);
                }
                Aov::Visible => {
                    insert_ratio(&mut image, ["Visible.Y", "ShadowRays.Y"], &self.visible);
                }
                Aov::CacheEntries => {
                    insert_ratio(&mut image, ["CacheEntries.Y", "Hits.Y"], &self.cache_entries);
                }
                Aov::Unfiltered | Aov::Albedo | Aov::Normal | Aov::Position | Aov::GuideCell => {
                    let layers = TRIPLES.iter().zip(self.triples());
                    for (layer, sums) in layers.filter(|(layer, _)| layer.aov == Some(*aov)) {
                        // `AlbedoSum` of a checkpoint is the sum behind the mean `Albedo`.
                        let names = layer.channels.map(|channel| channel.replace("Sum", ""));
                        insert_means(&mut image, names.each_ref().map(String::as_str), sums);
                    }
                }
                Aov::LightGroups => {
                    for group in &self.groups {
                        let means = self.group_means(group);
                        let mean = |pixel: usize| narrow(means(pixel));
                        let names = GroupSums::channels("Combined", &group.name);
                        let names = names.each_ref().map(String::as_str);
                        image.insert_triple(names, &pixels().map(mean).collect::<Vec<_>>());
                    }
                }
                Aov::CryptoObject | Aov::CryptoMaterial => {
                    let [objects, materials] = self.coverages();
                    let (name, coverages) = match aov {
                        Aov::CryptoObject => (OBJECTS, objects),
                        _ => (MATERIALS, materials),
                    };
                    if !coverages.is_empty() {
                        let shares = |pixel: usize| {
                            let count = f64::from(self.samples(pixel).max(1));
                            coverages[pixel].map(|[id, own]| (id, f64::from(own) / count))
                        };
                        let shares: Vec<_> = pixels().map(shares).collect();
                        cryptomatte::insert(&mut image, name, &shares);
                    }
                }
            }
        }
        image
    }
}

/// Inserts two channels for pairs of counts: first over second, and second; nothing without pairs.
fn insert_ratio(image: &mut Image, [ratio, whole]: [&str; 2], counts: &[[u32; 2]]) {
    if !counts.is_empty() {
        let quotient =
            |&[part, whole]: &[u32; 2]| (f64::from(part) / f64::from(whole.max(1))) as f32;
        image.channels.insert(ratio.to_owned(), counts.iter().map(quotient).collect());
        let wholes = counts.iter().map(|pair| pair[1] as f32).collect();
        image.channels.insert(whole.to_owned(), wholes);
    }
}
