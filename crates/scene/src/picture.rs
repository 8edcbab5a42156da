//! Pictures: OpenEXR files. Reads and writes an [`Image`] of named float channels and attributes.
//!
//! Files have one part. The picture is `R`, `G`, `B`, linear with Rec.709 primaries; other layers
//! have dotted names (`Albedo.R`, `N.X`), which viewers group by prefix. OpenEXR stores channels
//! sorted by name, so readers look them up by name.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io::{self, BufRead, BufReader, BufWriter, Cursor, Read, Seek, SeekFrom, Write},
    path::Path,
};

use exr::{
    block::lines::LineRefMut,
    image::write::{
        layers::WritableLayers,
        samples::{SamplesWriter, WritableSamples},
    },
    math::RoundingMode,
    meta::{
        attribute::{LevelMode, SampleType},
        header::Header,
    },
    prelude::{
        AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, IntegerBounds, Layer,
        LayerAttributes, LineOrder, ReadChannels, ReadLayers, SpecificChannels, Text, Vec2,
        WritableImage,
        attribute::{AttributeValue, Chromaticities},
    },
};

use rayon::prelude::*;

use crate::{
    error::{Error, Result},
    files::{EXR_LARGEST_RATIO, check_promise, is_special_file, open_regular, write_atomically},
    memory,
};

/// Primaries and white point of ITU-R BT.709 (red, green, blue, white; CIE x, y).
pub(crate) const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// Value of a file attribute.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute {
    /// UTF-8 text.
    Text(String),
    /// 32-bit integer.
    Integer(i32),
    /// 32-bit float.
    Float(f32),
    /// 64-bit float.
    Double(f64),
}

/// Image of named float channels, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width of the stored window in pixels.
    pub width: u32,
    /// Height of the stored window in pixels.
    pub height: u32,
    /// Upper left pixel of the stored window in the whole film (OpenEXR's data window).
    pub origin: [i32; 2],
    /// Width and height of the whole film in pixels (OpenEXR's display window).
    pub film_size: [u32; 2],
    /// Samples by channel name, each `width * height` long.
    pub channels: BTreeMap<String, Vec<f32>>,
    /// Attributes by name, except those of the format itself.
    pub attributes: BTreeMap<String, Attribute>,
}

/// Linear Rec.709 picture alone, the input of error metrics and previews.
#[derive(Clone, Debug, PartialEq)]
pub struct RgbImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Row by row from the top.
    pub pixels: Vec<[f32; 3]>,
}

/// Part of a film, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Left edge.
    pub x: u32,
    /// Upper edge.
    pub y: u32,
    /// Width, at least 1.
    pub width: u32,
    /// Height, at least 1.
    pub height: u32,
}

