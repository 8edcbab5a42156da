//! Header of a PLY file: encoding, elements and their properties.

use std::io::{BufRead, Read};

use super::Source;
use crate::{
    error::{Error, Result},
    features,
};

/// Most bytes read of a header line; a longer one belongs to another kind of file.
const MAX_HEADER_LINE_BYTES: u64 = 65_536;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    BinaryLittleEndian,
    BinaryBigEndian,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Signed,
    Unsigned,
    Float,
}

/// Type of a number.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scalar {
    kind: Kind,
    pub(super) byte_count: usize,
}

impl Scalar {
    fn parse(name: &str) -> Option<Self> {
        let (kind, byte_count) = match name {
            "char" | "int8" => (Kind::Signed, 1),
            "uchar" | "uint8" => (Kind::Unsigned, 1),
            "short" | "int16" => (Kind::Signed, 2),
            "ushort" | "uint16" => (Kind::Unsigned, 2),
            "int" | "int32" => (Kind::Signed, 4),
            "uint" | "uint32" => (Kind::Unsigned, 4),
            "long" | "int64" => (Kind::Signed, 8),
            "ulong" | "uint64" => (Kind::Unsigned, 8),
            "float" | "float32" => (Kind::Float, 4),
            "double" | "float64" => (Kind::Float, 8),
            _ => return None,
        };
        Some(Self { kind, byte_count })
    }

    /// Largest value of an integer, which stands for 1 in colours; none for floats.
    pub(super) fn largest(self) -> Option<f64> {
        let bits = match self.kind {
            Kind::Signed => 8 * self.byte_count - 1,
            Kind::Unsigned => 8 * self.byte_count,
            Kind::Float => return None,
        };
        Some((u64::MAX >> (64 - bits)) as f64)
    }

    /// Value of little-endian bytes, with zeros after its own; every index fits a double exactly.
    pub(super) fn value(self, bytes: [u8; 8]) -> f64 {
        let word = u64::from_le_bytes(bytes);
        let unused_bits = 64 - 8 * self.byte_count;
        match self.kind {
            // Shifting right repeats the sign.
            Kind::Signed => ((word << unused_bits).cast_signed() >> unused_bits) as f64,
            Kind::Unsigned => word as f64,
            Kind::Float if self.byte_count == 4 => f64::from(f32::from_bits(word as u32)),
            Kind::Float => f64::from_bits(word),
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) value: Scalar,
    /// Type of the count if the property is a list.
    pub(super) list_count: Option<Scalar>,
}

#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Fewest bytes the element can take, with each property in its shortest form.
    pub(super) fn least_bytes(&self, encoding: Encoding) -> u64 {
        let of_property = |property: &Property| match encoding {
            Encoding::Ascii => 2,
            _ => property.list_count.unwrap_or(property.value).byte_count as u64,
        };
        self.properties.iter().map(of_property).sum::<u64>().saturating_mul(self.count)
    }
}

impl Source<'_> {
    fn header_line(&mut self, end: u8) -> Result<String> {
        let mut bytes = Vec::new();
        self.reader
            .by_ref()
            .take(MAX_HEADER_LINE_BYTES)
            .read_until(end, &mut bytes)
            .map_err(|source| Error::io(self.path, "read", source))?;
        if bytes.is_empty() {
            return Err(self.error("truncated: the file ends before `end_header`"));
        }
        self.bytes_read += bytes.len() as u64;
        Ok(String::from_utf8_lossy(&bytes).trim().to_owned())
    }

    /// Reads up to and including `end_header`, and sets the encoding.
    pub(super) fn read_header(&mut self) -> Result<Vec<Element>> {
        let start =
            self.reader.fill_buf().map_err(|source| Error::io(self.path, "read", source))?;
        // Lines of old Macs end in a carriage return.
        let is_old = start.starts_with(b"ply\r") && !start.starts_with(b"ply\r\n");
        let end = if is_old { b'\r' } else { b'\n' };
        let magic = self.header_line(end)?;
        if magic != "ply" {
            let start: String = magic.chars().take(16).collect();
            return Err(
                self.error(format!("expected a PLY file that starts with `ply`, found `{start}`"))
            );
        }
        let mut elements: Vec<Element> = Vec::new();
        let mut encoding = None;
        loop {
            self.line += 1;
            let text = self.header_line(end)?;
            let words: Vec<&str> = text.split_whitespace().collect();
            match words.as_slice() {
                ["format", name, version] => {
                    encoding = Some(match *name {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::BinaryLittleEndian,
                        "binary_big_endian" => Encoding::BinaryBigEndian,
                        _ => {
                            return Err(self.error(format!(
                                "expected format ascii, binary_little_endian or binary_big_endian, \
                                 found `{name} {version}`"
                            )));
                        }
                    });
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| {
                        self.error(format!("expected the number of `{name}`, found `{count}`"))
                    })?;
                    elements.push(Element {
                        name: (*name).to_owned(),
                        count,
                        properties: Vec::new(),
                    });
                }
                ["property", kind @ .., name] => {
                    let property = self.property(kind, name)?;
                    let Some(element) = elements.last_mut() else {
                        return Err(self.error(format!("property `{name}` before any element")));
                    };
                    element.properties.push(property);
                }
                ["comment" | "obj_info", ..] | [] => {}
                ["end_header"] => break,
                _ => self.ignored.add(features::PLY_HEADER, || format!("`{text}`")),
            }
        }
        self.line += 1;
        self.encoding = encoding.ok_or_else(|| self.error("the header has no line `format`"))?;
        Ok(elements)
    }

    fn property(&self, kind: &[&str], name: &str) -> Result<Property> {
        let scalar = |word: &str| {
            Scalar::parse(word).ok_or_else(|| {
                self.error(format!("property `{name}` has the unknown type `{word}`"))
            })
        };
        let (value, list_count) = match kind {
            [value] => (scalar(value)?, None),
            ["list", count, value] => (scalar(value)?, Some(scalar(count)?)),
            _ => return Err(self.error(format!("cannot read the type of property `{name}`"))),
        };
        Ok(Property { name: name.to_owned(), value, list_count })
    }
}
