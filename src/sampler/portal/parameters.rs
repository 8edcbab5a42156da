//! Parameters of `portal`.

use crate::sampler::knob::{self, Knob};

/// Parameters of `portal`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PortalParameters {
    /// `portal-share`: share of the portals among directions that are not from the BRDF; the rest is the
    /// environment's.
    pub portal_share: f32,
}

impl Default for PortalParameters {
    fn default() -> Self {
        Self { portal_share: 0.5 }
    }
}

impl PortalParameters {
    pub(in crate::sampler) const KNOBS: &'static [Knob<Self>] = &[Knob {
        key: "portal-share",
        set: |own, value| knob::number(&mut own.portal_share, value, 0.0..=1.0),
        get: |own| own.portal_share.to_string(),
    }];
}
