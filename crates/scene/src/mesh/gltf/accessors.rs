//! Accessors of a glTF file → arrays; every range is checked.

use gltf::{
    accessor::{Accessor, DataType, Dimensions, sparse::IndexType},
    buffer::View,
};

use super::GltfReader;
use crate::{
    error::{Error, Result},
    files::little_endian,
    memory,
};

/// Most elements of a sparse accessor that starts from zeros, which no buffer bounds.
const MAX_ZEROS: usize = 1 << 26;

impl<'a> GltfReader<'a> {
    /// Reads vectors of `N` numbers: floats, or integers as `KHR_mesh_quantization` has them.
    pub(super) fn vectors<const N: usize>(&self, accessor: &Accessor) -> Result<Vec<[f32; N]>> {
        let (expected, name) = match N {
            1 => (Dimensions::Scalar, "one"),
            2 => (Dimensions::Vec2, "two"),
            3 => (Dimensions::Vec3, "three"),
            _ => (Dimensions::Vec4, "four"),
        };
        let data_type = accessor.data_type();
        if data_type == DataType::U32 || accessor.dimensions() != expected {
            return Err(self.error(format!(
                "accessor {}: expected vectors of {name} floats or short integers, found {:?} of \
                 {data_type:?}",
                accessor.index(),
                accessor.dimensions(),
            )));
        }
        let scale = match (accessor.normalized(), data_type) {
            (true, DataType::I8) => 127.0,
            (true, DataType::U8) => 255.0,
            (true, DataType::I16) => 32_767.0,
            (true, DataType::U16) => 65_535.0,
            _ => 1.0,
        };
        let size = data_type.size();
        let component = |bytes: &[u8]| {
            let value = match *bytes {
                [a] if data_type == DataType::I8 => f32::from(a as i8),
                [a] => f32::from(a),
                [a, b] if data_type == DataType::I16 => f32::from(i16::from_le_bytes([a, b])),
                [a, b] => f32::from(u16::from_le_bytes([a, b])),
                [a, b, c, d] => f32::from_le_bytes([a, b, c, d]),
                _ => 0.0,
            };
            // The least of the signed integers is one below −1.
            if scale == 1.0 { value } else { (value / scale).max(-1.0) }
        };
        self.elements(accessor, |bytes| {
            std::array::from_fn(|index| component(&bytes[index * size..][..size]))
        })
    }

    /// Reads the corners of triangles, all below `vertex_count`.
    pub(super) fn indices(&self, accessor: &Accessor, vertex_count: usize) -> Result<Vec<u32>> {
        let (data_type, dimensions) = (accessor.data_type(), accessor.dimensions());
        let is_unsigned = matches!(data_type, DataType::U8 | DataType::U16 | DataType::U32);
        if !is_unsigned || dimensions != Dimensions::Scalar {
            return Err(self.error(format!(
                "accessor {}: expected unsigned indices, found {dimensions:?} of {data_type:?}",
                accessor.index()
            )));
        }
        let indices = self.elements(accessor, |bytes| little_endian(bytes) as u32)?;
        match indices.iter().position(|&index| index as usize >= vertex_count) {
            Some(element) => Err(self.error(format!(
                "accessor {}, element {element} (triangle {}): vertex index {} is out of range, \
                 the primitive has {vertex_count} vertices",
                accessor.index(),
                element / 3,
                indices[element]
            ))),
            None => Ok(indices),
        }
    }

    /// Reads the elements of an accessor, each from its `accessor.size()` bytes.
    pub(super) fn elements<T>(
        &self,
        accessor: &Accessor,
        element: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>> {
        let label = format!("accessor {}", accessor.index());
        let (count, size) = (accessor.count(), accessor.size());
        let asker = format_args!("{}: {label}", self.path.display());
        memory::check_count(asker, count, size_of::<T>()).map_err(Error::memory)?;
        let mut elements: Vec<T> = match accessor.view() {
            Some(view) => {
                self.slices(&label, &view, accessor.offset(), count, size)?.map(&element).collect()
            }
            None if accessor.sparse().is_some() && count <= MAX_ZEROS => {
                (0..count).map(|_| element(&vec![0; size])).collect()
            }
            None => return Err(self.error(format!("{label} has no buffer view"))),
        };
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let index_size = match indices.index_type() {
                IndexType::U8 => 1,
                IndexType::U16 => 2,
                IndexType::U32 => 4,
            };
            let (from, count) = (indices.offset(), sparse.count());
            let places = self.slices(&label, &indices.view(), from, count, index_size)?;
            let new = self.slices(&label, &values.view(), values.offset(), count, size)?;
            for (place, value) in places.zip(new) {
                let place = little_endian(place) as usize;
                *elements.get_mut(place).ok_or_else(|| {
                    self.error(format!("{label}: sparse index {place} is out of range"))
                })? = element(value);
            }
        }
        Ok(elements)
    }

    /// Cuts a buffer view into `count` elements of `size` bytes from an offset on; `label` names its user.
    fn slices<'s>(
        &'s self,
        label: &str,
        view: &View,
        offset: usize,
        count: usize,
        size: usize,
    ) -> Result<impl Iterator<Item = &'s [u8]> + use<'s, 'a>> {
        let stride = view.stride().unwrap_or(size);
        let needed = count
            .checked_sub(1)
            .map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size))
            .and_then(|bytes| bytes.checked_add(offset));
        let bytes = self.view_bytes(view)?;
        if needed.is_none_or(|needed| needed > bytes.len()) || (stride < size) {
            return Err(self.error(format!(
                "{label}: {count} elements of {size} bytes every {stride} from byte {offset} do \
                 not fit into the {} bytes of buffer view {}",
                bytes.len(),
                view.index()
            )));
        }
        Ok((0..count).map(move |index| {
            let start = offset + index * stride;
            &bytes[start..start + size]
        }))
    }

    pub(super) fn view_bytes(&self, view: &View) -> Result<&[u8]> {
        let buffer = &self.buffers[view.buffer().index()];
        view.offset()
            .checked_add(view.length())
            .and_then(|end| buffer.get(view.offset()..end))
            .ok_or_else(|| {
                self.error(format!(
                    "truncated: buffer view {} needs {} bytes from byte {}, its buffer has {}",
                    view.index(),
                    view.length(),
                    view.offset(),
                    buffer.len()
                ))
            })
    }
}
