//! Shapes → triangles in world space with their materials.

use std::{borrow::Cow, f64::consts::PI, sync::Arc};

use glam::{DAffine3, DMat3, DMat4, DVec3, Vec2, Vec3};

use super::{
    Reader,
    bsdfs::{default_of_shapes, diffuse},
    document::Node,
    parameters::{NO_INVERSE, Parameters},
    serialized,
};
use crate::{
    error::Result,
    features, files,
    geometry::check_extent,
    instance::{Instance, MAX_INSTANCES},
    material::Opacity,
    mesh::Mesh,
    quadrics,
    shapes::check_triangles,
    transform::Transform,
};

/// Most groups in one another; Mitsuba allows one.
const MAX_GROUPS: usize = 4;

/// Shape as it stands in its group or in the scene.
#[derive(Debug, Default)]
pub(super) struct Shape {
    mesh: Mesh,
    to_world: DMat4,
    material: u32,
    /// True if triangles turn their other side out, by `flip_normals`.
    flips: bool,
    /// True for a mesh file, which is as large as it is.
    is_file: bool,
}

impl Shape {
    /// True for a sphere, whose mesh is that of all others.
    fn is_ball(&self, node: Node<'_>) -> bool {
        node.kind() == "sphere" && self.mesh.tangents.is_empty()
    }

    /// The mesh as it is under a transform that mirrors or not.
    fn turned(&self, mirrors: bool) -> Cow<'_, Mesh> {
        let mirrors_tangents = mirrors && !self.mesh.tangents.is_empty();
        if !self.flips && !mirrors_tangents {
            return Cow::Borrowed(&self.mesh);
        }
        let mut mesh = self.mesh.clone();
        if self.flips {
            mesh.reverse();
        }
        if mirrors_tangents {
            // Mitsuba's bitangent is the normal × the tangent in the world.
            mesh.tangents.iter_mut().for_each(|tangent| tangent[3] = -tangent[3]);
        }
        Cow::Owned(mesh)
    }
}

impl Reader {
    /// Reads a shape, and places it unless it is a group.
    pub(super) fn shape(&mut self, node: Node<'_>) -> Result<()> {
        if node.kind() == "shapegroup" {
            return Ok(());
        }
        self.place(node, DMat4::IDENTITY, MAX_GROUPS)
    }

    /// Tests for a shape that can be read, and names one that cannot: of an unknown kind, or of a file that
    /// is not there.
    fn can_be_read(&mut self, node: Node<'_>) -> Result<bool> {
        match node.kind() {
            "obj" | "ply" | "serialized" | "rectangle" | "cube" | "sphere" | "disk"
            | "cylinder" | "bsplinecurve" | "linearcurve" | "hair" => {}
            kind => {
                let name = format!("shapes of the kind `{kind}`");
                self.ignored.add_named(features::MI_SHAPE, &name, || node.place());
                return Ok(false);
            }
        }
        let Some(name) = Parameters::new(node).string("filename")? else { return Ok(true) };
        let is_there = node.file_if_there(name)?.is_some();
        if !is_there {
            self.ignored.add(features::MI_MISSING, || format!("`{name}`, {}", node.place()));
        }
        Ok(is_there)
    }

    fn place(&mut self, node: Node<'_>, outer: DMat4, groups_left: usize) -> Result<()> {
        if node.kind() == "instance" {
            return self.instance(node, outer, groups_left);
        }
        let is_shared = groups_left < MAX_GROUPS;
        let shape = match self.shapes.get(&node.index).cloned() {
            Some(shape) => shape,
            None if !self.can_be_read(node)? => return Ok(()),
            None => {
                let shape = Arc::new(self.read_shape(node)?);
                if is_shared {
                    self.shapes.insert(node.index, Arc::clone(&shape));
                }
                shape
            }
        };
        let name = node.attribute("id").map_or_else(|| node.place(), str::to_owned);
        self.geometry.start_object(&name);
        let triangles = shape.mesh.triangles.len();
        let matrix = outer * shape.to_world;
        // Surfaces that emit are placed: lamps are triangles in the world.
        let emits = self.materials[shape.material as usize].surface.emission.is_some();
        // Pictures of point clouds have thousands of balls, which are copies of one.
        let is_copy = is_shared || shape.is_ball(node);
        if is_copy && !emits && self.budget.takes_instances(1, triangles) {
            return self.add_instance(node, &shape, matrix);
        }
        if is_shared || !shape.is_file {
            self.repeated_triangles += triangles;
            check_triangles(self.repeated_triangles).map_err(|message| node.error(message))?;
        }
        self.append(node, &shape, matrix)
    }