impl Image {
    /// Creates an image without channels whose window is the whole film.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            origin: [0, 0],
            film_size: [width, height],
            channels: BTreeMap::new(),
            attributes: BTreeMap::new(),
        }
    }

    /// `width * height`.
    pub fn pixel_count(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Creates an image of the channels `R`, `G`, `B`.
    ///
    /// # Panics
    /// `pixels` is not `width * height` long.
    pub fn of_rgb(width: u32, height: u32, pixels: &[[f32; 3]]) -> Self {
        let mut image = Self::new(width, height);
        image.insert_triple(["R", "G", "B"], pixels);
        image
    }

    /// Adds the three components of `values` as the channels `names`.
    ///
    /// # Panics
    /// `values` is not `width * height` long.
    pub fn insert_triple(&mut self, names: [&str; 3], values: &[[f32; 3]]) {
        assert_eq!(values.len(), self.pixel_count(), "one value per pixel of layer {names:?}");
        for (component, name) in names.into_iter().enumerate() {
            let samples = values.par_iter().map(|value| value[component]).collect();
            self.channels.insert(name.to_owned(), samples);
        }
    }

    /// Returns three channels as vectors, or `None` if one is missing.
    pub fn triple(&self, names: [&str; 3]) -> Option<Vec<[f32; 3]>> {
        let [x, y, z] = names.map(|name| self.channels.get(name));
        let (x, y, z) = (x?, y?, z?);
        Some(x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z]).collect())
    }

    /// Returns `R`, `G`, `B`, or a lone `Y` as grey; `path` only serves the error message.
    ///
    /// # Errors
    /// [`Error::Format`] lists the channels found.
    pub fn rgb(&self, path: &Path) -> Result<RgbImage> {
        let pixels = self
            .triple(["R", "G", "B"])
            .or_else(|| self.triple(["Y", "Y", "Y"]))
            .ok_or_else(|| {
                let names: Vec<&str> = self.channels.keys().map(String::as_str).collect();
                Error::format(
                    path,
                    format!("expected channels R, G, B (or Y), found {}", names.join(", ")),
                )
            })?;
        Ok(RgbImage { width: self.width, height: self.height, pixels })
    }

    /// Names of the layers: the parts of channel names before their last dot, "" for the picture.
    pub fn layers(&self) -> Vec<&str> {
        let splits = self.channels.keys().map(|name| name.rsplit_once('.'));
        let names: BTreeSet<&str> = splits.map(|split| split.map_or("", |split| split.0)).collect();
        names.into_iter().collect()
    }

    /// Returns a layer of colours (R, G, B), vectors (X, Y, Z) or single values (Y) as a picture.
    ///
    /// # Errors
    /// [`Error::Usage`] lists the layers of `path` if there is none of this name with such channels.
    pub fn layer(&self, layer: &str, path: &Path) -> Result<RgbImage> {
        let triple = |names: [&str; 3]| {
            let dot = if layer.is_empty() { "" } else { "." };
            let names = names.map(|name| format!("{layer}{dot}{name}"));
            self.triple([&names[0], &names[1], &names[2]])
        };
        let choices = [["R", "G", "B"], ["X", "Y", "Z"], ["Y", "Y", "Y"]];
        let pixels = choices.into_iter().find_map(triple).ok_or_else(|| {
            let known: Vec<&str> = self.layers().into_iter().filter(|name| !name.is_empty()).collect();
            Error::usage(format!(
                "--layer {layer}: {} has no such layer of channels R, G, B or X, Y, Z or Y; it has {}",
                path.display(),
                if known.is_empty() { "none".to_owned() } else { known.join(", ") }
            ))
        })?;
        Ok(RgbImage { width: self.width, height: self.height, pixels })
    }

    /// Returns the part of the image within `window`, in pixels of the whole film.
    ///
    /// # Errors
    /// [`Error::Usage`] if the window does not lie in the part that is stored.
    pub fn cropped(&self, window: Window, path: &Path) -> Result<Self> {
        let start = |at: u32, origin: i32| i64::from(at) - i64::from(origin);
        let [x, y] = [start(window.x, self.origin[0]), start(window.y, self.origin[1])];
        let end = [x + i64::from(window.width), y + i64::from(window.height)];
        if x < 0 || y < 0 || end[0] > i64::from(self.width) || end[1] > i64::from(self.height) {
            let [left, top] = self.origin.map(i64::from);
            return Err(Error::usage(format!(
                "--crop: {} holds pixels {left} ≤ x < {}, {top} ≤ y < {}, expected a part of them",
                path.display(),
                left + i64::from(self.width),
                top + i64::from(self.height)
            )));
        }
        let rows = |samples: &Vec<f32>| {
            let row = |row: i64| {
                let first = (row * i64::from(self.width) + x) as usize;
                &samples[first..first + window.width as usize]
            };
            (y..end[1]).flat_map(row).copied().collect()
        };
        let channels = self.channels.iter();
        Ok(Self {
            width: window.width,
            height: window.height,
            origin: [x + i64::from(self.origin[0]), y + i64::from(self.origin[1])]
                .map(|value| i32::try_from(value).unwrap_or(i32::MAX)),
            film_size: self.film_size,
            channels: channels.map(|(name, samples)| (name.clone(), rows(samples))).collect(),
            attributes: self.attributes.clone(),
        })
    }

    /// Writes the image with ZIP compression, atomically.
    ///
    /// # Errors
    /// [`Error::Io`] with the cause; [`Error::Format`] for an image that OpenEXR cannot hold (no
    /// channel, no pixel).
    ///
    /// # Panics
    /// A channel is not `width * height` long.
    pub fn write_exr(&self, path: &Path) -> Result<()> {
        self.write_exr_compressed(path, Compression::ZIP16)
    }

    /// Writes the image without compression: sums are too irregular for it to be worth the time.
    ///
    /// # Errors
    /// As [`Image::write_exr`].
    pub fn write_exr_uncompressed(&self, path: &Path) -> Result<()> {
        self.write_exr_compressed(path, Compression::Uncompressed)
    }

    fn write_exr_compressed(&self, path: &Path, compression: Compression) -> Result<()> {
        if self.channels.is_empty() || self.pixel_count() == 0 {
            let (Self { width, height, .. }, channels) = (self, self.channels.len());
            let message = format!(
                "an OpenEXR file needs at least one channel and one pixel, found {channels} channels of \
                 {width}x{height} pixels"
            );
            return Err(Error::format(path, message));
        }
        let channels = self
            .channels
            .iter()
            .map(|(name, samples)| {
                assert_eq!(samples.len(), self.pixel_count(), "samples of channel {name}");
                let width = self.width as usize;
                AnyChannel::new(text(name), BorrowedSamples { samples, width })
            })
            .collect();
        let mut attributes = LayerAttributes {
            layer_position: Vec2(self.origin[0], self.origin[1]),
            ..LayerAttributes::default()
        };
        for (name, value) in &self.attributes {
            let value = match value {
                Attribute::Text(value) => AttributeValue::Text(text(value)),
                Attribute::Integer(value) => AttributeValue::I32(*value),
                Attribute::Float(value) => AttributeValue::F32(*value),
                Attribute::Double(value) => AttributeValue::F64(*value),
            };
            attributes.other.insert(text(name), value);
        }
        let layer = Layer::new(
            (self.width as usize, self.height as usize),
            attributes,
            encoding(compression),
            AnyChannels::sort(channels),
        );
        let mut image = exr::prelude::Image::from_layer(layer);
        let [film_width, film_height] = self.film_size;
        image.attributes.display_window =
            IntegerBounds::from_dimensions((film_width as usize, film_height as usize));
        image.attributes.chromaticities = Some(REC_709);
        write_file(path, &image)
    }

    /// Reads the first flat layer of an OpenEXR file; half and integer channels become floats.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it is no OpenEXR file, is
    /// truncated or corrupt, or holds only deep data.
    pub fn read_exr(path: &Path) -> Result<Self> {
        let malformed = |error: exr::error::Error| match error {
            exr::error::Error::Io(source)
                if source.kind() != io::ErrorKind::UnexpectedEof
                    && source.raw_os_error().is_some() =>
            {
                Error::io(path, "read", source)
            }
            exr::error::Error::NotSupported(what) => {
                Error::format(path, format!("OpenEXR feature not supported: {what}"))
            }
            other => Error::format(path, format!("not a complete OpenEXR file: {other}")),
        };
        let file = open_regular(path)?;
        let file_bytes = file.metadata().map_err(|source| Error::io(path, "read", source))?.len();
        let meta_data = exr::meta::MetaData::read_from_buffered(BufReader::new(file), false)
            .map_err(malformed)?;
        for header in &meta_data.headers {
            let size = [header.layer_size.width() as u64, header.layer_size.height() as u64];
            let pixel_bytes = header.channels.bytes_per_pixel as u64;
            check_promise(size, pixel_bytes, file_bytes, EXR_LARGEST_RATIO).map_err(|message| {
                Error::format(path, format!("corrupt OpenEXR file: {message}"))
            })?;
            // Samples are floats in memory, beside those of the file for a while.
            let channels = header.channels.list.len() as u64 * 8;
            let bytes = size[0].saturating_mul(size[1]).saturating_mul(channels);
            memory::check(path.display(), bytes).map_err(Error::memory)?;
        }
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(BufReader::new(open_regular(path)?))
            .map_err(malformed)?;
        Self::from_layer(path, image)
    }

    fn from_layer(
        path: &Path,
        image: exr::prelude::Image<Layer<AnyChannels<FlatSamples>>>,
    ) -> Result<Self> {
        let layer = image.layer_data;
        let dimension = |value: usize| {
            u32::try_from(value)
                .map_err(|_| Error::format(path, format!("{value} pixels along one side")))
        };
        let display = image.attributes.display_window.size;
        let position = layer.attributes.layer_position;
        let mut result = Self {
            origin: [position.x(), position.y()],
            film_size: [dimension(display.width())?, dimension(display.height())?],
            ..Self::new(dimension(layer.size.width())?, dimension(layer.size.height())?)
        };
        for channel in layer.channel_data.list {
            let name = string(&channel.name);
            let samples: Vec<f32> = match channel.sample_data {
                FlatSamples::F32(samples) => samples,
                other => other.values_as_f32().collect(),
            };
            if samples.len() != result.pixel_count() {
                let (found, Self { width, height, .. }) = (samples.len(), &result);
                let message = format!(
                    "channel {name} has {found} samples, expected {} ({width}x{height}); subsampled \
                     channels are not supported",
                    result.pixel_count()
                );
                return Err(Error::format(path, message));
            }
            result.channels.insert(name, samples);
        }
        let others = layer.attributes.other.iter().chain(&image.attributes.other);
        for (name, value) in others {
            let value = match value {
                AttributeValue::Text(value) => Attribute::Text(string(value)),
                AttributeValue::I32(value) => Attribute::Integer(*value),
                AttributeValue::F32(value) => Attribute::Float(*value),
                AttributeValue::F64(value) => Attribute::Double(*value),
                _ => continue,
            };
            result.attributes.insert(string(name), value);
        }
        Ok(result)
    }
}

