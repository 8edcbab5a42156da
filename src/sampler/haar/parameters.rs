//! Parameters of `haar`.

use crate::sampler::knob::{ON_OR_OFF, parameters};

parameters! {
    /// Parameters of `haar` beside shares and visibility weights, which are those of `product` and
    /// `visibility`.
    pub struct HaarParameters {
        /// `haar-level`: base-2 logarithm of the product's nodes along each side of the square.
        "haar-level" level: u32 = 3, 3..=5;
        /// `haar-cache`: on if nodes near blocked directions lose weight at the same hit.
        "haar-cache" has_cache: bool = false, ON_OR_OFF;
    }
}
