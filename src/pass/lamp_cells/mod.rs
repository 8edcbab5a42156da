//! Cells of the scene that choose lamps: for each a list of the clusters that bring most light there, as far
//! as rays from its surfaces see them. Made once, before the first sample, so that a choice depends on
//! nothing that a render draws.
//!
//! Departs from a light tree \[Conty Estevez & Kulla 2018\] by knowing what is blocked: lamps behind a wall
//! are as near as those before it.

use std::{
    collections::{BTreeMap, BTreeSet},
    f32::consts::PI,
    ops::Range,
};

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use super::{
    lamps::{Cluster, LampTables, corners, radius},
    surfaces,
};
use crate::{
    accel::{
        Accel,
        traverse::{Intersection, moved_off_surface, placed},
    },
    math::{
        colour::luminance,
        equal_area::direction_from_square,
        random::{hash_4d, unit_float},
    },
    scene::{Camera, Material, Scene},
    shader::{
        constants::{
            LAMP_BIT, LAMP_DIRECTIONAL, LAMP_POINT, LAMP_SPOT_LINEAR_ANGLE,
            LAMP_SPOT_SMOOTH_COSINE, NO_INSTANCE,
        },
        structs::{Lamp, LampChoice, LampEntry},
    },
    stage,
};

/// Cube faces that a normal can be nearest to.
const FACES: usize = 6;
/// Walks from the camera that find surfaces, and as many from lamps and triangles; places of each.
const WALKS: u32 = 1 << 14;
const WALK_PLACES: u32 = 4;
/// Edges of the square that walks from the camera go through, in heights of the image.
const VIEW: f32 = 2.0;
/// Most cells with surfaces.
const MOST_CELLS: usize = 8192;
const MOST_GRID_CELLS: u64 = 1 << 19;
/// Most times that a cell far from the camera's paths is wider than one where they go.
const MOST_COARSE: u32 = 16;
/// Most shadow rays of all cells together, and of these for each cluster.
const MOST_RAYS: usize = 1 << 21;
const RAYS_PER_CLUSTER: usize = 1 << 13;
/// Most clusters that a cell looks at closely.
const MOST_TRIED: usize = 48;
const MOST_ENTRIES: usize = 32;
/// Places of a cell that rays start from, one to each cluster. Four may all lie in the next room.
const PLACES: usize = 16;
/// Visibility before any ray, and the rays that it is worth.
const PRIOR: [f32; 2] = [0.1, 0.25];
/// Exponent of the visibility in the weight of a cluster.
const VISIBILITY_EXPONENT: f32 = 0.75;
/// Least visibility that a choice counts with: rays from a few places miss what others see.
const LEAST_VISIBILITY: f32 = 0.05;
/// Range of the probability that a lamp is drawn by power alone.
const BY_POWER: [f64; 2] = [0.1, 0.5];
/// Surfaces that light passes, on the way to a lamp.
const MOST_PASSED: u32 = 8;
/// Separates these random numbers from all others.
const SEED: u32 = 0x6c61_6d70;
/// Units of the probabilities.
const UNITS: f64 = 4_294_967_296.0;

/// Cubes of one size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Grid {
    /// Corner, metres.
    pub(crate) origin: Vec3,
    pub(crate) cells_per_metre: f32,
    /// Cells along each axis.
    pub(crate) size: [u32; 3],
}

/// Lists of clusters by cell and cube face.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LampCells {
    pub(crate) grid: Grid,
    /// Entries of a list, a power of two.
    pub(crate) list_length: u32,
    /// First entry of the list of each cell and face.
    pub(crate) lists: Vec<u32>,
    /// The lists. The first draws by power alone.
    pub(crate) entries: Vec<LampEntry>,
}

/// Place on a surface, with the normal on the side that it was seen from.
#[derive(Clone, Copy, Debug)]
struct Place {
    position: Vec3,
    normal: Vec3,
}

/// A lamp as a place sees it.
struct Light {
    direction: Vec3,
    distance: f32,
    /// At normal incidence, over the probability of the lamp in its cluster.
    irradiance: f32,
}

