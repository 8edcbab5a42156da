//! Loop's subdivision of triangle meshes \[Loop 1987\], with the rules of \[Biermann et al. 2000\] for
//! boundaries as pbrt-v4 takes them: corners move to the limit surface after the last level.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::mesh::Mesh;

/// Most triangles that one shape may be cut into.
pub(super) const MAX_TRIANGLES: usize = 1 << 25;

/// Most levels; each makes four triangles of one.
const MAX_LEVELS: i64 = 12;

/// Neighbours of a vertex.
#[derive(Clone, Debug, Default)]
struct Ring {
    sum: DVec3,
    count: u32,
    boundary_sum: DVec3,
    boundary_count: u32,
}

impl Ring {
    /// Weight of each neighbour of an inner vertex.
    fn beta(&self) -> f64 {
        let count = f64::from(self.count.max(1));
        if self.count == 3 { 3.0 / 16.0 } else { 3.0 / (8.0 * count) }
    }

    /// Blends a vertex with its neighbours, of which each has a weight.
    fn blend(&self, position: DVec3, inner_weight: f64, boundary_weight: f64) -> DVec3 {
        let (sum, count, weight) = if self.boundary_count > 0 {
            (self.boundary_sum, self.boundary_count, boundary_weight)
        } else {
            (self.sum, self.count, inner_weight)
        };
        position * (1.0 - f64::from(count) * weight) + sum * weight
    }
}

/// Edge with the corners across it in its triangles.
#[derive(Clone, Copy, Debug, Default)]
struct Edge {
    across: [u32; 2],
    triangles: u32,
}

fn edges(triangles: &[[u32; 3]]) -> HashMap<[u32; 2], Edge> {
    let mut edges: HashMap<[u32; 2], Edge> = HashMap::with_capacity(triangles.len() * 3 / 2);
    for &[a, b, c] in triangles {
        for (from, to, across) in [(a, b, c), (b, c, a), (c, a, b)] {
            let edge = edges.entry([from.min(to), from.max(to)]).or_default();
            if let Some(place) = edge.across.get_mut(edge.triangles as usize) {
                *place = across;
            }
            edge.triangles = edge.triangles.saturating_add(1);
        }
    }
    edges
}

fn rings(positions: &[DVec3], edges: &HashMap<[u32; 2], Edge>) -> Vec<Ring> {
    let mut rings = vec![Ring::default(); positions.len()];
    for (&[from, to], edge) in edges {
        for (vertex, neighbour) in [(from, to), (to, from)] {
            let (ring, neighbour) = (&mut rings[vertex as usize], positions[neighbour as usize]);
            ring.sum += neighbour;
            ring.count += 1;
            if edge.triangles != 2 {
                ring.boundary_sum += neighbour;
                ring.boundary_count += 1;
            }
        }
    }
    rings
}

/// Subdivides a mesh, with normals from the triangles around each vertex of the result. Fails for levels that
/// are out of range or make too many triangles.
pub(super) fn subdivide(
    positions: &[[f32; 3]],
    mut triangles: Vec<[u32; 3]>,
    levels: i64,
) -> Result<Mesh, String> {
    let found = u32::try_from(levels).ok().filter(|_| levels <= MAX_LEVELS);
    let count = found.and_then(|levels| triangles.len().checked_mul(1 << (2 * levels)));
    if count.is_none_or(|count| count > MAX_TRIANGLES) {
        return Err(format!(
            "expected `levels` that make at most {MAX_TRIANGLES} triangles of {}, found {levels}",
            triangles.len()
        ));
    }
    let mut positions: Vec<DVec3> =
        positions.iter().map(|&position| Vec3::from_array(position).as_dvec3()).collect();
    for _ in 0..levels {
        (positions, triangles) = refine(&positions, &triangles);
    }
    let edges = edges(&triangles);
    let limit: Vec<DVec3> = positions
        .iter()
        .zip(rings(&positions, &edges))
        .map(|(&position, ring)| {
            let gamma = 1.0 / (f64::from(ring.count) + 3.0 / (8.0 * ring.beta()));
            ring.blend(position, gamma, 0.2)
        })
        .collect();
    let mut normals = vec![DVec3::ZERO; limit.len()];
    for triangle in &triangles {
        let [a, b, c] = triangle.map(|at| limit[at as usize]);
        triangle.iter().for_each(|&at| normals[at as usize] += (b - a).cross(c - a));
    }
    Ok(Mesh {
        positions: limit.iter().map(|position| position.as_vec3().to_array()).collect(),
        normals: normals.iter().map(|n| n.normalize_or_zero().as_vec3().to_array()).collect(),
        triangles,
        ..Mesh::default()
    })
}

/// Makes four triangles of each.
fn refine(positions: &[DVec3], triangles: &[[u32; 3]]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let edges = edges(triangles);
    let rings = rings(positions, &edges);
    let mut refined: Vec<DVec3> = positions
        .iter()
        .zip(&rings)
        .map(|(&position, ring)| ring.blend(position, ring.beta(), 0.125))
        .collect();
    let mut middles = HashMap::with_capacity(edges.len());
    let mut middle = |from: u32, to: u32| {
        let key = [from.min(to), from.max(to)];
        *middles.entry(key).or_insert_with(|| {
            let at = |vertex: u32| positions[vertex as usize];
            let ends = at(from) + at(to);
            let edge = edges.get(&key).copied().unwrap_or_default();
            refined.push(if edge.triangles == 2 {
                0.375 * ends + 0.125 * (at(edge.across[0]) + at(edge.across[1]))
            } else {
                0.5 * ends
            });
            (refined.len() - 1) as u32
        })
    };
    let mut cut = Vec::with_capacity(triangles.len() * 4);
    for &[a, b, c] in triangles {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        cut.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    (refined, cut)
}
