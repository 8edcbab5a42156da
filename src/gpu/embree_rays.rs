//! Rays of Embree, in the layout of its C API (`rtcore_ray.h`).

use std::{
    ffi::{c_int, c_void},
    ptr,
};

/// `RTC_INVALID_GEOMETRY_ID`
pub(super) const NOTHING: u32 = u32::MAX;

/// A segment of a ray: `RTCRay`.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Segment {
    origin: [f32; 3],
    /// Distance beyond which hits count.
    nearest: f32,
    direction: [f32; 3],
    /// Moment; scenes do not move.
    time: f32,
    /// Distance up to which hits count, then that of the closest hit, or −∞ after any.
    pub(super) farthest: f32,
    mask: u32,
    id: u32,
    flags: u32,
}

impl Segment {
    /// Makes the segment from just beyond `origin` to `farthest`.
    pub(crate) fn new(origin: [f32; 3], direction: [f32; 3], farthest: f32) -> Self {
        // The mask lets it meet all geometry.
        Self { origin, direction, farthest, mask: u32::MAX, ..Self::default() }
    }
}

/// `RTCRayHit`, with room for what later versions add to the hit.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug)]
pub(super) struct SegmentHit {
    pub(super) segment: Segment,
    normal: [f32; 3],
    barycentric: [f32; 2],
    pub(super) primitive: u32,
    pub(super) geometry: u32,
    instance: [u32; 9],
}

impl SegmentHit {
    pub(super) fn new(segment: Segment) -> Self {
        Self {
            segment,
            normal: [0.0; 3],
            barycentric: [0.0; 2],
            primitive: NOTHING,
            geometry: NOTHING,
            instance: [NOTHING; 9],
        }
    }
}

/// `RTCIntersectContext` of version 3, with room at its end.
#[repr(C)]
pub(super) struct Context {
    flags: c_int,
    filter: *const c_void,
    instance: [u32; 8],
}

impl Context {
    pub(super) fn new() -> Self {
        Self { flags: 0, filter: ptr::null(), instance: [NOTHING; 8] }
    }
}