/// Estimate of a cluster in a cell.
struct Estimate<'a> {
    cluster: &'a Cluster,
    /// Estimate without looking.
    score: f64,
    weight: f64,
    /// Factor on the weight by what rays see.
    visibility: f32,
}

impl Grid {
    /// Returns the finest grid over `places` with at most `most` cells and faces that hold any.
    fn over(places: &[Place], most: usize) -> Self {
        let positions = || places.iter().map(|place| place.position);
        let low = positions().reduce(Vec3::min).unwrap_or_default();
        let high = positions().reduce(Vec3::max).unwrap_or_default();
        let extent = (high - low).max_element().max(1e-6);
        let with = |count: f32| {
            let edge = extent / count;
            let size = ((high - low) / edge).floor().as_uvec3() + UVec3::ONE;
            Self { origin: low, cells_per_metre: 1.0 / edge, size: size.into() }
        };
        let finer = (4..32).map(|step| with(0.5 * (0.5 * step as f32).exp2()));
        finer.take_while(|grid| grid.fits(places, most)).last().unwrap_or(with(1.0))
    }

    /// Returns this grid with cells divided into as many as `places` allow, of which at most `most` hold any,
    /// and their number along each edge.
    fn divided(&self, places: &[Place], most: usize) -> (Self, u32) {
        let with = |times: u32| Self {
            cells_per_metre: times as f32 * self.cells_per_metre,
            size: self.size.map(|count| times * count),
            ..*self
        };
        let times = (2..=MOST_COARSE).take_while(|times| with(*times).fits(places, most)).last();
        let times = times.unwrap_or(1);
        (with(times), times)
    }

    /// True if the cells are not too many, and at most `most` cells and faces hold any of `places`.
    fn fits(&self, places: &[Place], most: usize) -> bool {
        let held = || places.iter().map(|place| self.index(place)).collect::<BTreeSet<_>>();
        let cells: u64 = self.size.iter().map(|&count| u64::from(count)).product();
        cells <= MOST_GRID_CELLS && held().len() <= most
    }

    fn cell(&self, position: Vec3) -> UVec3 {
        let place = (position - self.origin) * self.cells_per_metre;
        place.max(Vec3::ZERO).as_uvec3().min(UVec3::from(self.size) - UVec3::ONE)
    }

    fn index_of(&self, cell: UVec3, face: usize) -> usize {
        let [width, height, _] = self.size.map(|count| count as usize);
        let [x, y, z] = cell.to_array().map(|place| place as usize);
        ((z * height + y) * width + x) * FACES + face
    }

    /// Inverse of [`Self::index_of`].
    fn cell_of(&self, index: usize) -> (UVec3, usize) {
        let [width, height, _] = self.size;
        let cell = (index / FACES) as u32;
        (UVec3::new(cell % width, cell / width % height, cell / width / height), index % FACES)
    }

    /// Index of the cell and face of a place: twin of `lamp_list`.
    fn index(&self, place: &Place) -> usize {
        self.index_of(self.cell(place.position), cube_face(place.normal))
    }
}

/// Twin of `cube_face` in `glsl/include/frame.glsl`.
fn cube_face(normal: Vec3) -> usize {
    let size = normal.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    2 * axis + usize::from(normal[axis] < 0.0)
}

