//! The Vulkan layer of `faulty_layer.c`, whose device fails on request.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{path::PathBuf, process::Command, sync::OnceLock};

use super::c_library;

const LAYER: &str = "VK_LAYER_TEST_faulty";

/// Compiles the layer and returns its folder.
fn folder() -> &'static PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let library = c_library::compile("faulty_layer");
        let folder = library.parent().unwrap().to_owned();
        let manifest = serde_json::json!({
            "file_format_version": "1.1.2",
            "layer": {
                "name": LAYER, "type": "GLOBAL", "library_path": library, "api_version": "1.2.0",
                "implementation_version": "1", "description": "A device that fails on request",
            },
        });
        std::fs::write(folder.join("faulty_layer.json"), manifest.to_string()).unwrap();
        folder
    })
}

/// Puts the layer under a program; `faults` are its variables.
pub fn insert(command: &mut Command, faults: &[(&str, u64)]) {
    command.env("VK_LAYER_PATH", folder()).env("VK_INSTANCE_LAYERS", LAYER);
    for (name, value) in faults {
        command.env(name, value.to_string());
    }
}
