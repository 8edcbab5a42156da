//! Cells of the environment's rectangles: twin of `glsl/include/regions.glsl`.

use fenestra::sampler::regions::{Partition, Rectangle};

/// Draws the column and row of a cell of region `index`, as the shader does: the first word of
/// `bits` chooses a column of the alias table, the second keeps it or takes its alias.
pub fn choose_cell(partition: &Partition, index: usize, bits: [u32; 2]) -> [u32; 2] {
    let region = &partition.regions[index];
    let Rectangle { first, size, .. } = region.rectangle;
    let count = size[0] * size[1];
    let own = ((u64::from(bits[0]) * u64::from(count)) >> 32) as u32;
    let entry = partition.entries[region.first_entry + own as usize];
    let chosen = if u64::from(bits[1]) < entry.threshold { own } else { entry.alias };
    [first[0] + chosen % size[0], first[1] + chosen / size[0]]
}
