//! Environment maps from files and from parameters: values, repairs, warnings and refusals.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{fs, path::Path};

use exr::{
    math::Vec2 as ExrVec2,
    meta::attribute::Chromaticities,
    prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes,
        SpecificChannels, WritableImage,
    },
};
use fenestra_scene::{
    environment::{
        CourtParameters, DaylightParameters, EnvironmentMap, EnvironmentTables, SkyParameters,
    },
    math::{colour::luminance, frame::direction_from_lat_long},
    picture::RgbImage,
    texture::Texture,
};
use glam::{Vec2, Vec3};

use crate::support::folder::Folder;

/// Texel of an 8×4 map. All differ, and RGBE and half floats hold them exactly.
fn texel(index: usize) -> Vec3 {
    Vec3::new(1.0 + index as f32, 0.5, 2.0 * index as f32)
}

fn texels() -> Vec<Vec3> {
    (0..32).map(texel).collect()
}

/// Loads a map with its warnings.
fn load(path: &Path) -> (EnvironmentMap, Vec<String>) {
    let mut warnings = Vec::new();
    let map = EnvironmentMap::load(path, 1.0, &mut warnings).unwrap();
    (map, warnings)
}

/// Returns the message of a failed load and checks that it names the file.
fn refusal(path: &Path) -> String {
    let mut warnings = Vec::new();
    let message =
        EnvironmentMap::load(path, 1.0, &mut warnings).expect_err("is refused").to_string();
    assert!(message.starts_with(&path.display().to_string()), "{message}");
    message
}

fn hdr_bytes(width: usize, height: usize, texels: &[Vec3]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let texels: Vec<image::Rgb<f32>> = texels.iter().map(|t| image::Rgb(t.to_array())).collect();
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&texels, width, height).unwrap();
    bytes
}

fn pfm_bytes(
    width: usize,
    height: usize,
    texels: &[Vec3],
    big_endian: bool,
    grey: bool,
) -> Vec<u8> {
    let (magic, scale) = (if grey { "Pf" } else { "PF" }, if big_endian { "1.0" } else { "-1.0" });
    let mut bytes = format!("{magic}\n{width} {height}\n{scale}\n").into_bytes();
    for row in texels.chunks(width).rev() {
        for texel in row {
            for value in texel.to_array().into_iter().take(if grey { 1 } else { 3 }) {
                let value = if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
                bytes.extend(value);
            }
        }
    }
    bytes
}

fn write_exr(path: &Path, channels: Vec<(&str, FlatSamples)>) {
    let channels =
        channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
    let layer = Layer::new(
        (8, 4),
        LayerAttributes::named("map"),
        Encoding::FAST_LOSSLESS,
        AnyChannels::sort(channels),
    );
    Image::from_layer(layer).write().to_file(path).unwrap();
}

#[test]
fn every_format_gives_the_same_map_with_the_first_row_on_top() {
    let folder = Folder::new();
    let hdr = hdr_bytes(8, 4, &texels());
    // Mitsuba and others write their own word, and the content tells the format.
    let other = [b"#?RGBE", &hdr["#?RADIANCE".len()..]].concat();
    let mut paths = vec![folder.write("map.hdr", &hdr), folder.write("map.rgbe", &other)];
    paths.extend([folder.write("map.exr", &hdr), folder.write("map.png", &other)]);
    for (name, big_endian) in [("little.pfm", false), ("big.PFM", true)] {
        paths.push(folder.write(name, pfm_bytes(8, 4, &texels(), big_endian, false)));
    }
    let component = |c: usize| texels().iter().map(move |texel| texel[c]).collect::<Vec<f32>>();
    let half = |c: usize| component(c).into_iter().map(half::f16::from_f32).collect::<Vec<_>>();
    let path = folder.path().join("mixed.exr");
    // Mix channels of several types with others between them.
    write_exr(
        &path,
        vec![
            ("R", FlatSamples::F32(component(0))),
            ("G", FlatSamples::F16(half(1))),
            ("B", FlatSamples::F16(half(2))),
            ("A", FlatSamples::F32(vec![0.25; 32])),
            ("Z", FlatSamples::F32(vec![9.0; 32])),
        ],
    );
    paths.push(path);
    for path in paths {
        let (map, warnings) = load(&path);
        assert_eq!((map.width, map.height), (8, 4), "{}", path.display());
        assert_eq!(map.texels, texels(), "{}", path.display());
        assert_eq!(map.source, path.display().to_string());
        assert!(warnings.is_empty(), "{warnings:?}");
        // The first row is up.
        let up = map.radiance(Vec3::Y).x;
        assert!((1.0..=8.0).contains(&up), "{}: {up}", path.display());
    }
}

