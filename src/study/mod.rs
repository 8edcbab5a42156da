//! Error metrics and comparisons.

pub mod falsecolour;
pub mod metrics;
