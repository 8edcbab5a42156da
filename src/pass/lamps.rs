//! Lamps and emitting triangles → an alias table by power, densities over triangles, and clusters for the
//! choice by place.

use std::{collections::BTreeMap, f32::consts::PI, ops::Range};

use glam::Vec3;

use crate::{
    accel::Accel,
    math::{
        alias::{alias_table, probabilities},
        colour::luminance,
        refinement::refine,
    },
    scene::{
        Lamp, Scene, instance,
        lamp::{LampKind, SpotFalloff},
        light_group::LightGroups,
    },
    shader::{
        constants::{
            LAMP_BIT, LAMP_DIRECTIONAL, LAMP_POINT, LAMP_SPOT_LINEAR_ANGLE,
            LAMP_SPOT_SMOOTH_COSINE, LAMP_SPOT_SQUARED_COSINE,
        },
        structs,
    },
};

/// Threshold of a column that always keeps its own source.
const THRESHOLD_SCALE: u64 = u32::MAX as u64;

/// Clusters up to which lamps are drawn by power: so few cost less than the choice by place.
const FEW_CLUSTERS: usize = 32;
const MOST_CLUSTERS: usize = 1024;
/// Extent of connected triangles that are not divided further, as a share of the radius of the scene.
const SMALL_CLUSTER: f32 = 1.0 / 8.0;

/// Contents of the lamp buffers.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LampTables {
    /// Alias table over emitting triangles and lamps, in proportion to their power. The tables of the
    /// clusters follow.
    pub choices: Vec<structs::LampChoice>,
    pub source_count: u32,
    /// Lights without a surface.
    pub lamps: Vec<structs::Lamp>,
    /// Density of sampling points on the triangles of each material by power, per square metre.
    pub emission_densities: Vec<f32>,
    /// Luminous power of all.
    pub(super) total: f64,
    /// Groups that are drawn by place; empty where few are drawn by power.
    pub(super) clusters: Vec<Cluster>,
    /// Cluster of each placed triangle that emits, where there are any.
    pub triangle_clusters: Vec<u32>,
}

/// Lamp or emitting triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    /// Triangle in BVH order, or `LAMP_BIT` and a lamp.
    pub(super) source: u32,
    /// Luminous power.
    pub(super) power: f64,
    /// Middle, metres; `None` if it is infinitely far away.
    pub(super) centre: Option<Vec3>,
}

/// Lamps that are drawn by power among themselves.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cluster {
    /// Columns of its alias table in [`LampTables::choices`]; the first names the cluster.
    pub(super) columns: Range<u32>,
    pub(super) power: f64,
    /// Mean of the middles by power.
    pub(super) centre: Option<Vec3>,
}

impl LampTables {
    /// Lays out the lamps of `scene`, whose triangles `accel` holds in BVH order.
    ///
    /// Power weighs the choice: of a triangle π · area · luminance of its mean radiance, for both
    /// sides if both emit. A textured triangle takes the mean of the whole image.
    pub(crate) fn new(scene: &Scene, accel: &Accel, groups: &LightGroups) -> Self {
        let per_area: Vec<f32> = scene
            .materials
            .iter()
            .map(|material| {
                let Some(emission) = &material.surface.emission else { return 0.0 };
                let mean = emission
                    .texture
                    .as_ref()
                    .map_or(1.0, |texture| luminance(texture.mean().into()));
                let sides = if emission.two_sided { 2.0 } else { 1.0 };
                let power = sides * PI * luminance(emission.radiance) * mean;
                if power.is_finite() { power.max(0.0) } else { 0.0 }
            })
            .collect();
        let mut sources = Vec::new();
        if per_area.iter().any(|&power| power > 0.0) {
            // Surfaces that emit are placed in the world.
            let placed = &accel.triangle_materials[..accel.placed_count()];
            for (triangle, &material) in (0_u32..).zip(placed) {
                let power = per_area[material as usize];
                if power > 0.0 {
                    let power = f64::from(power) * area(accel, triangle);
                    let centre = corners(accel, triangle).into_iter().sum::<Vec3>() / 3.0;
                    sources.push(Source { source: triangle, power, centre: Some(centre) });
                }
            }
        }
        let radius = radius(scene.geometry.extent());
        for (index, lamp) in (0_u32..).zip(&scene.lamps) {
            let centre = match lamp.kind {
                LampKind::Point { position, .. } => Some(position),
                LampKind::Spot(spot) => Some(spot.position),
                LampKind::Directional { .. } => None,
            };
            let power = power(&lamp.kind, radius);
            sources.push(Source { source: LAMP_BIT | index, power, centre });
        }
        let lamps = scene.lamps.iter().map(|lamp| convert(lamp, groups)).collect();
        let all: Vec<u32> = (0..sources.len() as u32).collect();
        let total: f64 = sources.iter().map(|source| source.power).sum();
        let mut tables =
            Self { source_count: sources.len() as u32, total, lamps, ..Self::default() };
        if !tables.add_table(&sources, &all) {
            tables.source_count = 0;
            tables.emission_densities = vec![0.0; per_area.len()];
            return tables;
        }
        tables.emission_densities =
            per_area.iter().map(|&power| (f64::from(power) / total) as f32).collect();
        let small = SMALL_CLUSTER * radius;
        let members = clusters(&sources, connected(accel, &sources), small);
        if members.len() > FEW_CLUSTERS {
            tables.add_clusters(accel, &sources, &members);
        }
        tables
    }

