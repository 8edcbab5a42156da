//! Tensor files: named arrays of numbers, the container of the RGL material database.
//!
//! Format, little-endian: `tensor_file\0`, two bytes of the version 1.0, a 32-bit count of fields, and
//! for each of them the length of its name (16 bits), the name, the count of dimensions (16 bits), the
//! type (8 bits: 1 is a byte, 10 a 32-bit float), the offset of its values in the file, and its shape
//! (64 bits each), the last dimension the fastest.

use std::{collections::BTreeMap, ops::Range, path::Path};

use crate::{
    error::{Error, Result},
    files,
};

pub(super) const MAGIC: [u8; 12] = *b"tensor_file\0";
/// Bytes before the fields.
const HEADER_BYTES: usize = MAGIC.len() + 6;
/// Types of values.
const BYTE: u8 = 1;
const FLOAT: u8 = 10;

/// Array in a file.
struct Field {
    kind: u8,
    shape: Vec<usize>,
    /// Place of the values in the file.
    bytes: Range<usize>,
}

/// Fields of a file by name, and its bytes.
pub(super) struct TensorFile<'a> {
    path: &'a Path,
    bytes: Vec<u8>,
    fields: BTreeMap<String, Field>,
}

impl<'a> TensorFile<'a> {
    /// Reads a file, and checks that its fields lie in it.
    pub(super) fn read(path: &'a Path) -> Result<Self> {
        let bytes = files::read(path)?;
        let fields = fields(&bytes).map_err(|message| Error::format(path, message))?;
        Ok(Self { path, bytes, fields })
    }

    pub(super) fn error(&self, message: impl Into<String>) -> Error {
        Error::format(self.path, message)
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.fields.contains_key(name)
    }

    fn field<const DIMENSIONS: usize>(
        &self,
        name: &str,
        (kind, kind_name): (u8, &str),
    ) -> Result<(&[u8], [usize; DIMENSIONS])> {
        let Some(field) = self.fields.get(name) else {
            let found: Vec<&str> = self.fields.keys().map(String::as_str).collect();
            return Err(self.error(format!(
                "expected the field `{name}` of a measured BRDF, found {}",
                if found.is_empty() { "none".to_owned() } else { found.join(", ") }
            )));
        };
        match <[usize; DIMENSIONS]>::try_from(&field.shape[..]) {
            Ok(shape) if field.kind == kind => Ok((&self.bytes[field.bytes.clone()], shape)),
            _ => Err(self.error(format!(
                "field `{name}`: expected {kind_name} in {DIMENSIONS} dimensions, found type {} and \
                 shape {:?}",
                field.kind, field.shape
            ))),
        }
    }

    /// Floats of a field and its shape. Fails for a field that is missing, empty, not finite or of another
    /// type or count of dimensions.
    pub(super) fn floats<const DIMENSIONS: usize>(
        &self,
        name: &str,
    ) -> Result<(Vec<f32>, [usize; DIMENSIONS])> {
        let (bytes, shape) = self.field(name, (FLOAT, "32-bit floats"))?;
        let values: Vec<f32> =
            bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        if values.is_empty() {
            return Err(self.error(format!("field `{name}`: empty, its shape is {shape:?}")));
        }
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok((values, shape)),
            Some(index) => Err(self.error(format!(
                "field `{name}`: expected finite numbers, found {} at index {index}",
                values[index]
            ))),
        }
    }

    /// Truth value of a field of one byte.
    pub(super) fn flag(&self, name: &str) -> Result<bool> {
        let (bytes, shape) = self.field::<1>(name, (BYTE, "a byte"))?;
        match bytes {
            [flag] => Ok(*flag != 0),
            _ => Err(self.error(format!("field `{name}`: expected one byte, found {shape:?}"))),
        }
    }
}

/// Fields of a whole file.
fn fields(bytes: &[u8]) -> std::result::Result<BTreeMap<String, Field>, String> {
    if !bytes.starts_with(&MAGIC) {
        return Err("expected a tensor file of the RGL material database, which begins with \
                    `tensor_file`; other kinds of .bsdf files cannot be read"
            .to_owned());
    }
    let mut at = MAGIC.len();
    let mut take = |length: usize| -> std::result::Result<Range<usize>, String> {
        let range = at..at + length;
        if range.end > bytes.len() {
            return Err(format!("truncated: its header goes on after byte {}", bytes.len()));
        }
        at = range.end;
        Ok(range)
    };
    let number = |range: Range<usize>| files::little_endian(&bytes[range]);
    let version = [number(take(1)?), number(take(1)?)];
    if version[0] != 1 {
        let [major, minor] = version;
        return Err(format!("expected version 1 of a tensor file, found {major}.{minor}"));
    }
    let mut fields = BTreeMap::new();
    for _ in 0..number(take(4)?) {
        let length = number(take(2)?) as usize;
        let name = String::from_utf8_lossy(&bytes[take(length)?]).into_owned();
        let dimensions = number(take(2)?);
        let kind = number(take(1)?) as u8;
        let first = usize::try_from(number(take(8)?)).ok();
        let mut shape = Vec::new();
        for _ in 0..dimensions {
            shape.push(number(take(8)?));
        }
        let count = shape.iter().try_fold(1_u64, |count, &length| count.checked_mul(length));
        let count = count.and_then(|count| usize::try_from(count).ok());
        // A type that is not read has at least a byte a value.
        let size = if kind == FLOAT { size_of::<f32>() } else { 1 };
        let end = count
            .and_then(|count| count.checked_mul(size))
            .and_then(|length| first?.checked_add(length));
        let (Some(first), Some(end)) = (first, end) else {
            return Err(format!("field `{name}`: the shape {shape:?} is larger than any file"));
        };
        if first < HEADER_BYTES || end > bytes.len() {
            return Err(format!(
                "truncated or damaged: the field `{name}` of shape {shape:?} takes the bytes {first} to \
                 {end} of a file of {}",
                bytes.len()
            ));
        }
        let shape = shape.into_iter().map(|length| length as usize).collect();
        fields.insert(name, Field { kind, shape, bytes: first..end });
    }
    Ok(fields)
}
