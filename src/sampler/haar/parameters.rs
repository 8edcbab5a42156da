//! Parameters of `haar`.

use crate::sampler::knob::{self, Knob};

/// Parameters of `haar` beside shares and visibility weights, which are those of `product` and `visibility`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HaarParameters {
    /// `haar-level`: base-2 logarithm of the product's nodes along each side of the square.
    pub level: u32,
    /// `haar-cache`: true if nodes near blocked directions lose weight at the same hit.
    pub has_cache: bool,
}

impl Default for HaarParameters {
    fn default() -> Self {
        Self { level: 3, has_cache: false }
    }
}

impl HaarParameters {
    pub(in crate::sampler) const KNOBS: &'static [Knob<Self>] = &[
        Knob {
            key: "haar-level",
            set: |own, value| knob::number(&mut own.level, value, 3..=5),
            get: |own| own.level.to_string(),
        },
        Knob {
            key: "haar-cache",
            set: |own, value| knob::choice(&mut own.has_cache, value, knob::ON_OR_OFF),
            get: |own| knob::name_of(&own.has_cache, knob::ON_OR_OFF),
        },
    ];
}
