//! Visibility records on the host: their cubes and bins, and counts → expected visibility. Places and
//! directions find their record by `glsl/control_variates/records.glsl`.

use super::ControlVariatesParameters;
use crate::{
    sampler::regions::cell_edges,
    scene::Scene,
    shader::rooms::control_variates::{
        CONSTANT_RECORD_EDGE, CONSTANT_RECORD_LARGEST_EDGE, CONSTANT_RECORD_SIDE,
        VISIBILITY_RECORDS,
    },
};

/// Rays of all records together that a record leans on, where it has counted little itself.
const PRIOR_RAYS: f32 = 2.0;

/// The cubes and bins of visibility records.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordGrid {
    /// Bins along each side of the square of directions.
    pub side: u32,
    /// Edge of a cube per metre of distance to the camera.
    pub edge_per_distance: f32,
    /// Largest edge, metres.
    pub largest_edge: f32,
}

impl RecordGrid {
    /// Returns the grid for the scene's camera and film.
    pub fn new(scene: &Scene, parameters: &ControlVariatesParameters) -> Self {
        let [edge_per_distance, largest_edge] = cell_edges(scene, parameters.record_pixels as f32);
        Self { side: parameters.record_side, edge_per_distance, largest_edge }
    }

    /// Number of entries of all records.
    pub fn entries(&self) -> usize {
        (VISIBILITY_RECORDS * self.side * self.side) as usize
    }

    /// Specialization constants of the passes over records.
    pub fn constants(&self) -> [(u32, u32); 3] {
        [
            (CONSTANT_RECORD_SIDE, self.side),
            (CONSTANT_RECORD_EDGE, self.edge_per_distance.to_bits()),
            (CONSTANT_RECORD_LARGEST_EDGE, self.largest_edge.to_bits()),
        ]
    }

    /// Expected visibility of all entries from their rays and visible rays. A record that has counted n
    /// rays in a bin, v of them visible, expects (v + 2 s) / (n + 2), with s the share of all records
    /// in that bin: never 0 or 1 unless all agree.
    ///
    /// # Panics
    /// There are not two counts for every entry.
    pub fn expected(&self, counts: &[[u32; 2]]) -> Vec<f32> {
        assert_eq!(counts.len(), self.entries(), "two counts for every entry");
        let bins = (self.side * self.side) as usize;
        let mut of_bin = vec![[0_u64; 2]; bins];
        for record in counts.chunks(bins) {
            for (sum, count) in of_bin.iter_mut().zip(record) {
                sum[0] += u64::from(count[0]);
                sum[1] += u64::from(count[1]);
            }
        }
        let share = |[rays, visible]: [f32; 2], prior: f32| {
            (visible + PRIOR_RAYS * prior) / (rays + PRIOR_RAYS)
        };
        let [rays, visible] =
            of_bin.iter().fold([0.0; 2], |sum, of| [sum[0] + of[0] as f32, sum[1] + of[1] as f32]);
        let of_all = share([rays, visible], 0.5);
        let priors: Vec<f32> =
            of_bin.iter().map(|count| share(count.map(|rays| rays as f32), of_all)).collect();
        let expect = |(index, count): (usize, &[u32; 2])| {
            share(count.map(|rays| rays as f32), priors[index % bins])
        };
        counts.iter().enumerate().map(expect).collect()
    }
}