    /// Adds an instance of a shape of a group, or of a ball, whose mesh is in memory once for each way to
    /// turn it.
    fn add_instance(&mut self, node: Node<'_>, shape: &Shape, matrix: DMat4) -> Result<()> {
        if self.geometry.instances.len() >= MAX_INSTANCES {
            return Err(node.error(format!("at most {MAX_INSTANCES} instances can be used")));
        }
        let transform = placement(node, matrix)?;
        let key = match shape.is_ball(node) {
            true => (usize::MAX, shape.flips),
            false => (node.index, transform.mirrors),
        };
        let prototype = match self.prototypes.get(&key) {
            Some(prototype) => *prototype,
            None => {
                let mesh = shape.turned(transform.mirrors);
                let (prototype, dropped) = self.geometry.add_prototype(&mesh, |_| 0);
                self.dropped
                    .add(dropped, mesh.triangles.len(), || format!("shape of {}", node.place()));
                self.prototypes.insert(key, prototype);
                prototype
            }
        };
        let Some(instance) = Instance::new(prototype.index, &transform, shape.material, true)
        else {
            return self.append(node, shape, matrix);
        };
        check_extent(prototype.corners(&instance)).map_err(|message| node.error(message))?;
        self.geometry.instances.push(instance);
        Ok(())
    }

    fn instance(&mut self, node: Node<'_>, outer: DMat4, groups_left: usize) -> Result<()> {
        let Some(groups_left) = groups_left.checked_sub(1) else {
            return Err(node.error("a shapegroup contains itself, or is nested too deep"));
        };
        let parameters = Parameters::new(node);
        let group = parameters.object("shape")?;
        let Some(group) = group.filter(|group| group.kind() == "shapegroup") else {
            return Err(node.error("instance: expected a reference to a shapegroup"));
        };
        let matrix = outer * parameters.transform("to_world")?;
        let inside = Parameters::new(group);
        for shape in inside.objects("shape")? {
            self.place(shape, matrix, groups_left)?;
        }
        inside.finish(&mut self.ignored);
        parameters.finish(&mut self.ignored);
        Ok(())
    }

    fn append(&mut self, node: Node<'_>, shape: &Shape, matrix: DMat4) -> Result<()> {
        let transform = placement(node, matrix)?;
        let first_vertex = self.geometry.positions.len();
        let mesh = shape.turned(transform.mirrors);
        let counts = self.geometry.counts(mesh.positions.len(), mesh.triangles.len());
        counts.map_err(|message| node.error(message))?;
        let dropped = self.geometry.append(&mesh, &transform, |_| shape.material);
        self.dropped.add(dropped, mesh.triangles.len(), || format!("shape of {}", node.place()));
        let placed = self.geometry.positions[first_vertex..].iter().copied().map(Vec3::from);
        check_extent(placed).map_err(|message| node.error(message))
    }

