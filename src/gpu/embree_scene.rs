//! Triangles that Embree has built a tree over, and the rays that it follows there.

use std::{
    ffi::{c_int, c_void},
    ops::Range,
    ptr,
    sync::Arc,
};

use glam::Vec3;

use super::{
    buffer::Buffer,
    embree::{Embree, Filter, Handle, Queries},
    embree_rays::{Arguments, Context, Met, NOTHING, Packet},
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

/// Positions of triangles, three for each.
#[derive(Clone)]
pub(crate) enum Vertices {
    /// In a buffer whose memory the host shares.
    Shared(Buffer),
    /// In the world, and one vertex more, since the library reads beyond the last.
    Own(Arc<Vec<[f32; 3]>>),
}

/// Triangles whose positions lie together.
pub(crate) struct Part {
    vertices: Vertices,
    /// Number in the scene of the triangle that has the first three.
    first: u32,
    corners: Vec<[u32; 3]>,
    instance: u32,
    /// True if rays are asked whether they stop at the triangles.
    is_passing: bool,
}

impl Part {
    /// Takes `triangles` of the scene, whose positions are `vertices` from those of `first` on: those that
    /// stop all light, and those of which `may_pass` says that light may pass them.
    pub(crate) fn pair(
        vertices: &Vertices,
        first: u32,
        instance: u32,
        triangles: Range<u32>,
        may_pass: impl Fn(u32) -> bool,
    ) -> [Self; 2] {
        [false, true].map(|is_passing| {
            let own = triangles.clone().filter(|triangle| may_pass(*triangle) == is_passing);
            let corners = |triangle: u32| [0, 1, 2].map(|corner| 3 * (triangle - first) + corner);
            let (vertices, corners) = (vertices.clone(), own.map(corners).collect());
            Self { vertices, first, corners, instance, is_passing }
        })
    }

    fn triangle(&self, primitive: u32) -> u32 {
        self.first + self.corners[primitive as usize][0] / 3
    }
}

/// A surface of a passing [`Part`] that a ray meets, not always the closest.
pub(crate) struct Meeting {
    /// Lane of the ray in its packet.
    pub lane: usize,
    pub triangle: u32,
    pub instance: u32,
    pub origin: Vec3,
    pub direction: Vec3,
    pub distance: f32,
}

/// Closest hit of a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    pub triangle: u32,
    pub instance: u32,
    pub distance: f32,
}

/// Hits that rays are followed to; the place of a function in [`Queries`].
#[derive(Clone, Copy)]
pub(crate) enum Search {
    Closest,
    Any,
}

/// Decides whether a ray stops at a surface.
pub(crate) type Stops<'a> = dyn FnMut(&Meeting) -> bool + 'a;

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
    /// Builds the tree. Fails with [`crate::Error::Memory`], with [`crate::Error::Device`] if the library
    /// does, or with [`crate::Error::Vulkan`] if the host does not share the memory of a buffer. Panics if a
    /// triangle lies beyond its buffer.
    pub(crate) fn new(embree: &Arc<Embree>, mut parts: Vec<Part>) -> Result<Self> {
        parts.retain(|part| !part.corners.is_empty());
        // SAFETY: the device is alive.
        let raw = unsafe { (embree.new_scene)(embree.device) };
        let scene = Self { raw, parts, embree: Arc::clone(embree) };
        let filter: Filter = match embree.queries {
            Queries::Three(_) => heed::<true>,
            Queries::Four(_) => heed::<false>,
        };
        for (number, part) in (0..).zip(&scene.parts) {
            let (vertices, stride, vertex_count) = match &part.vertices {
                Vertices::Shared(buffer) => {
                    let words = buffer.words()?;
                    (words.as_ptr().cast(), VERTEX_BYTES, size_of_val(words) / VERTEX_BYTES)
                }
                Vertices::Own(own) => {
                    (own.as_ptr().cast(), size_of::<[f32; 3]>(), own.len().saturating_sub(1))
                }
            };
            assert!(
                part.corners.iter().flatten().all(|&vertex| (vertex as usize) < vertex_count),
                "triangles lie in their buffer"
            );
            // SAFETY: device and scene are alive. Both arrays have the stated size and stride, live in
            // `parts` as long as the scene, and nobody writes to them; reads of 16 bytes at the last
            // vertex stay within them. Filters read `part`, which does not move. The scene keeps the
            // geometry, which nobody uses after this.
            unsafe {
                let geometry = (embree.new_geometry)(embree.device, TRIANGLES);
                let set_buffer = embree.set_buffer;
                set_buffer(geometry, VERTICES, 0, FORMAT_FLOAT3, vertices, 0, stride, vertex_count);
                let corners = &part.corners;
                set_buffer(
                    geometry,
                    INDICES,
                    0,
                    FORMAT_UINT3,
                    corners.as_ptr().cast(),
                    0,
                    size_of::<[u32; 3]>(),
                    corners.len(),
                );
                if part.is_passing {
                    (embree.set_own)(geometry, ptr::from_ref(part).cast());
                    (embree.set_closest_filter)(geometry, filter);
                    (embree.set_any_filter)(geometry, filter);
                }
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

    /// Follows the rays of a packet: to their closest hits, for [`EmbreeScene::hit`], or to any, for
    /// [`Packet::is_blocked`]. `is_coherent` says that they go the same way.
    pub(crate) fn find(
        &self,
        search: Search,
        packet: &mut Packet,
        is_coherent: bool,
        mut stops: &mut Stops<'_>,
    ) {
        let heed = (&raw mut stops).cast::<c_void>();
        let packet = ptr::from_mut(packet);
        // SAFETY: the scene is built; packet and context have the layout of the library's version, which
        // reads `followed` and writes elsewhere. Filters are called in this thread before the function
        // returns, and find `stops` by `heed`.
        unsafe {
            let followed = &raw const (*packet).followed;
            match &self.embree.queries {
                Queries::Three(queries) => {
                    let context = &mut Context::new(heed, is_coherent);
                    queries[search as usize](followed, self.raw, context, packet);
                }
                Queries::Four(queries) => Arguments::with(heed, is_coherent, |arguments| {
                    queries[search as usize](followed, self.raw, packet, arguments);
                }),
            }
        }
    }

    /// Closest hit of a ray, if it has met anything.
    pub(crate) fn hit(&self, packet: &Packet, lane: usize) -> Option<Found> {
        if packet.geometry[lane] == NOTHING {
            return None;
        }
        let part = self.parts.get(packet.geometry[lane] as usize)?;
        Some(Found {
            triangle: part.triangle(packet.primitive[lane]),
            instance: part.instance,
            distance: packet.distance(lane),
        })
    }
}

/// Asks for every ray that has met a surface of a passing part whether it stops.
///
/// # Safety
/// The library calls it while [`EmbreeScene::find`] runs.
unsafe extern "C" fn heed<const IS_OF_THREE: bool>(met: *const Met) {
    // SAFETY: the library has made `met`, the geometry was given its part, and `find` its `stops`.
    unsafe {
        let part = &*(*met).own.cast::<Part>();
        let stops = &mut *(*met).heed(IS_OF_THREE).cast::<&mut Stops<'_>>();
        (*met).for_each(|lane, [origin, direction], distance, primitive| {
            stops(&Meeting {
                lane,
                triangle: part.triangle(primitive),
                instance: part.instance,
                origin: origin.into(),
                direction: direction.into(),
                distance,
            })
        });
    }
}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        // SAFETY: the scene is alive, and nobody uses it after this.
        unsafe { (self.embree.release_scene)(self.raw) };
    }
}
