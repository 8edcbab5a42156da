//! Small sound files of every format that the program reads, for mutations to begin from.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::{fs, io::Cursor};

use fenestra_scene::picture::Image;
use flate2::{Compression, write::ZlibEncoder};
use image::{DynamicImage, ImageFormat, RgbImage, RgbaImage};

/// A scene with a mesh, maps and a part of everything that scene files may say.
pub const TOML: &str = r#"[camera]
position = [0.0, 1.0, 3.0]
look_at = [0.0, 0.3, 0.0]
vertical_fov_deg = 45.0

[film]
width = 24
height = 16

[environment]
map = "map.pfm"
scale = 2.0
rotation_deg = 30.0

[[material]]
name = "clay"
type = "plastic"
diffuse = [0.6, 0.4, 0.3]
roughness = 0.4
ior = 1.5

[[material]]
name = "steel"
type = "conductor"
roughness = 0.2
eta = [2.9, 2.9, 2.6]
k = [3.1, 3.1, 3.0]

[[material]]
name = "picture"
type = "diffuse"
reflectance = { texture = "image.png" }

[[object]]
mesh = "mesh.ply"
material = "clay"
translate = [0.0, 0.5, 0.0]
rotate_deg = [10.0, 20.0, 30.0]
scale = 2.0

[[object]]
shape = "box"
size = [4.0, 0.2, 4.0]
material = "steel"
translate = [0.0, -0.1, 0.0]

[[object]]
shape = "sphere"
radius = 0.4
segments = 8
material = "picture"
"#;

/// A scene under a sky, with a lamp.
pub const SKY: &str = r#"[camera]
position = [0, 1, 3]
look_at = [0, 0, 0]
vertical_fov_deg = 45
[film]
width = 8
height = 8
filter = "gaussian"
[environment]
sky = { width = 16, sun_elevation_deg = 30.0 }
[[material]]
name = "m"
type = "diffuse"
reflectance = [0.5, 0.5, 0.5]
[[object]]
shape = "box"
size = [1, 1, 1]
material = "m"
"#;

pub const PLY: &str = "ply\nformat ascii 1.0\ncomment a quad\nelement vertex 4\nproperty float x\n\
    property float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\n\
    property float u\nproperty float v\nelement face 2\nproperty list uchar int vertex_indices\n\
    end_header\n-1 -1 0 0 0 1 0 0\n1 -1 0 0 0 1 1 0\n1 1 0 0 0 1 1 1\n-1 1 0 0 0 1 0 1\n4 0 1 2 3\n\
    3 0 1 2\n";

/// Two triangles in binary PLY.
pub fn binary_ply(is_big: bool) -> Vec<u8> {
    let order = if is_big { "big" } else { "little" };
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex 4\nproperty float x\nproperty double \
         y\nproperty short z\nelement face 2\nproperty uchar flag\nproperty list uint8 uint32 \
         vertex_index\nend_header\n"
    )
    .into_bytes();
    let mut push = |little: Vec<u8>| {
        bytes.extend(if is_big { little.into_iter().rev().collect() } else { little });
    };
    for [x, y] in [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
        push(x.to_le_bytes().to_vec());
        push(f64::from(y).to_le_bytes().to_vec());
        push(3_i16.to_le_bytes().to_vec());
    }
    for face in [[0_u32, 1, 2], [0, 2, 3]] {
        push(vec![7]);
        push(vec![3]);
        face.iter().for_each(|index| push(index.to_le_bytes().to_vec()));
    }
    bytes
}

pub const OBJ: &str = "# quad\nmtllib input.mtl\no quad\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\ng front\nusemtl red\ns 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\n\
    usemtl glass\ns off\nf 1 2 3\nf -4//-1 -3//-1 -2//-1\nf 1 2 3 \\\n 4\n";

pub const MTL: &str = "newmtl red\nKd 0.8 0.2 0.1\nKs 0.1 0.1 0.1\nNs 100\nmap_Kd -s 2 2 1 -o 0.1 0 0 \
    image.png\nmap_Bump -bm 0.5 image.png\nillum 2\n\nnewmtl glass\nd 0.5\nTf 0.9 0.9 0.9\nNi 1.5\n\
    illum 4\nKe 1 1 1\nPr 0.3\nPm 1\nnorm image.png\n";

