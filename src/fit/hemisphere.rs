//! BRDF × cosine for one view as a fit sees it: samples on an equal-area grid of the hemisphere,
//! finest where the energy is.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::{config, points::Patch};
use crate::math::refinement::refine;

/// Initial cells along each side of the square.
const FIRST_CELLS: u32 = 24;
/// Deepest subdivision: cells of 1e-4 radians, far smaller than the narrowest lobe.
const MAX_DEPTH: u32 = 9;

/// Direction and value in a quarter of a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HemisphereSample {
    /// Unit direction in the local frame.
    pub direction: DVec3,
    /// Value of the function there.
    pub value: f64,
    /// Steradians of the quarter.
    pub solid_angle: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct HemisphereTarget {
    /// Quadrature over the hemisphere.
    pub samples: Vec<HemisphereSample>,
    /// The cells, four samples each.
    pub patches: Vec<Patch>,
}

impl HemisphereTarget {
    /// Integral of the function.
    pub(crate) fn energy(&self) -> f64 {
        self.patches.iter().map(|patch| patch.energy).sum()
    }
}

/// Maps the unit square to the hemisphere, equal areas to equal solid angles. \[Shirley & Chiu 1997\].
pub fn direction_from_square(point: DVec2) -> DVec3 {
    let centred = 2.0 * point - DVec2::ONE;
    if centred == DVec2::ZERO {
        return DVec3::Z;
    }
    let (radius, azimuth) = if centred.x.abs() > centred.y.abs() {
        (centred.x, PI / 4.0 * (centred.y / centred.x))
    } else {
        (centred.y, PI / 2.0 - PI / 4.0 * (centred.x / centred.y))
    };
    // z = 1 − r² maps the disk to the hemisphere with equal areas.
    let sine = radius * (2.0 - radius * radius).max(0.0).sqrt();
    DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), 1.0 - radius * radius)
}

/// Square cell of the grid with its four samples.
#[derive(Clone, Copy)]
struct Cell {
    depth: u32,
    x: u32,
    y: u32,
    samples: [(DVec3, f64); 4],
}

impl Cell {
    fn new(depth: u32, x: u32, y: u32, function: &dyn Fn(DVec3) -> f64) -> Self {
        let side = 1.0 / f64::from(FIRST_CELLS << depth);
        let corner = DVec2::new(f64::from(x), f64::from(y)) * side;
        let sample = |index: usize| {
            let offset =
                DVec2::new(0.25 + 0.5 * (index % 2) as f64, 0.25 + 0.5 * (index / 2) as f64);
            let direction = direction_from_square(corner + side * offset);
            let value = function(direction);
            (direction, if value.is_finite() { value.max(0.0) } else { 0.0 })
        };
        Self { depth, x, y, samples: std::array::from_fn(sample) }
    }

    fn solid_angle(&self) -> f64 {
        2.0 * PI / f64::from(FIRST_CELLS << self.depth).powi(2)
    }

    fn middle(&self) -> DVec3 {
        self.samples.iter().map(|sample| sample.0).sum::<DVec3>().normalize()
    }

    fn priority(&self) -> Option<f64> {
        let sum: f64 = self.samples.iter().map(|sample| sample.1).sum();
        let priority = 0.5 * self.solid_angle() * sum.sqrt();
        (self.depth < MAX_DEPTH && priority > 0.0).then_some(priority)
    }

    fn children(&self, function: &dyn Fn(DVec3) -> f64) -> [Self; 4] {
        std::array::from_fn(|index| {
            let (x, y) = (2 * self.x + (index % 2) as u32, 2 * self.y + (index / 2) as u32);
            Self::new(self.depth + 1, x, y, function)
        })
    }
}

/// Samples a non-negative function of direction; any other value counts as 0. Always refines the
/// cells toward `peak`, to find a highlight narrower than a cell.
pub(crate) fn sample_hemisphere(function: &dyn Fn(DVec3) -> f64, peak: DVec3) -> HemisphereTarget {
    let first = |index| Cell::new(0, index % FIRST_CELLS, index / FIRST_CELLS, function);
    let mut cells: Vec<Cell> = (0..FIRST_CELLS * FIRST_CELLS).map(first).collect();
    let split = |cells: &mut Vec<Cell>, index: usize| {
        let [first, rest @ ..] = cells[index].children(function);
        cells[index] = first;
        cells.extend(rest);
    };
    let mut index = 0;
    while index < cells.len() {
        let cell = cells[index];
        let size = cell.solid_angle().sqrt();
        if cell.depth < config::PEAK_DEPTH && cell.middle().distance(peak) < 1.2 * size {
            split(&mut cells, index);
        } else {
            index += 1;
        }
    }
    // Each split adds three cells.
    refine(&mut cells, config::HEMISPHERE_CELLS - 2, Cell::priority, split);
    let mut target = HemisphereTarget { samples: Vec::new(), patches: Vec::new() };
    for cell in &cells {
        let quarter = 0.25 * cell.solid_angle();
        let mut patch = Patch { energy: 0.0, moment: DVec3::ZERO, solid_angle: cell.solid_angle() };
        for &(direction, value) in &cell.samples {
            patch.energy += quarter * value;
            patch.moment += quarter * value * direction;
            target.samples.push(HemisphereSample { direction, value, solid_angle: quarter });
        }
        target.patches.push(patch);
    }
    target
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrates_what_is_known() {
        let target = sample_hemisphere(&|direction| direction.z / PI, DVec3::Z);
        assert!((target.energy() - 1.0).abs() < 1e-3, "{}", target.energy());
        let total: f64 = target.samples.iter().map(|sample| sample.solid_angle).sum();
        assert!((total - 2.0 * PI).abs() < 1e-9);
        // A highlight of a sixth of a degree is found through the hint.
        let peak = DVec3::new(-0.6, 0.0, 0.8);
        let narrow = |direction: DVec3| {
            (-5e4 * (direction - peak).length_squared()).exp() * 1e5 / (2.0 * PI)
        };
        let target = sample_hemisphere(&narrow, peak);
        assert!((target.energy() - 1.0).abs() < 0.02, "{}", target.energy());
    }
}
