//! Textures: image files and what may be wrong with them, lookups against closed forms, and
//! `glsl/include/texture.glsl` against its twins.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{io::Cursor, sync::Arc};

use bytemuck::{Pod, Zeroable};
use fenestra::{
    accel::{
        Accel,
        attributes::{TriangleAttributes, attributes_of},
    },
    math::colour::luminance,
    scene::{
        Geometry,
        material::{Anisotropy, ConductorFresnel, Material, MaterialKind, Opacity},
        texture::{
            Channels, Encoding, Interpolation, MAX_TEXTURE_SIDE, Texels, Texture, TextureCache,
            TextureUse, Wrap, lookup::gradient_tangent,
        },
    },
    session::Settings,
    shader::{
        bindings::{Binding, scene},
        constants::{
            ATTRIBUTE_COLOR, ATTRIBUTE_FIRST_UVS, ATTRIBUTE_SECOND_UVS, ATTRIBUTE_TANGENT,
            CONSTANT_ATTRIBUTE_PAGE_SHIFT, CONSTANT_ATTRIBUTE_PAGES, CONSTANT_ATTRIBUTES,
            CONSTANT_TEXTURE_PAGE_SHIFT, CONSTANT_TEXTURE_PAGES, NO_TEXTURE, TEXTURE_NEAREST,
        },
        structs,
    },
    surface::{SurfaceTables, TextureTables},
};
use glam::{Vec2, Vec3, Vec4, vec2, vec3, vec4};
use half::f16;
use image::{DynamicImage, ImageFormat};

use crate::{
    support::{self, assert_error, materials, png_chunk, random::Random, scenes},
    twin::texture as twin,
};

// Image files