#[test]
fn grey_files_give_grey_maps() {
    let folder = Folder::new();
    let grey: Vec<Vec3> = texels().iter().map(|texel| Vec3::splat(texel.x)).collect();
    for big_endian in [false, true] {
        let path = folder.write("grey.pfm", pfm_bytes(8, 4, &texels(), big_endian, true));
        assert_eq!(load(&path).0.texels, grey);
    }
    let path = folder.path().join("grey.exr");
    write_exr(&path, vec![("Y", FlatSamples::F32(grey.iter().map(|texel| texel.x).collect()))]);
    assert_eq!(load(&path).0.texels, grey);
}

#[test]
fn images_of_8_bits_are_maps_of_srgb() {
    let folder = Folder::new();
    let (map, warnings) = load(&folder.write("map.ppm", b"P6\n2 1\n255\n\xff\x00\x80\xbc\xbc\xbc"));
    assert!(warnings.is_empty(), "{warnings:?}");
    // Values of the transfer function of IEC 61966-2-1.
    let expected = [Vec3::new(1.0, 0.0, 0.215_861), Vec3::splat(0.502_886)];
    assert!(
        map.texels.iter().zip(expected).all(|(own, other)| own.abs_diff_eq(other, 1e-6)),
        "{map:?}"
    );
}

