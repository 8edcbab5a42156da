//! Shared by the tests: temporary folders, files to read, and mutations of them.

pub mod folder;
pub mod fuzz;
pub mod gltf;
pub mod seeds;
pub mod tensor;

/// Fails unless a message holds all parts.
#[track_caller]
pub fn assert_contains(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "{part:?} is missing in {message:?}");
    }
}