fn encode(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn decode(bytes: &[u8]) -> Texture {
    let mut warnings = Vec::new();
    let texture = Texture::decode("image", bytes, &mut warnings).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    texture
}

#[test]
fn images_of_every_kind_become_texels() {
    let rgba = image::RgbaImage::from_raw(2, 1, vec![1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
    let expected = Texels::Bytes(vec![[1, 2, 3, 4], [5, 6, 7, 8]]);
    for format in [ImageFormat::Png, ImageFormat::Tga] {
        let bytes = encode(&rgba.clone().into(), format);
        let folder = tempfile::tempdir().unwrap();
        // TGA has no magic number: the extension tells.
        let path = folder.path().join(format!("a.{}", format.extensions_str()[0]));
        std::fs::write(&path, bytes).unwrap();
        let texture = Texture::load(&path, &mut Vec::new()).unwrap();
        assert_eq!((texture.width, texture.height), (2, 1));
        assert_eq!(texture.texels, expected);
    }
    let grey = image::GrayImage::from_raw(1, 1, vec![77]).unwrap();
    let texels = decode(&encode(&grey.into(), ImageFormat::Png)).texels;
    assert_eq!(texels, Texels::Bytes(vec![[77, 77, 77, 255]]));
    let grey = image::GrayAlphaImage::from_raw(1, 1, vec![77, 5]).unwrap();
    let texels = decode(&encode(&grey.into(), ImageFormat::Png)).texels;
    assert_eq!(texels, Texels::Bytes(vec![[77, 77, 77, 5]]));
    let deep = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(1, 1, vec![12_345]).unwrap();
    let texels = decode(&encode(&deep.into(), ImageFormat::Png)).texels;
    assert_eq!(texels, Texels::Shorts(vec![[12_345, 12_345, 12_345, u16::MAX]]), "all 16 bits");
    let flat = image::RgbImage::from_pixel(8, 8, image::Rgb([200, 200, 200]));
    let Texels::Bytes(texels) = decode(&encode(&flat.into(), ImageFormat::Jpeg)).texels else {
        panic!("a JPEG has bytes")
    };
    assert!(texels.iter().all(|texel| texel[0].abs_diff(200) <= 2 && texel[3] == 255));
    let float = image::Rgb32FImage::from_raw(1, 1, vec![0.5, 2.0, 100.0]).unwrap();
    for format in [ImageFormat::Hdr, ImageFormat::OpenExr] {
        let texels = decode(&encode(&float.clone().into(), format)).texels;
        let expected = [0.5, 2.0, 100.0, 1.0].map(f16::from_f32);
        assert_eq!(texels, Texels::Halves(vec![expected]), "{format:?}");
    }
}

#[test]
fn colour_chunks_of_png_count_for_nothing() {
    let image = image::RgbImage::from_raw(1, 1, vec![10, 100, 200]).unwrap();
    let plain = encode(&image.into(), ImageFormat::Png);
    let gamma = png_chunk(b"gAMA", &100_000_u32.to_be_bytes());
    // The header is the first chunk: 8 bytes of signature, 25 of the header.
    let tagged = [&plain[..33], &gamma, &plain[33..]].concat();
    assert_eq!(decode(&tagged).texels, decode(&plain).texels);
}

#[test]
fn values_that_no_half_holds_are_repaired_with_a_warning() {
    let values = vec![f32::NAN, -1.0, 1e9, 0.5, f32::INFINITY, f32::NEG_INFINITY, 0.25, 7.0];
    let image = image::Rgba32FImage::from_raw(2, 1, values).unwrap();
    let bytes = encode(&image.into(), ImageFormat::OpenExr);
    let mut warnings = Vec::new();
    let texture = Texture::decode("sun.exr", &bytes, &mut warnings).unwrap();
    let expected = [[0.0, 0.0, 65_504.0, 0.5], [65_504.0, 0.0, 0.25, 1.0]];
    let expected = expected.map(|texel: [f32; 4]| texel.map(f16::from_f32));
    assert_eq!(texture.texels, Texels::Halves(expected.to_vec()));
    assert_eq!(warnings[0], "sun.exr: 3 values are negative or not a number and were set to 0");
    assert!(warnings[1].starts_with("sun.exr: 3 values are above 65504, or opacities above 1"));
}

#[test]
fn damaged_and_huge_images_are_refused() {
    let case = |bytes: &[u8], expected: &str| {
        assert_error(Texture::decode("image", bytes, &mut Vec::new()), &[expected]);
    };
    case(
        b"",
        "expected a PNG, JPEG, WebP, TGA, BMP, PNM, HDR, EXR or PFM image, found another file",
    );
    case(b"GIF89a", "found another file");
    let image: DynamicImage = image::RgbImage::new(4, 4).into();
    let png = encode(&image, ImageFormat::Png);
    case(&png[..png.len() / 2], "not a readable image");
    let lie = |width: u32, height: u32| {
        let sizes = [width, height].map(u32::to_be_bytes).concat();
        let header = png_chunk(b"IHDR", &[&sizes[..], &png[24..29]].concat());
        [&png[..8], &header, &png[33..]].concat()
    };
    assert_eq!(lie(4, 4), png);
    case(
        &lie(MAX_TEXTURE_SIDE + 1, 1),
        "expected an image of 1 to 16384 texels a side, found 16385×1",
    );
    case(&lie(16_000, 16_000), "its header promises 16000x16000 pixels");
    case(&lie(16, 16), "not a readable image");
    let exr = encode(&image.into_rgb32f().into(), ImageFormat::OpenExr);
    case(&exr[..exr.len() - 20], "not a readable OpenEXR file");
    let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16000 +X 16000\n\x02\x02\x3e\x80";
    case(hdr, "its header promises 16000x16000 pixels");
    let jpeg = encode(&image::RgbImage::new(8, 8).into(), ImageFormat::Jpeg);
    let frame = jpeg.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
    let mut huge = jpeg.clone();
    huge[frame + 5..frame + 9].copy_from_slice(&[0x3e, 0x80, 0x3e, 0x80]);
    case(&huge, "its header promises 16000x16000 pixels");
}

#[test]
fn a_file_is_decoded_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    std::fs::write(&path, encode(&image::RgbImage::new(2, 2).into(), ImageFormat::Png)).unwrap();
    let own = folder.path().file_name().unwrap();
    let again = folder.path().join("..").join(own).join("a.png");
    let mut cache = TextureCache::default();
    let mut warnings = Vec::new();
    cache.load_all([path.clone(), again.clone(), path.clone()], &mut warnings).unwrap();
    let texture = cache.load(&path, &mut warnings).unwrap();
    assert!(Arc::ptr_eq(&texture, &cache.load(&again, &mut warnings).unwrap()));
    assert_eq!(cache.files().len(), 1);
    let missing = folder.path().join("b.png");
    assert_error(cache.load_all([missing], &mut warnings), &["b.png: cannot read"]);
}

// Lookups against closed forms

/// Reads a texture alone at texture coordinates.
fn value(used: &TextureUse, uv: Vec2) -> Vec4 {
    let mut tables = TextureTables::default();
    let index = tables.add(Some(used));
    let words = tables.words(0..tables.word_count);
    twin::texture_value(&words, &tables.uses, index, uv, Vec2::NAN)
}

fn texture(width: u32, height: u32, texels: Texels) -> Arc<Texture> {
    Arc::new(Texture { name: format!("{width}×{height}"), width, height, texels })
}

/// A ramp: the centre of texel i has the value (i + ½) / width.
fn ramp(width: u32) -> Arc<Texture> {
    let texel = |index| [(index as f32 + 0.5) / width as f32, 0.0, 0.0, 1.0].map(f16::from_f32);
    texture(width, 1, Texels::Halves((0..width).map(texel).collect()))
}

#[test]
fn a_ramp_is_interpolated_and_continued() {
    let mut used = TextureUse::new(ramp(8));
    let close = |used: &TextureUse, u: f32, expected: f32| {
        let found = value(used, vec2(u, 0.3)).x;
        assert!((found - expected).abs() < 1e-3, "{:?} at {u}: {found}, not {expected}", used.wrap);
    };
    let (first, last) = (1.0 / 16.0, 15.0 / 16.0);
    for step in 0..100 {
        let u = first + (last - first) * step as f32 / 99.0;
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            used.wrap = [wrap; 2];
            close(&used, u, u);
            close(&used, u + 6.0, if wrap == Wrap::Clamp { last } else { u });
            close(&used, u - 4.0, if wrap == Wrap::Clamp { first } else { u });
        }
        used.wrap = [Wrap::Mirror; 2];
        close(&used, -u, u);
        close(&used, 2.0 - u, u);
        close(&used, u - 3.0, 1.0 - u);
    }
    used.wrap = [Wrap::Repeat; 2];
    close(&used, 0.0, 0.5 * (first + last));
    close(&used, -7.0, 0.5 * (first + last));
    used.wrap = [Wrap::Mirror; 2];
    close(&used, 1.0, last);
    close(&used, f32::INFINITY, first);
    close(&used, f32::NAN, first);
    used.interpolation = Interpolation::Nearest;
    for texel in 0..8 {
        let centre = (texel as f32 + 0.5) / 8.0;
        close(&used, centre - 0.06, centre);
        close(&used, centre + 0.06, centre);
    }
}

#[test]
fn colours_are_decoded_before_interpolation() {
    let used = TextureUse::new(texture(2, 1, Texels::Bytes(vec![[0, 0, 0, 0], [255; 4]])));
    assert!(value(&used, vec2(0.5, 0.5)).abs_diff_eq(Vec4::splat(0.5), 1e-6));
    let grey = |encoding, texels| {
        let mut used = TextureUse::new(texture(1, 1, texels));
        used.encoding = encoding;
        value(&used, Vec2::ZERO)
    };
    let bytes = Texels::Bytes(vec![[128, 10, 255, 128]]);
    // IEC 61966-2-1 in double precision.
    let curve = |byte: f64| {
        let share = byte / 255.0;
        if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
    };
    let alpha = 128.0 / 255.0;
    let expected = vec4(curve(128.0) as f32, curve(10.0) as f32, 1.0, alpha);
    assert!(grey(Encoding::Srgb, bytes.clone()).abs_diff_eq(expected, 1e-6));
    let expected = vec4(alpha, 10.0 / 255.0, 1.0, alpha);
    assert!(grey(Encoding::Linear, bytes).abs_diff_eq(expected, 1e-6));
    let shorts = Texels::Shorts(vec![[128 * 257, 10 * 257, 65_535, 128 * 257]]);
    assert!(grey(Encoding::Linear, shorts.clone()).abs_diff_eq(expected, 1e-6));
    let expected = vec4(curve(128.0) as f32, curve(10.0) as f32, 1.0, alpha);
    assert!(grey(Encoding::Srgb, shorts).abs_diff_eq(expected, 1e-6));
}

#[test]
fn channels_factors_and_coordinates_come_in_their_order() {
    let texels = vec![[51, 102, 153, 204]];
    let mut used = TextureUse::new(texture(1, 1, Texels::Bytes(texels)));
    used.encoding = Encoding::Linear;
    used.scale = [2.0, 1.0, 0.5];
    used.bias = [0.0, 0.1, -0.1];
    let mut check = |channels, red: f32, green: f32, blue: f32| {
        used.channels = channels;
        let expected = vec4(2.0 * red, green + 0.1, 0.5 * blue - 0.1, 0.8);
        assert!(value(&used, Vec2::ZERO).abs_diff_eq(expected, 1e-6), "{channels:?}");
    };
    check(Channels::Color, 0.2, 0.4, 0.6);
    check(Channels::Red, 0.2, 0.2, 0.2);
    check(Channels::Green, 0.4, 0.4, 0.4);
    check(Channels::Blue, 0.6, 0.6, 0.6);
    check(Channels::Alpha, 0.8, 0.8, 0.8);
    let mut used = TextureUse::new(texture(2, 2, Texels::Bytes((1..=4).map(|v| [v; 4]).collect())));
    used.encoding = Encoding::Linear;
    used.interpolation = Interpolation::Nearest;
    assert_eq!((value(&used, vec2(0.1, 0.1)) * 255.0).round(), Vec4::splat(1.0), "upper left");
    let image = Arc::clone(&used.texture);
    let lower_left =
        TextureUse { image_from_uv: TextureUse::from_lower_left(image).image_from_uv, ..used };
    assert_eq!((value(&lower_left, vec2(0.1, 0.1)) * 255.0).round(), Vec4::splat(3.0));
    assert_eq!(twin::texture_value(&[0], &[], NO_TEXTURE, Vec2::ZERO, Vec2::ZERO), Vec4::ONE);
}

#[test]
fn tangents_follow_the_image_on_either_side_and_mirrored() {
    let edges = [vec3(2.0, 0.0, 0.0), vec3(0.0, 3.0, 0.0)];
    let tangent = |image| gradient_tangent(edges, image, Vec3::Z);
    // u to the right, v of the image down.
    assert_eq!(tangent([vec2(1.0, 0.0), vec2(0.0, -1.0)]), vec4(1.0, 0.0, 0.0, 1.0));
    assert_eq!(tangent([vec2(-1.0, 0.0), vec2(0.0, -1.0)]), vec4(-1.0, 0.0, 0.0, -1.0));
    assert_eq!(tangent([vec2(0.0, -1.0), vec2(1.0, 0.0)]), vec4(0.0, 1.0, 0.0, -1.0));
    assert_eq!(tangent([vec2(1.0, 1.0), vec2(2.0, 2.0)]), Vec4::ZERO);
    let flat = vec3(0.5, 0.5, 1.0);
    let right = vec3(1.0, 0.5, 0.5);
    let up = vec3(0.5, 1.0, 0.5);
    let along = vec4(1.0, 0.0, 0.0, 1.0);
    for side in [1.0, -1.0] {
        let mapped = |texel| twin::mapped_normal(texel, 1.0, along, side * Vec3::Z, side);
        assert!(mapped(flat).abs_diff_eq(side * Vec3::Z, 1e-6));
        // The back is the same relief from behind: its normals point the other way.
        assert!(mapped(right).abs_diff_eq(side * Vec3::X, 1e-6));
        assert!(mapped(up).abs_diff_eq(side * Vec3::Y, 1e-6));
    }
    assert_eq!(twin::mapped_normal(right, 1.0, Vec4::ZERO, Vec3::Z, 1.0), Vec3::Z);
    assert!(twin::mapped_normal(right, 0.0, along, Vec3::Z, 1.0).abs_diff_eq(Vec3::Z, 1e-6));
}

// The shader against its twins

/// Texels in pages of this many words, so that all four pages hold some.
const TEXTURE_PAGE_SHIFT: u32 = 6;
/// Attributes in smaller pages.
const ATTRIBUTE_PAGE_SHIFT: u32 = 5;

fn images(numbers: &mut Random) -> Vec<Arc<Texture>> {
    let mut byte = || (numbers.uniform_f32() * 256.0) as u8;
    let bytes = (0..15).map(|_| [byte(), byte(), byte(), byte()]).collect();
    let more = (0..64).map(|_| [byte(), byte(), byte(), byte()]).collect();
    let mut short = || u16::from(byte()) << 8 | u16::from(byte());
    let shorts = (0..35).map(|_| [short(), short(), short(), short()]).collect();
    let mut float = || f16::from_f32(4.0 * numbers.uniform_f32());
    let halves = (0..36).map(|_| [float(), float(), float(), float()]).collect();
    vec![
        texture(5, 3, Texels::Bytes(bytes)),
        texture(7, 5, Texels::Shorts(shorts)),
        texture(4, 9, Texels::Halves(halves)),
        texture(8, 8, Texels::Bytes(more)),
        texture(1, 1, Texels::Bytes(vec![[1, 20, 230, 255]])),
    ]
}

/// Every combination of what a use can say, with random placement.
fn uses(images: &[Arc<Texture>], numbers: &mut Random) -> Vec<TextureUse> {
    let mut uses = Vec::new();
    let wraps = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];
    let channels =
        [Channels::Color, Channels::Red, Channels::Green, Channels::Blue, Channels::Alpha];
    for image in images {
        for index in 0..180 {
            let mut number = || 2.0 * numbers.uniform_f32() - 1.0;
            uses.push(TextureUse {
                texture: Arc::clone(image),
                channels: channels[index % 5],
                encoding: [Encoding::Srgb, Encoding::Linear][index / 5 % 2],
                uv_set: (index % 2) as u32,
                image_from_uv: [[number(), number(), number()], [number(), number(), number()]],
                wrap: [wraps[index / 10 % 3], wraps[index / 30 % 3]],
                interpolation: [Interpolation::Bilinear, Interpolation::Nearest][index / 90 % 2],
                scale: [number(), number(), number()],
                bias: [number(), number(), number()],
            });
        }
    }
    uses
}

