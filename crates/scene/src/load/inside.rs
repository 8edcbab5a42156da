//! View from inside a room for files without a camera, by a coarse grid of the surfaces.

use glam::{IVec3, Vec3};
use rayon::prelude::*;

use crate::Geometry;

/// Cells along the longest side of the scene.
const CELLS: f32 = 64.0;
/// Heights of rooms of people, for scenes in metres, and of their eyes.
const ROOM_HEIGHTS: (f32, f32) = (1.9, 8.0);
const EYE_HEIGHT: f32 = 1.6;
/// Height of the eyes in other rooms, as a share of theirs.
const EYE_SHARE: f32 = 0.55;
/// Smallest share of cells inside, of all, that makes a room of a scene.
const ROOM_SHARE: f32 = 0.08;
/// Smallest height of a room, as a share of the scene's: a shelf of a bookcase is none.
const HEIGHT_SHARE: f32 = 0.35;
/// Largest share of surfaces that show the room their back.
const MOST_BACKS: f32 = 0.3;
/// Directions that are looked along.
const DIRECTIONS: usize = 48;
/// Directions beside one that are in view too.
const IN_VIEW: usize = 4;
/// Height of the middle of a view below that of the eyes, as a share of its length.
const TILT: f32 = 0.06;

/// Surfaces in cells.
struct Grid {
    low: Vec3,
    cell: f32,
    size: IVec3,
    /// Area of the surfaces in a cell times their normals, and their area.
    cells: Vec<(Vec3, f32)>,
}

/// Place of an eye and a point that it looks at.
pub(super) struct View {
    pub from: Vec3,
    pub at: Vec3,
}

/// Cells to a surface, and true if it is one that shows its back. Out of the scene there is none.
struct Sight {
    cells: f32,
    is_back: bool,
    leaves: bool,
}

/// Finds a view of a room from inside; none for a scene that is no room.
pub(super) fn view(geometry: &Geometry, low: Vec3, high: Vec3) -> Option<View> {
    let grid = Grid::new(geometry, low, high)?;
    let places: Vec<IVec3> = places(IVec3::ZERO, grid.size - 1).collect();
    let inside: Vec<IVec3> =
        places.into_par_iter().filter(|&place| grid.is_inside(place)).collect();
    let is_room = inside.len() as f32 > ROOM_SHARE * grid.cells.len() as f32;
    let eyes = inside.iter().copied().filter(|&place| is_room && grid.is_at_eye_height(place));
    let place = eyes.max_by(|a, b| grid.room_about(*a).total_cmp(&grid.room_about(*b)))?;
    let sights: Vec<Sight> = (0..DIRECTIONS).map(|at| grid.sight(place, direction(at))).collect();
    let backs = sights.iter().filter(|sight| sight.is_back).count();
    if backs as f32 > MOST_BACKS * DIRECTIONS as f32 {
        return None;
    }
    let worth = |at: usize| -> f32 {
        let beside = (0..=2 * IN_VIEW).map(|step| (at + DIRECTIONS + step - IN_VIEW) % DIRECTIONS);
        // A window counts as much as the room is long.
        beside.map(|at| sights[at].cells * if sights[at].leaves { 2.0 } else { 1.0 }).sum()
    };
    let best = (0..DIRECTIONS).max_by(|a, b| worth(*a).total_cmp(&worth(*b)))?;
    let ahead = direction(best);
    // Step back as far as there is room.
    let behind = grid.sight(place, -ahead);
    let back = if behind.leaves { 0.0 } else { (0.7 * behind.cells - 1.0).max(0.0) };
    let from = grid.center(place) - ahead * back * grid.cell;
    let length = (sights[best].cells + back) * grid.cell;
    Some(View { from, at: from + length * (ahead - TILT * Vec3::Y) })
}

/// Cells from a first to a last one, both included.
fn places(first: IVec3, last: IVec3) -> impl Iterator<Item = IVec3> {
    (first.z..=last.z).flat_map(move |z| {
        let row = move |y| (first.x..=last.x).map(move |x| IVec3::new(x, y, z));
        (first.y..=last.y).flat_map(row)
    })
}

/// Horizontal direction by its number.
fn direction(at: usize) -> Vec3 {
    let (sine, cosine) = (at as f32 / DIRECTIONS as f32 * std::f32::consts::TAU).sin_cos();
    Vec3::new(sine, 0.0, -cosine)
}

