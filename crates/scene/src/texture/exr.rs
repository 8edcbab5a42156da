//! OpenEXR files → texels: the channels R, G, B or Y, with A if there is one.

use std::io::Cursor;

use bytemuck::Zeroable;
use exr::{
    math::Vec2,
    meta::header::Header,
    prelude::{ReadChannels, ReadLayers, ReadSpecificChannel},
};

use super::floats::warn_of_primaries;

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
/// colour and opacity; returns width and height too, and the notes that `texel` keeps. Warns, with `name`,
/// of colours and windows that are taken for others.
///
/// `check_size` is asked with the size and the bytes of a pixel before memory is allocated.
pub(crate) fn decode<T: Zeroable + 'static, N: Default + 'static>(
    name: &str,
    bytes: &[u8],
    check_size: impl Fn([u64; 2], u64) -> Result<(), String>,
    texel: fn(&mut N, [f32; 4]) -> T,
    warnings: &mut Vec<String>,
) -> Result<([u32; 2], Vec<T>, N), String> {
    let unreadable = |error: exr::error::Error| format!("not a readable OpenEXR file: {error}");
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false);
    let meta = meta.map_err(unreadable)?;
    let names: Vec<String> = (meta.headers.iter())
        .flat_map(|header| &header.channels.list)
        .map(|channel| channel.name.to_string())
        .collect();
    let with = |names: &[String]| {
        let has = |header: &Header, name: &String| {
            header.channels.list.iter().any(|channel| channel.name.eq(name))
        };
        let mut flat = meta.headers.iter().filter(|header| !header.deep);
        flat.find(|header| names.iter().all(|name| has(header, name)))
    };
    // Some programs begin the names of channels by those of their layers; Blender's picture is `Combined`.
    let mut layers: Vec<&str> = names.iter().filter_map(|name| name.strip_suffix('R')).collect();
    layers.retain(|layer| layer.is_empty() || layer.ends_with('.'));
    layers.sort_by_key(|layer| (!layer.is_empty(), !layer.ends_with("Combined.")));
    let colors = layers.iter().find_map(|layer| {
        let colors = ["R", "G", "B"].map(|channel| format!("{layer}{channel}"));
        Some((with(&colors)?, colors, format!("{layer}A")))
    });
    let grey = ["Y".to_owned()];
    let header = colors.as_ref().map(|(header, ..)| *header).or_else(|| with(&grey));
    let Some(header) = header else {
        return Err(format!("expected the channels R, G, B or Y, found {}", names.join(", ")));
    };
    if let Some((_, [red, ..], _)) = colors.as_ref().filter(|(_, [red, ..], _)| red != "R") {
        warnings.push(format!("{name}: of its layers, that of the channel `{red}` is read"));
    }
    if header.data_window() != header.shared_attributes.display_window {
        warnings.push(format!("{name}: its display window is taken to be its data window"));
    }
    if let Some(found) = header.shared_attributes.chromaticities {
        let points = [found.red, found.green, found.blue, found.white];
        warn_of_primaries(name, points.map(|Vec2(x, y)| [x, y]), warnings);
    }
    for header in &meta.headers {
        let size = [header.layer_size.width() as u64, header.layer_size.height() as u64];
        check_size(size, header.channels.bytes_per_pixel as u64)?;
    }
    let channels = exr::prelude::read().no_deep_data().largest_resolution_level();
    let channels = channels.specific_channels();
    let read = Cursor::new(bytes);
    // The two readers are of different types.
    macro_rules! pixels {
        ($channels:expr, $alpha:expr, $values:ident: $kind:ty => $texel:expr) => {
            $channels
                .optional($alpha, 1.0)
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
    let canvas = if let Some((_, [red, green, blue], alpha)) = &colors {
        let colors = channels.required(&**red).required(&**green).required(&**blue);
        pixels!(colors, &**alpha, values: (f32, f32, f32, f32) => values.into())
    } else {
        pixels!(channels.required("Y"), "A", values: (f32, f32) => {
            let (grey, alpha) = values;
            [grey, grey, grey, alpha]
        })
    };
    let height = canvas.texels.len() / canvas.width;
    Ok(([canvas.width as u32, height as u32], canvas.texels, canvas.notes))
}
