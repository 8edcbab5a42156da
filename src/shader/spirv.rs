//! SPIR-V of the passes, compiled by `build.rs`.

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// SPIR-V of the pass `name`.
///
/// # Panics
/// If there is no `glsl/<name>.comp`: a mistake of the caller.
pub fn pass(name: &str) -> &'static [u8] {
    match PASSES.binary_search_by(|(pass, _)| (*pass).cmp(name)) {
        Ok(index) => PASSES[index].1,
        Err(_) => panic!("there is no glsl/{name}.comp"),
    }
}

/// Which of the four descriptor sets a module's variables lie in.
pub fn used_sets(spirv: &[u32]) -> [bool; 4] {
    const HEADER_WORDS: usize = 5;
    const OP_DECORATE: u32 = 71;
    const DECORATION_DESCRIPTOR_SET: u32 = 34;
    let mut used = [false; 4];
    let mut position = HEADER_WORDS;
    while let Some(&first) = spirv.get(position) {
        let length = (first >> 16) as usize;
        if first & 0xffff == OP_DECORATE
            && spirv.get(position + 2) == Some(&DECORATION_DESCRIPTOR_SET)
            && let Some(set) = spirv.get(position + 3)
            && let Some(used) = used.get_mut(*set as usize)
        {
            *used = true;
        }
        position += length.max(1);
    }
    used
}
