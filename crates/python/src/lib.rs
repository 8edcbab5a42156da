//! The native part of the Python package `fenestra`: the program's own commands and session.
//!
//! Options arrive as the command line's, arrays as their bytes; `python/fenestra/__init__.py` makes them of
//! keywords and NumPy arrays.

mod following;
mod logging;

use std::{collections::HashMap, path::PathBuf};

use bytemuck::{AnyBitPattern, NoUninit, cast_slice, pod_collect_to_vec};
use fenestra::{
    cli::{self, Command},
    command::{self, compile, convert, render, study},
    film::{Attribute, Image, RgbImage},
    scene::{
        load::{Arrays, LoadOptions},
        mesh::Mesh,
    },
    session::StopReason,
};
use pyo3::{
    create_exception,
    exceptions::{PyException, PyKeyboardInterrupt},
    prelude::*,
    pybacked::PyBackedBytes,
    types::{PyByteArray, PyDict},
};

use following::{Standing, follow};

create_exception!(fenestra, Error, PyException, "The message of the program, with its remedy.");

/// Converts an error of the program.
fn exception(error: &fenestra::Error) -> PyErr {
    match error {
        fenestra::Error::Interrupted => PyKeyboardInterrupt::new_err(()),
        error => Error::new_err(cli::explain(error).join("\n")),
    }
}

/// Runs `work` while other threads of Python go on, and hands on what it logs.
fn apart<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> fenestra::Result<T> + Send,
) -> PyResult<T> {
    logging::listen();
    let result = py.detach(work);
    logging::hand_on(py)?;
    result.map_err(|error| exception(&error))
}

/// Parses the arguments of `render`.
fn render_arguments(arguments: &[String]) -> PyResult<Box<render::Arguments>> {
    match cli::parse(arguments).map_err(|error| exception(&error))? {
        Command::Render(arguments) => Ok(arguments),
        _ => Err(Error::new_err("expected the arguments of `render`")),
    }
}

/// Vectors of an array's bytes.
fn vectors<T: NoUninit + AnyBitPattern>(
    arrays: &HashMap<String, PyBackedBytes>,
    name: &str,
) -> Vec<T> {
    arrays.get(name).map_or_else(Vec::new, |bytes| pod_collect_to_vec(bytes))
}

/// A scene in memory.
#[pyclass(module = "fenestra._fenestra")]
struct Scene(fenestra::scene::Scene);

#[pymethods]
impl Scene {
    /// Loads the scene that arguments of `render` name.
    #[staticmethod]
    fn load(py: Python<'_>, arguments: Vec<String>) -> PyResult<Self> {
        let arguments = render_arguments(&arguments)?;
        apart(py, || render::load(&arguments)).map(Self)
    }

    /// Builds the scene of a text whose meshes and images may be arrays: of each mesh the bytes by name, of
    /// each image width, height and bytes.
    #[staticmethod]
    #[expect(clippy::needless_pass_by_value, reason = "arguments of Python")]
    fn build(
        py: Python<'_>,
        path: PathBuf,
        text: String,
        meshes: HashMap<PathBuf, HashMap<String, PyBackedBytes>>,
        images: HashMap<PathBuf, (u32, u32, PyBackedBytes)>,
    ) -> PyResult<Self> {
        let mesh = |arrays: &HashMap<String, PyBackedBytes>| Mesh {
            positions: vectors(arrays, "positions"),
            normals: vectors(arrays, "normals"),
            uvs: [vectors(arrays, "uvs"), Vec::new()],
            colors: vectors(arrays, "colors"),
            triangles: vectors(arrays, "triangles"),
            ..Mesh::default()
        };
        let meshes = meshes.iter().map(|(name, arrays)| (name.clone(), mesh(arrays))).collect();
        let images = images.into_iter().map(|(name, (width, height, bytes))| {
            (name, RgbImage { width, height, pixels: pod_collect_to_vec(&bytes) })
        });
        let arrays = Arrays { meshes, images: images.collect() };
        apart(py, || {
            let options = LoadOptions::default();
            let scene = fenestra::scene::Scene::parse_with(&path, &text, &options, &arrays)?;
            scene.warnings.iter().for_each(|warning| log::warn!("{warning}"));
            Ok(scene)
        })
        .map(Self)
    }

