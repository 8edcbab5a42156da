//! glTF 2.0 (`.gltf` with buffers beside it or inline, `.glb`): meshes with the transforms of their
//! nodes, materials with their textures, lamps and cameras.
//!
//! Names everything else that a file holds ([`features::GLTF`](crate::features::GLTF)) in a
//! warning, or refuses it. Reads the accessors itself and checks every range.

mod accessors;
mod animation;
mod compression;
mod contents;
mod document;
mod lamps;
mod material;
mod primitive;
mod textures;

use std::{
    collections::{HashMap, HashSet},
    path::Path,
    sync::Arc,
};

use glam::Mat4;
use gltf::{Document, Node, buffer::Source};
use primitive::Place;
use serde_json::Value;

use self::material::Pane;
use super::{Mesh, MeshCamera};
use crate::{
    error::{Error, Result},
    features::Ignored,
    files,
    instance::Budget,
    texture::{Texture, TextureCache},
};

const GLB_HEADER_BYTES: usize = 12;

/// Reads a glTF file with its buffers and images; `warnings` counts the parts that are left out. With a
/// budget, meshes whose copies exceed it are not copied; with a time, in seconds, nodes stand where the
/// animations move them; with the name of a variant, primitives have its materials. Fails with [`Error::Io`]
/// for a file that cannot be read, with [`Error::Parse`] for bad JSON, else with [`Error::Format`].
pub fn read(
    path: &Path,
    time: Option<f32>,
    variant: Option<&str>,
    budget: Option<Budget>,
    warnings: &mut Vec<String>,
) -> Result<Mesh> {
    let bytes = files::read(path)?;
    if let (Some(b"glTF"), Some(&[a, b, c, d])) = (bytes.get(..4), bytes.get(8..12)) {
        let stated = u32::from_le_bytes([a, b, c, d]) as usize;
        if stated > bytes.len() {
            let message =
                format!("truncated: the header states {stated} bytes, found {}", bytes.len());
            return Err(Error::format(path, message));
        }
        // The crate subtracts the bytes of the header without a look.
        if stated < GLB_HEADER_BYTES {
            let message = format!(
                "the header states {stated} bytes, expected at least its own {GLB_HEADER_BYTES}"
            );
            return Err(Error::format(path, message));
        }
    }
    let (document, blob, json) = document::parse(path, &bytes, variant)?;
    drop(bytes);
    let mut buffers = document::read_buffers(path, &document, &json, blob)?;
    let root = compression::expand(path, document, &json, &mut buffers)?;
    let document = document::checked(path, root)?;
    let mut reader = GltfReader {
        path,
        document: &document,
        json: &json,
        buffers,
        mesh: Mesh::default(),
        budget,
        copies: HashMap::new(),
        repeated: HashMap::new(),
        materials: HashMap::new(),
        panes: HashMap::new(),
        embedded: HashMap::new(),
        images: TextureCache::default(),
        cameras: Vec::new(),
        ignored: Ignored::default(),
        warnings,
    };
    let buffer_files = document.buffers().filter_map(|buffer| match buffer.source() {
        Source::Uri(uri) if !uri.starts_with("data:") => document::beside(path, uri).ok(),
        _ => None,
    });
    reader.mesh.variants = document::variant_names(&json);
    reader.mesh.side_files = buffer_files.collect();
    reader.read_scene(time)?;
    let mut mesh = reader.mesh;
    mesh.side_files.extend(reader.images.files());
    reader.cameras.sort_by_key(|(index, _)| *index);
    mesh.cameras = reader.cameras.into_iter().map(|(_, camera)| camera).collect();
    let ignored = reader.ignored.warnings(path);
    warnings.extend(ignored);
    mesh.part_coincident(path, warnings);
    mesh.complete_tangents(-1.0);
    for part in &mut mesh.repeated {
        // Tangents depend on the materials, which the whole has.
        std::mem::swap(&mut part.mesh.materials, &mut mesh.materials);
        part.mesh.complete_tangents(-1.0);
        std::mem::swap(&mut part.mesh.materials, &mut mesh.materials);
    }
    Ok(mesh)
}

/// Number of a part of the document; none for other values.
fn index(json: &Value) -> Option<usize> {
    json.as_u64().and_then(|number| usize::try_from(number).ok())
}

