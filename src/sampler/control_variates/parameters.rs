//! Parameters of `control-variates`.

use crate::sampler::knob::{ON_OR_OFF, parameters};

parameters! {
    /// Parameters of `control-variates` beside `candidates` and `compensation`.
    pub struct ControlVariatesParameters {
        /// `control-share`: α, the share of the expected visibility that is the control variate; 0 is none.
        "control-share" control_share: f32 = 1.0, 0.0..=1.0;
        /// `control-bits`: on if the expected visibility is rounded to 0 or 1 in the control variate, as in
        /// the paper.
        "control-bits" control_bits: bool = true, ON_OR_OFF;
        /// `control-choice`: on if shadow rays go where the records are in doubt, off if they go by light
        /// alone, as in the paper.
        "control-choice" control_choice: bool = true, ON_OR_OFF;
        /// `record-side`: bins of a record along each side of the square of directions.
        "record-side" record_side: u32 = 16, 4..=32;
        /// `record-pixels`: edge of a record's cube in the picture, at most, pixels.
        "record-pixels" record_pixels: u32 = 24, 1..=256;
    }
}
