//! Triangles on the same three points with different materials: fronts and backs of walls, as SketchUp and
//! others export them, and layers on one another.
//!
//! A rasteriser that culls backs shows the face that looks at the viewer. A tracer finds both at the same
//! distance, so they are moved apart here: each along its normal, by far less than a pixel.

use std::{
    collections::HashMap,
    hash::{DefaultHasher, Hash, Hasher},
    path::Path,
};

use glam::Vec3;
use rayon::prelude::*;

use super::{MaterialRun, Mesh};
use crate::material::Opacity;

/// Way of a triangle along its normal, as a share of its largest coordinate rounded up to a power of two:
/// 200 units in the last place, above what an intersection is wrong by.
const STEP: f32 = 1.2e-5;
/// Steps of a normal's components within which two directions are the same.
const DIRECTION_STEPS: f32 = 1024.0;

/// Corners of a triangle by their bits in rising order.
type Place = [[u32; 3]; 3];

/// Triangle among others that may lie in its place.
struct Candidate {
    place: Place,
    /// Differs for the two ways to look.
    is_odd: bool,
    index: u32,
}

impl Mesh {
    /// Moves triangles apart that lie on one another with different materials: back to back, and below a
    /// layer that is not opaque. Warns of those that a rasteriser without culling mixes up too.
    pub(super) fn part_coincident(&mut self, path: &Path, warnings: &mut Vec<String>) {
        if self.runs.len() < 2 {
            return;
        }
        let groups = self.coincident();
        let material = |index: u32| self.material_of(index as usize);
        let (mut moved, mut unculled, mut stacked) = (Vec::new(), 0, 0);
        for group in groups.chunk_by(|a, b| a.place == b.place) {
            let first = material(group[0].index);
            if group.iter().all(|other| material(other.index) == first) {
                continue;
            }
            let is_pair = group.iter().any(|other| other.is_odd != group[0].is_odd);
            let is_culled = group.iter().any(|other| self.is_culled(material(other.index)));
            unculled += usize::from(is_pair && !is_culled);
            for side in [false, true] {
                let side = group.iter().filter(|candidate| candidate.is_odd == side);
                let (opaque, layers): (Vec<_>, Vec<_>) =
                    side.partition(|candidate| self.is_opaque(material(candidate.index)));
                let base = opaque.first().map(|candidate| material(candidate.index));
                let others = opaque.iter().filter(|other| Some(material(other.index)) != base);
                stacked += others.count();
                let height = f32::from(u8::from(is_pair));
                moved.extend(opaque.iter().map(|candidate| (candidate.index, height)));
                let above = if opaque.is_empty() { height } else { height + 1.0 };
                moved.extend(layers.iter().map(|candidate| (candidate.index, above)));
            }
        }
        self.move_along_normals(&moved);
        let path = path.display();
        if unculled > 0 {
            warnings.push(format!(
                "{path}: {unculled} pairs of triangles lie back to back with different materials; \
                 each side shows the one that looks at it"
            ));
        }
        if stacked > 0 {
            warnings.push(format!(
                "{path}: {stacked} triangles lie on others of another material that look the same \
                 way; either is seen, by chance"
            ));
        }
    }

    /// Index into [`Mesh::materials`] of the material of a triangle, if it has one.
    pub(crate) fn material_of(&self, triangle: usize) -> Option<usize> {
        let next = self.runs.partition_point(|run| run.first_triangle <= triangle);
        self.runs[..next].last().and_then(|run: &MaterialRun| run.material)
    }

    /// Tests for a material of which a rasteriser shows the front alone.
    fn is_culled(&self, material: Option<usize>) -> bool {
        material.is_some_and(|material| self.materials[material].is_culled)
    }

    fn is_opaque(&self, material: Option<usize>) -> bool {
        material.is_none_or(|material| {
            let own = &self.materials[material].material;
            own.surface.opacity == Opacity::default() && !own.kind.is_glass()
        })
    }

    /// Triangles that share their place with others, those of a place together.
    fn coincident(&self) -> Vec<Candidate> {
        let mut hashes: Vec<(u64, u32)> = (0..self.triangles.len() as u32)
            .into_par_iter()
            .filter_map(|index| {
                let mut hasher = DefaultHasher::new();
                self.candidate(index)?.place.hash(&mut hasher);
                Some((hasher.finish(), index))
            })
            .collect();
        hashes.par_sort_unstable();
        let same = hashes.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1).flatten();
        let mut found: Vec<_> = same.filter_map(|&(_, index)| self.candidate(index)).collect();
        found.sort_by_key(|candidate| (candidate.place, candidate.index));
        found
    }

    /// Triangle with its place; none if it has no area or a corner that is not finite.
    fn candidate(&self, index: u32) -> Option<Candidate> {
        let corners = self.triangles[index as usize].map(|at| self.positions[at as usize]);
        if !corners.iter().flatten().all(|coordinate| coordinate.is_finite()) {
            return None;
        }
        // The sum turns −0 to 0.
        let [a, b, c] = corners.map(|corner| corner.map(|coordinate| (coordinate + 0.0).to_bits()));
        let mut place = [a, b, c];
        place.sort_unstable();
        let is_odd = (a > b) ^ (b > c) ^ (a > c);
        let has_area = place[0] != place[1] && place[1] != place[2];
        has_area.then_some(Candidate { place, is_odd, index })
    }

    /// Gives triangles vertices of their own, some steps along their normals.
    fn move_along_normals(&mut self, moved: &[(u32, f32)]) {
        let mut vertices = HashMap::new();
        for &(triangle, steps) in moved.iter().filter(|(_, steps)| *steps > 0.0) {
            let corners = self.triangles[triangle as usize];
            let [a, b, c] = corners.map(|at| Vec3::from(self.positions[at as usize]));
            let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
            let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
            let shift = normal * (steps * STEP * largest.log2().ceil().exp2());
            let direction = (normal * DIRECTION_STEPS).round().as_ivec3();
            let corners = corners.map(|corner| {
                *vertices.entry((corner, direction, steps.to_bits())).or_insert_with(|| {
                    let Some(copy) = self.repeat_vertex(corner) else { return corner };
                    let place = &mut self.positions[copy as usize];
                    *place = (Vec3::from(*place) + shift).to_array();
                    copy
                })
            });
            self.triangles[triangle as usize] = corners;
        }
    }
}
