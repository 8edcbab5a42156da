//! The integration tests of scenes, one program: a module a subject.

mod support;

mod animation;
mod brdf_formats;
mod compressed_meshes;
mod environment_files;
mod export;
mod exr;
mod fuzz;
mod import;
mod instances_in_files;
mod math;
mod mesh_materials;
mod mitsuba;
mod mitsuba_by_hand;
mod pbrt;
mod rgl;
mod scene;
mod shapes;
mod spectra;
mod warnings;
