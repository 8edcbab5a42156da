//! Product lobes at one hit, read back from the device.

use super::lobes::LobeBuffers;
use crate::{
    error::Result,
    math::octahedron,
    pass::{BLOCK_PIXELS, LobeReadback},
    shader::rooms::product,
};

/// Number of lobes of the first path of the last wave. Fails if the device does.
pub fn lobe_count(buffers: &LobeBuffers) -> Result<usize> {
    let counts: Vec<u32> = buffers.set.buffer(product::LOBE_COUNTS).download(1)?;
    Ok(counts[0] as usize)
}

/// Reads the lobes of the first path in a wave of one block: fills `lobes` on the first call, updates
/// their last probabilities on every call. `factors` are the weights V. Fails if the device does.
pub fn read_lobes(
    buffers: &LobeBuffers,
    factors: &[f64],
    lobes: &mut Vec<LobeReadback>,
) -> Result<()> {
    let count = factors.len();
    if count == 0 {
        return Ok(());
    }
    let stride = BLOCK_PIXELS as usize;
    let words: Vec<[u32; 2]> =
        buffers.set.buffer(product::LOBES).download((count - 1) * stride + 1)?;
    let weight = |lobe: usize| f64::from(half(words[lobe * stride][1] >> 16)) * factors[lobe];
    let total: f64 = (0..count).map(weight).sum();
    let probability = |lobe: usize| if total > 0.0 { weight(lobe) / total } else { 0.0 };
    if lobes.is_empty() {
        lobes.extend((0..count).map(|lobe| LobeReadback {
            axis: octahedron::unpack(words[lobe * stride][0]),
            bandwidth: half(words[lobe * stride][1]),
            before: probability(lobe),
            after: 0.0,
        }));
    }
    for (index, lobe) in lobes.iter_mut().enumerate() {
        lobe.after = probability(index);
    }
    Ok(())
}

fn half(word: u32) -> f32 {
    half::f16::from_bits(word as u16).to_f32()
}
