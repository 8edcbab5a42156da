//! Shapes of a scene description → meshes in the space of the shape, counter-clockwise from the side
//! of the normal.

use glam::{DVec3, DVec4, Vec3};

use super::{
    parameters::{Entity, Kind, Log},
    subdivision::{MAX_TRIANGLES, subdivide},
};
use crate::{
    error::Result,
    features,
    mesh::{Mesh, ply},
    quadrics,
    strands::{Basis, Detail},
};

/// Columns and rows of a bilinear patch that is not flat, or whose coordinates are not linear.
const PATCH_CELLS: u32 = 16;

/// Makes the mesh of a shape.
pub(super) fn mesh(entity: &Entity, strands: &mut Detail, log: &mut Log) -> Result<Mesh> {
    let mut mesh = match entity.name.as_str() {
        "trianglemesh" => triangle_mesh(entity, log)?,
        "plymesh" => {
            let file = entity.required("filename")?;
            let path = log.folder.file(file).map_err(|message| entity.error(message))?;
            if !path.exists() {
                let name = format!("mesh `{file}`, which is not there");
                log.ignore_named(features::PBRT_MISSING, &name, &entity.place);
                entity.without_effect("alpha displacement displacement.edgelength");
                return Ok(Mesh::default());
            }
            let mut mesh = ply::read(&path, &mut log.warnings)
                .map_err(|error| entity.error(error.to_string()))?;
            // pbrt does not read them.
            mesh.colors.clear();
            for name in ["displacement", "displacement.edgelength"] {
                log.ignore(features::PBRT_DISPLACEMENT, entity.place_of(name));
            }
            log.inputs.push(path);
            mesh
        }
        "loopsubdiv" => {
            let positions = positions(entity)?;
            let triangles = groups(entity, positions.len())?;
            let scheme = entity.place_of("scheme");
            log.ignore_named(features::PBRT_PARAMETER, "parameter `scheme`", scheme);
            let levels = entity.number("levels", 3.0)?;
            subdivide(&positions, triangles, levels as i64)
                .map_err(|message| entity.error(message))?
        }
        "bilinearmesh" => bilinear_mesh(entity, log)?,
        "sphere" | "disk" | "cylinder" => quadric(entity)?,
        "curve" => curve(entity, strands, log)?,
        other => return Err(entity.error(format!("unknown shape `{other}`"))),
    };
    face_normals(&mut mesh);
    Ok(mesh)
}

fn vector<const N: usize>(numbers: &[f64]) -> Vec<[f32; N]> {
    let vectors = numbers.chunks_exact(N);
    vectors.map(|numbers| std::array::from_fn(|index| numbers[index] as f32)).collect()
}

fn positions(entity: &Entity) -> Result<Vec<[f32; 3]>> {
    let positions = vector(entity.numbers("P", Kind::Triple)?);
    if positions.is_empty() {
        return Err(entity.error("expected vertex positions `P`"));
    }
    Ok(positions)
}

/// Reads `indices`, in groups of `N`; `0 1 2 …` for as many vertices as one group needs.
fn groups<const N: usize>(entity: &Entity, vertex_count: usize) -> Result<Vec<[u32; N]>> {
    let Some(parameter) = entity.find_of("indices", &[Kind::Integer])? else {
        if vertex_count == N {
            return Ok(vec![std::array::from_fn(|index| index as u32)]);
        }
        return Err(entity.error(format!("expected `indices` of {vertex_count} vertices")));
    };
    let indices = parameter.numbers();
    if let Some(found) = indices.iter().find(|index| !(0.0..vertex_count as f64).contains(*index)) {
        let message = format!("the index {found} is out of range of {vertex_count} vertices");
        return Err(parameter.place.error(format!("{}: {message}", entity.label())));
    }
    if indices.len() % N != 0 {
        let message = format!("expected a multiple of {N} indices, found {}", indices.len());
        return Err(parameter.place.error(format!("{}: {message}", entity.label())));
    }
    let groups = indices.chunks_exact(N);
    Ok(groups.map(|indices| std::array::from_fn(|at| indices[at] as u32)).collect())
}

/// Reads an attribute of vertices: nothing, or one for each; of another length it is named and left out.
fn attribute<const N: usize>(
    entity: &Entity,
    name: &str,
    kind: Kind,
    vertex_count: usize,
    log: &mut Log,
) -> Result<Vec<[f32; N]>> {
    let mut found = vector(entity.numbers(name, kind)?);
    if !found.is_empty() && found.len() != vertex_count {
        let name = format!("`{name}` of another number than the vertices");
        log.ignore_named(features::PBRT_PARAMETER, &name, &entity.place);
        found.clear();
    }
    Ok(found)
}

fn triangle_mesh(entity: &Entity, log: &mut Log) -> Result<Mesh> {
    let positions = positions(entity)?;
    let count = positions.len();
    let tangents = entity.place_of("S");
    log.ignore_named(features::PBRT_PARAMETER, "tangents `S` of meshes", tangents);
    // They number faces for Ptex alone.
    entity.find("faceIndices");
    Ok(Mesh {
        triangles: groups(entity, count)?,
        normals: attribute(entity, "N", Kind::Triple, count, log)?,
        uvs: [attribute(entity, "uv", Kind::Pair, count, log)?, Vec::new()],
        positions,
        ..Mesh::default()
    })
}

