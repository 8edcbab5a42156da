//! OpenEXR files → halves: the channels R, G, B or Y, with A if there is one.

use std::io::Cursor;

use exr::{
    math::Vec2,
    prelude::{ReadChannels, ReadLayers, ReadSpecificChannel},
};
use half::f16;

use super::{
    Texels, Texture,
    check::{Repairs, check_size},
};
use crate::files;

/// Texels as they are read, with the width that places them.
struct Canvas {
    width: usize,
    texels: Vec<[f16; 4]>,
    repairs: Repairs,
}

impl Canvas {
    fn new(size: Vec2<usize>) -> Self {
        let texels = bytemuck::zeroed_vec(size.area());
        Self { width: size.width(), texels, repairs: Repairs::default() }
    }

    fn set(&mut self, at: Vec2<usize>, texel: [f32; 4]) {
        self.texels[at.y() * self.width + at.x()] = self.repairs.texel(texel);
    }
}

/// Decodes the first layer that has the channels.
pub(super) fn decode(
    name: &str,
    bytes: &[u8],
    warnings: &mut Vec<String>,
) -> Result<Texture, String> {
    let unreadable = |error: exr::error::Error| format!("not a readable OpenEXR file: {error}");
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false);
    let meta = meta.map_err(unreadable)?;
    let has = |name: &str| {
        let flat = meta.headers.iter().filter(|header| !header.deep);
        flat.flat_map(|header| &header.channels.list).any(|channel| channel.name.eq(name))
    };
    let is_color = has("R") && has("G") && has("B");
    if !is_color && !has("Y") {
        let channels = meta.headers.iter().flat_map(|header| &header.channels.list);
        let found: Vec<String> = channels.map(|channel| channel.name.to_string()).collect();
        return Err(format!("expected the channels R, G, B or Y, found {}", found.join(", ")));
    }
    for header in &meta.headers {
        let size = [header.layer_size.width() as u64, header.layer_size.height() as u64];
        let texel_bytes = header.channels.bytes_per_pixel as u64;
        check_size(size, texel_bytes, bytes.len(), files::EXR_LARGEST_RATIO)?;
        let names = ["R", "G", "B", "A", "Y"];
        for channel in &header.channels.list {
            if names.iter().any(|name| channel.name.eq(name)) && channel.sampling != Vec2(1, 1) {
                return Err(format!("channel {} is subsampled, which is not read", channel.name));
            }
        }
    }
    let channels = exr::prelude::read().no_deep_data().largest_resolution_level();
    let read = Cursor::new(bytes);
    let canvas: Canvas = if is_color {
        channels
            .specific_channels()
            .required("R")
            .required("G")
            .required("B")
            .optional("A", 1.0)
            .collect_pixels(
                |resolution, _| Canvas::new(resolution),
                |canvas: &mut Canvas, at, (red, green, blue, alpha): (f32, f32, f32, f32)| {
                    canvas.set(at, [red, green, blue, alpha]);
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_buffered(read)
            .map_err(unreadable)?
            .layer_data
            .channel_data
            .pixels
    } else {
        channels
            .specific_channels()
            .required("Y")
            .optional("A", 1.0)
            .collect_pixels(
                |resolution, _| Canvas::new(resolution),
                |canvas: &mut Canvas, at, (grey, alpha): (f32, f32)| {
                    canvas.set(at, [grey, grey, grey, alpha]);
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_buffered(read)
            .map_err(unreadable)?
            .layer_data
            .channel_data
            .pixels
    };
    canvas.repairs.warn(name, warnings);
    let height = canvas.texels.len() / canvas.width;
    Ok(Texture {
        name: name.to_owned(),
        width: canvas.width as u32,
        height: height as u32,
        texels: Texels::Halves(canvas.texels),
    })
}
