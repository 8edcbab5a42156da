//! MERL `.binary` files: header, half/difference angle indexing, the three RGB scales →
//! [`MeasuredTable`]. \[Matusik et al. 2003\].

use std::{io::Read, path::Path};

use glam::Vec3;
use rayon::prelude::*;

use crate::{
    error::{Error, Result},
    files,
    measured::{
        layout::*,
        table::{CELL_COUNT, MeasuredTable},
    },
};

/// Bytes before the values: three little-endian 32-bit counts.
pub const HEADER_BYTES: usize = 12;

/// Bins in θ_h, θ_d and φ_d, the same for every file of the database.
pub const EXPECTED_DIMENSIONS: [i32; 3] = [
    MEASURED_THETA_HALF_BINS as i32,
    MEASURED_THETA_DIFFERENCE_BINS as i32,
    MEASURED_PHI_DIFFERENCE_BINS as i32,
];

/// Size of a whole file: 34,992,012 bytes.
pub const FILE_BYTES: usize = HEADER_BYTES + 3 * CELL_COUNT * size_of::<f64>();

/// Factors from stored values to 1/sr, per channel.
pub const SCALES: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// The three counts of a header.
pub fn dimensions(header: [u8; HEADER_BYTES]) -> [i32; 3] {
    std::array::from_fn(|index| i32::from_le_bytes(header.as_chunks().0[index]))
}

/// Reads a MERL file.
///
/// A cell with a negative channel is invalid, as the format defines. A cell that is not finite is
/// also invalid and counted in the table's warnings.
pub fn load(path: &Path) -> Result<MeasuredTable> {
    let io_error = |source| Error::io(path, "read", source);
    let file = files::open_regular(path)?;
    let stated_bytes = file.metadata().map_err(io_error)?.len();
    let mut bytes = Vec::new();
    file.take(FILE_BYTES as u64).read_to_end(&mut bytes).map_err(io_error)?;
    let found_bytes = if bytes.len() < FILE_BYTES { bytes.len() as u64 } else { stated_bytes };
    let Some((header, values)) = bytes.split_first_chunk() else {
        return Err(wrong_size(path, found_bytes));
    };
    let found = dimensions(*header);
    if found != EXPECTED_DIMENSIONS {
        let [expected, found] = [EXPECTED_DIMENSIONS, found]
            .map(|[half, difference, phi]| format!("{half} × {difference} × {phi}"));
        let message = format!(
            "expected a MERL table of {expected} cells (θ_h, θ_d, φ_d), the header says {found}; tables of \
             other sizes, such as those with 360 bins in φ_d, cannot be read"
        );
        return Err(Error::format(path, message));
    }
    if found_bytes != FILE_BYTES as u64 {
        return Err(wrong_size(path, found_bytes));
    }

    let stored = values.as_chunks().0;
    let value = |channel: usize, cell: usize| {
        (f64::from_le_bytes(stored[channel * CELL_COUNT + cell]) * SCALES[channel]) as f32
    };
    let cells: Vec<Vec3> = (0..CELL_COUNT)
        .into_par_iter()
        .map(|cell| Vec3::new(value(0, cell), value(1, cell), value(2, cell)))
        .collect();
    drop(bytes);
    let non_finite = cells.par_iter().filter(|cell| !cell.is_finite()).count();
    let mut table =
        MeasuredTable::from_cells(cells).map_err(|message| Error::format(path, message))?;
    if non_finite > 0 {
        table.warnings.push(format!("{non_finite} cells that are not finite were left out"));
    }
    Ok(table)
}

/// Error for a file that ends early or holds more than the table.
fn wrong_size(path: &Path, found_bytes: u64) -> Error {
    let word = if found_bytes < FILE_BYTES as u64 { "truncated" } else { "too long" };
    Error::format(
        path,
        format!("{word}: expected a MERL file of {FILE_BYTES} bytes, found {found_bytes}"),
    )
}