fn quadric(entity: &Entity) -> Result<Mesh> {
    let radius = entity.number("radius", 1.0)? as f32;
    if !(radius > 0.0 && radius.is_finite()) {
        return Err(entity.error(format!("expected a radius above 0, found {radius}")));
    }
    let turns = (entity.number("phimax", 360.0)? / 360.0).clamp(0.0, 1.0);
    let limits = |size: f64| -> Result<[f64; 2]> {
        let [a, b] = [entity.number("zmin", -size)?, entity.number("zmax", size)?];
        Ok([a.min(b), a.max(b)])
    };
    Ok(match entity.name.as_str() {
        "sphere" => {
            let radius = f64::from(radius);
            let angle = |z: f64| (f64::from(z as f32) / radius).clamp(-1.0, 1.0).acos();
            let [low, high] = limits(radius)?.map(angle);
            let mut mesh = quadrics::sphere(radius as f32, [high, low], turns);
            // v runs from −z to +z.
            mesh.uvs[0].iter_mut().for_each(|uv| uv[1] = 1.0 - uv[1]);
            mesh
        }
        "disk" => {
            let inner = entity.number("innerradius", 0.0)? as f32;
            let height = entity.number("height", 0.0)? as f32;
            if !(0.0..radius).contains(&inner) {
                let message = "expected an `innerradius` from 0 to below the radius, found";
                return Err(entity.error(format!("{message} {inner}")));
            }
            let mut mesh = quadrics::disk(radius, inner, turns);
            mesh.positions.iter_mut().for_each(|position| position[2] += height);
            // u goes around, v from the rim inward.
            for uv in &mut mesh.uvs[0] {
                *uv = [uv[1], radius * (1.0 - uv[0]) / (radius - inner)];
            }
            mesh
        }
        _ => quadrics::cylinder(radius, limits(1.0)?.map(|z| z as f32), turns),
    })
}

fn basis(entity: &Entity) -> Result<Basis> {
    let degree = match entity.number("degree", 3.0)? {
        2.0 => 2,
        3.0 => 3,
        found => return Err(entity.error(format!("expected a degree of 2 or 3, found {found}"))),
    };
    match entity.string("basis")?.unwrap_or("bezier") {
        "bezier" => Ok(Basis::Bezier(degree)),
        "bspline" => Ok(Basis::Spline(degree)),
        found => {
            Err(entity.error(format!("expected the basis bezier or bspline, found `{found}`")))
        }
    }
}

/// Fineness for all curves of a file.
pub(super) fn detail<'a>(shapes: impl Iterator<Item = &'a Entity>) -> Detail {
    let spans = |entity: &Entity| {
        basis(entity).ok()?.spans(entity.numbers("P", Kind::Triple).ok()?.len() / 3)
    };
    Detail::of(shapes.filter(|entity| entity.name == "curve").filter_map(spans).sum())
}

fn curve(entity: &Entity, strands: &mut Detail, log: &mut Log) -> Result<Mesh> {
    let basis = basis(entity)?;
    let positions = positions(entity)?;
    let Some(spans) = basis.spans(positions.len()) else {
        let message = format!("{} control points make no curve", positions.len());
        return Err(entity.error(message));
    };
    let width = entity.number("width", 1.0)?;
    let [from, to] = [entity.number("width0", width)?, entity.number("width1", width)?];
    // All kinds are as wide to a ray.
    entity.without_effect("type N splitdepth");
    // Widths that are linear in the number of a control point are linear along the curve.
    let [shift, length] = match basis {
        Basis::Spline(degree) => [0.5 * (degree as f64 - 1.0), spans as f64],
        _ => [0.0, positions.len() as f64 - 1.0],
    };
    let controls: Vec<DVec4> = (positions.iter().enumerate())
        .map(|(index, position)| {
            let along = (index as f64 - shift) / length;
            Vec3::from_array(*position).as_dvec3().extend(0.5 * (from + (to - from) * along))
        })
        .collect();
    let name = match strands.step {
        1 => features::PBRT_CURVE.name.to_owned(),
        step => format!("exact form of `curve`, and all but one of {step}, thicker by as much"),
    };
    log.ignore_named(features::PBRT_CURVE, &name, &entity.place);
    let mut mesh = Mesh::default();
    strands.add(&mut mesh, basis, &controls);
    Ok(mesh)
}

