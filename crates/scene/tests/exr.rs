//! OpenEXR files: round trips, files of other programs, and broken files.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::{fs, path::Path};

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Layer, LayerAttributes, WritableImage, f16,
};
use fenestra_scene::picture::{Attribute, Image};

fn example() -> Image {
    let mut image = Image::new(5, 3);
    image.origin = [2, -1];
    image.film_size = [9, 7];
    let ramp = |scale: f32| (0..15).map(|index| scale * index as f32).collect::<Vec<f32>>();
    image.channels.insert("R".to_owned(), ramp(0.1));
    image.channels.insert("G".to_owned(), ramp(1e-20));
    image.channels.insert("B".to_owned(), ramp(-1e30));
    image.channels.insert("N.X".to_owned(), ramp(0.0));
    let attributes = [
        ("fenestra.sampler", Attribute::Text("mis — ünïcode".to_owned())),
        ("empty", Attribute::Text(String::new())),
        ("samplesPerPixel", Attribute::Integer(-64)),
        ("renderTimeSeconds", Attribute::Float(1.5e-7)),
        ("fenestra.seconds", Attribute::Double(1.0 / 3.0)),
        (
            "fenestra.a_name_that_is_longer_than_thirty_one_bytes",
            Attribute::Text("long\nlines".repeat(1000)),
        ),
    ];
    for (name, value) in attributes {
        image.attributes.insert(name.to_owned(), value);
    }
    image
}

fn message(path: &Path) -> String {
    Image::read_exr(path).unwrap_err().to_string()
}

#[test]
fn images_come_back_as_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/folder/image.exr");
    let image = example();
    image.write_exr(&path).unwrap();
    assert_eq!(Image::read_exr(&path).unwrap(), image);
    image.write_exr_uncompressed(&path).unwrap();
    assert_eq!(Image::read_exr(&path).unwrap(), image);
}

#[test]
fn the_same_image_gives_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: &str| {
        let path = folder.path().join(name);
        example().write_exr(&path).unwrap();
        fs::read(&path).unwrap()
    };
    assert!((0..4).all(|_| bytes("a.exr") == bytes("b.exr")));
}

#[test]
fn every_bit_survives_compression() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bits.exr");
    // Cover all exponents, both signs, some mantissas and infinities; 64 rows fill several ZIP blocks.
    let bits: Vec<u32> = (0..64 * 64_u32).map(|index| index.wrapping_mul(0x0010_0801)).collect();
    let samples = bits.iter().map(|&bits| f32::from_bits(bits)).collect();
    let mut image = Image::new(64, 64);
    image.channels.insert("Y".to_owned(), samples);
    image.write_exr(&path).unwrap();
    let read = Image::read_exr(&path).unwrap();
    let read_bits: Vec<u32> = read.channels["Y"].iter().map(|value| value.to_bits()).collect();
    assert_eq!(read_bits, bits);
}

#[test]
fn files_state_rec_709_primaries_and_both_windows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.exr");
    example().write_exr(&path).unwrap();
    let meta_data = exr::meta::MetaData::read_from_file(&path, true).unwrap();
    let [header] = &meta_data.headers[..] else {
        panic!("expected one part, found {}", meta_data.headers.len());
    };
    let chromaticities = header.shared_attributes.chromaticities.unwrap();
    let expected = [(0.64, 0.33), (0.30, 0.60), (0.15, 0.06), (0.3127, 0.3290)];
    let found =
        [chromaticities.red, chromaticities.green, chromaticities.blue, chromaticities.white];
    for (found, (x, y)) in found.into_iter().zip(expected) {
        assert_eq!((found.x(), found.y()), (x, y));
    }
    let display = header.shared_attributes.display_window;
    assert_eq!((display.size.width(), display.size.height()), (9, 7));
    assert_eq!((display.position.x(), display.position.y()), (0, 0));
    let position = header.own_attributes.layer_position;
    assert_eq!((position.x(), position.y()), (2, -1));
    assert!(header.own_attributes.layer_name.is_none());
}

