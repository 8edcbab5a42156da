//! Mesh of a `.serialized` file, versions 3 and 4 of Mitsuba 0.6.
//!
//! Numbers are little-endian. Each mesh is a header of two 16-bit numbers and a zlib stream; the file
//! ends in the offsets of all meshes and their count.

use std::{io::Read, path::Path};

use flate2::read::ZlibDecoder;

use crate::{
    error::{Error, Result},
    files::{self, DEFLATE_LARGEST_RATIO, little_endian},
    mesh::Mesh,
};

const MAGIC: u16 = 0x041C;
const HAS_NORMALS: u32 = 0x0001;
const HAS_COORDINATES: u32 = 0x0002;
const HAS_COLORS: u32 = 0x0008;
const FACE_NORMALS: u32 = 0x0010;
const DOUBLE_PRECISION: u32 = 0x2000;
/// Longest name of a mesh.
const MAX_NAME: usize = 4096;

/// Reads mesh number `index`; its normals are empty if the file asks for flat ones. Fails for a file that is
/// truncated, of another format or without that mesh.
pub(super) fn read(path: &Path, index: usize) -> Result<(Mesh, bool)> {
    let bytes = files::read(path)?;
    parse(&bytes, index).map_err(|message| Error::format(path, message))
}

fn parse(bytes: &[u8], index: usize) -> Result<(Mesh, bool), String> {
    let number = |at: usize, length: usize| -> Option<u64> {
        bytes.get(at..at.checked_add(length)?).map(little_endian)
    };
    let header = |at: usize| {
        let (magic, version) = (number(at, 2)?, number(at + 2, 2)?);
        (magic == u64::from(MAGIC) && matches!(version, 3 | 4)).then_some(version)
    };
    let Some(version) = header(0) else {
        return Err("expected a serialized mesh of version 3 or 4, found another file".to_owned());
    };
    let truncated = || "the file is truncated".to_owned();
    let end = bytes.len().checked_sub(4).ok_or_else(truncated)?;
    let count = number(end, 4).ok_or_else(truncated)? as usize;
    let length = if version == 4 { 8 } else { 4 };
    let table = count.checked_mul(length).and_then(|size| end.checked_sub(size));
    let table = table.ok_or_else(truncated)?;
    if index >= count {
        return Err(format!("shape_index {index}: the file has {count} meshes"));
    }
    let offset = |index: usize| {
        let offset = number(table + index * length, length)?;
        usize::try_from(offset).ok()
    };
    let start = offset(index).ok_or_else(truncated)?;
    let stop = if index + 1 == count { table } else { offset(index + 1).ok_or_else(truncated)? };
    let mesh = start.checked_add(4).and_then(|from| bytes.get(from..stop.min(table)));
    let (Some(mesh), Some(version)) = (mesh, header(start)) else {
        return Err(format!("mesh {index} does not begin where the file says"));
    };
    let left = (mesh.len() as u64).saturating_mul(DEFLATE_LARGEST_RATIO);
    Stream { decoder: ZlibDecoder::new(mesh), left }.mesh(version)
}

/// Numbers of a zlib stream, with a bound on what it can hold.
struct Stream<'a> {
    decoder: ZlibDecoder<&'a [u8]>,
    /// Most bytes that the stream can hold.
    left: u64,
}

impl Stream<'_> {
    fn bytes(&mut self, count: u64) -> Result<Vec<u8>, String> {
        let Some(left) = self.left.checked_sub(count) else {
            return Err("its header promises more than the file holds".to_owned());
        };
        self.left = left;
        let mut bytes = vec![0; count as usize];
        let message = |error| format!("not a readable zlib stream: {error}");
        self.decoder.read_exact(&mut bytes).map_err(message)?;
        Ok(bytes)
    }

    fn integer(&mut self, length: u64) -> Result<u64, String> {
        self.bytes(length).map(|bytes| little_endian(&bytes))
    }

    /// Vectors of `N` numbers in the precision of the file.
    fn vectors<const N: usize>(
        &mut self,
        count: u64,
        double: bool,
    ) -> Result<Vec<[f32; N]>, String> {
        let size: u64 = if double { 8 } else { 4 };
        let bytes = self.bytes(count.saturating_mul(N as u64 * size))?;
        let number = |bytes: &[u8]| match *bytes {
            [a, b, c, d] => f32::from_le_bytes([a, b, c, d]),
            [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]) as f32,
            _ => f32::NAN,
        };
        let mut numbers = bytes.chunks_exact(size as usize).map(number);
        let vector = |_| std::array::from_fn(|_| numbers.next().unwrap_or(f32::NAN));
        Ok((0..count).map(vector).collect())
    }

    fn mesh(mut self, version: u64) -> Result<(Mesh, bool), String> {
        let flags = self.integer(4)? as u32;
        if version == 4 {
            let mut length = 0;
            while self.integer(1)? != 0 {
                length += 1;
                if length > MAX_NAME {
                    return Err(format!("the name of a mesh is longer than {MAX_NAME} bytes"));
                }
            }
        }
        let (vertices, triangles) = (self.integer(8)?, self.integer(8)?);
        if vertices > u64::from(u32::MAX) || triangles > u64::from(u32::MAX) {
            return Err(format!("{vertices} vertices and {triangles} triangles are too many"));
        }
        let double = flags & DOUBLE_PRECISION != 0;
        let mut mesh = Mesh { positions: self.vectors(vertices, double)?, ..Mesh::default() };
        if flags & HAS_NORMALS != 0 {
            mesh.normals = self.vectors(vertices, double)?;
        }
        if flags & HAS_COORDINATES != 0 {
            mesh.uvs[0] = self.vectors(vertices, double)?;
        }
        if flags & HAS_COLORS != 0 {
            let colors = self.vectors::<3>(vertices, double)?;
            mesh.colors = colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect();
        }
        let bytes = self.bytes(triangles * 12)?;
        let mut indices = bytes.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes));
        let triangle = |_| std::array::from_fn(|_| indices.next().unwrap_or(u32::MAX));
        mesh.triangles = (0..triangles).map(triangle).collect();
        let largest = mesh.triangles.iter().flatten().max();
        if let Some(largest) = largest.filter(|index| u64::from(**index) >= vertices) {
            return Err(format!("a triangle has the vertex {largest}, there are {vertices}"));
        }
        Ok((mesh, flags & FACE_NORMALS != 0))
    }
}