#[test]
fn scale_and_rotation_are_applied() {
    let folder = Folder::new();
    let path = folder.write("map.hdr", hdr_bytes(8, 4, &texels()));
    let map = EnvironmentMap::load(&path, 2.5, &mut Vec::new()).unwrap().turned(-270.0);
    assert_eq!(map.texels[3], texel(3) * 2.5);
    assert!((map.rotation_rad - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    for scale in [-1.0, f32::NAN] {
        let error = EnvironmentMap::load(&path, scale, &mut Vec::new());
        assert!(error.unwrap_err().to_string().contains("scale"));
    }
}

#[test]
fn texels_that_are_not_radiance_become_black_and_are_counted() {
    let folder = Folder::new();
    let mut broken = texels();
    broken[0].y = -0.5;
    broken[5].x = f32::NAN;
    broken[6].z = f32::INFINITY;
    broken[31] = Vec3::NEG_INFINITY;
    broken[30].x = 1e30;
    let path = folder.write("broken.pfm", pfm_bytes(8, 4, &broken, false, false));
    let (map, warnings) = load(&path);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains("5 of 32 texels"), "{warnings:?}");
    for (index, value) in map.texels.iter().enumerate() {
        let expected = if [0, 5, 6, 30, 31].contains(&index) { Vec3::ZERO } else { texel(index) };
        assert_eq!(*value, expected, "texel {index}");
    }
    // A scale may bring a texel back among numbers.
    let mut warnings = Vec::new();
    let map = EnvironmentMap::load(&path, 1e-20, &mut warnings).unwrap();
    assert!(warnings[0].contains("4 of 32 texels") && map.texels[30].x > 9e9, "{warnings:?}");
}

#[test]
fn other_ratios_are_warned_of() {
    let folder = Folder::new();
    let path = folder.write("square.pfm", pfm_bytes(4, 8, &texels(), false, false));
    let (map, warnings) = load(&path);
    assert!(warnings.len() == 1 && warnings[0].contains("4×8"), "{warnings:?}");
    assert!((EnvironmentTables::new(&map).total).is_normal());
}

/// Headers as cameras, painters and Blender write them.
#[test]
fn what_headers_say_of_colours_and_windows_is_named() {
    let folder = Folder::new();
    let hdr = hdr_bytes(8, 4, &texels());
    let with = |line: &str| {
        let bytes = [b"#?RADIANCE\n", line.as_bytes(), &hdr["#?RADIANCE".len()..]].concat();
        let (map, warnings) = load(&folder.write("map.hdr", bytes));
        assert_eq!(map.texels, texels(), "{line}");
        warnings.concat()
    };
    let own = "PRIMARIES=0.640 0.330 0.290 0.600 0.150 0.060 0.333 0.333";
    assert_eq!(with(&format!("EXPOSURE=1\n{own}")), "");
    assert!(with("EXPOSURE=2").contains("not divided by `EXPOSURE`"));
    assert!(with("COLORCORR=1 2 1").contains("and `COLORCORR`"));
    assert!(with(&own.replace("0.290", "0.170")).contains("of other primaries"));

    let component = |c: usize| texels().iter().map(move |texel| texel[c]).collect::<Vec<f32>>();
    let path = folder.path().join("layers.exr");
    let layer = |name, c: usize| (name, FlatSamples::F32(component(c)));
    let black = |name| (name, FlatSamples::F32(vec![0.0; 32]));
    let emission = [black("a.Emit.R"), black("a.Emit.G"), black("a.Emit.B"), black("a.Depth.Z")];
    let combined = [layer("b.Combined.R", 0), layer("b.Combined.G", 1), layer("b.Combined.B", 2)];
    write_exr(&path, emission.into_iter().chain(combined).collect());
    let (map, warnings) = load(&path);
    assert_eq!(map.texels, texels());
    assert!(
        warnings.concat().contains("that of the channel `b.Combined.R` is read"),
        "{warnings:?}"
    );

    let path = folder.path().join("windows.exr");
    let colors = SpecificChannels::rgb(|at: ExrVec2<usize>| {
        let [r, g, b] = texel(at.x() + 8 * at.y()).to_array();
        (r, g, b)
    });
    let mut image = Image::from_channels((8, 4), colors);
    let point = |x, y| ExrVec2(x, y);
    let (red, green, blue) = (point(0.713, 0.293), point(0.165, 0.83), point(0.128, 0.044));
    image.attributes.chromaticities =
        Some(Chromaticities { red, green, blue, white: point(0.3217, 0.3377) });
    image.attributes.display_window.size = ExrVec2(9, 4);
    image.write().to_file(&path).unwrap();
    let (map, warnings) = load(&path);
    assert_eq!(map.texels, texels());
    let [window, primaries] = &warnings[..] else { panic!("{warnings:?}") };
    assert!(window.contains("its display window is taken to be its data window"), "{window}");
    assert!(primaries.contains("its colours are of other primaries"), "{primaries}");
}

#[test]
fn damaged_files_are_refused_with_a_reason() {
    let folder = Folder::new();
    let hdr = hdr_bytes(8, 4, &texels());
    let pfm = pfm_bytes(8, 4, &texels(), false, false);
    let exr_path = folder.path().join("whole.exr");
    write_exr(&exr_path, vec![("Y", FlatSamples::F32(vec![1.0; 32]))]);
    let exr = fs::read(&exr_path).unwrap();
    for (name, whole) in [("cut.hdr", &hdr), ("cut.pfm", &pfm), ("cut.exr", &exr)] {
        for length in [0, 1, 7, whole.len() / 3, whole.len() / 2, whole.len() - 1] {
            let path = folder.write(name, &whole[..length]);
            assert!(refusal(&path).len() > path.display().to_string().len() + 10);
        }
    }
    let cases: [(&str, &[u8], &str); 12] = [
        ("magic.hdr", b"no map", "not a readable Radiance file"),
        ("magic.exr", b"no map", "not a readable OpenEXR file"),
        ("word.pfm", b"P6\n2 1\n-1\n", "expected PF or Pf, found \"P6\""),
        ("width.pfm", b"PF\nwide 1\n-1\n", "width: expected an integer, found \"wide\""),
        ("height.pfm", b"PF\n2 -1\n-1\n", "height: expected an integer, found \"-1\""),
        ("scale.pfm", b"PF\n2 1\n0\n", "scale: expected a number other than 0"),
        ("short.pfm", b"PF\n2 1\n-1\n1234", "need 24 bytes, found 4"),
        ("zero.pfm", b"PF\n0 1\n-1\n", "0×1 texels"),
        ("absurd.pfm", b"PF\n4000000000 4000000000\n-1\n", "4000000000×4000000000 texels"),
        ("long.pfm", b"PF\n40000 2\n-1\n", "at most 32768 along a side"),
        (
            "absurd.hdr",
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 400000 +X 800000\n",
            "800000×400000 texels",
        ),
        ("map.jpg", b"", "expected a PNG"),
    ];
    for (name, bytes, expected) in cases {
        let message = refusal(&folder.write(name, bytes));
        assert!(message.contains(expected), "{message}");
    }
    let subsampled = b"Y\0\x02\0\0\0\0\0\0\0\x01\0\0\0\x01\0\0\0";
    let place = exr.windows(subsampled.len()).position(|found| found == subsampled).unwrap();
    let mut twice = exr.clone();
    (twice[place + 10], twice[place + 14]) = (2, 2);
    assert!(refusal(&folder.write("twice.exr", twice)).contains("subsampl"));
    // Textures have shorter sides, and are known by their first bytes.
    let texture = |bytes: &[u8]| Texture::decode("a", bytes, &mut Vec::new());
    let message = texture(b"PF\n20000 1\n-1\n").unwrap_err().to_string();
    assert!(message.contains("1 to 16384 texels a side, found 20000×1"), "{message}");
    assert!(texture(&[b"#?RGBE", &hdr[10..]].concat()).is_ok());
    let message = refusal(&folder.path().join("missing.hdr"));
    assert!(message.contains("cannot read"), "{message}");
    let path = folder.path().join("normals.exr");
    write_exr(&path, vec![("N.X", FlatSamples::F32(vec![1.0; 32]))]);
    let message = refusal(&path);
    assert!(message.contains("R, G, B or Y") && message.contains("N.X"), "{message}");
}

#[test]
fn a_header_that_promises_more_than_the_file_holds_is_refused() {
    let folder = Folder::new();
    let header = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8192 +X 16384\n";
    let message = refusal(&folder.write("vast.hdr", header.as_bytes()));
    assert!(message.contains("its header promises 16384x8192 pixels"), "{message}");
    let path = folder.path().join("vast.exr");
    write_exr(&path, vec![("Y", FlatSamples::F32(vec![1.0; 32]))]);
    let mut bytes = fs::read(&path).unwrap();
    let window = b"dataWindow\0box2i\0\x10\0\0\0";
    let place = bytes.windows(window.len()).position(|found| found == window).unwrap();
    let corner = place + window.len() + 8;
    bytes[corner..corner + 8].copy_from_slice(&[16383_u32, 8191].map(u32::to_le_bytes).concat());
    let message = refusal(&folder.write("vast.exr", &bytes));
    assert!(message.contains("its header promises 16384x8192 pixels"), "{message}");
    // A flat map of the largest size is compressed most, and is still read.
    let flat = vec![Vec3::ONE; 8192 * 64];
    let path = folder.write("flat.hdr", hdr_bytes(8192, 64, &flat));
    assert_eq!(load(&path).0.texels, flat);
}

#[test]
fn a_file_with_flipped_bytes_never_panics() {
    let folder = Folder::new();
    let exr_path = folder.path().join("whole.exr");
    write_exr(&exr_path, vec![("Y", FlatSamples::F32(vec![1.0; 32]))]);
    let sources = [
        ("flip.exr", fs::read(&exr_path).unwrap()),
        ("flip.hdr", hdr_bytes(8, 4, &texels())),
        ("flip.pfm", pfm_bytes(8, 4, &texels(), true, false)),
    ];
    for (name, bytes) in sources {
        for position in 0..bytes.len().min(400) {
            let mut damaged = bytes.clone();
            damaged[position] ^= 0xff;
            let path = folder.write(name, &damaged);
            // Either outcome is fine, but a map that loads must hold radiance.
            if let Ok(map) = EnvironmentMap::load(&path, 1.0, &mut Vec::new()) {
                assert!(map.texels.iter().all(|t| t.is_finite() && t.min_element() >= 0.0));
            }
        }
    }
}

#[test]
fn the_uffizi_map_loads_where_it_is_present() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/scenes/env/uffizi_1200x600.hdr");
    if !path.exists() {
        return;
    }
    let (map, warnings) = load(&path);
    assert_eq!((map.width, map.height), (1200, 600));
    assert!(warnings.is_empty(), "{warnings:?}");
    // Bright sky, dark paving.
    assert!(luminance(map.radiance(Vec3::Y)) > 10.0 * luminance(map.radiance(-Vec3::Y)));
}