fn materials(uses: &[TextureUse]) -> Vec<Material> {
    let material = |(index, used): (usize, &TextureUse)| {
        let reflectance = Vec3::splat(0.5);
        let mut material = Material::new("m", MaterialKind::Diffuse { reflectance });
        material.surface.normal = Some(used.clone());
        material.surface.normal_scale = 0.1 + 0.2 * (index % 7) as f32;
        material.surface.vertex_color = index % 2 == 0;
        // An opacity that is just the cutoff is not below it.
        let (factor, cutoff) = if index % 15 == 0 { (0.0, 0.0) } else { (0.9, 0.3) };
        material.surface.opacity = Opacity {
            factor,
            texture: (index % 3 != 0).then(|| used.clone()),
            cutoff: (index % 5 == 0).then_some(cutoff),
        };
        material
    };
    uses.iter().enumerate().map(material).collect()
}

/// Triangles with two sets of coordinates, tangents for most and colours.
fn geometry(numbers: &mut Random) -> Geometry {
    let mut geometry = Geometry::default();
    for triangle in 0..6 {
        let first = geometry.positions.len() as u32;
        geometry.triangles.push([first, first + 1, first + 2]);
        geometry.materials.push(0);
        for corner in 0..3 {
            geometry.positions.push((5.0 * numbers.point()).to_array());
            geometry.normals.push([0.0; 3]);
            for uvs in &mut geometry.uvs {
                uvs.push((3.0 * numbers.point()).truncate().to_array());
            }
            let is_there = triangle % 3 != 0 || corner != 1;
            let tangent = if is_there { numbers.point().normalize() } else { Vec3::ZERO };
            let sign = if triangle % 2 == 0 { 1.0 } else { -1.0 };
            geometry.tangents.push(tangent.extend(sign).to_array());
            geometry.colors.push([0, 1, 2, 3].map(|_| numbers.uniform_f32()));
        }
    }
    geometry
}