impl Grid {
    fn new(geometry: &Geometry, low: Vec3, high: Vec3) -> Option<Self> {
        let cell = (high - low).max_element() / CELLS;
        if !(cell.is_finite() && cell > 0.0) {
            return None;
        }
        let size = ((high - low) / cell).floor().as_ivec3() + 1;
        let mut grid = Self {
            low,
            cell,
            size,
            cells: vec![(Vec3::ZERO, 0.0); size.element_product() as usize],
        };
        for triangle in &geometry.triangles {
            grid.add(triangle.map(|at| geometry.positions[at as usize].into()));
        }
        Some(grid)
    }

    /// Adds a triangle to the cells that its plane crosses within its box.
    fn add(&mut self, [a, b, c]: [Vec3; 3]) {
        let across = (b - a).cross(c - a);
        let normal = across.normalize_or_zero();
        let first = self.place(a.min(b).min(c));
        let last = self.place(a.max(b).max(c));
        let reach = 0.5 * self.cell * normal.abs().element_sum();
        let is_touched = |place: &IVec3| {
            let offset = self.center(*place) - a;
            offset.dot(normal).abs() <= reach && self.covers([a, b, c], normal, *place)
        };
        let touched: Vec<IVec3> = places(first, last).filter(is_touched).collect();
        let share = 0.5 * across / touched.len().max(1) as f32;
        for place in touched {
            let index = self.index(place);
            self.cells[index].0 += share;
            self.cells[index].1 += share.length();
        }
    }

    /// Tests for a triangle of which a point lies within about a cell of the middle of another.
    fn covers(&self, corners: [Vec3; 3], normal: Vec3, place: IVec3) -> bool {
        let middle = self.center(place);
        (0..3).all(|corner| {
            let (from, to) = (corners[corner], corners[(corner + 1) % 3]);
            let outward = (to - from).cross(normal).normalize_or_zero();
            (middle - from).dot(outward) <= 0.75 * self.cell
        })
    }

    fn place(&self, point: Vec3) -> IVec3 {
        let place = ((point - self.low) / self.cell).floor().as_ivec3();
        place.clamp(IVec3::ZERO, self.size - 1)
    }

    fn center(&self, place: IVec3) -> Vec3 {
        self.low + (place.as_vec3() + 0.5) * self.cell
    }

    fn index(&self, place: IVec3) -> usize {
        ((place.z * self.size.y + place.y) * self.size.x + place.x) as usize
    }

    /// Way from a cell to the next surface.
    fn sight(&self, place: IVec3, direction: Vec3) -> Sight {
        let mut cells = 0.0;
        loop {
            cells += 1.0;
            let at = (place.as_vec3() + direction * cells).round().as_ivec3();
            if at.min_element() < 0 || (at - self.size).max_element() >= 0 {
                return Sight { cells, is_back: false, leaves: true };
            }
            let (normals, area) = self.cells[self.index(at)];
            if area > 0.0 {
                // Two faces of a wall in one cell show neither.
                let is_back = normals.dot(direction) > 0.3 * area;
                return Sight { cells, is_back, leaves: false };
            }
        }
    }

    /// Tests for an empty cell with a floor, a ceiling, and walls on three sides or more.
    fn is_inside(&self, place: IVec3) -> bool {
        let is_hit = |direction: Vec3| !self.sight(place, direction).leaves;
        self.cells[self.index(place)].1 == 0.0
            && is_hit(-Vec3::Y)
            && is_hit(Vec3::Y)
            && [Vec3::X, -Vec3::X, Vec3::Z, -Vec3::Z].into_iter().filter(|d| is_hit(*d)).count() > 2
    }

    /// Tests for the height of the eyes in a room that is high enough.
    fn is_at_eye_height(&self, place: IVec3) -> bool {
        let below = self.sight(place, -Vec3::Y).cells * self.cell;
        let room = below + self.sight(place, Vec3::Y).cells * self.cell;
        let (low, high) = ROOM_HEIGHTS;
        let eyes = if (low..=high).contains(&room) { EYE_HEIGHT } else { EYE_SHARE * room };
        room >= HEIGHT_SHARE * self.size.y as f32 * self.cell
            && (below - eyes).abs() <= 0.75 * self.cell
    }

    /// Least way to a surface around an eye.
    fn room_about(&self, place: IVec3) -> f32 {
        let ways = (0..DIRECTIONS).step_by(3).map(|at| self.sight(place, direction(at)));
        ways.filter(|sight| !sight.leaves).map(|sight| sight.cells).fold(f32::INFINITY, f32::min)
    }
}
