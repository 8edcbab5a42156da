//! A cell of learned visibility, as it is read back.

use super::key::CellKey;

/// Knowledge of a cell about one region of the environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionReadback {
    /// Rays that the cell itself had counted when its estimates were made, with one candidate also
    /// directions that brought nothing; shares of rays where the regions were split afterwards.
    pub trials: f64,
    /// Those of them that reached the environment.
    pub hits: f64,
    /// V̂: estimated share of rays that reach it, by the hierarchy; in the steps of the tables.
    pub visibility: f64,
    /// P: probability that a guided direction lies in it.
    pub probability: f64,
}

/// A cell of learned visibility.
#[derive(Clone, Debug, PartialEq)]
pub struct CellReadback {
    /// Key; `None` for the cell of all places whose surface points at the face.
    pub key: Option<CellKey>,
    /// Face of the cube that its surfaces point at.
    pub face: usize,
    /// Knowledge by region, in the order of [`super::GuideReadback::partition`].
    pub regions: Vec<RegionReadback>,
}