#[test]
fn half_and_integer_channels_of_other_programs_become_floats() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("foreign.exr");
    let half = vec![f16::from_f32(0.5), f16::from_f32(-2.0)];
    let channels = [
        AnyChannel::new("Y", FlatSamples::F16(half)),
        AnyChannel::new("id", FlatSamples::U32(vec![7, 8])),
    ];
    let layer = Layer::new(
        (2, 1),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.into_iter().collect()),
    );
    exr::prelude::Image::from_layer(layer).write().to_file(&path).unwrap();
    let image = Image::read_exr(&path).unwrap();
    assert_eq!(image.channels["Y"], [0.5, -2.0]);
    assert_eq!(image.channels["id"], [7.0, 8.0]);
    assert_eq!(image.rgb(&path).unwrap().pixels, [[0.5; 3], [-2.0; 3]]);
}

#[test]
fn a_missing_channel_is_named_beside_those_that_are_there() {
    let mut image = example();
    image.channels.remove("G");
    let path = Path::new("in.exr");
    assert_eq!(example().layer("", path).unwrap(), example().rgb(path).unwrap());
    let message = image.rgb(path).unwrap_err().to_string();
    assert_eq!(message, "in.exr: expected channels R, G, B (or Y), found B, N.X, R");
}

#[test]
fn images_without_pixels_or_channels_are_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.exr");
    let mut flat = Image::new(0, 3);
    flat.channels.insert("Y".to_owned(), Vec::new());
    for image in [Image::new(2, 2), flat] {
        let message = image.write_exr(&path).unwrap_err().to_string();
        assert!(message.contains("needs at least one channel and one pixel"), "{message}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn files_of_another_kind_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    assert!(message(&path).contains("in.exr: cannot read: No such file"), "{}", message(&path));
    assert!(message(folder.path()).contains("cannot read"), "{}", message(folder.path()));
    for content in [&b""[..], b"v/1\x01", b"#?RADIANCE\n", &[0; 4096], b"\x89PNG\r\n\x1a\n"] {
        fs::write(&path, content).unwrap();
        assert!(message(&path).contains("not a complete OpenEXR file"), "{}", message(&path));
    }
}

#[test]
fn a_file_cut_anywhere_is_an_error_and_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.exr");
    let mut image = example();
    image.attributes.retain(|name, _| name.len() < 20);
    for compressed in [true, false] {
        if compressed {
            image.write_exr(&path).unwrap();
        } else {
            image.write_exr_uncompressed(&path).unwrap();
        }
        let whole = fs::read(&path).unwrap();
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            let message = message(&path);
            assert!(message.contains("cut.exr: "), "{length} of {}: {message}", whole.len());
        }
    }
}

#[test]
fn a_file_with_any_byte_wrong_neither_panics_nor_exhausts_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flipped.exr");
    let mut image = example();
    image.attributes.retain(|name, _| name.len() < 20);
    image.write_exr(&path).unwrap();
    let whole = fs::read(&path).unwrap();
    for index in 0..whole.len() {
        for flip in [0xff, 0x80, 0x01] {
            let mut broken = whole.clone();
            broken[index] ^= flip;
            fs::write(&path, &broken).unwrap();
            // A changed sample is as good as another, but a changed header must not crash.
            if let Ok(read) = Image::read_exr(&path) {
                let pixel_count = read.pixel_count();
                assert!(read.channels.values().all(|samples| samples.len() == pixel_count));
            }
        }
    }
}

#[test]
fn a_header_that_promises_more_than_the_file_can_hold_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("vast.exr");
    // 2^30 x 2^30 pixels of 16 bytes are 2^64 bytes, which overflow.
    let (low, high) = (-(1_i32 << 29), (1_i32 << 29) - 1);
    for (names, [low, high], side) in [
        (&["Y"][..], [0, 1_000_000], "1000001"),
        (&["R", "G", "B", "A"], [low, high], "1073741824"),
    ] {
        let mut image = Image::new(5, 3);
        for name in names {
            image.channels.insert((*name).to_owned(), vec![1.0; 15]);
        }
        image.write_exr(&path).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        let window = b"dataWindow\0box2i\0\x10\0\0\0";
        let place = bytes.windows(window.len()).position(|found| found == window).unwrap();
        let corners = [low, low, high, high].map(i32::to_le_bytes).concat();
        bytes[place + window.len()..][..16].copy_from_slice(&corners);
        fs::write(&path, bytes).unwrap();
        let message = message(&path);
        assert!(message.contains(&format!("promises {side}x{side} pixels")), "{message}");
    }
}
