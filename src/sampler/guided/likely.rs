//! The regions of a cell that hold most of its probability, which `weights=product` weights with the
//! BRDF at every hit.
//!
//! Entries of a cell → [`LikelyRegion`]s; twin of `guide_weight_by_brdf` in
//! `glsl/include/guide.glsl`, which redistributes the probability of these regions among them in
//! proportion to probability × BRDF × cosine toward the region's mean direction (after Tsai et al.
//! 2008, who take the product with lobes, in the place of a table).

use crate::sampler::guided::{estimate::decode_entry, partition::Partition};
use crate::shader::constants::GUIDE_LIKELY_REGIONS;

/// One of the likeliest regions of a cell, as it lies on the device: its mean direction, three
/// floats; its index, 10 bits, and above them its probability in 65,536ths.
pub type LikelyRegion = [u32; 4];

/// Index of no region.
const NO_REGION: u32 = 0x3ff;

/// The [`GUIDE_LIKELY_REGIONS`] regions of greatest probability by the entries of one cell, in the
/// order of the regions; what is missing has no probability and comes last.
pub fn likely_regions(entries: &[[u32; 2]], partition: &Partition) -> Vec<LikelyRegion> {
    let mut parts: Vec<(u32, u32)> = entries
        .iter()
        .zip(&partition.regions)
        .enumerate()
        .map(|(index, (entry, region))| {
            let probability = f64::from(decode_entry(*entry).0) * region.share;
            ((probability * 65_536.0).round() as u32, index as u32)
        })
        .filter(|(part, _)| *part > 0)
        .collect();
    parts.sort_unstable_by_key(|&(part, index)| (u32::MAX - part, index));
    parts.truncate(GUIDE_LIKELY_REGIONS as usize);
    parts.sort_unstable_by_key(|&(_, index)| index);
    let mut likely: Vec<LikelyRegion> = parts
        .into_iter()
        .map(|(part, index)| {
            let [x, y, z] =
                partition.regions[index as usize].direction.as_vec3().to_array().map(f32::to_bits);
            [x, y, z, index | part << 10]
        })
        .collect();
    let up = 1.0_f32.to_bits();
    likely.resize(GUIDE_LIKELY_REGIONS as usize, [0, up, 0, NO_REGION]);
    likely
}
