//! Measured BRDFs on the half/difference grid of the MERL files.

/// Isotropic measured BRDF on a grid of θ_h × θ_d × φ_d.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredTable {}
