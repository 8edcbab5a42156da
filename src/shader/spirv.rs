//! SPIR-V of the passes, compiled by `build.rs`, and the buffers that a module uses.

use std::collections::BTreeSet;

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// Returns the SPIR-V of `glsl/<name>.comp` or `glsl/<room>/<name>.comp`. Panics without such a file.
pub fn pass(name: &str) -> &'static [u8] {
    match PASSES.binary_search_by(|(pass, _)| (*pass).cmp(name)) {
        Ok(index) => PASSES[index].1,
        Err(_) => panic!("there is no {name}.comp in glsl"),
    }
}

/// Returns the descriptor set and binding number of every buffer that a module uses.
pub fn used_bindings(spirv: &[u32]) -> BTreeSet<(u32, u32)> {
    const HEADER_WORDS: usize = 5;
    const OP_DECORATE: u32 = 71;
    const DECORATION_BINDING: u32 = 33;
    const DECORATION_DESCRIPTOR_SET: u32 = 34;
    let decorations = |kind: u32| {
        let mut position = HEADER_WORDS;
        std::iter::from_fn(move || {
            let words = spirv.get(position..)?;
            position += (words.first()? >> 16).max(1) as usize;
            Some(words)
        })
        .filter_map(move |words| match *words {
            [first, target, found, value, ..] if first & 0xffff == OP_DECORATE && found == kind => {
                Some((target, value))
            }
            _ => None,
        })
    };
    let sets: Vec<(u32, u32)> = decorations(DECORATION_DESCRIPTOR_SET).collect();
    decorations(DECORATION_BINDING)
        .filter_map(|(target, binding)| {
            let (_, set) = sets.iter().find(|(other, _)| *other == target)?;
            Some((*set, binding))
        })
        .collect()
}