    /// Adds an alias table over `members` of `sources`, in proportion to their power. Returns false if none
    /// has any.
    fn add_table(&mut self, sources: &[Source], members: &[u32]) -> bool {
        let weights: Vec<f64> =
            members.iter().map(|member| sources[*member as usize].power).collect();
        let Some(table) = alias_table(&weights, THRESHOLD_SCALE) else { return false };
        let drawn = probabilities(&table, THRESHOLD_SCALE);
        let share = weights.iter().sum::<f64>() / self.total;
        let choices = table.iter().zip(members).zip(&drawn).map(|((entry, &member), &drawn)| {
            structs::LampChoice {
                threshold: entry.threshold as u32,
                alias: entry.alias,
                source: sources[member as usize].source,
                probability: (drawn * share) as f32,
                ..structs::LampChoice::default()
            }
        });
        self.choices.extend(choices);
        true
    }

    fn add_clusters(&mut self, accel: &Accel, sources: &[Source], members: &[Vec<u32>]) {
        self.triangle_clusters = vec![0; accel.placed_count()];
        for members in members {
            let first = self.choices.len() as u32;
            // Nothing is drawn from a cluster without power.
            if !self.add_table(sources, members) {
                continue;
            }
            for member in members {
                let source = sources[*member as usize].source;
                self.choices[*member as usize].cluster = first;
                if let Some(cluster) = self.triangle_clusters.get_mut(source as usize) {
                    *cluster = first;
                }
            }
            let own = || members.iter().map(|member| &sources[*member as usize]);
            let power: f64 = own().map(|source| source.power).sum();
            let weighted =
                |source: &Source| source.centre.map(|c| c * (source.power / power) as f32);
            let centre = own().map(weighted).sum();
            let columns = first..self.choices.len() as u32;
            self.clusters.push(Cluster { columns, power, centre });
        }
    }
}

/// Groups the triangles that hang together at their corners; others are groups by themselves.
fn connected(accel: &Accel, sources: &[Source]) -> Vec<Vec<u32>> {
    fn root(parents: &mut [u32], mut index: u32) -> u32 {
        while parents[index as usize] != index {
            let next = parents[index as usize];
            parents[index as usize] = parents[next as usize];
            index = next;
        }
        index
    }
    let mut parents: Vec<u32> = (0..sources.len() as u32).collect();
    let mut owners = BTreeMap::new();
    for (index, Source { source, .. }) in (0_u32..).zip(sources) {
        let corners = (source & LAMP_BIT == 0).then(|| corners(accel, *source));
        for corner in corners.into_iter().flatten() {
            let owner = *owners.entry(corner.to_array().map(f32::to_bits)).or_insert(index);
            let [a, b] = [owner, index].map(|index| root(&mut parents, index));
            parents[a.max(b) as usize] = a.min(b);
        }
    }
    let mut groups: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for index in 0..sources.len() as u32 {
        groups.entry(root(&mut parents, index)).or_default().push(index);
    }
    groups.into_values().collect()
}

