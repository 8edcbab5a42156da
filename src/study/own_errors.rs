//! Errors of a reference itself, and which errors measured against it are well above them.

use serde::{Deserialize, Serialize};

/// A run is judged where its mean squared error is at least this many times the reference's own.
pub const JUDGED_FROM: f64 = 4.0;

/// What is known of a reference's own error.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OwnErrors {
    /// Where it comes from.
    pub description: String,
    /// Samples per pixel of both halves, where known.
    pub spp: Option<u64>,
    /// Wall time of the passes of both halves, seconds, where known.
    pub seconds: Option<f64>,
    /// Mean squared error of the mean of the halves; absent for one image without variances.
    pub mse: Option<f64>,
    /// Mean relative squared error of the same.
    pub relmse: Option<f64>,
    /// The same without the worst 0.1% of the pixels.
    pub relmse_trimmed: Option<f64>,
    /// Mean over pixels and channels.
    pub mean: f64,
    /// Standard error of that mean, an upper estimate; absent where the files have no variances.
    pub mean_standard_error: Option<f64>,
}

/// Whether an error is well above the reference's own. Where that is unknown, every error that is
/// positive is taken.
pub fn is_judged(error: f64, own: Option<f64>) -> bool {
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
    }
}
