//! Spherical radial basis functions (spherical Gaussians): pure functions.
