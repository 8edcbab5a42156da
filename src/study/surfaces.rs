//! The mask of a scene: pixels that see surfaces alone, and those that see the environment.
//!
//! A few camera rays per pixel tell them apart by the film's layer of positions, which grows by that of every
//! ray that hits something. A pixel with one ray that escapes counts as environment: its noise is that of
//! smoothing edges. Behind glass the glass is the first hit, and the pixel counts as surface.

use super::{
    folder::Folder,
    metrics::parts::PartErrors,
    reference::{OwnParts, Reference},
};
use crate::{
    error::Result,
    film::{Attribute, Image, RgbImage},
    scene::Scene,
    session::{Renderer, Session},
};

/// File stem of the mask: share of the camera rays that hit a surface, in every channel.
pub(crate) const STEM: &str = "surfaces";
const RAY_COUNT: u32 = 16;
/// Attribute that says which scene a mask is of.
const HASH: &str = "fenestra.scene_hash";

/// Both parts of a scene's picture.
#[derive(Clone, Debug)]
pub struct Surfaces {
    /// True where every ray hit a surface.
    pub is_surface: Vec<bool>,
    /// The reference's own errors in both parts.
    pub own: OwnParts,
}

/// Errors of a picture in both parts; a part without pixels has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Parts {
    /// Over pixels that see surfaces alone.
    pub surfaces: Option<PartErrors>,
    /// Over pixels that see the environment.
    pub environment: Option<PartErrors>,
    /// True if the errors over surfaces are well above the reference's own.
    pub surfaces_judged: bool,
}

impl Surfaces {
    /// Reads the mask from `folder` or renders it there; `make` gives a session with the layer of positions.
    pub(super) fn of(
        folder: &Folder,
        scene: &Scene,
        reference: &Reference,
        make: impl FnOnce() -> Result<Session>,
    ) -> Result<Self> {
        let path = folder.image(&scene.name, STEM);
        let hash = Attribute::Text(scene.hash.clone());
        let found = if path.exists() { Some(Image::read_exr(&path)?) } else { None };
        let size = (reference.first.width, reference.first.height);
        let image = match found.filter(|image| {
            (image.width, image.height) == size && image.attributes.get(HASH) == Some(&hash)
        }) {
            Some(image) => image,
            None => {
                let shares = shares(&mut make()?.renderer)?;
                let mut image = Image::of_rgb(size.0, size.1, &shares);
                image.attributes.insert(HASH.to_owned(), hash);
                image.write_exr(&path)?;
                image
            }
        };
        let is_surface = mask(&image.rgb(&path)?);
        let count = is_surface.iter().filter(|inside| **inside).count();
        let halves = [&reference.second, &reference.second];
        let quarter = |part: Option<PartErrors>| {
            part.map(|part| PartErrors::each(|error| 0.25 * error(&part)))
        };
        let [surfaces, environment] = split(&reference.first, halves, &is_surface)?.map(quarter);
        let surface_share = count as f64 / is_surface.len().max(1) as f64;
        Ok(Self { is_surface, own: OwnParts { surface_share, surfaces, environment } })
    }

    /// Measures a picture's errors in both parts. Fails for values that are not finite, or another size.
    pub(crate) fn errors(&self, picture: &RgbImage, reference: &Reference) -> Result<Parts> {
        let halves = [&reference.first, &reference.second];
        let [surfaces, environment] = split(picture, halves, &self.is_surface)?;
        let surfaces_judged = surfaces.is_some_and(|part| self.own.judges(&part));
        Ok(Parts { surfaces, environment, surfaces_judged })
    }
}

/// True where the mask says that every ray hit a surface.
pub fn mask(shares: &RgbImage) -> Vec<bool> {
    shares.pixels.iter().map(|pixel| pixel[0] >= 1.0).collect()
}

fn split(
    picture: &RgbImage,
    halves: [&RgbImage; 2],
    is_surface: &[bool],
) -> Result<[Option<PartErrors>; 2]> {
    let others: Vec<bool> = is_surface.iter().map(|inside| !inside).collect();
    Ok([
        PartErrors::of_halves(picture, halves, is_surface)?,
        PartErrors::of_halves(picture, halves, &others)?,
    ])
}

/// Shares of the camera rays that hit a surface.
fn shares(renderer: &mut Renderer) -> Result<Vec<[f32; 3]>> {
    let mut last: Vec<[f32; 3]> = Vec::new();
    let mut hits: Vec<u16> = Vec::new();
    for _ in 0..RAY_COUNT {
        renderer.render_pass(1)?;
        let positions = renderer.sums()?.position;
        hits.resize(positions.len(), 0);
        last.resize(positions.len(), [0.0; 3]);
        for ((hits, before), now) in hits.iter_mut().zip(&last).zip(&positions) {
            *hits += u16::from(before != now);
        }
        last = positions;
    }
    Ok(hits.into_iter().map(|hits| [f32::from(hits) / RAY_COUNT as f32; 3]).collect())
}
