//! Parameters of `control-variates`.

use crate::sampler::knob::{self, Knob};

/// Parameters of `control-variates` beside `candidates` and `compensation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlVariatesParameters {
    /// `control-share`: α, the share of the expected visibility that is the control variate; 0 is none.
    pub control_share: f32,
    /// `control-bits`: true if the expected visibility is rounded to 0 or 1 in the control variate, as in the
    /// paper.
    pub control_bits: bool,
    /// `control-choice`: true if shadow rays go where the records are in doubt, false if they go by light
    /// alone, as in the paper.
    pub control_choice: bool,
    /// `record-side`: bins of a record along each side of the square of directions.
    pub record_side: u32,
    /// `record-pixels`: edge of a record's cube in the picture, at most, pixels.
    pub record_pixels: u32,
}

impl Default for ControlVariatesParameters {
    fn default() -> Self {
        Self {
            control_share: 1.0,
            control_bits: true,
            control_choice: true,
            record_side: 16,
            record_pixels: 24,
        }
    }
}

impl ControlVariatesParameters {
    pub(in crate::sampler) const KNOBS: &'static [Knob<Self>] = &[
        Knob {
            key: "control-share",
            set: |own, value| knob::number(&mut own.control_share, value, 0.0..=1.0),
            get: |own| own.control_share.to_string(),
        },
        Knob {
            key: "control-bits",
            set: |own, value| knob::choice(&mut own.control_bits, value, knob::ON_OR_OFF),
            get: |own| knob::name_of(&own.control_bits, knob::ON_OR_OFF),
        },
        Knob {
            key: "control-choice",
            set: |own, value| knob::choice(&mut own.control_choice, value, knob::ON_OR_OFF),
            get: |own| knob::name_of(&own.control_choice, knob::ON_OR_OFF),
        },
        Knob {
            key: "record-side",
            set: |own, value| knob::number(&mut own.record_side, value, 4..=32),
            get: |own| own.record_side.to_string(),
        },
        Knob {
            key: "record-pixels",
            set: |own, value| knob::number(&mut own.record_pixels, value, 1..=256),
            get: |own| own.record_pixels.to_string(),
        },
    ];
}