impl LampCells {
    /// Makes the lists of a scene for the clusters of `tables`, of which there are some.
    pub(super) fn new(scene: &Scene, accel: &Accel, tables: &LampTables) -> Self {
        let clusters = &tables.clusters;
        stage::enter(format_args!("looking for {} groups of lamps", clusters.len()));
        let rays = MOST_TRIED.min(clusters.len()) * PLACES;
        let survey = Survey::new(scene, accel, tables);
        let walked = |camera| -> Vec<Place> {
            (0..WALKS).into_par_iter().flat_map_iter(|walk| survey.walk(walk, camera)).collect()
        };
        let (near, mut places) = (walked(Some(&scene.camera)), walked(None));
        places.extend(&near);
        let most = (MOST_RAYS.min(RAYS_PER_CLUSTER * clusters.len()) / rays).min(MOST_CELLS);
        // Half of the cells are where the camera's paths go; the others cover all surfaces.
        let (grid, times) = Grid::over(&places, most / 2).divided(&near, most / 2);
        let coarse_index = |cell: UVec3, face| grid.index_of(cell / times * times, face);
        let mut fine: BTreeMap<usize, Vec<Place>> = BTreeMap::new();
        let mut coarse: BTreeMap<usize, Vec<Place>> = BTreeMap::new();
        for place in &near {
            fine.entry(grid.index(place)).or_default().push(*place);
        }
        for place in &places {
            let index = coarse_index(grid.cell(place.position), cube_face(place.normal));
            coarse.entry(index).or_default().push(*place);
        }
        let list_length = (clusters.len() + 1).next_power_of_two().min(MOST_ENTRIES);
        let edge = 1.0 / grid.cells_per_metre;
        let sets: Vec<(&Vec<Place>, f32)> = fine
            .values()
            .map(|places| (places, edge))
            .chain(coarse.values().map(|places| (places, times as f32 * edge)))
            .collect();
        let lists: Vec<Vec<LampEntry>> = (0_u32..)
            .zip(&sets)
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|(label, (places, edge))| survey.list(label, places, *edge, list_length))
            .collect();
        let by_power = list_of(tables, &[], 1.0, list_length);
        let entries = by_power.into_iter().chain(lists.into_iter().flatten()).collect();
        let first_of = |number: usize| ((number + 1) * list_length) as u32;
        let mut found = vec![0; FACES * grid.size.iter().product::<u32>() as usize];
        let numbers: BTreeMap<usize, usize> = coarse.keys().copied().zip(fine.len()..).collect();
        for (index, list) in found.iter_mut().enumerate() {
            let (cell, face) = grid.cell_of(index);
            if let Some(number) = numbers.get(&coarse_index(cell, face)) {
                *list = first_of(*number);
            }
        }
        for (number, index) in fine.keys().enumerate() {
            found[*index] = first_of(number);
        }
        log::info!(
            "{} clusters of {} lamps, {} cells of {edge:.2} m choose among them",
            clusters.len(),
            tables.source_count,
            fine.len()
        );
        Self { grid, list_length: list_length as u32, lists: found, entries }
    }
}

/// Data that lists are made from.
struct Survey<'a> {
    accel: &'a Accel,
    tables: &'a LampTables,
    /// True for materials that light may pass.
    passes: Vec<bool>,
    /// True for materials that emit to both sides.
    two_sided: Vec<bool>,
    radius: f32,
    offset: f32,
}

impl<'a> Survey<'a> {
    fn new(scene: &Scene, accel: &'a Accel, tables: &'a LampTables) -> Self {
        let emits_twice = |material: &Material| {
            material.surface.emission.as_ref().is_some_and(|emission| emission.two_sided)
        };
        Self {
            accel,
            tables,
            passes: scene.materials.iter().map(surfaces::passes).collect(),
            two_sided: scene.materials.iter().map(emits_twice).collect(),
            radius: radius(scene.geometry.extent()),
            offset: accel.ray_offset(),
        }
    }

