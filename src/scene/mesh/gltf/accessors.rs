//! Accessors of a glTF file → arrays; every range is checked.

use gltf::{
    accessor::{Accessor, DataType, Dimensions, sparse::IndexType},
    buffer::View,
};

use super::GltfReader;
use crate::error::Result;

/// Most elements of a sparse accessor that starts from zeros, which no buffer bounds.
const MAX_ZEROS: usize = 1 << 26;

/// Elements of one size in a buffer view.
struct Elements {
    offset: usize,
    count: usize,
    size: usize,
}

impl<'a> GltfReader<'a> {
    /// Reads vectors of `N` floats.
    pub(super) fn vectors<const N: usize>(&self, accessor: &Accessor) -> Result<Vec<[f32; N]>> {
        let expected = if N == 3 { Dimensions::Vec3 } else { Dimensions::Vec4 };
        if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, expected) {
            return Err(self.error(format!(
                "accessor {}: expected vectors of {} floats, found {:?} of {:?}",
                accessor.index(),
                if N == 3 { "three" } else { "four" },
                accessor.dimensions(),
                accessor.data_type()
            )));
        }
        let component = |bytes: &[u8], at: usize| {
            f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        };
        self.elements(accessor, |bytes| std::array::from_fn(|index| component(bytes, 4 * index)))
    }

    /// Reads the corners of triangles, all below `vertex_count`.
    pub(super) fn indices(&self, accessor: &Accessor, vertex_count: usize) -> Result<Vec<u32>> {
        let kind = (accessor.data_type(), accessor.dimensions());
        let indices: Vec<u32> = match kind {
            (DataType::U8, Dimensions::Scalar) => {
                self.elements(accessor, |bytes| u32::from(bytes[0]))?
            }
            (DataType::U16, Dimensions::Scalar) => self
                .elements(accessor, |bytes| u32::from(u16::from_le_bytes([bytes[0], bytes[1]])))?,
            (DataType::U32, Dimensions::Scalar) => self.elements(accessor, |bytes| {
                u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
            })?,
            (data_type, dimensions) => {
                return Err(self.error(format!(
                    "accessor {}: expected unsigned indices, found {dimensions:?} of {data_type:?}",
                    accessor.index()
                )));
            }
        };
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
    fn elements<T>(&self, accessor: &Accessor, element: impl Fn(&[u8]) -> T) -> Result<Vec<T>> {
        let label = format!("accessor {}", accessor.index());
        let (count, size) = (accessor.count(), accessor.size());
        let range = |offset, count, size| Elements { offset, count, size };
        let mut elements: Vec<T> = match accessor.view() {
            Some(view) => self
                .slices(&label, &view, &range(accessor.offset(), count, size))?
                .map(&element)
                .collect(),
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
            let places = range(indices.offset(), sparse.count(), index_size);
            let new = range(values.offset(), sparse.count(), size);
            let places = self.slices(&label, &indices.view(), &places)?;
            for (place, value) in places.zip(self.slices(&label, &values.view(), &new)?) {
                let place = place.iter().rev().fold(0, |sum, &byte| sum << 8 | usize::from(byte));
                *elements.get_mut(place).ok_or_else(|| {
                    self.error(format!("{label}: sparse index {place} is out of range"))
                })? = element(value);
            }
        }
        Ok(elements)
    }

    /// Cuts a buffer view into elements; `label` names its user.
    fn slices<'s>(
        &'s self,
        label: &str,
        view: &View,
        &Elements { offset, count, size }: &Elements,
    ) -> Result<impl Iterator<Item = &'s [u8]> + use<'s, 'a>> {
        let stride = view.stride().unwrap_or(size);
        let needed = count
            .checked_sub(1)
            .map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size))
            .and_then(|bytes| bytes.checked_add(offset));
        let buffer = &self.buffers[view.buffer().index()];
        let bytes = view
            .offset()
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
            })?;
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
}