/// Writes the channels `R`, `G`, `B` with ZIP compression, atomically, by the colours of columns and rows,
/// which are not held in memory.
pub(crate) fn write_colors(
    path: &Path,
    [width, height]: [usize; 2],
    color: impl Fn(usize, usize) -> [f32; 3] + Sync,
) -> Result<()> {
    let channels = SpecificChannels::rgb(|Vec2(column, row)| {
        let [red, green, blue] = color(column, row);
        (red, green, blue)
    });
    let encoding = encoding(Compression::ZIP16);
    let layer = Layer::new((width, height), LayerAttributes::default(), encoding, channels);
    let mut image = exr::prelude::Image::from_layer(layer);
    image.attributes.chromaticities = Some(REC_709);
    write_file(path, &image)
}

fn encoding(compression: Compression) -> Encoding {
    Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing }
}

fn write_file<'a, L: WritableLayers<'a>>(
    path: &Path,
    image: &'a exr::prelude::Image<L>,
) -> Result<()> {
    write_atomically(path, |file: &mut BufWriter<File>| {
        if !is_special_file(path) {
            image.write().to_buffered(&mut *file).map_err(io_error)?;
            file.flush()?;
            return sort_attributes(file.get_mut());
        }
        // The encoder goes back to fill its tables, which a stream cannot.
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).map_err(io_error)?;
        sort_attributes(&mut bytes)?;
        file.write_all(bytes.get_ref())
    })
}