/// Integrates lum L dω over directions that satisfy `condition`, by the midpoint rule over texels.
fn flux(map: &EnvironmentMap, condition: impl Fn(Vec3) -> bool) -> f64 {
    let (width, height) = (map.width, map.height);
    let mut sum = 0.0;
    for row in 0..height {
        let edge = |row: u32| (std::f64::consts::PI * f64::from(row) / f64::from(height)).cos();
        let solid_angle =
            2.0 * std::f64::consts::PI / f64::from(width) * (edge(row) - edge(row + 1));
        for column in 0..width {
            let uv =
                Vec2::new((column as f32 + 0.5) / width as f32, (row as f32 + 0.5) / height as f32);
            if condition(direction_from_lat_long(uv)) {
                let texel = map.texels[(row * width + column) as usize];
                sum += f64::from(luminance(texel)) * solid_angle;
            }
        }
    }
    sum
}

#[test]
fn the_sun_stands_where_it_should_with_the_power_it_should() {
    for width in [16, 64, 512, 1024] {
        for radius_deg in [0.02_f32, 0.27, 3.0] {
            let parameters = SkyParameters {
                width,
                sun_elevation_deg: 30.0,
                sun_azimuth_deg: 90.0,
                sun_radius_deg: radius_deg,
                sun_radiance: [1e5; 3],
                zenith: [0.0; 3],
                horizon: [0.0; 3],
                ground: [0.0; 3],
            };
            let map = EnvironmentMap::sky(&parameters, 1.0).unwrap();
            // 90° clockwise from −Z is +X.
            let sun = Vec3::new(0.866_025_4, 0.5, 0.0);
            // The middle of a texel lies within half its diagonal of the disc.
            let reach = (radius_deg + 0.75 * 360.0 / width as f32).to_radians().cos();
            let near = flux(&map, |direction| direction.dot(sun) > reach);
            let expected =
                1e5 * 2.0 * std::f64::consts::PI * (1.0 - f64::from(radius_deg).to_radians().cos());
            assert!((near / expected - 1.0).abs() < 1e-4, "{width}, {radius_deg}°: {near}");
            assert!((near / flux(&map, |_| true) - 1.0).abs() < 1e-9);
            if (width, radius_deg) == (1024, 3.0) {
                // Its rim lights the part of a texel that it covers: the disc within has its own radiance.
                let largest = map.texels.iter().map(|texel| texel.x).fold(0.0, f32::max);
                assert!((largest / 1e5 - 1.0).abs() < 5e-3, "{largest}");
            }
        }
    }
}