    /// Name of the scene.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// Lines on what was left out or repaired.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.0.warnings.clone()
    }

    /// Width and height of the film, pixels.
    #[getter]
    fn size(&self) -> (u32, u32) {
        (self.0.film.width, self.0.film.height)
    }

    /// Place of the camera, metres, and the unit direction in which it looks.
    #[getter]
    fn view(&self) -> ([f32; 3], [f32; 3]) {
        let camera = &self.0.camera;
        let direction = (camera.look_at - camera.position).normalize();
        (camera.position.to_array(), direction.to_array())
    }

    /// Renders by arguments of `render`, whose scene they name in vain.
    fn render(
        &mut self,
        py: Python<'_>,
        arguments: Vec<String>,
        progress: Option<Bound<'_, PyAny>>,
    ) -> PyResult<Picture> {
        let arguments = render_arguments(&arguments)?;
        let film = self.0.film;
        let scene = &mut self.0;
        let result = follow(py, progress.as_ref(), |mut follower| {
            render::film(&arguments, scene, &mut follower)
        });
        self.0.film = film;
        result.map(|(image, reason)| Picture { image, reason })
    }
}

/// A rendered image.
#[pyclass(frozen, module = "fenestra._fenestra")]
struct Picture {
    image: Image,
    reason: StopReason,
}

#[pymethods]
impl Picture {
    /// Width and height of the rendered part of the film, pixels.
    #[getter]
    fn size(&self) -> (u32, u32) {
        (self.image.width, self.image.height)
    }

    /// Name of the rule that ended the render.
    #[getter]
    fn reason(&self) -> &str {
        self.reason.name()
    }

    /// Bytes of 32-bit floats of each channel, row by row from the top.
    fn channels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let channels = PyDict::new(py);
        for (name, values) in &self.image.channels {
            channels.set_item(name, PyByteArray::new(py, cast_slice(values)))?;
        }
        Ok(channels)
    }

    /// Settings, samples, times and device, as attributes of the image file.
    #[getter]
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let attributes = PyDict::new(py);
        for (name, value) in &self.image.attributes {
            match value {
                Attribute::Text(value) => attributes.set_item(name, value)?,
                Attribute::Integer(value) => attributes.set_item(name, value)?,
                Attribute::Float(value) => attributes.set_item(name, value)?,
                Attribute::Double(value) => attributes.set_item(name, value)?,
            }
        }
        Ok(attributes)
    }

    /// Writes the image with all layers and metadata.
    fn write_exr(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        apart(py, || self.image.write_exr(&path))
    }
}

/// Runs `convert` or `study` by its arguments.
#[pyfunction]
#[pyo3(signature = (arguments, progress=None))]
fn run(py: Python<'_>, arguments: Vec<String>, progress: Option<Bound<'_, PyAny>>) -> PyResult<()> {
    match cli::parse(&arguments).map_err(|error| exception(&error))? {
        Command::Convert(arguments) => apart(py, || convert::run(&arguments)),
        Command::Study(arguments) => follow(py, progress.as_ref(), |follower| {
            study::run_with(&arguments, follower, |_, _| ())
        }),
        _ => Err(Error::new_err("expected the arguments of `convert` or `study`")),
    }
}

/// Runs the program `fenestra` and returns its exit status.
#[pyfunction]
fn main(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| cli::run(arguments))
}

/// Names what runs the program `fenestra`, for the self-test of a device and to compile kernels ahead.
#[pyfunction]
fn set_program(program: Vec<String>) {
    command::set_program(program);
    compile::allow();
}

/// See `python/fenestra/__init__.py`.
#[pymodule]
fn _fenestra(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("Error", module.py().get_type::<Error>())?;
    module.add_class::<Scene>()?;
    module.add_class::<Picture>()?;
    module.add_class::<Standing>()?;
    module.add_function(wrap_pyfunction!(run, module)?)?;
    module.add_function(wrap_pyfunction!(main, module)?)?;
    module.add_function(wrap_pyfunction!(set_program, module)?)
}