#[test]
fn colours_of_vertices_end_at_black_and_white() {
    let words = |color: [f32; 4]| {
        let mut geometry = geometry(&mut Random(7));
        geometry.colors.fill(color);
        let accel = Accel::build(&geometry, 1 << 20).unwrap();
        TriangleAttributes::new(&geometry, &accel, ATTRIBUTE_COLOR).words
    };
    assert_eq!(words([2.0, -1.0, 0.5, 1.0]), words([1.0, 0.0, 0.5, 1.0]));
}

/// Twin of `TextureQuery` in `glsl/test/texture.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct TextureQuery {
    use_index: u32,
    material: u32,
    triangle: u32,
    side: f32,
    uv0: Vec2,
    uv1: Vec2,
    weights: Vec3,
    shading_normal: Vec3,
}

/// Twin of `TextureAnswer` in `glsl/test/texture.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct TextureAnswer {
    value: [f32; 4],
    number: f32,
    used: structs::TextureUse,
    surface: structs::MaterialSurface,
    uv0: Vec2,
    uv1: Vec2,
    tangent: [f32; 4],
    color: [f32; 4],
    opacity: f32,
    surface_color: [f32; 3],
    mapped: Vec3,
}

/// Cuts words into pages for four bindings; missing pages repeat the first.
fn pages(words: &[u32], shift: u32, names: [Binding; 4]) -> (u32, Vec<(Binding, &[u8])>) {
    let pages: Vec<&[u32]> = words.chunks(1 << shift).collect();
    assert!(pages.len() <= 4, "{} pages", pages.len());
    let page = |(index, name)| {
        let words = pages.get(index).copied().unwrap_or(pages[0]);
        (name, bytemuck::cast_slice(words))
    };
    (pages.len() as u32, names.into_iter().enumerate().map(page).collect())
}