fn daylight(parameters: DaylightParameters) -> EnvironmentMap {
    EnvironmentMap::daylight(&parameters, 1.0).unwrap()
}

/// Irradiance of the sun of a daylight on a surface that faces it, and its direction.
fn sun(parameters: DaylightParameters) -> (Vec3, Vec3) {
    let [all, sky] =
        [1.0, 0.0].map(|sun_scale| daylight(DaylightParameters { sun_scale, ..parameters }));
    let (width, height) = (all.width as usize, all.height as usize);
    let (mut irradiance, mut direction) = (Vec3::ZERO, Vec3::ZERO);
    for (index, (all, sky)) in all.texels.iter().zip(&sky.texels).enumerate() {
        let (row, column) = ((index / width) as f32, (index % width) as f32);
        let edge = |row: f32| (std::f32::consts::PI * row / height as f32).cos();
        let solid_angle = std::f32::consts::TAU / width as f32 * (edge(row) - edge(row + 1.0));
        let own = (*all - *sky) * solid_angle;
        let uv = Vec2::new((column + 0.5) / width as f32, (row + 0.5) / height as f32);
        irradiance += own;
        direction += luminance(own) * direction_from_lat_long(uv);
    }
    (irradiance, direction.normalize())
}

/// Values of the emitter `sunsky` of Mitsuba 3.9.1 in RGB.
#[test]
fn sky_and_sun_are_those_of_mitsuba() {
    let of = |sun_direction: Vec3, turbidity: f32, albedo: [f32; 3]| DaylightParameters {
        sun_direction: Some(sun_direction.to_array()),
        turbidity,
        albedo,
        ..DaylightParameters::default()
    };
    let sky = |sun: Vec3, turbidity: f32, albedo: [f32; 3]| {
        daylight(DaylightParameters { sun_scale: 0.0, ..of(sun, turbidity, albedo) })
    };
    let map = sky(Vec3::new(0.3, 0.6, 0.5), 3.7, [0.2; 3]);
    for (direction, expected) in [
        (Vec3::Y, [0.02852724, 0.04459, 0.08474188]),
        (Vec3::new(0.5, 0.2, -0.5), [0.06040344, 0.09969734, 0.16682282]),
        (Vec3::new(-0.3, 0.4, 0.2), [0.03280686, 0.05470972, 0.10282528]),
    ] {
        // The mean of both sides: at the pole a texel's centre lies beside the direction.
        let side = |tilt: f32| map.radiance((direction.normalize() + tilt * Vec3::X).normalize());
        let found = (side(2e-3) + side(-2e-3)) / 2.0;
        let error = (found / Vec3::from(expected) - 1.0).abs().max_element();
        assert!(error < 1e-3, "{direction}: {found} {expected:?}");
    }
    for (elevation, turbidity, expected) in [
        (25.3_f32, 3.0, [1.3508092, 1.036_220_9, 0.65123785]),
        (7.7, 4.4, [0.663_972_8, 0.356_092_34, 0.098_340_44]),
        (1.0, 3.0, [0.26227944, 0.07084908, 0.0]),
    ] {
        let (sine, cosine) = elevation.to_radians().sin_cos();
        let (found, _) = sun(of(Vec3::new(cosine, sine, 0.0), turbidity, [0.2; 3]));
        assert!(found.abs_diff_eq(Vec3::from(expected), 1e-3), "{elevation}: {found}");
    }
    assert!(daylight(of(Vec3::NEG_Y, 3.0, [0.2; 3])).is_black());
    // The sky shows the colour of the ground.
    let zenith = |albedo: [f32; 3]| sky(Vec3::Y, 3.0, albedo).radiance(Vec3::X).to_array();
    let (grey, white) = (zenith([0.2; 3]), zenith([1.0; 3]));
    assert_eq!(zenith([0.2, 1.0, 0.2]), [grey[0], white[1], grey[2]]);
    assert!(white[1] > grey[1]);
}

