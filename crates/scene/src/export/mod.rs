//! Writers of scenes for other renderers: validated [`crate::Scene`] → files.
//!
//! A format is a folder of [`Export`]s. Differences that it forces are [`Export::warnings`], each with
//! the name of the material or lamp. `parts` alone reads the geometry.

pub mod gltf;
mod images;
pub mod mitsuba;
mod names;
mod parts;
pub mod pbrt;
mod ply;

use glam::Vec3;

use crate::{Scene, error::Result, math::colour::luminance, measured::MeasuredTable};

/// Settings of the render that are not part of the scene.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Path vertices lit by the environment; 1 is direct light.
    pub depth: u32,
    /// Samples per pixel.
    pub samples: u32,
}

/// A scene translated to a format, before it is written.
pub trait Export {
    /// Differences that the format forces, one message for each material or lamp concerned.
    fn warnings(&self) -> &[String];

    /// Writes the scene file and the folder of the same name beside it.
    ///
    /// # Errors
    /// [`crate::Error::Io`] for a file that cannot be written.
    fn write(&self) -> Result<()>;
}

/// Warning about the portals of `scene`, which no export has.
fn portal_warning(scene: &Scene) -> Option<String> {
    let first = scene.portals.first()?;
    let first = if first.name.is_empty() { "the first" } else { &first.name };
    Some(format!(
        "portals: left out, {} in all, `{first}` among them; they change the noise of a picture, not \
         what it shows",
        scene.portals.len()
    ))
}

/// Share of light from a uniform hemisphere that a measured material reflects: 2 ∫ E(μ) μ dμ by midpoints.
fn reflected_share(table: &MeasuredTable) -> Vec3 {
    const STEPS: u32 = 64;
    let step = |index: u32| {
        let cosine = (index as f32 + 0.5) / STEPS as f32;
        table.albedo(cosine) * (2.0 * cosine / STEPS as f32)
    };
    (0..STEPS).map(step).sum::<Vec3>().clamp(Vec3::ZERO, Vec3::ONE)
}

/// Refractive index, up to 4, whose reflectance at normal incidence is that of a principled dielectric.
fn index_of(ior: f32, specular: f32, specular_color: Vec3) -> f32 {
    if specular == 1.0 && specular_color == Vec3::ONE {
        return ior;
    }
    let ratio = (ior - 1.0) / (ior + 1.0);
    let reflectance = (ratio * ratio * specular_color).min(Vec3::ONE) * specular;
    // At a root of 0.6 the index is 4, the largest that is read back.
    let root = luminance(reflectance).max(0.0).sqrt().min(0.6);
    (1.0 + root) / (1.0 - root)
}

/// Three numbers with commas.
fn triple(vector: Vec3) -> String {
    format!("{}, {}, {}", vector.x, vector.y, vector.z)
}