    fn read_shape(&mut self, node: Node<'_>) -> Result<Shape> {
        let parameters = Parameters::new(node);
        let to_world = parameters.transform("to_world")?;
        let flips = parameters.boolean("flip_normals")?.unwrap_or(false);
        // Mitsuba computes some normals after the shape's transform, though before that of an instance.
        let mirrors = to_world.determinant() < 0.0;
        let mut shape = Shape { to_world, flips, ..Shape::default() };
        let radius = || Ok(parameters.float_in("radius", (1e-9, 1e9))?.unwrap_or(1.0));
        match node.kind() {
            "obj" | "ply" | "serialized" => self.mesh_file(&parameters, &mut shape)?,
            "rectangle" => shape.mesh = quadrics::rectangle(),
            "cube" => {
                shape.mesh = quadrics::cube();
                if parameters.boolean("face_normals")?.unwrap_or(false) {
                    shape.mesh.normals.clear();
                    shape.flips ^= mirrors;
                }
            }
            "disk" => shape.mesh = quadrics::disk(1.0, 0.0, 1.0),
            "sphere" => {
                let center = parameters.vector("center")?.unwrap_or(Vec3::ZERO);
                shape.mesh = quadrics::sphere(1.0, [0.0, PI], 1.0);
                shape.to_world *= DMat4::from_translation(center.as_dvec3())
                    * DMat4::from_scale(DVec3::splat(f64::from(radius()?)));
                // Mitsuba 3.9.1 turns mirrored spheres inside out, but no other round shape.
                shape.flips ^= mirrors;
            }
            "cylinder" => {
                let point = |name: &str, default: Vec3| {
                    Ok(parameters.vector(name)?.unwrap_or(default).as_dvec3())
                };
                let (from, to) = (point("p0", Vec3::ZERO)?, point("p1", Vec3::Z)?);
                shape.mesh = quadrics::cylinder(radius()?, [0.0, 1.0], 1.0);
                let Some(frame) = frame_along(to - from) else {
                    return Err(node.error("cylinder: expected `p0` and `p1` to differ"));
                };
                shape.to_world *= DMat4::from(DAffine3::from_mat3_translation(frame, from));
            }
            "bsplinecurve" | "linearcurve" | "hair" => {
                shape.mesh = self.strands(&parameters, to_world)?;
                shape.to_world = DMat4::IDENTITY;
                shape.is_file = true;
            }
            // Others have been left out.
            _ => {}
        }
        shape.material = self.material(&parameters)?;
        let surface = &self.materials[shape.material as usize].surface;
        if !surface.vertex_color {
            shape.mesh.colors.clear();
        }
        if surface.reads_uvs() && shape.mesh.uvs[0].is_empty() {
            // Mitsuba gives every triangle half of the image.
            shape.mesh.spread([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
        }
        // Heights bend along the axes of their image, whose directions the triangles have.
        let has_tangents = surface.normal.as_ref().is_some_and(|normal| !self.reliefs.hold(normal));
        if has_tangents && !shape.mesh.uvs[0].is_empty() {
            shape.mesh.tangents = tangents(&shape.mesh);
        }
        parameters.finish(&mut self.ignored);
        Ok(shape)
    }

    fn mesh_file(&mut self, parameters: &Parameters<'_>, shape: &mut Shape) -> Result<()> {
        let node = parameters.node;
        let name = parameters.required("filename", parameters.string("filename")?)?;
        let path = node.file(name)?;
        let mut is_flat = parameters.boolean("face_normals")?.unwrap_or(false);
        let kind = node.kind();
        if files::extension(&path) != kind {
            return Err(node.error(format!("{kind}: expected a file in .{kind}, found `{name}`")));
        }
        let is_obj = kind == "obj";
        let mut mesh = if kind == "serialized" {
            let index = parameters.integer("shape_index")?.unwrap_or(0);
            let index = usize::try_from(index).map_err(|_| {
                node.error(format!("shape_index: expected 0 or more, found {index}"))
            })?;
            let (mesh, own_flat) = serialized::read(&path, index)?;
            is_flat |= own_flat;
            mesh
        } else {
            let mut warnings = Vec::new();
            let mesh = Mesh::read(&path, &mut warnings)?;
            // The materials of an OBJ file do not count, nor what is wrong with them.
            self.warnings.extend(warnings.into_iter().filter(|_| !is_obj));
            mesh
        };
        if parameters.boolean("flip_tex_coords")?.unwrap_or(is_obj) {
            mesh.uvs.iter_mut().flatten().for_each(|uv| uv[1] = 1.0 - uv[1]);
        }
        self.inputs.push(path);
        if is_flat {
            mesh.normals.clear();
        }
        shape.flips ^= mesh.normals.is_empty() && shape.to_world.determinant() < 0.0;
        if mesh.normals.is_empty() && !is_flat {
            mesh.normals = smooth_normals(&mesh);
        }
        // The shape is one object.
        mesh.objects.clear();
        shape.mesh = mesh;
        shape.is_file = true;
        Ok(())
    }

    /// Material of a shape's model and light, shared by shapes of the same.
    fn material(&mut self, parameters: &Parameters<'_>) -> Result<u32> {
        let model = parameters.object("bsdf")?;
        let light = parameters.object("emitter")?;
        let interior = parameters.any("interior")?;
        let key = [model, light, interior].map(|node| node.map(|node| node.index));
        if let Some(&material) = self.material_numbers.get(&key) {
            return Ok(material);
        }
        let mut material = match model {
            Some(node) => self.model(node)?,
            None if light.is_some() => diffuse(0.0),
            None => default_of_shapes(),
        };
        if let Some(light) = light
            && let Some(mut emission) = self.emission(light)?
        {
            // Mitsuba's lights shine where their surface is cut away too.
            let opacity = &mut material.surface.opacity;
            if opacity.factor == 0.0 || opacity.texture.is_some() {
                self.ignored.add(features::MI_CUT_LIGHT, || light.place());
            }
            if opacity.factor == 0.0 {
                *opacity = Opacity::default();
            } else {
                emission.radiance /= opacity.factor;
            }
            material.surface.emission = Some(emission);
            material.name += &format!(", light of {}", light.place());
        }
        if let Some(medium) = interior {
            self.fill(&mut material.kind, medium)?;
            material.name += &format!(", medium of {}", medium.place());
        }
        for medium in parameters.objects("medium")? {
            if interior.is_none_or(|inside| inside.index != medium.index) {
                self.ignored.add(features::MI_MEDIUM, || medium.place());
            }
        }
        let number = self.materials.len() as u32;
        self.materials.push(material);
        self.material_numbers.insert(key, number);
        Ok(number)
    }
}

fn placement(node: Node<'_>, matrix: DMat4) -> Result<Transform> {
    Transform::from_matrix(matrix).ok_or_else(|| node.error(NO_INVERSE))
}

/// Axes whose z leads along `axis` with its length, as Mitsuba chooses the others \[Duff et al. 2017\].
fn frame_along(axis: DVec3) -> Option<DMat3> {
    let (x, y) = axis.try_normalize()?.any_orthonormal_pair();
    Some(DMat3::from_cols(x, y, axis))
}

/// Tangents of vertices along u, as the bumps of a normal map need them: the bitangent is the normal ×
/// the tangent, also where texture coordinates are mirrored.
fn tangents(mesh: &Mesh) -> Vec<[f32; 4]> {
    let mut tangents = vec![Vec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|at| Vec3::from_array(mesh.positions[at as usize]));
        let [u, v, w] = triangle.map(|at| Vec2::from_array(mesh.uvs[0][at as usize]));
        let (along, across) = (v - u, w - u);
        let determinant = along.perp_dot(across);
        let tangent = (b - a) * across.y - (c - a) * along.y;
        let Some(tangent) = (tangent * determinant.signum()).try_normalize() else { continue };
        for corner in triangle {
            tangents[*corner as usize] += tangent;
        }
    }
    tangents.iter().map(|tangent| tangent.normalize_or_zero().extend(1.0).to_array()).collect()
}

/// Normals of vertices from those of their triangles, by the angle of the corner \[Thürmer & Wüthrich
/// 1998\]; zero where there are none.
fn smooth_normals(mesh: &Mesh) -> Vec<[f32; 3]> {
    let mut normals = vec![DVec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let corners = triangle.map(|at| Vec3::from_array(mesh.positions[at as usize]).as_dvec3());
        let [a, b, c] = corners;
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        for corner in 0..3 {
            let own = corners[corner];
            let sides = [corners[(corner + 1) % 3] - own, corners[(corner + 2) % 3] - own];
            let angle = sides[0].angle_between(sides[1]);
            if angle.is_finite() {
                normals[triangle[corner] as usize] += normal * angle;
            }
        }
    }
    normals.iter().map(|normal| normal.normalize_or_zero().as_vec3().to_array()).collect()
}
