//! A cell of learned visibility, as it is read back.

use super::key::CellKey;

/// How closely a cell belongs to the place that found it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellLevel {
    /// All places whose surface points at this face of the cube.
    Face(usize),
    /// Four fine cells along each axis.
    Coarse(CellKey),
    /// The place itself.
    Fine(CellKey),
}

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
    /// Level, and the key or face of the cell.
    pub level: CellLevel,
    /// Knowledge by region, in the order of [`super::GuideReadback::partition`].
    pub regions: Vec<RegionReadback>,
}
