//! Sampling the product of environment and BRDF.

pub mod parameters;
