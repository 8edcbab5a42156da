//! Shared by the tests: temporary folders, files to read, and mutations of them.

pub mod folder;
pub mod fuzz;
pub mod gltf;
pub mod seeds;
pub mod tensor;

use std::collections::HashMap;

use fenestra_scene::Scene;

/// Fails unless each of the parameters before `;`, parted by `|`, makes a scene that no other makes, and each
/// after it, which states a default, changes nothing. `read` returns the scene with one, or with none for "".
#[track_caller]
pub fn assert_each_counts(what: &str, parameters: &str, read: impl Fn(&str) -> Scene) {
    let (parameters, defaults) = parameters.split_once(';').unwrap_or((parameters, ""));
    let plain = read("");
    for default in defaults.split('|') {
        let stated = read(default);
        assert_eq!(stated.warnings, plain.warnings, "{what}: {default}");
        assert_eq!(stated.hash, plain.hash, "{what}: {default}");
    }
    let mut seen = HashMap::from([(plain.hash, "")]);
    for parameter in parameters.split('|').filter(|parameter| !parameter.is_empty()) {
        assert_eq!(seen.insert(read(parameter).hash, parameter), None, "{what}: {parameter}");
    }
}

/// Fails unless a message holds all parts.
#[track_caller]
pub fn assert_contains(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "{part:?} is missing in {message:?}");
    }
}