/// Compares shader and twins for triangles with the attributes `bits`.
fn compare(bits: u32) {
    let numbers = &mut Random(7);
    let uses = uses(&images(numbers), numbers);
    let surfaces = SurfaceTables::new(&materials(&uses));
    let textures = &surfaces.textures;
    let words = textures.words(0..textures.word_count);
    for from in (0..textures.word_count).step_by(50) {
        let page = textures.words(from..from + 50);
        assert_eq!(page, words[from as usize..words.len().min(from as usize + 50)]);
    }
    let geometry = geometry(numbers);
    let accel = Accel::build(&geometry, 1 << 20).unwrap();
    let attributes = TriangleAttributes::new(&geometry, &accel, bits);
    let queries: Vec<TextureQuery> = (0..20_000)
        .map(|index| {
            let material = index % surfaces.surfaces.len();
            let mut uv = || (4.0 * numbers.point()).truncate();
            let (uv0, uv1) = (uv(), uv());
            let [a, b] = [numbers.uniform_f32(), numbers.uniform_f32()];
            let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
            TextureQuery {
                use_index: surfaces.surfaces[material].normal,
                material: material as u32,
                triangle: (numbers.uniform_f32() * accel.triangle_count() as f32) as u32,
                side: if index % 2 == 0 { 1.0 } else { -1.0 },
                uv0,
                uv1,
                weights: vec3(a, b, 1.0 - a - b),
                shading_normal: numbers.point().normalize(),
            }
        })
        .collect();

    let texture_names = [
        scene::TEXTURE_WORDS_0,
        scene::TEXTURE_WORDS_1,
        scene::TEXTURE_WORDS_2,
        scene::TEXTURE_WORDS_3,
    ];
    let (texture_pages, mut buffers) = pages(&words, TEXTURE_PAGE_SHIFT, texture_names);
    assert_eq!(texture_pages, 4, "every page is read");
    let attribute_names = [
        scene::TRIANGLE_ATTRIBUTES_0,
        scene::TRIANGLE_ATTRIBUTES_1,
        scene::TRIANGLE_ATTRIBUTES_2,
        scene::TRIANGLE_ATTRIBUTES_3,
    ];
    let attribute_words = if bits == 0 { &[0][..] } else { &attributes.words };
    let shift = ATTRIBUTE_PAGE_SHIFT + u32::from(attribute_words.len() > 128);
    let (attribute_pages, more) = pages(attribute_words, shift, attribute_names);
    buffers.extend(more);
    buffers.extend([
        (scene::TEXTURE_USE_TEXELS, bytemuck::cast_slice(&textures.uses)),
        (scene::MATERIAL_SURFACE_TEXELS, bytemuck::cast_slice(&surfaces.surfaces)),
        // No instances: the shader leaves this alone.
        (scene::INSTANCES, bytemuck::cast_slice(&[0_u32; 32])),
    ]);
    let triangles = bytemuck::cast_slice(&accel.triangle_pages[0]);
    let page = |name| (name, triangles);
    buffers.extend(
        [scene::TRIANGLES_0, scene::TRIANGLES_1, scene::TRIANGLES_2, scene::TRIANGLES_3].map(page),
    );
    let constants = [
        (CONSTANT_TEXTURE_PAGES, texture_pages),
        (CONSTANT_TEXTURE_PAGE_SHIFT, TEXTURE_PAGE_SHIFT),
        (CONSTANT_ATTRIBUTE_PAGES, attribute_pages),
        (CONSTANT_ATTRIBUTE_PAGE_SHIFT, shift),
        (CONSTANT_ATTRIBUTES, attributes.bits),
    ];
    let answers: Vec<TextureAnswer> = support::run_probe("texture", &constants, &buffers, &queries);

    // Rounding may move a point into the next texel of a texture without interpolation, and turn an
    // opacity at its cutoff.
    let mut other_texels = 0;
    for (query, answer) in queries.iter().zip(&answers) {
        let TextureQuery { use_index, uv0, uv1, triangle, side, .. } = *query;
        assert_eq!(answer.used, textures.uses[use_index as usize], "the use as loaded");
        assert_eq!(answer.surface, surfaces.surfaces[query.material as usize], "the surface");
        let at = twin::triangle_attributes(&attributes, triangle, query.weights);
        let surface = &surfaces.surfaces[query.material as usize];
        let value = twin::texture_value(&words, &textures.uses, use_index, uv0, uv1);
        let uvs = [at.uv0, at.uv1];
        let opacity = twin::surface_opacity(&words, &textures.uses, surface, uvs, at.color.w);
        let color = at.color.truncate();
        let color = twin::surface_color(&words, &textures.uses, surface, uvs, color);
        let number = answer.number - luminance(value.truncate());
        let is_other = !Vec4::from(answer.value).abs_diff_eq(value, 2e-4)
            || number.abs() > 2e-4
            || (answer.opacity - opacity).abs() > 2e-4
            || !Vec3::from(answer.surface_color).abs_diff_eq(color, 2e-4);
        let is_one_texel = answer.used.width * answer.used.height == 1;
        assert!(!is_one_texel || answer.value[3] == 1.0, "opaque between alike texels: {answer:?}");
        assert!(answer.uv0.abs_diff_eq(at.uv0, 1e-5), "{query:?}");
        assert!(answer.uv1.abs_diff_eq(at.uv1, 1e-5), "{query:?}");
        assert!(Vec4::from(answer.tangent).abs_diff_eq(at.tangent, 1e-5), "{query:?}");
        assert!(Vec4::from(answer.color).abs_diff_eq(at.color, 1e-5), "{query:?}");

        let normal = side * query.shading_normal;
        let mut tangent = twin::stored_tangent(at.tangent, normal);
        if tangent == Vec4::ZERO {
            let used = &textures.uses[use_index as usize];
            let image = [0, 1, 2].map(|corner| {
                let uv = |bit| twin::words(&attributes).corner_uv(triangle, corner, bit);
                twin::image_coordinates(used, uv(ATTRIBUTE_FIRST_UVS), uv(ATTRIBUTE_SECOND_UVS))
            });
            let [a, b, c] = accel.triangle(triangle).vertices.map(|v| Vec3::from(v.position));
            let image = [image[1] - image[0], image[2] - image[0]];
            tangent = gradient_tangent([b - a, c - a], image, normal);
        }
        let texel = twin::texture_value(&words, &textures.uses, use_index, at.uv0, at.uv1);
        let mapped = twin::mapped_normal(
            texel.truncate(),
            surface.normal_scale,
            tangent,
            query.shading_normal,
            side,
        );
        let is_turned = !answer.mapped.abs_diff_eq(mapped, 5e-3);
        other_texels += usize::from(is_other || is_turned);
        let may_differ = textures.uses[use_index as usize].flags & TEXTURE_NEAREST != 0
            || surface.opacity_cutoff >= 0.0;
        assert!(!is_other || may_differ, "{query:?}: {answer:?}");
    }
    assert!(other_texels < queries.len() / 200, "{other_texels} answers differ");
}

