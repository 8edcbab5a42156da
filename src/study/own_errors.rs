//! A reference's own errors, and the test whether an error stands out from them.

use serde::{Deserialize, Serialize};

use super::metrics::{Errors, parts::PartErrors};

/// A run is judged if its mean squared error is at least this many times the reference's own.
pub(crate) const JUDGED_FROM: f64 = 4.0;

/// A reference's own errors, as far as they are known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OwnErrors {
    /// Origin of the reference.
    pub description: String,
    /// Samples per pixel of both halves, if known.
    pub spp: Option<u64>,
    /// Wall time of the passes of both halves, seconds, if known.
    pub seconds: Option<f64>,
    /// Mean squared error of the mean of the halves; absent for one image without variances.
    pub mse: Option<f64>,
    /// Mean relative squared error of the same.
    pub relmse: Option<f64>,
    /// The same without the worst 0.1% of the pixels.
    pub relmse_trimmed: Option<f64>,
    /// Mean over pixels and channels.
    pub mean: f64,
    /// Standard error of that mean, an upper estimate; absent if the files have no variances.
    pub mean_standard_error: Option<f64>,
}

impl OwnErrors {
    /// Tests whether both relative errors stand out of the reference's own.
    pub(crate) fn judges_relative(&self, errors: &Errors) -> bool {
        is_judged(errors.relmse, self.relmse)
            && is_judged(errors.relmse_trimmed, self.relmse_trimmed)
    }
}

/// A reference's own errors over lit surfaces and over the environment seen directly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OwnParts {
    /// Share of the pixels that see surfaces alone.
    pub surface_share: f64,
    /// Over those pixels.
    pub surfaces: Option<PartErrors>,
    /// Over the others.
    pub environment: Option<PartErrors>,
}

impl OwnParts {
    /// Tests whether errors over the surfaces stand out of the reference's own.
    pub(crate) fn judges(&self, part: &PartErrors) -> bool {
        is_judged(part.relmse, self.surfaces.map(|own| own.relmse))
            && is_judged(part.relmse_trimmed, self.surfaces.map(|own| own.relmse_trimmed))
    }
}

/// Tests whether an error is well above the reference's own, or positive if that is unknown.
pub(crate) fn is_judged(error: f64, own: Option<f64>) -> bool {
    error > 0.0 && own.is_none_or(|own| error >= JUDGED_FROM * own)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn judged_is_what_stands_out_of_the_references_noise() {
        assert!(is_judged(4.0, Some(1.0)) && !is_judged(3.9, Some(1.0)));
        assert!(is_judged(1e-9, None) && !is_judged(0.0, None) && !is_judged(-1.0, None));
        assert!(!is_judged(f64::NAN, Some(1.0)));
        let errors = |relmse, relmse_trimmed| PartErrors { mse: 0.0, relmse, relmse_trimmed };
        let own = OwnParts { surfaces: Some(errors(1.0, 0.1)), ..OwnParts::default() };
        assert!(own.judges(&errors(4.0, 0.5)));
        assert!(!own.judges(&errors(4.0, 0.3)) && !own.judges(&errors(3.0, 0.5)));
    }
}
