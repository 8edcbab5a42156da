//! Comparisons of samplers as experiments.
//!
//! A study file and the command line ([`mod@file`], [`plan`], [`contender`]) → runs against a
//! reference in two halves ([`engine`], [`mod@reference`], [`reference_check`],
//! [`halves`], [`surfaces`], [`overhead`]), each kept as one of the [`runs`] in the report
//! [`folder`] → figures over the seeds ([`summary`], [`quality`], [`statistics`]) → `results.json`,
//! `results.csv` ([`results`]) and the page ([`report`]). [`metrics`] defines the errors.

pub mod contender;
pub(crate) mod engine;
pub(crate) mod falsecolour;
pub mod file;
mod finished;
pub(crate) mod folder;
mod halves;
pub mod metrics;
mod overhead;
pub mod plan;
mod quality;
mod reference;
mod reference_check;
pub(crate) mod report;
pub(crate) mod results;
mod runs;
pub mod statistics;
mod summary;
mod surfaces;
mod watch;
