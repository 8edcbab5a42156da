//! Off-line fits of environment maps and BRDFs into spherical radial basis functions: Figure 4.1 of
//! \[Wu & Shih 2009\], after \[Tsai et al. 2008\].
//!
//! Environment map → [`environment_lobes`] → [`EnvironmentFit`]; BRDF × cosine for a row of view elevations →
//! [`brdf_lobes`] → [`BrdfFit`]. Both cut the target into patches ([`points`]), grow a mixture on them
//! ([`growth`]) by expectation maximization ([`expectation`]) and judge it on every cell of the target
//! ([`judge`]). Lobes of maps get colours ([`colour`]). Fits are kept under the hash of their input
//! ([`cache`]). The second method minimizes the squared error by L-BFGS ([`squared_error`], [`solver`]).
//!
//! Deviation: \[Tsai et al. 2008\] minimize the squared error. A sampling density needs a small
//! Kullback-Leibler divergence, and expectation maximization cannot produce negative amplitudes.

pub mod brdf;
pub mod cache;
pub mod colour;
pub mod component;
pub mod config;
pub mod environment;
pub mod expectation;
pub mod fitted;
pub mod grid;
pub(crate) mod growth;
pub mod hemisphere;
pub mod judge;
pub mod picture;
pub mod points;
pub mod report;
pub(crate) mod solver;
pub mod squared_error;

pub use brdf::{BrdfOptions, brdf_lobes};
pub use cache::{Cache, read_fit, write_fit};
pub use config::Method;
pub use environment::{EnvironmentOptions, environment_lobes};
pub use fitted::{BrdfFit, EnvironmentFit, EnvironmentLobe, Fit};
pub use report::describe;