/// The equation of time: clocks are 16.4 minutes behind on 3 November and 14.2 ahead on 11 February.
#[test]
fn the_sun_stands_south_at_noon_of_sundials() {
    for (date, minutes) in [([2025, 11, 3], -16.4), ([2025, 2, 11], 14.2)] {
        let hour = 12.0 + minutes / 60.0;
        let noon = DaylightParameters {
            date,
            hour,
            timezone: 0.0,
            place: [50.0, 0.0],
            ..Default::default()
        };
        let (_, direction) = sun(noon);
        assert!(direction.z > 0.0 && direction.x.abs() < 1e-3, "{date:?}: {direction}");
    }
}

#[test]
fn procedural_maps_are_lit_as_their_names_say() {
    let parameters = SkyParameters::default();
    let sky = EnvironmentMap::sky(&parameters, 1.0).unwrap();
    let brightest = sky.texels.iter().map(|texel| luminance(*texel)).fold(0.0, f32::max);
    assert!(brightest > 1e4, "{brightest}");
    // Away from the sun, the glow about it is gone.
    let opposite = Vec3::new(-50_f32.to_radians().sin(), 3e-3, 50_f32.to_radians().cos());
    let SkyParameters { zenith, horizon, ground, .. } = parameters;
    for (direction, expected) in [(Vec3::Y, zenith), (opposite, horizon), (-Vec3::Y, ground)] {
        let found = sky.radiance(direction);
        assert!(found.abs_diff_eq(expected.into(), 0.03), "{found} instead of {expected:?}");
    }
    // The horizon fades into the ground over 2°.
    for (down_deg, share) in [(1.0_f32, 0.5), (3.0, 1.0)] {
        let found = sky.radiance(opposite.with_y(-down_deg.to_radians().tan()).normalize());
        let expected = Vec3::from(horizon).lerp(ground.into(), share);
        assert!(found.abs_diff_eq(expected, 0.03), "{down_deg}°: {found} instead of {expected}");
    }
    // The glow falls to 1/e of its 1.5 in 0.17 rad.
    let even = SkyParameters { zenith: [1.0; 3], horizon: [1.0; 3], ..parameters };
    let even =
        EnvironmentMap::sky(&SkyParameters { sun_elevation_deg: 90.0, ..even }, 1.0).unwrap();
    let found = even.radiance(Vec3::new(0.17_f32.sin(), 0.17_f32.cos(), 0.0)).x;
    assert!((found - 1.0 - 1.5 * (-1_f32).exp()).abs() < 0.01, "{found}");

    let court = EnvironmentMap::court(&CourtParameters::default(), 1.0).unwrap();
    assert_eq!((court.width, court.height), (1024, 512));
    let (up, wall) = (court.radiance(Vec3::Y), court.radiance(Vec3::new(1.0, 0.3, 0.2)));
    assert!(up.abs_diff_eq(CourtParameters::default().sky.into(), 0.1), "{up}");
    assert!(luminance(up) > 10.0 * luminance(wall));
    // A gateway in the facade toward −Z, 45 m away, is a round arch of 9 m that shows the sky.
    let facade = |height: f32| luminance(court.radiance(Vec3::new(0.0, height - 1.7, -45.0)));
    assert!(facade(8.0) > 5.0 && facade(10.0) < 1.0, "{} {}", facade(8.0), facade(10.0));
    // Where all windows glint, a line through one column of panes meets one in each storey.
    let glints = CourtParameters { glint_share: 1.0, ..CourtParameters::default() };
    let glints = EnvironmentMap::court(&glints, 1.0).unwrap();
    let facade = (0..950).map(|step| {
        let way = Vec3::new(9.0, 0.02 * step as f32 - 1.7, 0.225).normalize();
        luminance(glints.radiance(way)) > 5.0
    });
    let facade: Vec<bool> = facade.collect();
    let windows = facade.windows(2).filter(|pair| !pair[0] && pair[1]).count();
    assert_eq!(windows, 3, "{facade:?}");
    let paving = |side: f32| flux(&court, |way| way.y < -0.3 && side * way.x > 0.0);
    assert!((paving(1.0) / paving(-1.0) - 1.0).abs() < 0.1, "{} {}", paving(1.0), paving(-1.0));
    let sky_share = flux(&court, |direction| direction.y > 0.7) / flux(&court, |_| true);
    assert!((0.4..0.95).contains(&sky_share), "{sky_share}");
    let glints = court.texels.iter().filter(|texel| texel.x > 30.0).count();
    assert!(glints > 20, "{glints} texels of glinting windows");
    assert!(court.texels.iter().all(|texel| texel.is_finite() && texel.min_element() > 0.0));
    let again = EnvironmentMap::court(&CourtParameters::default(), 1.0).unwrap();
    assert_eq!(court.texels, again.texels);
    let other = CourtParameters { seed: 2, ..CourtParameters::default() };
    assert_ne!(court.texels, EnvironmentMap::court(&other, 1.0).unwrap().texels);
    let scaled = EnvironmentMap::court(&CourtParameters::default(), 2.0).unwrap().turned(90.0);
    assert_eq!(scaled.texels[1000], court.texels[1000] * 2.0);
    let turned = scaled.radiance(-Vec3::X).distance(2.0 * court.radiance(-Vec3::Z));
    assert!(turned < 1e-3, "{turned}");
}

