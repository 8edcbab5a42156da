//! `KHR_materials_variants`: other materials of primitives, by name.

use gltf::json::{Index, Root};
use serde_json::Value;

const EXTENSION: &str = "KHR_materials_variants";

pub(super) fn names(json: &Value) -> Vec<String> {
    let variants = json["extensions"][EXTENSION]["variants"].as_array();
    let name = |variant: &Value| variant["name"].as_str().unwrap_or_default().to_owned();
    variants.into_iter().flatten().map(name).collect()
}

/// Gives primitives the materials of the variant `name`, and removes the choice from them.
///
/// # Errors
/// A message that names the variants, for an unknown one.
pub(super) fn choose(name: &str, json: &mut Value, root: &mut Root) -> Result<(), String> {
    let names = names(json);
    let Some(chosen) = names.iter().position(|own| own == name) else {
        let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        return Err(format!("--variant {name}: there is no such variant, the file has {known}"));
    };
    for (index, mesh) in root.meshes.iter_mut().enumerate() {
        for (part, primitive) in mesh.primitives.iter_mut().enumerate() {
            let extensions =
                json["meshes"][index]["primitives"][part]["extensions"].as_object_mut();
            let Some(own) = extensions.and_then(|extensions| extensions.remove(EXTENSION)) else {
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
