//! Measured BRDFs: MERL, Cornell and RGL files → [`MeasuredTable`], which evaluates and samples them.
//!
//! Directions are unit vectors in the shading frame (z is the normal) and point away from the surface.
//! Values are per steradian without the cosine.

pub mod cornell;
pub mod layout;
pub mod lookup;
pub mod merl;
pub mod rgl;
mod table;
mod tabulate;
mod tensor;

use std::{
    collections::HashMap,
    io::Read,
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::{
    error::{Error, Result},
    files,
};

pub use table::{CELL_COUNT, MeasuredTable, RglTraits, bin_directions, cell_index};

impl MeasuredTable {
    /// Reads a measured BRDF: MERL `.binary` or RGL `.bsdf` if the name or the first 12 bytes say so,
    /// else the text format of Cornell and pbrt-v2.
    pub fn load(path: &Path) -> Result<Self> {
        let mut head = [0; merl::HEADER_BYTES];
        let read = files::open_regular(path)?
            .read(&mut head)
            .map_err(|source| Error::io(path, "read", source))?;
        if head == tensor::MAGIC || files::extension(path) == "bsdf" {
            return rgl::load(path);
        }
        let is_merl = path.extension().is_some_and(|extension| extension == "binary")
            || (read == head.len() && merl::dimensions(head) == merl::EXPECTED_DIMENSIONS);
        if is_merl { merl::load(path) } else { cornell::load(path) }
    }
}

/// Tables of measured BRDFs by file, each loaded once.
#[derive(Default)]
pub(crate) struct MeasuredFiles(HashMap<PathBuf, Arc<MeasuredTable>>);

impl MeasuredFiles {
    /// Returns the table of a file. The first time, adds the file to `inputs`, and its warnings by its name.
    /// Fails as [`MeasuredTable::load`].
    pub(crate) fn table(
        &mut self,
        path: &Path,
        inputs: &mut Vec<PathBuf>,
        warnings: &mut Vec<String>,
    ) -> Result<Arc<MeasuredTable>> {
        if let Some(table) = self.0.get(path) {
            return Ok(Arc::clone(table));
        }
        let table = Arc::new(MeasuredTable::load(path)?);
        let named = |warning: &String| format!("{}: {warning}", path.display());
        warnings.extend(table.warnings.iter().map(named));
        inputs.push(path.to_owned());
        self.0.insert(path.to_owned(), Arc::clone(&table));
        Ok(table)
    }
}
