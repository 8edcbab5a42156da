//! Rays of Embree in packets, in the layout of its C API (`rtcore_ray.h`, `rtcore_common.h`).

use std::{
    ffi::{c_int, c_uint, c_void},
    ptr,
};

/// Rays of a packet: those that the library follows at once on a CPU with AVX2.
pub(crate) const LANES: usize = 8;
/// A number of each ray of a packet.
pub(super) type Lanes<T> = [T; LANES];

/// `RTC_INVALID_GEOMETRY_ID`
pub(super) const NOTHING: u32 = u32::MAX;
/// A ray of a packet that is followed.
const FOLLOWED: c_int = -1;

/// Segments of rays that are followed together, and what they meet: `RTCRayHit8`, with room for what later
/// versions add to it, and our own at its end.
#[repr(C, align(32))]
#[derive(Clone, Debug, Default)]
pub(crate) struct Packet {
    origin: [Lanes<f32>; 3],
    /// Distance beyond which hits count.
    nearest: Lanes<f32>,
    direction: [Lanes<f32>; 3],
    /// Moment; scenes do not move.
    time: Lanes<f32>,
    /// Distance up to which hits count, then that of the closest hit, or −∞ after any.
    farthest: Lanes<f32>,
    mask: Lanes<u32>,
    /// Number of the ray, which filters are told.
    lane: Lanes<u32>,
    flags: Lanes<u32>,
    normal: [Lanes<f32>; 3],
    barycentric: [Lanes<f32>; 2],
    pub(super) primitive: Lanes<u32>,
    pub(super) geometry: Lanes<u32>,
    instance: [Lanes<u32>; 9],
    pub(super) followed: Lanes<c_int>,
    places: Lanes<u32>,
    count: usize,
}

impl Packet {
    pub(crate) fn new() -> Self {
        Self {
            // The mask lets rays meet all geometry.
            mask: [u32::MAX; LANES],
            lane: [0, 1, 2, 3, 4, 5, 6, 7],
            primitive: [NOTHING; LANES],
            geometry: [NOTHING; LANES],
            instance: [[NOTHING; LANES]; 9],
            ..Self::default()
        }
    }

    /// Adds the segment from just beyond `origin` to `farthest`, whose answer belongs at `place`. Panics if
    /// the packet is full.
    pub(crate) fn push(
        &mut self,
        place: u32,
        origin: [f32; 3],
        direction: [f32; 3],
        farthest: f32,
    ) {
        let lane = self.count;
        for axis in 0..3 {
            self.origin[axis][lane] = origin[axis];
            self.direction[axis][lane] = direction[axis];
        }
        self.farthest[lane] = farthest;
        self.geometry[lane] = NOTHING;
        self.followed[lane] = FOLLOWED;
        self.places[lane] = place;
        self.count += 1;
    }

    pub(crate) fn clear(&mut self) {
        self.followed = [0; LANES];
        self.count = 0;
    }

    /// Places of the rays, lane by lane.
    pub(crate) fn places(&self) -> &[u32] {
        &self.places[..self.count]
    }

    /// Tests whether a ray has met anything, after a search for any hit.
    pub(crate) fn is_blocked(&self, lane: usize) -> bool {
        self.farthest[lane] < 0.0
    }

    /// Distance of the closest hit of a ray that has met something.
    pub(super) fn distance(&self, lane: usize) -> f32 {
        self.farthest[lane]
    }
}

/// `RTCIntersectContext` of version 3.
#[repr(C)]
pub(super) struct Context {
    flags: c_int,
    filter: *const c_void,
    instances: Instances,
}

/// `RTCRayQueryContext` of version 4 and the end of the context of version 3, with room for more levels, and
/// our own at its end.
#[repr(C)]
pub(super) struct Instances {
    levels: [u32; 8],
    heed: *mut c_void,
}

/// `RTCIntersectArguments` and `RTCOccludedArguments` of version 4, with room at the end.
#[repr(C)]
pub(super) struct Arguments {
    flags: c_int,
    features: c_int,
    context: *mut Instances,
    filter: *const c_void,
    intersect: *const c_void,
    reserved: [usize; 4],
}

impl Instances {
    /// Makes a context in which filters find `heed`.
    fn new(heed: *mut c_void) -> Self {
        Self { levels: [NOTHING; 8], heed }
    }
}

impl Context {
    /// As [`Instances::new`].
    pub(super) fn new(heed: *mut c_void, is_coherent: bool) -> Self {
        // `RTC_INTERSECT_CONTEXT_FLAG_COHERENT`
        Self { flags: is_coherent.into(), filter: ptr::null(), instances: Instances::new(heed) }
    }
}

impl Arguments {
    /// As [`Instances::new`], and calls `ask` with the arguments.
    pub(super) fn with(heed: *mut c_void, is_coherent: bool, ask: impl FnOnce(&mut Self)) {
        ask(&mut Self {
            // `RTC_RAY_QUERY_FLAG_COHERENT`, `RTC_FEATURE_FLAG_ALL`
            flags: c_int::from(is_coherent) << 16,
            features: -1,
            context: &mut Instances::new(heed),
            filter: ptr::null(),
            intersect: ptr::null(),
            reserved: [0; 4],
        });
    }
}

/// `RTCFilterFunctionNArguments`: rays of a packet of `count` that have met a surface.
#[repr(C)]
pub(super) struct Met {
    /// Rays that have; 0 lets one go on.
    valid: *mut c_int,
    /// Pointer that the geometry was given.
    pub(super) own: *const c_void,
    context: *const c_void,
    ray: *const f32,
    hit: *const u32,
    count: c_uint,
}

impl Met {
    /// Pointer that the context of version 3 or 4 was given.
    ///
    /// # Safety
    /// The context is one that [`Context::new`] or, of version 4, [`Arguments::with`] made.
    pub(super) unsafe fn heed(&self, is_of_three: bool) -> *mut c_void {
        // SAFETY: as the caller says.
        unsafe {
            if is_of_three {
                (*self.context.cast::<Context>()).instances.heed
            } else {
                (*self.context.cast::<Instances>()).heed
            }
        }
    }

    /// Calls `stops` with the lane in its packet, origin, direction and distance of every ray, and with the
    /// primitive that it has met. Rays that are not stopped go on.
    ///
    /// # Safety
    /// The library has made `self`.
    pub(super) unsafe fn for_each(
        &self,
        mut stops: impl FnMut(usize, [[f32; 3]; 2], f32, u32) -> bool,
    ) {
        let count = self.count as usize;
        for ray in 0..count {
            // SAFETY: there are `count` words of each of the members of a packet, in the order of
            // `Packet`: twelve of rays, and seven of hits before those of instances.
            unsafe {
                let valid = self.valid.add(ray);
                if *valid != FOLLOWED {
                    continue;
                }
                let member = |member: usize| *self.ray.add(member * count + ray);
                let origin = [member(0), member(1), member(2)];
                let direction = [member(4), member(5), member(6)];
                let lane = member(10).to_bits() as usize;
                let primitive = *self.hit.add(5 * count + ray);
                if !stops(lane, [origin, direction], member(8), primitive) {
                    *valid = 0;
                }
            }
        }
    }
}
