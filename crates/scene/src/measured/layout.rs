//! Layout of the words of a [`MeasuredTable`](super::MeasuredTable): `src/shader/constants.rs` of the
//! renderer repeats these numbers for its shaders, and checks them.

/// Intervals of the tables over the cosine 0…1 of a direction with the normal; one more node.
pub const BRDF_COSINE_INTERVALS: u32 = 64;
/// Nodes of such a table.
pub const BRDF_COSINE_NODES: u32 = BRDF_COSINE_INTERVALS + 1;
/// Bins of the measured grid in θ_h; the edge of bin k is at (k/90)²·90°.
pub const MEASURED_THETA_HALF_BINS: u32 = 90;
/// Bins of the measured grid in θ_d, of equal width.
pub const MEASURED_THETA_DIFFERENCE_BINS: u32 = 90;
/// Bins of the measured grid in φ_d, of equal width over 0…π.
pub const MEASURED_PHI_DIFFERENCE_BINS: u32 = 180;
/// Bins of the outgoing polar angle in a measured material's sampling table, of equal width.
pub const MEASURED_ELEVATION_BINS: u32 = 32;
/// Bins of θ_h in the sampling table; the edge of bin k is at (k/32)²·90°.
pub const MEASURED_POLAR_BINS: u32 = 32;
/// Bins of |φ_h − φ_o| in the sampling table, of equal width over 0…π.
pub const MEASURED_AZIMUTH_BINS: u32 = 16;
/// Cells of the sampling table for one outgoing elevation; a power of two.
pub const MEASURED_SAMPLING_CELLS: u32 = MEASURED_POLAR_BINS * MEASURED_AZIMUTH_BINS;
/// Probability of the cosine lobe by elevation; the albedo is at 0.
pub const MEASURED_COSINE_SHARE_OFFSET: u32 = 3 * BRDF_COSINE_NODES;
/// Cumulative probabilities of the sampling cells by elevation.
pub const MEASURED_CUMULATIVE_OFFSET: u32 = MEASURED_COSINE_SHARE_OFFSET + MEASURED_ELEVATION_BINS;
/// Densities of the sampling cells by elevation, per steradian of half vectors.
pub const MEASURED_DENSITY_OFFSET: u32 =
    MEASURED_CUMULATIVE_OFFSET + MEASURED_ELEVATION_BINS * MEASURED_SAMPLING_CELLS;
/// Grid cells, two words each: halves red and green, half blue.
pub const MEASURED_GRID_OFFSET: u32 =
    MEASURED_DENSITY_OFFSET + MEASURED_ELEVATION_BINS * MEASURED_SAMPLING_CELLS;
/// Bins of φ_h in the turns of an anisotropic table, of equal width over −π…π from the tangent.
pub const MEASURED_TURN_BINS: u32 = 96;
/// Bins of θ_d there, of equal width; those of θ_h are the grid's.
pub const MEASURED_TURN_THETA_DIFFERENCE_BINS: u32 = 8;
/// Bins of φ_d there, of equal width over 0…π.
pub const MEASURED_TURN_PHI_DIFFERENCE_BINS: u32 = 16;
/// Factors of the values by θ_h, θ_d, φ_h and φ_d, as cells of the grid, if the table is anisotropic.
pub const MEASURED_TURN_OFFSET: u32 = MEASURED_GRID_OFFSET
    + 2 * MEASURED_THETA_HALF_BINS * MEASURED_THETA_DIFFERENCE_BINS * MEASURED_PHI_DIFFERENCE_BINS;
/// Least value of a cell, 1/sr: where a BRDF reflects nothing at all, light found for one direction could
/// not be shared with others (`glsl/sharing/shared_part.glsl`). A half holds it exactly.
pub const MEASURED_LEAST_VALUE: f32 = 1.0 / (1 << 20) as f32;