pub const GLTF_REST: &str = r#", "cameras": [{"type": "perspective",
    "perspective": {"yfov": 0.7, "znear": 0.1, "aspectRatio": 1.5}}],
    "extensionsUsed": ["KHR_lights_punctual"],
    "extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 5,
      "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}}]}},
    "images": [{"uri": "image.png"}], "samplers": [{"wrapS": 33071}],
    "textures": [{"source": 0, "sampler": 0}]"#;
pub const GLTF_NODES: &str = r#"{"mesh": 0, "translation": [1, 2, 3], "scale": [1, 1, 2],
    "children": [1, 2]}, {"camera": 0, "rotation": [0, 0, 0, 1]},
    {"extensions": {"KHR_lights_punctual": {"light": 0}}, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0,
    1, 0, 0, 0, 0, 1]}"#;
pub const GLTF_MATERIALS: &str = r#"{"name": "oak", "alphaMode": "MASK", "alphaCutoff": 0.4,
    "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.4, 0.3, 1],
      "baseColorTexture": {"index": 0}, "metallicFactor": 0.2, "roughnessFactor": 0.6},
    "emissiveFactor": [0, 1, 0], "normalTexture": {"index": 0, "scale": 0.5}}"#;

/// Puts a glTF document into a GLB container, with its buffer unless that is empty.
pub fn glb(document: &str, buffer: &[u8]) -> Vec<u8> {
    let mut json = document.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut chunks = Vec::new();
    for (kind, chunk) in [(b"JSON", &json[..]), (b"BIN\0", buffer)] {
        if !chunk.is_empty() {
            chunks.extend((chunk.len() as u32).to_le_bytes());
            chunks.extend(kind);
            chunks.extend(chunk);
        }
    }
    let length = (12 + chunks.len() as u32).to_le_bytes();
    [b"glTF\x02\0\0\0", &length[..], &chunks].concat()
}

/// Corrects the lengths of a GLB container of one chunk.
pub fn mend_glb(bytes: &mut [u8]) {
    if bytes.len() >= 20 {
        let length = bytes.len() as u32;
        bytes[8..12].copy_from_slice(&length.to_le_bytes());
        bytes[12..16].copy_from_slice(&(length - 20).to_le_bytes());
    }
}

pub const PBRT: &str = r#"LookAt 0 0 -5 0 0 0 0 1 0
Film "rgb" "integer xresolution" 20 "integer yresolution" 10 "string filename" "a.exr"
PixelFilter "gaussian" "float xradius" 2
Sampler "halton" "integer pixelsamples" 4
Camera "perspective" "float fov" 60
WorldBegin
LightSource "infinite" "rgb L" [ 1 0.5 0.2 ] "float scale" 2
LightSource "spot" "point3 from" [ 0 1 0 ] "blackbody I" 3000
Texture "wood" "spectrum" "imagemap" "string filename" "image.png" "float uscale" 2
MakeNamedMaterial "m" "string type" "conductor" "spectrum eta" "metal-Cu-eta" "float roughness" .1
AttributeBegin
  Material "diffuse" "texture reflectance" "wood"
  Translate 0 1 0 Rotate 30 0 1 0 Scale 1 2 1
  Shape "trianglemesh" "point3 P" [ 1 0 0 0 1 0 0 0 1 ] "integer indices" [ 0 1 2 ]
  Shape "plymesh" "string filename" "mesh.ply"
AttributeEnd
ObjectBegin "ball"
  Shape "sphere" "float radius" 0.5
ObjectEnd
ObjectInstance "ball"
AttributeBegin
  NamedMaterial "m"
  AreaLightSource "diffuse" "rgb L" [ 2 2 2 ]
  Shape "disk" "float radius" 0.2
  Shape "bilinearmesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 1 1 0 ]
  Shape "loopsubdiv" "integer levels" 1 "integer indices" [ 0 1 2 ] "point3 P" [ 0 0 0 1 0 0 0 1 0 ]
AttributeEnd
"#;

pub const XML: &str = r#"<scene version="3.0.0">
<default name="spp" value="16"/>
<sensor type="perspective"><float name="fov" value="60"/>
  <transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
  <film type="hdrfilm"><integer name="width" value="40"/><integer name="height" value="20"/>
    <rfilter type="gaussian"/></film><sampler type="independent"/></sensor>
<bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.5 0.4 0.3"/>
  </bsdf></bsdf>
<bsdf type="roughconductor" id="metal"><string name="material" value="Cu"/>
  <float name="alpha" value="0.1"/></bsdf>
