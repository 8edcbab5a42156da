//! Spherical radial basis functions with the Gaussian kernel: pure functions in 32-bit floats.
//!
//! A lobe is `amplitude · G(ω; ξ, λ)` with the kernel `G = exp(λ(ω·ξ − 1))`, unit axis ξ and
//! bandwidth λ; a mixture is a sum of lobes. \[Tsai & Shih 2006\] and \[Wu & Shih 2009\], Eq. 6.
//! All functions hold for bandwidths from 1e-3 to 1e5; most textbook forms fail there, because they
//! subtract numbers as large as λ. Integrals and densities cover the whole sphere, per steradian.
//!
//! The twin is `glsl/include/srbf.glsl`: same names, same order, same arithmetic. Mixtures have no
//! twin, because a shader loops over lobes in its own buffers.

pub mod kernel;
pub mod mixture;
pub mod product;
pub mod sample;
pub mod special;

pub(crate) use kernel::kernel_value;
pub use kernel::{
    Lobe, kernel_deviation, kernel_hemisphere_part, kernel_integral, lobe_integral, lobe_value,
};
pub use mixture::Mixture;
pub use product::{lobe_convolution, lobe_product};
pub use sample::{kernel_inverse, kernel_pdf, kernel_sample, kernel_sample_distance, lobe_frame};