    /// Follows paths from the camera, or light from a lamp, every second time from a triangle, over diffuse
    /// surfaces.
    fn walk(&self, walk: u32, camera: Option<&Camera>) -> Vec<Place> {
        let mut places = Vec::new();
        let [a, b, c, d] = hash_4d([walk, 0, 0, SEED]);
        let sides = [1.0, -1.0][(d & 1) as usize];
        let triangles = self.accel.placed_count();
        let choice = self.choice(0..self.tables.source_count, a, b);
        let triangle = if walk.is_multiple_of(2) && triangles > 0 {
            Some(scaled(a, triangles))
        } else {
            Some(choice.source).filter(|source| source & LAMP_BIT == 0)
        };
        let (mut origin, mut direction) = if let Some(camera) = camera {
            let [right, up, forward] = camera.axes();
            let half = VIEW * (0.5 * camera.vertical_fov_deg).to_radians().tan();
            let [x, y] = [c, d].map(|bits| half * (2.0 * unit_float(bits) - 1.0));
            (camera.position, (forward + x * right + y * up).normalize())
        } else if let Some(triangle) = triangle {
            let position = self.point_on(triangle, [c, d.rotate_left(16)]);
            let normal = sides * self.normal(triangle, NO_INSTANCE);
            places.push(Place { position, normal });
            let direction = bounced(normal, hash_4d([walk, 0, 1, SEED]));
            (moved_off_surface(position, normal, direction, self.offset), direction)
        } else {
            let lamp = &self.tables.lamps[(choice.source & !LAMP_BIT) as usize];
            let out = direction_from_square([unit_float(c), unit_float(d)].into());
            if lamp.kind == LAMP_DIRECTIONAL {
                return places;
            }
            let axis = Vec3::from(lamp.direction);
            let out = if lamp.kind == LAMP_POINT { out } else { (axis + 0.5 * out).normalize() };
            (lamp.position.into(), out)
        };
        for step in 1..=WALK_PLACES {
            let Some(hit) = self.stops(&mut origin, direction, f32::MAX) else { break };
            let position = origin + hit.distance * direction;
            let normal = self.normal(hit.triangle, hit.instance);
            let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
            places.push(Place { position, normal });
            direction = bounced(normal, hash_4d([walk, step, 1, SEED]));
            origin = moved_off_surface(position, normal, direction, self.offset);
        }
        places
    }

    /// Returns the first surface before `farthest` that light does not pass, and moves the origin to the last
    /// one that it does.
    fn stops(&self, origin: &mut Vec3, direction: Vec3, mut farthest: f32) -> Option<Intersection> {
        for _ in 0..MOST_PASSED {
            let hit = self.accel.closest_before(*origin, direction, farthest)?;
            let own = self.accel.triangle_materials[hit.triangle as usize];
            let instance = self.accel.instances.get(hit.instance as usize);
            let material = instance.map_or(own, |instance| instance.material(own));
            if !self.passes[material as usize] {
                return Some(hit);
            }
            let step = hit.distance + 2.0 * self.offset;
            *origin += step * direction;
            farthest -= step;
        }
        None
    }

    /// Draws a lamp from an alias table.
    fn choice(&self, columns: Range<u32>, a: u32, b: u32) -> LampChoice {
        let own = self.tables.choices[(columns.start + scaled(a, columns.len())) as usize];
        if b < own.threshold {
            own
        } else {
            self.tables.choices[(columns.start + own.alias) as usize]
        }
    }

    fn point_on(&self, triangle: u32, [a, b]: [u32; 2]) -> Vec3 {
        let [p, q, r] = corners(self.accel, triangle);
        let [u, v] = [a, b].map(unit_float);
        let [u, v] = if u + v > 1.0 { [1.0 - v, 1.0 - u] } else { [u, v] };
        p + u * (q - p) + v * (r - p)
    }

    /// Unit normal of a triangle in the world.
    fn normal(&self, triangle: u32, instance: u32) -> Vec3 {
        let instance = self.accel.instances.get(instance as usize);
        let corners = self.accel.triangle(triangle).vertices;
        let [a, b, c] = corners.map(|vertex| placed(instance, vertex.position));
        (b - a).cross(c - a).normalize_or(Vec3::Y)
    }

