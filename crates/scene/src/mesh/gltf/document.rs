//! glTF file → checked document with its buffers.

use std::path::{Path, PathBuf};

use base64::{
    Engine, alphabet,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use gltf::{
    Document, Glb,
    buffer::Source,
    json::{Index, Root, texture::Sampler, validation::Checked},
    mesh::{Mode, Semantic},
};
use percent_encoding::percent_decode_str;
use serde_json::{Value, json};

use super::compression;
use crate::{
    beside::Folder,
    error::{Error, Result},
    features, files,
};

/// Base64 with or without padding (RFC 4648, section 4).
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Parses a document; returns it, to be [`checked`], with its binary chunk and its JSON as a tree, which
/// holds the extensions. With the name of a variant, primitives have its materials.
pub(super) fn parse(
    path: &Path,
    bytes: &[u8],
    variant: Option<&str>,
) -> Result<(Document, Option<Vec<u8>>, Value)> {
    let not_json = |error: serde_json::Error| {
        let message = format!("not a glTF document: {error}");
        Error::parse(path, error.line(), error.column(), message)
    };
    let glb = bytes
        .starts_with(b"glTF")
        .then(|| Glb::from_slice(bytes).map_err(|error| not_gltf(path, &error)));
    let glb = glb.transpose()?;
    let text = glb.as_ref().map_or(bytes, |glb| &glb.json);
    let text = text.strip_prefix(files::BYTE_ORDER_MARK).unwrap_or(text);
    // Some fill the chunk with zeros, where it ends in spaces.
    let text = &text[..text.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1)];
    let mut json: Value = serde_json::from_slice(text).map_err(not_json)?;
    if let Some(version) = json["asset"]["version"].as_str()
        && version.split('.').next() != Some("2")
    {
        let message =
            format!("`asset.version`: expected 2.0, found {version}: convert it to glTF 2.0");
        return Err(Error::format(path, message));
    }
    let mut root: Root = match serde_json::from_slice(text) {
        Ok(root) => root,
        // The crate asks for more than the format does.
        Err(error) => {
            let mut completed = json.clone();
            complete(&mut completed);
            serde_json::from_value(completed).map_err(|_| not_json(error))?
        }
    };
    // Parsing checks against the extensions that the crate knows, not those that are known here.
    for extension in std::mem::take(&mut root.extensions_required) {
        let name = format!("`{extension}`");
        let is_left_out = features::GLTF.iter().any(|feature| feature.name == name);
        if !is_left_out && !features::GLTF_EXTENSIONS.contains(&extension.as_str()) {
            let message = format!(
                "the file requires the extension `{extension}`, which is not supported: export it \
                 without"
            );
            return Err(Error::format(path, message));
        }
    }
    // Nobody here reads these, which the crate checks: exporters write numbers that mean nothing.
    root.samplers.iter_mut().for_each(|sampler| *sampler = Sampler::default());
    for view in &mut root.buffer_views {
        view.target = None;
        // Below the smallest stride elements lie without gaps.
        view.byte_stride.take_if(|stride| stride.0 < 4);
    }
    // Attributes of applications are no part of the picture, but the crate refuses their names.
    for primitive in root.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
        primitive.attributes.retain(|name, _| matches!(name, Checked::Valid(_)));
        let positions = Checked::Valid(Semantic::Positions);
        if !primitive.attributes.contains_key(&positions) && !root.accessors.is_empty() {
            // One without positions shows nothing: as points it is left out with a warning.
            primitive.attributes.insert(positions, Index::new(0));
            primitive.mode = Checked::Valid(Mode::Points);
        }
    }
    complete_positions(path, &mut root)?;
    if let Some(name) = variant {
        choose_variant(name, &mut json, &mut root)
            .map_err(|message| Error::format(path, message))?;
    }
    Ok((
        Document::from_json_without_validation(root),
        glb.and_then(|glb| glb.bin).map(|bin| bin.into_owned()),
        json,
    ))
}

