//! Functions of `glsl` in Rust that only tests need, in the order and with the arithmetic of the shaders. The
//! renderer has the twins that it calls itself: values of BRDFs, kernels, traversal, independent random
//! numbers.

pub mod brdf;
pub mod control_variates;
pub mod environment;
pub mod guided;
pub mod haar;
pub mod random;
pub mod regions;
pub mod specular;
pub mod spherical_rectangle;
pub mod srbf;
pub mod surface;
pub mod texture;
pub mod tiles;