    /// Draws a point on a lamp of `cluster`, as `position` sees it.
    fn light(&self, cluster: &Cluster, position: Vec3, numbers: [u32; 4]) -> Light {
        let [a, b, c, d] = numbers;
        let source = self.choice(cluster.columns.clone(), a, b).source;
        let power = cluster.power as f32;
        if source & LAMP_BIT == 0 {
            let to_lamp = self.point_on(source, [c, d]) - position;
            let distance = to_lamp.length().max(1e-6);
            let direction = to_lamp / distance;
            let cosine = -direction.dot(self.normal(source, NO_INSTANCE));
            let material = self.accel.triangle_materials[source as usize] as usize;
            let (sides, cosine) =
                if self.two_sided[material] { (2.0, cosine.abs()) } else { (1.0, cosine.max(0.0)) };
            let irradiance = power * cosine / (sides * PI * distance * distance);
            return Light { direction, distance: distance - 2.0 * self.offset, irradiance };
        }
        let lamp = &self.tables.lamps[(source & !LAMP_BIT) as usize];
        if lamp.kind == LAMP_DIRECTIONAL {
            let irradiance = luminance(lamp.intensity.into());
            return Light {
                direction: -Vec3::from(lamp.direction),
                distance: f32::MAX,
                irradiance,
            };
        }
        let to_lamp = Vec3::from(lamp.position) - position;
        let distance = to_lamp.length().max(1e-6);
        let direction = to_lamp / distance;
        let share = if lamp.kind == LAMP_POINT {
            1.0
        } else {
            spot_falloff(lamp, -direction.dot(lamp.direction.into()))
        };
        // The lamps of a cluster are drawn by power, as that of a triangle.
        let own = luminance(lamp.intensity.into()) * share * power / self.power_of(source, cluster);
        Light { direction, distance, irradiance: own / (distance * distance) }
    }

    /// Power of a lamp of `cluster`.
    fn power_of(&self, source: u32, cluster: &Cluster) -> f32 {
        let own = cluster.columns.clone().map(|column| &self.tables.choices[column as usize]);
        let own = own.filter(|choice| choice.source == source).map(|choice| choice.probability);
        own.sum::<f32>() * self.tables.total as f32
    }

    /// Makes the list of a cell with these places.
    fn list(&self, label: u32, places: &[Place], edge: f32, length: usize) -> Vec<LampEntry> {
        let middle = places.iter().map(|place| place.position).sum::<Vec3>() / places.len() as f32;
        let least = (0.5 * edge).powi(2);
        let score = |cluster: &Cluster| {
            let far = 0.25 * self.radius * self.radius;
            let squared = cluster.centre.map_or(far, |centre| centre.distance_squared(middle));
            cluster.power / f64::from(squared.max(least))
        };
        let mut estimates: Vec<Estimate<'_>> = self
            .tables
            .clusters
            .iter()
            .map(|cluster| Estimate {
                cluster,
                score: score(cluster),
                weight: 0.0,
                visibility: 0.0,
            })
            .collect();
        let columns = |estimate: &Estimate<'_>| estimate.cluster.columns.start;
        estimates.sort_by(|a, b| b.score.total_cmp(&a.score).then(columns(a).cmp(&columns(b))));
        let unseen: f64 = estimates.iter().skip(MOST_TRIED).map(|estimate| estimate.score).sum();
        estimates.truncate(MOST_TRIED);
        let step = places.len().div_ceil(PLACES);
        for estimate in &mut estimates {
            self.look(label, estimate, places.iter().step_by(step), least);
        }
        // Lamps farther away are seen about as often as the farther half of these.
        let farther = &estimates[estimates.len() / 2..];
        let sum =
            |of: fn(&Estimate<'_>) -> f64, all: &[Estimate<'_>]| all.iter().map(of).sum::<f64>();
        let seen = sum(|e| e.weight, farther) / sum(|e| e.score, farther).max(f64::MIN_POSITIVE);
        estimates.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(columns(a).cmp(&columns(b))));
        let all = sum(|e| e.weight, &estimates) + seen * unseen;
        estimates.truncate(length - 1);
        estimates.retain(|estimate| estimate.weight > 1e-4 * all);
        let listed = sum(|e| e.weight, &estimates);
        if listed <= 0.0 {
            return list_of(self.tables, &[], 1.0, length);
        }
        let by_power = (1.0 - listed / all).clamp(BY_POWER[0], BY_POWER[1]);
        estimates.sort_by_key(columns);
        list_of(self.tables, &estimates, by_power, length)
    }

    /// Estimates what a cluster brings to places.
    fn look<'b>(
        &self,
        label: u32,
        estimate: &mut Estimate<'_>,
        places: impl Iterator<Item = &'b Place>,
        least: f32,
    ) {
        let (mut sum, mut rays, mut hits) = (0.0, 0.0, 0.0);
        let column = estimate.cluster.columns.start;
        for (number, place) in (0_u32..).zip(places) {
            let numbers = hash_4d([label, column, number, SEED]);
            let light = self.light(estimate.cluster, place.position, numbers);
            let cosine = light.direction.dot(place.normal);
            if light.irradiance <= 0.0 || cosine <= 0.0 {
                continue;
            }
            let squared = light.distance * light.distance;
            let clamped = if squared < least { squared / least } else { 1.0 };
            sum += light.irradiance * clamped * (0.1 + 0.9 * cosine);
            rays += 1.0;
            let (direction, mut origin) = (light.direction, place.position);
            origin = moved_off_surface(origin, place.normal, direction, self.offset);
            if self.stops(&mut origin, direction, light.distance).is_none() {
                hits += 1.0;
            }
        }
        let [prior, worth] = PRIOR;
        let visibility = (hits + worth * prior) / (rays + worth);
        estimate.visibility = visibility.max(LEAST_VISIBILITY).powf(VISIBILITY_EXPONENT);
        estimate.weight = f64::from(sum * estimate.visibility);
    }
}

