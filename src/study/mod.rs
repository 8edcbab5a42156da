//! Error metrics and comparisons.