<bsdf type="diffuse" id="image"><texture type="bitmap" name="reflectance">
  <string name="filename" value="image.png"/></texture></bsdf>
<shape type="rectangle"><ref id="wall"/><transform name="to_world"><scale x="2" y="1"/>
  <rotate x="1" angle="-90"/><translate x="0.2"/></transform></shape>
<shape type="sphere"><point name="center" x="0" y="1" z="0"/><float name="radius" value="0.3"/>
  <emitter type="area"><spectrum name="radiance" value="400:1, 500:2, 600:1"/></emitter></shape>
<shape type="cube"><ref id="metal"/></shape>
<shape type="serialized"><string name="filename" value="mesh.serialized"/>
  <integer name="shape_index" value="0"/><ref id="image"/></shape>
<shape type="ply"><string name="filename" value="mesh.ply"/></shape>
<emitter type="envmap"><string name="filename" value="map.pfm"/></emitter>
<emitter type="point"><point name="position" value="1,2,3"/><rgb name="intensity" value="3"/></emitter>
</scene>"#;

/// A scene of one serialized mesh.
pub const SERIALIZED_XML: &str = r#"<scene version="3.0.0"><sensor type="perspective"/>
<shape type="serialized"><string name="filename" value="mesh.serialized"/></shape>
<emitter type="constant"/></scene>"#;

/// Content of a serialized mesh before its compression.
pub fn serialized() -> Vec<u8> {
    let mut bytes = 0x1001_u32.to_le_bytes().to_vec();
    bytes.extend(b"quad\0");
    bytes.extend(3_u64.to_le_bytes());
    bytes.extend(1_u64.to_le_bytes());
    for value in [0_f32, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 1., 0., 0., 1.] {
        bytes.extend(value.to_le_bytes());
    }
    [0_u32, 1, 2].iter().for_each(|index| bytes.extend(index.to_le_bytes()));
    bytes
}

/// Compresses the content of a serialized mesh and adds header and table.
pub fn pack_serialized(content: &mut Vec<u8>) {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    std::io::Write::write_all(&mut encoder, content).unwrap();
    let mut bytes = vec![0x1c, 0x04, 4, 0];
    bytes.extend(encoder.finish().unwrap());
    bytes.extend(0_u64.to_le_bytes());
    bytes.extend(1_u32.to_le_bytes());
    *content = bytes;
}

pub const CORNELL: &str = "# paint\n3 # wavelengths\n450 550\n650\n0.3 0 0.2 -2 0.1 0.1 0.2\n\
    0.8 0 0.7 1 0.1 0.3 0.1\n1.3 0 1.2 3.1 0.1 0.1 0.1\n0.3 0 0.7 0 0.2 0.1 0.1\n";

/// A PFM map of 4×2 texels.
pub fn pfm() -> Vec<u8> {
    let mut bytes = b"PF\n4 2\n-1.0\n".to_vec();
    (0..24_u8).for_each(|index| bytes.extend((f32::from(index) * 0.1).to_le_bytes()));
    bytes
}

/// A Radiance map of 8×4 texels, plain or in run lengths.
pub fn hdr(is_packed: bool) -> Vec<u8> {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1.0\n\n-Y 4 +X 8\n".to_vec();
    for row in 0..4 {
        if is_packed {
            bytes.extend([2, 2, 0, 8]);
            (0..4).for_each(|channel| bytes.extend([136, 100 + channel + row]));
        } else {
            (0..8).for_each(|column| bytes.extend([90 + row, 20 + column, 200, 129]));
        }
    }
    bytes
}

/// An image of 4×4 texels in a format of photographs.
pub fn picture(format: ImageFormat, has_alpha: bool) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let values = |channels: u8| (0..16 * channels).map(|index| index.wrapping_mul(13)).collect();
    let image = if has_alpha {
        DynamicImage::ImageRgba8(RgbaImage::from_raw(4, 4, values(4)).unwrap())
    } else {
        DynamicImage::ImageRgb8(RgbImage::from_raw(4, 4, values(3)).unwrap())
    };
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// An OpenEXR image of 8×4 pixels.
pub fn exr(is_compressed: bool) -> Vec<u8> {
    let values: Vec<_> = (0..32_u8).map(|index| [f32::from(index), 1.0, 0.5]).collect();
    let image = Image::of_rgb(8, 4, &values);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    if is_compressed { image.write_exr(&path) } else { image.write_exr_uncompressed(&path) }
        .unwrap();
    fs::read(path).unwrap()
}