fn bilinear_mesh(entity: &Entity, log: &mut Log) -> Result<Mesh> {
    let positions = positions(entity)?;
    let count = positions.len();
    let patches: Vec<[u32; 4]> = groups(entity, count)?;
    let normals: Vec<[f32; 3]> = attribute(entity, "N", Kind::Triple, count, log)?;
    let uvs: Vec<[f32; 2]> = attribute(entity, "uv", Kind::Pair, count, log)?;
    entity.find("faceIndices");
    log.ignore(features::PBRT_EMISSION_IMAGE, entity.place_of("emissionfilename"));
    if patches.len().saturating_mul(2 * (PATCH_CELLS * PATCH_CELLS) as usize) > MAX_TRIANGLES {
        let message = format!("{} patches, more than can be cut into triangles", patches.len());
        return Err(entity.error(message));
    }
    let mut mesh = Mesh::default();
    for patch in patches {
        let corners = patch.map(|at| Vec3::from_array(positions[at as usize]).as_dvec3());
        let normals = (!normals.is_empty())
            .then(|| patch.map(|at| Vec3::from_array(normals[at as usize]).as_dvec3()));
        let uvs = match uvs.is_empty() {
            true => [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]],
            false => patch.map(|at| uvs[at as usize]),
        };
        push_patch(&mut mesh, corners, normals, uvs);
    }
    Ok(mesh)
}

/// Adds a patch with the corners p00, p10, p01 and p11.
fn push_patch(
    mesh: &mut Mesh,
    corners: [DVec3; 4],
    normals: Option<[DVec3; 4]>,
    uvs: [[f32; 2]; 4],
) {
    let [p00, p10, p01, p11] = corners;
    // A parallelogram is two triangles, with linear coordinates.
    let size = (p11 - p00).abs().max_element();
    let cells =
        if (p00 + p11 - p10 - p01).abs().max_element() <= 1e-6 * size { 1 } else { PATCH_CELLS };
    let first = mesh.positions.len() as u32;
    for row in 0..=cells {
        for column in 0..=cells {
            let (u, v) = (f64::from(column) / f64::from(cells), f64::from(row) / f64::from(cells));
            let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
            let blend = |values: [DVec3; 4]| -> DVec3 {
                values.iter().zip(weights).map(|(value, weight)| *value * weight).sum()
            };
            let normal = match normals {
                Some(normals) => blend(normals),
                None => {
                    let along_u = (p10 - p00).lerp(p11 - p01, v);
                    along_u.cross((p01 - p00).lerp(p11 - p10, u))
                }
            };
            mesh.positions.push(blend(corners).as_vec3().to_array());
            mesh.normals.push(normal.normalize_or_zero().as_vec3().to_array());
            let uv = [0, 1].map(|axis| {
                let values = uvs.iter().zip(weights);
                values.map(|(uv, weight)| uv[axis] * weight as f32).sum()
            });
            mesh.uvs[0].push(uv);
        }
    }
    for row in 0..cells {
        for column in 0..cells {
            let at = first + row * (cells + 1) + column;
            mesh.triangles.push([at, at + 1, at + cells + 2]);
            mesh.triangles.push([at, at + cells + 2, at + cells + 1]);
        }
    }
}

/// Turns triangles whose vertex normals point to the other side: these tell the outside in pbrt.
fn face_normals(mesh: &mut Mesh) {
    if mesh.normals.is_empty() {
        return;
    }
    for triangle in &mut mesh.triangles {
        let at = |values: &[[f32; 3]]| {
            triangle.map(|corner| Vec3::from_array(values[corner as usize]).as_dvec3())
        };
        let [a, b, c] = at(&mesh.positions);
        let shading: DVec3 = at(&mesh.normals).iter().sum();
        if (b - a).cross(c - a).dot(shading) < 0.0 {
            triangle.swap(1, 2);
        }
    }
}

/// Gives a mesh without texture coordinates those of pbrt: (0, 0), (1, 0) and (1, 1) on every triangle. Fails
/// for more corners than indices can address.
pub(super) fn give_coordinates(mesh: &mut Mesh) -> Result<(), String> {
    if !mesh.uvs[0].is_empty() {
        return Ok(());
    }
    if mesh.triangles.len() > MAX_TRIANGLES {
        return Err("too many triangles without texture coordinates under a texture".to_owned());
    }
    mesh.spread([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
    Ok(())
}

/// Gives a mesh tangents along u for normal maps, with the bitangent n × tangent of pbrt; `mirrors`
/// tells whether the placement of the shape, before any mirror of the whole world, does.
pub(super) fn give_tangents(mesh: &mut Mesh, mirrors: bool) {
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|at| Vec3::from_array(mesh.positions[at as usize]).as_dvec3());
        let [s, t, r] = triangle.map(|at| mesh.uvs[0][at as usize].map(f64::from));
        let (first, second) = ([t[0] - s[0], t[1] - s[1]], [r[0] - s[0], r[1] - s[1]]);
        let determinant = first[0] * second[1] - first[1] * second[0];
        let along_u = (b - a) * second[1] - (c - a) * first[1];
        // The sum weighs triangles by their area.
        let tangent = along_u * determinant.signum();
        for corner in triangle {
            sums[*corner as usize] += if determinant == 0.0 { DVec3::ZERO } else { tangent };
        }
    }
    let sign = if mirrors { -1.0 } else { 1.0 };
    let tangent = |sum: &DVec3| sum.normalize_or_zero().as_vec3().extend(sign).to_array();
    mesh.tangents = sums.iter().map(tangent).collect();
}