#[test]
fn shader_agrees_with_its_twins_for_all_attributes() {
    compare(ATTRIBUTE_FIRST_UVS | ATTRIBUTE_SECOND_UVS | ATTRIBUTE_TANGENT | ATTRIBUTE_COLOR);
}

#[test]
fn shader_agrees_with_its_twins_for_some_attributes() {
    compare(ATTRIBUTE_SECOND_UVS | ATTRIBUTE_COLOR);
    compare(ATTRIBUTE_FIRST_UVS);
    compare(0);
}

/// A texture of one value is a factor of its property: of the colour, of the root of the width, of the share
/// of metal; and no surface reflects more than all light. The paths are those of a scene without textures,
/// whose materials have the products.
#[test]
fn textures_of_one_value_are_factors() {
    let _alone = support::alone();
    let metal = |alpha, reflectance| MaterialKind::Conductor {
        alpha,
        fresnel: ConductorFresnel::Schlick { reflectance },
    };
    let copper = |alpha, reflectance| MaterialKind::Conductor {
        alpha,
        fresnel: ConductorFresnel::Exact {
            reflectance,
            eta: vec3(0.27, 1.03, 1.17),
            k: vec3(3.41, 2.58, 2.42),
        },
    };
    let (full, half) = (vec3(0.8, 0.6, 0.4), vec3(0.4, 0.15, 1.0));
    let of = |kind| Material::new("m", kind);
    // Coloured texels count by their luminance.
    let (texel, dark) = ([0.75, 0.375, 1.0], [0.375, 0.1875, 0.5]);
    let [share, metallic] = [texel, dark].map(|texel| luminance(texel.into()));
    let alpha = 0.8 * share * share;
    let mut plain = vec![
        of(MaterialKind::Diffuse { reflectance: half }),
        of(metal(alpha, half)),
        of(materials::principled(half, 0.8 * metallic, 0.5 * share)),
    ];
    let used = |value: [f32; 3]| {
        let [r, g, b] = value.map(f16::from_f32);
        // Halves are linear, whatever the role of their image says.
        Some(TextureUse {
            encoding: Encoding::Srgb,
            ..TextureUse::new(texture(1, 1, Texels::Halves(vec![[r, g, b, f16::ONE]])))
        })
    };
    let mut textured = vec![
        of(MaterialKind::Diffuse { reflectance: full }),
        of(metal(0.8, full)),
        of(materials::principled(full, 0.8, 0.5)),
    ];
    for material in &mut textured {
        // Half of the red is in the colours of vertices.
        material.surface.color = used([1.0, 0.25, 4.0]);
        material.surface.vertex_color = true;
        material.surface.roughness = used(texel);
        material.surface.metallic = used(dark);
    }
    // The last time below a sheen.
    for (strength, sheen) in [(0.0, 0.0), (0.4, 0.0), (0.0, 0.5)] {
        if strength > 0.0 {
            (plain[1].kind, textured[1].kind) = (copper(alpha, half), copper(0.8, full));
        }
        for material in [&mut plain[2], &mut textured[2]] {
            if let MaterialKind::Principled(own) = &mut material.kind {
                own.sheen_color = Vec3::splat(sheen);
            }
        }
        let of = |strength, direction| Anisotropy { strength, rotation: 0.7, direction };
        plain[2].surface.anisotropy = of(strength, None);
        textured[2].surface.anisotropy = of(2.0 * strength, used([1.0, 0.5, 0.5]));
        let [plain, textured] = [&plain, &textured].map(|materials| {
            let mut scene = scenes::room(materials.clone());
            scene.geometry.uvs[0] = vec![[0.3, 0.7]; scene.geometry.positions.len()];
            scene.geometry.colors = vec![[0.5, 1.0, 1.0, 1.0]; scene.geometry.positions.len()];
            let mut settings = Settings { depth: 3, ..Settings::default() };
            settings.parameters.set("share-paths=8").unwrap();
            support::render(&scene, settings, 2).0.sum
        });
        let is_same = |(one, other): (&f32, &f32)| (one - other).abs() <= 1e-3 * one.max(*other);
        let same = |(one, other): &(&[f32; 3], &[f32; 3])| one.iter().zip(*other).all(is_same);
        let same = plain.iter().zip(&textured).filter(same).count();
        // Rounding sends a path elsewhere now and then.
        assert!(100 * same >= 98 * plain.len(), "{same} of {} pixels are the same", plain.len());
    }
}

