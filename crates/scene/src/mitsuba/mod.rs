//! Mitsuba scene files, XML of versions 0.5 to 3 → [`Imported`].
//!
//! `document` makes one tree of all files, `parameters` and `spectra` read from it, and one module
//! each turns shapes, models, textures, lights and sensors into Fenestra's. Conventions are those of
//! Mitsuba 3.9.1, whose documentation is at <https://mitsuba.readthedocs.io>. Errors carry file and line
//! of the element at fault.

mod bsdfs;
mod document;
mod emitters;
mod mixtures;
mod parameters;
mod principled;
mod sensor;
mod serialized;
mod shapes;
mod spectra;
mod strands;
mod textures;

use std::{
    collections::{HashMap, HashSet},
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::Vec3;

use self::{bsdfs::default_of_shapes, document::Document, shapes::Shape};
use super::{
    Asked, EnvironmentMap, Geometry, Lamp,
    features::{self, Ignored},
    geometry::DroppedOfMany,
    instance::Budget,
    instances::Prototype,
};
use crate::{
    beside::Folder,
    error::Result,
    import::{Imported, relief::Reliefs},
    material::Material,
    measured::MeasuredFiles,
    texture::TextureCache,
};

/// Scene on its way from the document.
#[derive(Default)]
struct Reader {
    textures: TextureCache,
    measured: MeasuredFiles,
    environment: Option<EnvironmentMap>,
    lamps: Vec<Lamp>,
    materials: Vec<Material>,
    /// Material by the elements of its model and of its light.
    material_numbers: HashMap<[Option<usize>; 3], u32>,
    /// Models around the one that is read.
    models_around: usize,
    reliefs: Reliefs,
    geometry: Geometry,
    /// Shapes of groups by their element.
    shapes: HashMap<usize, Arc<Shape>>,
    /// Prototypes of shapes of groups by their element, and by a transform that mirrors; that of balls last,
    /// by the side that is out.
    prototypes: HashMap<(usize, bool), Prototype>,
    budget: Budget,
    /// Triangles of shapes that are not in a file, and of copies.
    repeated_triangles: usize,
    inputs: Vec<PathBuf>,
    asked: Asked,
    ignored: Ignored,
    dropped: DroppedOfMany,
    warnings: Vec<String>,
}

/// Reads a scene file, whose names of files start in `folder`; `camera` is the id or number of its sensor,
/// which is else the first. Fails with [`crate::Error::Parse`] with file and line for what cannot be read or
/// rendered, or as the readers of meshes, images and maps.
pub(crate) fn read(path: &Path, camera: Option<&str>, folder: Folder) -> Result<Imported> {
    let document = Document::read(path, folder)?;
    let mut reader = Reader { inputs: document.files.clone(), ..Reader::default() };
    reader.textures.load_early(document.images());
    let mut sensors = Vec::new();
    for node in document.root().children() {
        match node.tag() {
            "sensor" | "camera" => sensors.push(node),
            "shape" => reader.shape(node)?,
            "emitter" | "luminaire" => reader.emitter(node)?,
            "integrator" => reader.integrator(node)?,
            "sampler" => reader.sampler(node)?,
            // Others are read where a shape or a sensor uses them.
            "bsdf" | "texture" | "spectrum" | "rgb" | "medium" | "film" | "rfilter" | "volume"
            | "phase" => {}
            found => {
                let name = format!("`{found}` in `scene`");
                reader.ignored.add_named(features::MI_ELEMENT, &name, || node.place());
            }
        }
    }
    let (camera, film) = reader.sensor(document.root(), &sensors, camera)?;
    if reader.materials.is_empty() {
        reader.materials.push(default_of_shapes());
    }
    reader.reliefs.settle(&mut reader.materials, &reader.geometry);
    let environment = match reader.environment {
        Some(environment) => environment,
        None => EnvironmentMap::constant(Vec3::ZERO, 1.0)
            .map_err(|message| document.root().error(message))?,
    };
    let mut warnings = reader.warnings;
    warnings.extend(reader.dropped.warnings(path));
    reader.ignored.merge(&document.renamed());
    warnings.extend(reader.ignored.warnings(path));
    let mut inputs = reader.inputs;
    let mut seen = HashSet::new();
    inputs.retain(|input| seen.insert(input.clone()));
    Ok(Imported {
        camera,
        film,
        asked: reader.asked,
        environment: Some(environment),
        lamps: reader.lamps,
        materials: reader.materials,
        geometry: reader.geometry,
        variants: Vec::new(),
        inputs,
        warnings,
    })
}