/// Samples of a channel, borrowed so that large films are not copied.
#[derive(Clone, Copy)]
struct BorrowedSamples<'a> {
    samples: &'a [f32],
    width: usize,
}

impl<'a> WritableSamples<'a> for BorrowedSamples<'_> {
    type Writer = BorrowedSamples<'a>;

    fn sample_type(&self) -> SampleType {
        SampleType::F32
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&'a self, _: &Header) -> Self::Writer {
        *self
    }
}

impl SamplesWriter for BorrowedSamples<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let start = line.location.position.y() * self.width + line.location.position.x();
        let end = start + line.location.sample_count;
        let written = line.write_samples_from_slice(&self.samples[start..end]);
        assert!(written.is_ok(), "a row of floats fits into the encoder's row");
    }
}

/// Sorts the attributes in the header of an OpenEXR file: the encoder's order differs from run to run.
fn sort_attributes(file: &mut (impl Read + Write + Seek)) -> io::Result<()> {
    // Behind the magic number and the version
    file.seek(SeekFrom::Start(8))?;
    let mut reader = BufReader::new(&mut *file);
    let mut attributes = Vec::new();
    loop {
        let mut attribute = Vec::new();
        // An empty name ends the header; name and type end with a zero.
        if reader.read_until(0, &mut attribute)? <= 1 {
            break;
        }
        reader.read_until(0, &mut attribute)?;
        let mut length = [0; 4];
        reader.read_exact(&mut length)?;
        attribute.extend(length);
        let length = u64::from(u32::from_le_bytes(length));
        reader.by_ref().take(length).read_to_end(&mut attribute)?;
        attributes.push(attribute);
    }
    attributes.sort_unstable();
    file.seek(SeekFrom::Start(8))?;
    file.write_all(&attributes.concat())
}

/// Encodes `value` as OpenEXR text in UTF-8.
fn text(value: &str) -> Text {
    Text::from_slice_unchecked(value.as_bytes())
}

/// Decodes OpenEXR text, which should be UTF-8; invalid bytes are replaced.
fn string(value: &Text) -> String {
    String::from_utf8_lossy(value.as_slice()).into_owned()
}

fn io_error(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(source) => source,
        other => io::Error::other(other.to_string()),
    }
}