#[test]
fn parameters_out_of_range_are_refused_by_name() {
    type Made = Result<EnvironmentMap, String>;
    fn made<P: serde::de::DeserializeOwned>(text: &str, make: fn(&P, f32) -> Made) -> Made {
        make(&toml::from_str(text).map_err(|error| error.to_string())?, 1.0)
    }
    let sky = |text| made(text, EnvironmentMap::sky);
    let court = |text| made(text, EnvironmentMap::court);
    let daylight = |text| made(text, EnvironmentMap::daylight);
    sky("width = 64\nsun_radius_deg = 5").unwrap();
    court("width = 64\nstoreys = 20\nglint_share = 1").unwrap();
    let cases = [
        (sky("width = 63"), "width = 63"),
        (sky("width = 100000"), "16…16384"),
        (sky("sun_radius_deg = 0"), "sun_radius_deg = 0"),
        (sky("sun_elevation_deg = nan"), "sun_elevation_deg = NaN; expected 0…90"),
        (sky("zenith = [0, -1, 0]"), "zenith"),
        (sky("sun_radiance = [inf, 1, 1]"), "sun_radiance"),
        (sky("moon = 1"), "unknown field `moon`"),
        (daylight("turbidity = 0"), "turbidity = 0; expected 1…10"),
        (daylight("hour = 25"), "hour = 25; expected 0…24"),
        (daylight("date = [2026, 13, 1]"), "date: month = 13; expected 1…12"),
        (daylight("date = [2024, 2, 30]"), "date: day = 30; expected 1…29"),
        (daylight("date = [2025, 12, 32]"), "date: day = 32; expected 1…31"),
        (daylight("sun_direction = [0, 0, 0]"), "expected a vector other than 0"),
        (court("width = 0"), "width = 0"),
        (court("eye_height = 30"), "eye_height = 30"),
        (court("court_width = 0"), "court_width = 0"),
        (court("glint = [-1, 0, 0]"), "glint"),
        (court("storeys = 0"), "storeys = 0"),
        (court("facade = [2, 0, 0]"), "facade = 2"),
        (court("window_spacing = 0"), "window_spacing"),
        (court("glint_share = 1.5"), "glint_share = 1.5; expected 0…1"),
        (court("eye_hight = 1"), "unknown field `eye_hight`"),
    ];
    for (result, expected) in cases {
        let message = result.unwrap_err();
        assert!(message.contains(expected), "{message} should hold {expected}");
    }
    assert!(EnvironmentMap::constant(Vec3::new(1.0, -1.0, 0.0), 1.0).is_err());
    assert!(EnvironmentMap::constant(Vec3::ONE, f32::NAN).is_err());
    let square = RgbImage { width: 1, height: 1, pixels: vec![[1.0; 3]] };
    let mut warnings = Vec::new();
    EnvironmentMap::of_image("square", &square, 1.0, &mut warnings).unwrap();
    assert!(warnings[0].starts_with("square: 1×1 texels; a lat-long map"), "{warnings:?}");
    assert!(EnvironmentMap::sky(&SkyParameters::default(), f32::MAX).is_err());
}
