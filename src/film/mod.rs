//! The film: sums of samples on their way to files.
//!
//! The device accumulates [`Sums`] over `n` samples of every pixel. They become the image file
//! ([`Sums::to_image`] → [`Image::write_exr`]), the preview ([`picture`]) and the [`Checkpoint`], from
//! which a render continues bit for bit. Every file carries the [`Metadata`] of its render.

pub mod checkpoint;
pub mod cryptomatte;
pub mod denoised;
pub mod display;
mod image;
pub mod layers;
pub mod merge;
pub mod metadata;
pub mod picture;
pub(crate) mod reconstruction;
pub mod sky;
pub mod statistics;
pub mod sums;
pub(crate) mod tone;

pub(crate) use self::tone::{Curve, Tone};
pub use self::{
    checkpoint::Checkpoint,
    display::DisplayServer,
    layers::{Aov, GroupSums},
    metadata::{Metadata, SampleRange},
    statistics::Statistics,
    sums::Sums,
};
pub use fenestra_scene::picture::{Attribute, Image, RgbImage, Window};
