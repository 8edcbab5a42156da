//! The step that loading is at, for those who wait: a word to the user while it takes long.

use std::{
    fmt,
    sync::{Mutex, PoisonError},
};

static CURRENT: Mutex<String> = Mutex::new(String::new());

/// States the step that begins, such as `reading mesh.obj`.
pub fn enter(step: impl fmt::Display) {
    *CURRENT.lock().unwrap_or_else(PoisonError::into_inner) = step.to_string();
}

/// Returns the latest step of any thread; empty before the first.
pub fn current() -> String {
    CURRENT.lock().unwrap_or_else(PoisonError::into_inner).clone()
}
