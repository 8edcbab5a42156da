//! Options that environment and BRDF fits share.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Objective of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Kullback-Leibler divergence, by expectation maximization: suits a sampling density.
    #[default]
    Em,
    /// Squared error, by projected L-BFGS from the result of `em`: the fits of \[Tsai et al. 2008\].
    L2,
}

/// Checks that a number, such as that of lobes, is from 1 to `most`.
pub(crate) fn check_count(count: usize, what: &str, most: usize) -> Result<()> {
    if (1..=most).contains(&count) {
        return Ok(());
    }
    Err(Error::usage(format!("{count} {what} asked for; expected 1 to {most}")))
}
