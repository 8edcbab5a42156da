//! Traversal on the host over the arrays of [`Accel`](super::Accel): the Rust twin of `bvh.glsl`.