pub(super) fn read_buffers(
    path: &Path,
    document: &Document,
    json: &Value,
    mut blob: Option<Vec<u8>>,
) -> Result<Vec<Vec<u8>>> {
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let index = buffer.index();
        if compression::is_fallback(&json["buffers"][index]) {
            buffers.push(Vec::new());
            continue;
        }
        let bytes = match buffer.source() {
            Source::Bin => blob.take().ok_or_else(|| {
                Error::format(path, format!("buffer {index} is in a chunk that the file lacks"))
            })?,
            Source::Uri(uri) => match data_of(uri) {
                Some(data) => data.ok_or_else(|| {
                    Error::format(path, format!("buffer {index} is not base64 data"))
                })?,
                None => files::read(&beside(path, uri)?)?,
            },
        };
        if bytes.len() < buffer.length() {
            let message = format!(
                "truncated: buffer {index} should have {} bytes, found {}",
                buffer.length(),
                bytes.len()
            );
            return Err(Error::format(path, message));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// Checks a document, whose compressed parts have been expanded.
pub(super) fn checked(path: &Path, root: Root) -> Result<Document> {
    Document::from_json(root).map_err(|error| not_gltf(path, &error))
}

fn not_gltf(path: &Path, error: &gltf::Error) -> Error {
    let message = match error {
        gltf::Error::Validation(faults) if !faults.is_empty() => {
            let (place, fault) = &faults[0];
            format!("`{place}`: {fault} (faults: {})", faults.len())
        }
        _ => error.to_string(),
    };
    Error::format(path, format!("not a glTF document: {message}"))
}

/// Checks that the accessor of every primitive's positions exists, on which the validation by the `gltf`
/// crate relies; states its bounds where the file leaves them out, which nobody here reads.
fn complete_positions(path: &Path, root: &mut Root) -> Result<()> {
    let Root { meshes, accessors, .. } = root;
    let count = accessors.len();
    for primitive in meshes.iter().flat_map(|mesh| &mesh.primitives) {
        let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
        let Some(index) = positions.map(|index| index.value()) else { continue };
        let accessor = accessors.get_mut(index).ok_or_else(|| {
            let message =
                format!("a primitive's POSITION names accessor {index}, the file has {count}");
            Error::format(path, format!("not a glTF document: {message}"))
        })?;
        for bound in [&mut accessor.min, &mut accessor.max] {
            bound.get_or_insert_with(|| json!([0.0, 0.0, 0.0]));
        }
    }
    Ok(())
}

/// Path of a file that is named by a relative URI.
pub(super) fn beside(path: &Path, uri: &str) -> Result<PathBuf> {
    let name = percent_decode_str(uri)
        .decode_utf8()
        .map_err(|_| Error::format(path, format!("cannot read the file name `{uri}`")))?;
    Folder::of(path)
        .found_within(Path::new(""), &name)
        .map_err(|message| Error::format(path, message))
}

/// Content of a URI that holds it; none if it names a file, and none inside if it is no base64.
pub(super) fn data_of(uri: &str) -> Option<Option<Vec<u8>>> {
    let data = uri.strip_prefix("data:")?;
    Some(data.split_once(";base64,").and_then(|(_, text)| BASE64.decode(text).ok()))
}

/// Adds the nodes of empty scenes; removes extras, which may be anything and not objects alone, members that
/// are null, and channels of animations that move no node.
fn complete(json: &mut Value) {
    fn clean(value: &mut Value) {
        match value {
            Value::Object(members) => {
                members.retain(|key, member| key != "extras" && !member.is_null());
                members.values_mut().for_each(clean);
            }
            Value::Array(elements) => elements.iter_mut().for_each(clean),
            _ => {}
        }
    }
    clean(json);
    fn array<'a>(json: &'a mut Value, key: &str) -> Option<&'a mut Vec<Value>> {
        json.get_mut(key)?.as_array_mut()
    }
    for scene in array(json, "scenes").into_iter().flatten() {
        if let Some(members) = scene.as_object_mut() {
            members.entry("nodes").or_insert_with(|| json!([]));
        }
    }
    for animation in array(json, "animations").into_iter().flatten() {
        if let Some(channels) = array(animation, "channels") {
            channels.retain(|channel| !channel["target"]["node"].is_null());
        }
    }
}

/// Other materials of primitives, by name.
const VARIANTS: &str = "KHR_materials_variants";

pub(super) fn variant_names(json: &Value) -> Vec<String> {
    let variants = json["extensions"][VARIANTS]["variants"].as_array();
    let name = |variant: &Value| variant["name"].as_str().unwrap_or_default().to_owned();
    variants.into_iter().flatten().map(name).collect()
}

/// Gives primitives the materials of the variant `name`, and removes the choice from them. Fails for an
/// unknown one, with a message that names the variants.
fn choose_variant(name: &str, json: &mut Value, root: &mut Root) -> Result<(), String> {
    let names = variant_names(json);
    let Some(chosen) = names.iter().position(|own| own == name) else {
        let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        return Err(format!("--variant {name}: there is no such variant, the file has {known}"));
    };
    for (index, mesh) in root.meshes.iter_mut().enumerate() {
        for (part, primitive) in mesh.primitives.iter_mut().enumerate() {
            let extensions =
                json["meshes"][index]["primitives"][part]["extensions"].as_object_mut();
            let Some(own) = extensions.and_then(|extensions| extensions.remove(VARIANTS)) else {
                continue;
            };
            let holds = |mapping: &&Value| {
                let variants = mapping["variants"].as_array();
                variants.is_some_and(|all| all.iter().any(|v| v.as_u64() == Some(chosen as u64)))
            };
            let mut mappings = own["mappings"].as_array().into_iter().flatten();
            if let Some(mapping) = mappings.find(holds) {
                let material = mapping["material"].as_u64().unwrap_or(u64::MAX);
                primitive.material = u32::try_from(material).ok().map(Index::new);
            }
        }
    }
    Ok(())
}
