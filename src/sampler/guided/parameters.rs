//! Parameters of the sampler `guided`.

use crate::sampler::knob::{Auto, Values, parameters};

/// Edge of the cohorts that `share-paths=auto` may choose, pixels (`docs/experiments.md`, shared_paths).
pub const AUTO_COHORT_EDGE: u32 = 4;

parameters! {
    /// Parameters of `guided`, apart from the number of candidates.
    pub struct GuidedParameters {
        /// `bounce-candidates`: BRDF directions to choose each bounce from by learned arriving light;
        /// 1 turns learning and choosing off.
        "bounce-candidates" bounce_candidates: u32 = 4, 1..=16;
        /// `guide-memory`: most bytes for the cells.
        "guide-memory" guide_memory: u64 = 128 << 20, Bytes;
        /// `later-rays`: most shadow rays at each vertex after the first; auto is a quarter of
        /// --shadow-rays, rounded up.
        "later-rays" later_rays: Option<u32> = None, Auto(1..=4096);
        /// `open-rays`: most shadow rays at the first vertex in open scenes; auto is a quarter of
        /// --shadow-rays, rounded up, where paths go on, and all of them in direct light.
        "open-rays" open_rays: Option<u32> = None, Auto(1..=4096);
        /// `regions`: most regions of the environment; a render starts with 256.
        "regions" regions: u32 = 1024, 16..=1024;
    }
}

/// At least a mebibyte, with or without a unit.
struct Bytes;

impl Values<u64> for Bytes {
    fn parse(&self, text: &str) -> Result<u64, String> {
        let bytes = parse_bytes(text).filter(|bytes| (1 << 20..=1 << 40).contains(bytes));
        bytes.ok_or_else(|| "1MiB or more, as in 128MiB".to_owned())
    }

    fn text(&self, value: &u64) -> String {
        value.to_string()
    }
}

impl GuidedParameters {
    /// Returns the shadow rays at each later vertex, given `shadow_rays` at the first: later
    /// vertices cause less of the error at the same cost per ray (`docs/experiments.md`, later_rays).
    pub fn later_rays_of(&self, shadow_rays: u32) -> u32 {
        self.later_rays.unwrap_or(shadow_rays.div_ceil(4)).min(shadow_rays)
    }

    /// Returns the shadow rays at the first and at each later of `depth` vertices in open scenes, where
    /// samples are those of `mis`: there a bounce that escapes is a sample too, and one or two rays beside
    /// it are enough (`docs/experiments.md`, escaped_bounces).
    pub fn rays_in_the_open(&self, shadow_rays: u32, depth: u32) -> [u32; 2] {
        let first = if depth > 1 { shadow_rays.div_ceil(4) } else { shadow_rays };
        [self.open_rays.unwrap_or(first), self.later_rays.unwrap_or(1)]
            .map(|rays| rays.min(shadow_rays))
    }

    /// Returns true if paths of `depth` vertices have guided bounces.
    pub fn guides_bounces(&self, depth: u32) -> bool {
        depth > 1 && self.bounce_candidates > 1
    }
}

/// Parses a number of bytes with an optional unit: B, KiB, MiB, GiB.
fn parse_bytes(text: &str) -> Option<u64> {
    let digits = text.len() - text.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let number: u64 = text[..digits].parse().ok()?;
    let shift = match &text[digits..] {
        "" | "B" => 0,
        "KiB" => 10,
        "MiB" => 20,
        "GiB" => 30,
        _ => return None,
    };
    number.checked_mul(1 << shift)
}

#[cfg(test)]
mod tests {
    use crate::sampler::{Parameters, Sampler};

    #[test]
    fn later_vertices_have_a_quarter_of_the_rays_unless_told_otherwise() {
        let mut all = Parameters::default();
        let later = |all: &Parameters, rays: u32| all.guided.later_rays_of(rays);
        assert_eq!([0, 1, 4, 5, 8, 16].map(|rays| later(&all, rays)), [0, 1, 1, 2, 2, 4]);
        let open = |all: &Parameters, rays, depth| all.guided.rays_in_the_open(rays, depth);
        assert_eq!([1, 6].map(|depth| open(&all, 8, depth)), [[8, 1], [2, 1]]);
        assert_eq!(open(&all, 0, 6), [0, 0]);
        all.set("open-rays=5").unwrap();
        assert_eq!([8, 3].map(|rays| open(&all, rays, 6)), [[5, 1], [3, 1]]);
        all.set("later-rays=3").unwrap();
        assert_eq!([0, 2, 5].map(|rays| later(&all, rays)), [0, 2, 3]);
        assert_eq!(Sampler::Guided.describe(&all)["later-rays"], "3");
        all.set("later-rays=auto").unwrap();
        assert_eq!(later(&all, 5), 2);
        assert!(all.guided.guides_bounces(2) && !all.guided.guides_bounces(1));
        all.set("bounce-candidates=1").unwrap();
        assert!(!all.guided.guides_bounces(2));
        assert_eq!(Sampler::Guided.describe(&all)["bounce-candidates"], "1");
    }
}
