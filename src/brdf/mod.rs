//! Reflection models: measured data → evaluable BRDF, and the analytic materials.

pub mod table;