/// Divides groups of sources into clusters no wider than `small` metres, the largest power and extent first,
/// as long as there are no more than [`MOST_CLUSTERS`]. Begins with one where the groups are too many. Each
/// that is infinitely far away is one by itself.
fn clusters(sources: &[Source], groups: Vec<Vec<u32>>, small: f32) -> Vec<Vec<u32>> {
    let source = |index: &u32| &sources[*index as usize];
    let (near, mut clusters): (Vec<Vec<u32>>, Vec<Vec<u32>>) = groups
        .into_iter()
        .partition(|group| group.iter().all(|index| source(index).centre.is_some()));
    let are_many = near.len() > MOST_CLUSTERS;
    let near = if are_many { vec![near.concat()] } else { near };
    let small = if are_many { 0.0 } else { small };
    let centre = |index: &u32| source(index).centre.unwrap_or_default();
    let extent = |members: &[u32]| {
        instance::bounds(members.iter().map(centre)).map_or(Vec3::ZERO, |[low, high]| high - low)
    };
    let priority = |members: &Vec<u32>| {
        let power: f64 = members.iter().map(|index| source(index).power).sum();
        let width = extent(members).max_element();
        (width > small).then(|| power * f64::from(width))
    };
    clusters.extend(near);
    refine(&mut clusters, MOST_CLUSTERS, priority, |clusters, index| {
        let members = &mut clusters[index];
        let axis = extent(members).max_position();
        members.sort_by(|a, b| centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(b)));
        let upper = members.split_off(members.len() / 2);
        clusters.push(upper);
    });
    clusters
}

/// Corners of a placed triangle, metres.
pub(super) fn corners(accel: &Accel, triangle: u32) -> [Vec3; 3] {
    accel.triangle(triangle).vertices.map(|vertex| Vec3::from_array(vertex.position))
}

