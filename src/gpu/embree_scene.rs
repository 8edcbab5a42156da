//! Triangles that Embree has built a tree over, and the rays that it follows there.

use std::{ffi::c_int, ptr, sync::Arc};

use super::{
    buffer::Buffer,
    embree::{Embree, Handle, Queries},
    embree_rays::{Context, NOTHING, Segment, SegmentHit},
};
use crate::error::Result;

/// `RTC_GEOMETRY_TYPE_TRIANGLE`
const TRIANGLES: c_int = 0;
/// `RTC_BUFFER_TYPE_INDEX`
const INDICES: c_int = 0;
/// `RTC_BUFFER_TYPE_VERTEX`
const VERTICES: c_int = 1;
/// `RTC_FORMAT_UINT3`
const FORMAT_UINT3: c_int = 0x5003;
/// `RTC_FORMAT_FLOAT3`
const FORMAT_FLOAT3: c_int = 0x9003;
/// `RTC_SCENE_FLAG_ROBUST`: no ray slips between triangles that share an edge.
const ROBUST: c_int = 1 << 2;

/// Bytes of a vertex in the buffers of triangles: position and normal.
const VERTEX_BYTES: usize = 16;

/// Triangles of one buffer, which has three vertices for each.
pub(crate) struct Part {
    vertices: Arc<Buffer>,
    /// Number of the buffer's first triangle in the scene.
    first: u32,
    corners: Vec<[u32; 3]>,
}

impl Part {
    /// Takes `triangles` of the scene, which lie in a buffer whose memory the host shares; `first` is the
    /// first of the buffer.
    pub(crate) fn new(
        vertices: &Arc<Buffer>,
        first: u32,
        triangles: impl Iterator<Item = u32>,
    ) -> Self {
        let corners = |triangle| [0, 1, 2].map(|corner| 3 * (triangle - first) + corner);
        Self { vertices: Arc::clone(vertices), first, corners: triangles.map(corners).collect() }
    }
}

/// A tree over triangles.
pub(crate) struct EmbreeScene {
    raw: Handle,
    /// Kept, since the library refers to their memory.
    parts: Vec<Part>,
    embree: Arc<Embree>,
}

// SAFETY: a scene that has been built is only read, and the library allows that from all threads.
unsafe impl Send for EmbreeScene {}
// SAFETY: as above.
unsafe impl Sync for EmbreeScene {}

impl EmbreeScene {
    /// Builds the tree.
    ///
    /// # Errors
    /// [`crate::Error::Memory`] if memory does not suffice, [`crate::Error::Device`] if the library fails,
    /// [`crate::Error::Vulkan`] if the host does not share the memory of a buffer.
    ///
    /// # Panics
    /// If a triangle lies beyond its buffer.
    pub(crate) fn new(embree: &Arc<Embree>, parts: Vec<Part>) -> Result<Self> {
        // SAFETY: the device is alive.
        let raw = unsafe { (embree.new_scene)(embree.device) };
        let scene = Self { raw, parts, embree: Arc::clone(embree) };
        for (number, part) in (0..).zip(&scene.parts) {
            let words = part.vertices.words()?;
            let vertex_count = size_of_val(words) / VERTEX_BYTES;
            assert!(
                part.corners.iter().flatten().all(|&vertex| (vertex as usize) < vertex_count),
                "triangles lie in their buffer"
            );
            // SAFETY: device and scene are alive. Both arrays have the stated size and stride, live in
            // `parts` as long as the scene, and nobody writes to them; reads of 16 bytes at the last
            // vertex stay within it. The scene keeps the geometry, which nobody uses after this.
            unsafe {
                let geometry = (embree.new_geometry)(embree.device, TRIANGLES);
                (embree.set_buffer)(
                    geometry,
                    VERTICES,
                    0,
                    FORMAT_FLOAT3,
                    words.as_ptr().cast(),
                    0,
                    VERTEX_BYTES,
                    vertex_count,
                );
                (embree.set_buffer)(
                    geometry,
                    INDICES,
                    0,
                    FORMAT_UINT3,
                    part.corners.as_ptr().cast(),
                    0,
                    size_of::<[u32; 3]>(),
                    part.corners.len(),
                );
                (embree.commit_geometry)(geometry);
                (embree.attach_geometry)(scene.raw, geometry, number);
                (embree.release_geometry)(geometry);
            }
        }
        // SAFETY: the scene is alive, and no other thread knows it yet.
        unsafe {
            (embree.set_scene_flags)(scene.raw, ROBUST);
            (embree.commit_scene)(scene.raw);
        }
        embree.check("the host's tree").map(|()| scene)
    }

    /// Finds the closest hit of a segment: its triangle and distance.
    pub(crate) fn closest(&self, segment: Segment) -> Option<(u32, f32)> {
        let mut ray = SegmentHit::new(segment);
        // SAFETY: the scene is built; ray and context have the layout of the library's version.
        unsafe {
            match self.embree.queries {
                Queries::Three(intersect, _) => intersect(self.raw, &mut Context::new(), &mut ray),
                Queries::Four(intersect, _) => intersect(self.raw, &mut ray, ptr::null_mut()),
            }
        }
        if ray.geometry == NOTHING {
            return None;
        }
        let part = self.parts.get(ray.geometry as usize)?;
        let triangle = part.first + part.corners[ray.primitive as usize][0] / 3;
        Some((triangle, ray.segment.farthest))
    }

    /// Tests a segment for any hit.
    pub(crate) fn is_blocked(&self, mut segment: Segment) -> bool {
        // SAFETY: the scene is built; ray and context have the layout of the library's version.
        unsafe {
            match self.embree.queries {
                Queries::Three(_, occluded) => {
                    occluded(self.raw, &mut Context::new(), &mut segment);
                }
                Queries::Four(_, occluded) => occluded(self.raw, &mut segment, ptr::null_mut()),
            }
        }
        segment.farthest < 0.0
    }
}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        // SAFETY: the scene is alive, and nobody uses it after this.
        unsafe { (self.embree.release_scene)(self.raw) };
    }
}
