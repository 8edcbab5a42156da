//! Parameters of `portal`.

crate::sampler::knob::parameters! {
    /// Parameters of `portal`.
    pub struct PortalParameters {
        /// `portal-share`: share of the portals among directions that are not from the BRDF; the rest is the
        /// environment's.
        "portal-share" portal_share: f32 = 0.5, 0.0..=1.0;
    }
}
