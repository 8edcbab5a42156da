//! OpenEXR files → texels: the channels R, G, B or Y, with A if there is one.

use std::io::Cursor;

use bytemuck::Zeroable;
use exr::{
    math::Vec2,
    prelude::{ReadChannels, ReadLayers, ReadSpecificChannel},
};

/// First bytes of an OpenEXR file.
pub(crate) const SIGNATURE: &[u8] = &exr::meta::magic_number::BYTES;

/// Texels as they are read, with the width that places them, and what was noticed on the way.
struct Canvas<T, N> {
    width: usize,
    texels: Vec<T>,
    notes: N,
}

impl<T: Zeroable, N: Default> Canvas<T, N> {
    /// Lets the system zero pages on first use: a damaged header may claim more than the file holds.
    fn new(size: Vec2<usize>) -> Self {
        let texels = bytemuck::zeroed_vec(size.area());
        Self { width: size.width(), texels, notes: N::default() }
    }
}

/// Decodes the first layer with the channels R, G, B, else the first with Y, to texels that `texel` makes of
/// colour and opacity; returns width and height too, and the notes that `texel` keeps.
///
/// `check_size` is asked with the size and the bytes of a pixel before memory is allocated.
pub(crate) fn decode<T: Zeroable + 'static, N: Default + 'static>(
    bytes: &[u8],
    check_size: impl Fn([u64; 2], u64) -> Result<(), String>,
    texel: fn(&mut N, [f32; 4]) -> T,
) -> Result<([u32; 2], Vec<T>, N), String> {
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
        check_size(size, header.channels.bytes_per_pixel as u64)?;
        let names = ["R", "G", "B", "A", "Y"];
        for channel in &header.channels.list {
            if names.iter().any(|name| channel.name.eq(name)) && channel.sampling != Vec2(1, 1) {
                return Err(format!("channel {} is subsampled, which is not read", channel.name));
            }
        }
    }
    let channels = exr::prelude::read().no_deep_data().largest_resolution_level();
    let channels = channels.specific_channels();
    let read = Cursor::new(bytes);
    // The two readers are of different types.
    macro_rules! pixels {
        ($channels:expr, $values:ident: $kind:ty => $texel:expr) => {
            $channels
                .optional("A", 1.0)
                .collect_pixels(
                    |size, _| Canvas::new(size),
                    move |canvas: &mut Canvas<T, N>, at, $values: $kind| {
                        let Canvas { width, texels, notes } = canvas;
                        texels[at.y() * *width + at.x()] = texel(notes, $texel);
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
    }
    let canvas = if is_color {
        let colors = channels.required("R").required("G").required("B");
        pixels!(colors, values: (f32, f32, f32, f32) => values.into())
    } else {
        pixels!(channels.required("Y"), values: (f32, f32) => {
            let (grey, alpha) = values;
            [grey, grey, grey, alpha]
        })
    };
    let height = canvas.texels.len() / canvas.width;
    Ok(([canvas.width as u32, height as u32], canvas.texels, canvas.notes))
}
