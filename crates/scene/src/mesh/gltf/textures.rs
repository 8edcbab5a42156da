//! Textures of a glTF document: image, sampler and `KHR_texture_transform`.

use std::sync::Arc;

use serde_json::Value;

use super::{
    GltfReader, document, index,
    material::{Reading, number, vector},
};
use crate::{
    error::Result,
    features,
    texture::{Channels, Encoding, Interpolation, Texture, TextureUse, Wrap},
};

/// Values of a sampler, which are those of OpenGL.
const NEAREST: u64 = 9728;
const CLAMP_TO_EDGE: u64 = 33071;
const MIRRORED_REPEAT: u64 = 33648;

impl GltfReader<'_> {
    /// Reads the texture that `info` names; none if it is absent or cannot be used.
    pub(super) fn texture(
        &mut self,
        info: &Value,
        (channels, encoding): (Channels, Encoding),
        reading: &mut Reading,
    ) -> Result<Option<TextureUse>> {
        if info.is_null() {
            return Ok(None);
        }
        let json = self.json;
        let Some(texture) = index(&info["index"]).and_then(|at| json["textures"].get(at)) else {
            let (place, found) = (&reading.place, &info["index"]);
            return Err(self.error(format!("{place}: the file has no texture {found}")));
        };
        let webp = &texture["extensions"]["EXT_texture_webp"];
        let Some(source) = index(&texture["source"]).or(index(&webp["source"])) else {
            let extensions = texture["extensions"].as_object().into_iter().flatten();
            // Without its image a surface would look like another one.
            if let Some((name, _)) = extensions.into_iter().find(|(_, own)| own["source"].is_u64())
            {
                let help = match name.as_str() {
                    "KHR_texture_basisu" => ": `gltf-transform ktxdecompress` writes one",
                    _ => "",
                };
                return Err(self.error(format!(
                    "{}: texture {} has no image but that of `{name}`, which is not read; expected \
                     one in PNG, JPEG or WebP{help}",
                    reading.place, info["index"]
                )));
            }
            reading.ignore(features::GLTF_NO_IMAGE);
            return Ok(None);
        };
        let transform = &info["extensions"]["KHR_texture_transform"];
        let own_set = info["texCoord"].as_u64().unwrap_or(0);
        let uv_set = match transform["texCoord"].as_u64().unwrap_or(own_set) {
            0 => 0,
            1 => 1,
            _ => {
                reading.ignore(features::GLTF_HIGH_UV);
                return Ok(None);
            }
        };
        let Some(image) = self.image(source, &reading.place)? else { return Ok(None) };
        let sampler = index(&texture["sampler"]).and_then(|at| json["samplers"].get(at));
        let sampler = sampler.unwrap_or(&Value::Null);
        let wrap = |key: &str| match sampler[key].as_u64() {
            Some(CLAMP_TO_EDGE) => Wrap::Clamp,
            Some(MIRRORED_REPEAT) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let interpolation = match sampler["magFilter"].as_u64() {
            Some(NEAREST) => Interpolation::Nearest,
            _ => Interpolation::Bilinear,
        };
        Ok(Some(TextureUse {
            channels,
            encoding,
            uv_set,
            image_from_uv: image_from_uv(transform),
            wrap: [wrap("wrapS"), wrap("wrapT")],
            interpolation,
            ..TextureUse::new(image)
        }))
    }

    /// Reads an image, or returns it again; one that cannot be read is a warning.
    fn image(&mut self, index: usize, place: &str) -> Result<Option<Arc<Texture>>> {
        if let Some(found) = self.embedded.get(&index) {
            return Ok(found.clone());
        }
        let image = &self.json["images"][index];
        let name = format!("{}: image {index}", self.path.display());
        let decoded = if let Some(uri) = image["uri"].as_str() {
            match document::data_of(uri) {
                Some(Some(bytes)) => Texture::decode(&name, &bytes, self.warnings),
                Some(None) => Err("not base64 data".to_owned()),
                None => match document::beside(self.path, uri) {
                    Ok(path) => return Ok(self.images.load_readable(&path, place, self.warnings)),
                    Err(error) => Err(error.to_string()),
                },
            }
        } else {
            let view = super::index(&image["bufferView"]);
            let view = view.and_then(|at| self.document.views().nth(at)).ok_or_else(|| {
                self.error(format!("image {index}: expected a URI or a buffer view, found neither"))
            })?;
            let mut own = Vec::new();
            let decoded = Texture::decode(&name, self.view_bytes(&view)?, &mut own);
            self.warnings.append(&mut own);
            decoded
        };
        let texture = match decoded {
            Ok(texture) => Some(Arc::new(texture)),
            Err(message) => {
                self.warnings
                    .push(format!("{name}: {message}; rendered without this texture ({place})"));
                None
            }
        };
        self.embedded.insert(index, texture.clone());
        Ok(texture)
    }
}

/// Matrix of `KHR_texture_transform`: scale, then rotation, then offset.
///
/// A positive angle turns coordinates counter-clockwise as one sees them, with v downwards; the
/// Khronos model `TextureTransformTest` shows which way that is.
fn image_from_uv(transform: &Value) -> [[f32; 3]; 2] {
    let [offset_u, offset_v] = vector(transform, "offset", [0.0; 2]);
    let [scale_u, scale_v] = vector(transform, "scale", [1.0; 2]);
    let (sine, cosine) = number(transform, "rotation", 0.0).sin_cos();
    [[cosine * scale_u, sine * scale_v, offset_u], [-sine * scale_u, cosine * scale_v, offset_v]]
}