#[test]
fn attributes_are_laid_out_where_materials_need_them() {
    let numbers = &mut Random(1);
    let mut geometry = geometry(numbers);
    assert_eq!(attributes_of(&geometry), 15);
    geometry.tangents.clear();
    assert_eq!(attributes_of(&geometry), 15 - ATTRIBUTE_TANGENT);
    let mut material = Material::new("m", MaterialKind::Diffuse { reflectance: Vec3::splat(0.5) });
    assert_eq!(SurfaceTables::new(&[material.clone()]).attributes, 0);
    let image = texture(1, 1, Texels::Bytes(vec![[1; 4]]));
    material.surface.color = Some(TextureUse { uv_set: 1, ..TextureUse::new(Arc::clone(&image)) });
    let tables = SurfaceTables::new(&[material.clone()]);
    assert_eq!(tables.attributes, ATTRIBUTE_SECOND_UVS);
    material.surface.normal = Some(TextureUse::new(image));
    let tables = SurfaceTables::new(&[material.clone(), material]);
    assert_eq!(tables.attributes, ATTRIBUTE_FIRST_UVS | ATTRIBUTE_SECOND_UVS | ATTRIBUTE_TANGENT);
    assert_eq!(tables.textures.word_count, 1, "an image is there once");
    assert!(tables.textures.check(0).is_ok());
    let accel = Accel::build(&geometry, 1 << 20).unwrap();
    let words = TriangleAttributes::new(&geometry, &accel, tables.attributes).words.len();
    assert_eq!(words, 6 * 3 * 4, "there are no tangents");
}

#[test]
fn too_many_texels_are_refused_with_their_sizes() {
    let mut tables = TextureTables::default();
    for side in [4, 8] {
        let texels = Texels::Bytes(vec![[0; 4]; (side * side) as usize]);
        tables.add(Some(&TextureUse::new(texture(side, side, texels))));
    }
    assert!(tables.check(5).is_ok());
    // 80 words do not fit into 64.
    assert_error(tables.check(4), &["2 images need 1 MiB", "the largest is 8×8 (8×8"]);
}