struct GltfReader<'a> {
    path: &'a Path,
    document: &'a Document,
    /// The document as a tree, which holds the extensions.
    json: &'a Value,
    buffers: Vec<Vec<u8>>,
    mesh: Mesh,
    /// Triangles that may still be copied; none to copy all.
    budget: Option<Budget>,
    /// Uses of each mesh of the document.
    copies: HashMap<usize, usize>,
    /// Place in `mesh.repeated` of the primitives of meshes; none for those that are copied.
    repeated: HashMap<[usize; 2], Option<usize>>,
    /// Index into `mesh.materials` of the materials that have been used.
    materials: HashMap<usize, usize>,
    /// Glass on some triangles of a material, by its index into `mesh.materials`.
    panes: HashMap<usize, Pane>,
    /// Images inside the document by their numbers; none for those that cannot be read.
    embedded: HashMap<usize, Option<Arc<Texture>>>,
    images: TextureCache,
    /// Cameras of the nodes with their numbers in the file.
    cameras: Vec<(usize, MeshCamera)>,
    ignored: Ignored,
    warnings: &'a mut Vec<String>,
}

impl GltfReader<'_> {
    fn error(&self, message: impl Into<String>) -> Error {
        Error::format(self.path, message)
    }

    /// Walks through the nodes of the default scene, else the first.
    fn read_scene(&mut self, time: Option<f32>) -> Result<()> {
        self.ignore_contents(time.is_none());
        let poses = time.map_or(Ok(HashMap::new()), |time| self.poses(time))?;
        let document = self.document;
        let mut worlds: Vec<Option<Mat4>> = vec![None; document.nodes().count()];
        let mut skinned = Vec::new();
        let mut seen_meshes = vec![false; document.meshes().count()];
        let scene = document.default_scene().or_else(|| document.scenes().next());
        let roots: Vec<Node> = match scene {
            Some(scene) => scene.nodes().collect(),
            None => {
                let children =
                    document.nodes().flat_map(|node| node.children().map(|own| own.index()));
                let children: HashSet<usize> = children.collect();
                document.nodes().filter(|node| !children.contains(&node.index())).collect()
            }
        };
        if self.budget.is_some() {
            for node in document.nodes() {
                if let Some(mesh) = node.mesh() {
                    let count = self.instances(&node, Mat4::IDENTITY)?.len();
                    *self.copies.entry(mesh.index()).or_default() += count;
                }
            }
        }
        // Use a stack, not recursion: nodes may nest deeper than the call stack.
        let mut stack: Vec<(Node, Mat4, bool)> =
            roots.into_iter().map(|node| (node, Mat4::IDENTITY, true)).collect();
        stack.reverse();
        while let Some((node, world_from_parent, is_shown)) = stack.pop() {
            if worlds[node.index()].is_some() {
                let message = format!("node {} has more than one parent", node.index());
                return Err(self.error(message));
            }
            let visibility = &self.json["nodes"][node.index()]["extensions"]["KHR_node_visibility"];
            let is_shown = is_shown && visibility["visible"] != false;
            let stands = || Mat4::from_cols_array_2d(&node.transform().matrix());
            let parent_from_node = poses.get(&node.index()).copied().unwrap_or_else(stands);
            let world_from_node = world_from_parent * parent_from_node;
            worlds[node.index()] = Some(world_from_node);
            stack.extend(node.children().map(|child| (child, world_from_node, is_shown)));
            if !is_shown {
                continue;
            }
            self.read_node(&node, world_from_node);
            self.read_lamp(&node, world_from_node)?;
            if let Some(mesh) = node.mesh() {
                if !std::mem::replace(&mut seen_meshes[mesh.index()], true) {
                    self.ignore_in_mesh(&mesh);
                }
                if node.skin().is_some() {
                    // Joints may stand further on.
                    skinned.push(node);
                    continue;
                }
                let name = node.name().or(mesh.name());
                let name = name.map_or_else(|| format!("node {}", node.index()), str::to_owned);
                self.mesh.start_object(&name);
                let weights = node.weights().or(mesh.weights()).unwrap_or_default();
                for world_from_instance in self.instances(&node, world_from_node)? {
                    for primitive in mesh.primitives() {
                        let key = [mesh.index(), primitive.index()];
                        // The weights of a node make its mesh another one.
                        if node.weights().is_none()
                            && let Some(at) = self.repeated_primitive(key, &primitive, weights)?
                        {
                            let repeated = &mut self.mesh.repeated[at];
                            repeated.name = mesh.name().unwrap_or(&name).to_owned();
                            repeated.places.push(world_from_instance);
                        } else {
                            let place = Place::Node(world_from_instance);
                            self.read_primitive(&primitive, weights, place)?;
                        }
                    }
                }
            }
        }
        skinned.iter().try_for_each(|node| self.read_skinned(node, &worlds))
    }
}
