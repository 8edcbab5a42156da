//! Stopping rules: what ends a run, by samples or by time.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Rule that ends a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rule {
    /// Samples per pixel.
    Spp(u32),
    /// Wall time of the passes, seconds.
    Seconds(f64),
}

impl Rule {
    pub(crate) fn time(time: Duration) -> Self {
        Self::Seconds(time.as_secs_f64())
    }

    /// Returns "400 spp" or "30 s".
    pub(crate) fn describe(self) -> String {
        match self {
            Self::Spp(spp) => format!("{spp} spp"),
            Self::Seconds(seconds) => format!("{seconds} s"),
        }
    }

    /// Returns "400spp" or "30s", for file names.
    pub(crate) fn file_stem(self) -> String {
        self.describe().replace(' ', "")
    }
}
