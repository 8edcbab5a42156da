//! Records of the log on their way to Python's logger `fenestra`.

use std::sync::{Mutex, PoisonError};

use log::{Level, LevelFilter, Log, Metadata, Record};
use pyo3::prelude::*;

/// Collects records on any thread until a thread of Python hands them on.
struct Collector(Mutex<Vec<(Level, String)>>);

static COLLECTOR: Collector = Collector(Mutex::new(Vec::new()));

impl Log for Collector {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.level() <= Level::Info
    }

    fn log(&self, record: &Record<'_>) {
        if self.enabled(record.metadata()) {
            let record = (record.level(), record.args().to_string());
            self.0.lock().unwrap_or_else(PoisonError::into_inner).push(record);
        }
    }

    fn flush(&self) {}
}

/// Collects from now on, unless the program's own log does.
pub(super) fn listen() {
    if log::set_logger(&COLLECTOR).is_ok() {
        log::set_max_level(LevelFilter::Info);
    }
}

/// Hands the records so far to Python's logger.
pub(super) fn hand_on(py: Python<'_>) -> PyResult<()> {
    let records = std::mem::take(&mut *COLLECTOR.0.lock().unwrap_or_else(PoisonError::into_inner));
    if records.is_empty() {
        return Ok(());
    }
    let logger = py.import("logging")?.call_method1("getLogger", ("fenestra",))?;
    for (level, text) in records {
        let method = match level {
            Level::Error => "error",
            Level::Warn => "warning",
            _ => "info",
        };
        // As an argument, since the text may hold `%`.
        logger.call_method1(method, ("%s", text))?;
    }
    Ok(())
}