/// Twin of `spot_falloff` in `glsl/include/lamps.glsl`.
fn spot_falloff(lamp: &Lamp, cosine: f32) -> f32 {
    if lamp.kind == LAMP_SPOT_LINEAR_ANGLE {
        let angle = cosine.clamp(-1.0, 1.0).acos();
        return ((lamp.outer - angle) / (lamp.outer - lamp.inner).max(1e-6)).clamp(0.0, 1.0);
    }
    let t = ((cosine - lamp.outer) / (lamp.inner - lamp.outer).max(1e-6)).clamp(0.0, 1.0);
    if lamp.kind == LAMP_SPOT_SMOOTH_COSINE { t * t * (3.0 - 2.0 * t) } else { t * t }
}

/// Twin of `scaled` in `glsl/include/random.glsl`.
fn scaled(bits: u32, count: usize) -> u32 {
    ((u64::from(bits) * count as u64) >> 32) as u32
}

/// Returns a direction in proportion to the cosine.
fn bounced(normal: Vec3, [a, b, ..]: [u32; 4]) -> Vec3 {
    let out = direction_from_square([unit_float(a), unit_float(b)].into());
    (normal + 0.999 * out).normalize()
}

/// Returns a list of `length` entries: one for all lamps, drawn by power with the probability `by_power`, and
/// one for each estimate, in the order of columns.
fn list_of(
    tables: &LampTables,
    estimates: &[Estimate<'_>],
    by_power: f64,
    length: usize,
) -> Vec<LampEntry> {
    let sum: f64 = estimates.iter().map(|estimate| estimate.weight).sum();
    let mut entries = Vec::with_capacity(length);
    let units = |probability: f64| ((probability * UNITS).round() as u64).min(u64::from(u32::MAX));
    let end = if estimates.is_empty() { u64::from(u32::MAX) + 1 } else { units(by_power) };
    let by_power = end as f64 / UNITS;
    entries.push(LampEntry {
        before: 0,
        ratio: by_power as f32,
        first: 0,
        count: tables.source_count,
        visibility: LEAST_VISIBILITY.powf(VISIBILITY_EXPONENT),
        ..LampEntry::default()
    });
    let (mut before, mut weight) = (end, 0.0);
    for (number, estimate) in estimates.iter().enumerate() {
        weight += estimate.weight;
        let is_last = number + 1 == estimates.len();
        let share = by_power + (1.0 - by_power) * (weight / sum);
        let end = if is_last { u64::from(u32::MAX) + 1 } else { units(share).max(before) };
        let own = (end - before) as f64 / UNITS;
        let columns = &estimate.cluster.columns;
        entries.push(LampEntry {
            before: before as u32,
            ratio: (own * tables.total / estimate.cluster.power + by_power) as f32,
            first: columns.start,
            count: columns.end - columns.start,
            visibility: estimate.visibility,
            ..LampEntry::default()
        });
        before = end.min(u64::from(u32::MAX));
    }
    let none = LampEntry { before: u32::MAX, first: u32::MAX, ..LampEntry::default() };
    entries.resize(length, none);
    entries
}

#[cfg(test)]
pub(super) mod tests;