/// Area of a triangle, square metres.
fn area(accel: &Accel, triangle: u32) -> f64 {
    let [a, b, c] = corners(accel, triangle).map(|corner| corner.as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}

/// Radius of a sphere around all positions, metres.
pub(super) fn radius(positions: impl Iterator<Item = Vec3>) -> f32 {
    instance::bounds(positions).map_or(0.0, |[low, high]| 0.5 * (high - low).length())
}

/// Luminous part of the power that a lamp sends into the scene.
fn power(kind: &LampKind, radius: f32) -> f64 {
    let power = match *kind {
        LampKind::Point { intensity, .. } => 4.0 * PI * luminance(intensity),
        LampKind::Spot(spot) => {
            let mean = 0.5 * (spot.inner_angle_rad.cos() + spot.outer_angle_rad.cos());
            2.0 * PI * (1.0 - mean) * luminance(spot.intensity)
        }
        LampKind::Directional { irradiance, .. } => PI * radius * radius * luminance(irradiance),
    };
    if power.is_finite() { f64::from(power.max(0.0)) } else { 0.0 }
}

fn convert(lamp: &Lamp, groups: &LightGroups) -> structs::Lamp {
    let light_group = groups.index(lamp.light_group.as_deref());
    match lamp.kind {
        LampKind::Point { position, intensity } => structs::Lamp {
            kind: LAMP_POINT,
            position: position.into(),
            intensity: intensity.into(),
            light_group,
            ..structs::Lamp::default()
        },
        LampKind::Spot(spot) => {
            let (inner, outer) = (spot.inner_angle_rad, spot.outer_angle_rad);
            let (kind, inner, outer) = match spot.falloff {
                SpotFalloff::SquaredCosine => (LAMP_SPOT_SQUARED_COSINE, inner.cos(), outer.cos()),
                SpotFalloff::SmoothCosine => (LAMP_SPOT_SMOOTH_COSINE, inner.cos(), outer.cos()),
                SpotFalloff::LinearAngle => (LAMP_SPOT_LINEAR_ANGLE, inner, outer),
            };
            structs::Lamp {
                kind,
                position: spot.position.into(),
                direction: spot.direction.into(),
                intensity: spot.intensity.into(),
                inner,
                outer,
                light_group,
                ..structs::Lamp::default()
            }
        }
        LampKind::Directional { direction, irradiance } => structs::Lamp {
            kind: LAMP_DIRECTIONAL,
            direction: direction.into(),
            intensity: irradiance.into(),
            light_group,
            ..structs::Lamp::default()
        },
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        pass::lamp_cells::tests::parsed,
        texture::{Encoding, Texels, Texture, TextureUse},
    };

    /// The draws follow the power: of a triangle that emits to one side or two, of spots, whose light from
    /// the inner to the outer angle counts by half, and of directional lamps on the disc that hides all.
    #[test]
    fn lamps_are_drawn_by_their_power() {
        let square = |name: &str, keys: &str, x: f32| {
            format!(
                "[[material]]\nname = \"{name}\"\ntype = \"diffuse\"\nreflectance = [0, 0, 0]\n\
                 emission = [1, 1, 1]\n{keys}\n[[object]]\nshape = \"box\"\nsize = [1, 1, 1]\n\
                 material = \"{name}\"\ntranslate = [{x}, 0, 0]\n"
            )
        };
        let text = "[camera]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov_deg = 40\n\
                    [[lamp]]\ntype = \"point\"\nposition = [0, 3, 0]\nintensity = [3, 3, 3]\n\
                    light_group = \"a\"\n\
                    [[lamp]]\ntype = \"spot\"\nposition = [0, 3, 0]\ndirection = [0, -1, 0]\n\
                    intensity = [12, 12, 12]\ninner_angle_deg = 0\nouter_angle_deg = 90\n\
                    light_group = \"b\"\n\
                    [[lamp]]\ntype = \"directional\"\ndirection = [0, -1, 0]\nirradiance = [4, 4, 4]\n\
                    light_group = \"c\"\n"
            .to_owned()
            + &square("one", "", 0.0)
            + &square("two", "emission_two_sided = true", 4.0);
        let (mut scene, accel, tables) = parsed(&text);
        // After the environment's.
        assert!(tables.lamps.iter().map(|lamp| lamp.light_group).eq(1..4), "{:?}", tables.lamps);
        // Over π: 4 · 3; 2 · 12 · ½; 4 times the squared radius of 5 m × 1 m × 1 m; 6 m² of each box, of one
        // side or two.
        let powers = [12.0, 12.0, 27.0, 6.0, 12.0];
        // The image of a lamp counts by its mean.
        let texels = Texels::Bytes(vec![[51, 51, 51, 255], [153, 153, 153, 255]]);
        let texture = Arc::new(Texture { name: String::new(), width: 2, height: 1, texels });
        let used = TextureUse { encoding: Encoding::Linear, ..TextureUse::new(texture) };
        let emission =
            scene.materials.iter_mut().rev().find_map(|own| own.surface.emission.as_mut());
        emission.unwrap().texture = Some(used);
        let darker = LampTables::new(&scene, &accel, &LightGroups::new(&scene));
        for (tables, last) in [(tables, 1.0), (darker, 0.4)] {
            let mut drawn = [0.0; 5];
            for choice in &tables.choices {
                let index = match choice.source {
                    lamp if lamp & LAMP_BIT != 0 => lamp & !LAMP_BIT,
                    triangle => 3 + accel.triangle_materials[triangle as usize],
                };
                drawn[index as usize] += choice.probability;
            }
            let expected = [&powers[..4], &[last * powers[4]]].concat();
            let total: f32 = expected.iter().sum();
            for (drawn, expected) in drawn.into_iter().zip(expected) {
                let expected = expected / total;
                assert!((drawn - expected).abs() < 1e-5, "{drawn}, expected {expected}");
            }
        }
    }

    /// A cluster of a lamp and another of three times its power lies three quarters of the way to it.
    #[test]
    fn clusters_lie_in_the_middle_of_their_power() {
        let accel = Accel::build(&Default::default(), 1 << 20).unwrap();
        let source = |index: u32, power: f64, x: f32| Source {
            source: LAMP_BIT | index,
            power,
            centre: Some(Vec3::X * x),
        };
        let sources = [source(0, 1.0, 0.0), source(1, 3.0, 4.0), source(2, 4.0, 9.0)];
        let mut tables = LampTables { total: 8.0, ..LampTables::default() };
        tables.add_table(&sources, &[0, 1, 2]);
        tables.add_clusters(&accel, &sources, &[vec![0, 1], vec![2]]);
        let found: Vec<_> = tables.clusters.iter().map(|own| (own.power, own.centre)).collect();
        assert_eq!(found, [(4.0, Some(Vec3::X * 3.0)), (4.0, Some(Vec3::X * 9.0))]);
    }
}
