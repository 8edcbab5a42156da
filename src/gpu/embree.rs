//! Embree, Intel's library of ray traversal on the CPU, loaded from its shared library where the device is
//! software: \[Wald et al. 2014\].
//!
//! The functions are those of its C API (`rtcore.h`). Versions 3 and 4 share those that build; those that
//! follow rays take other arguments, see [`Queries`].

use std::{
    ffi::{CStr, c_char, c_int, c_uint, c_void},
    mem::ManuallyDrop,
    ptr,
    sync::Arc,
};

use libloading::Library;

use super::{
    embree_rays::{Arguments, Context, Lanes, Met, Packet},
    library,
};
use crate::{
    error::{Error, Result},
    memory,
};

/// Environment variable with the library's file, or the folder that holds it.
const LIBRARY_VARIABLE: &str = "FENESTRA_EMBREE";
const NAMES: [&str; 2] = ["libembree4.so.4", "libembree3.so.3"];
const HELP: &str = "install the library (Debian: libembree3-3 or libembree4-4, as ./setup does), and name \
                    its folder in FENESTRA_EMBREE if the system does not find it";

/// `RTC_DEVICE_PROPERTY_VERSION`
const PROPERTY_VERSION: c_int = 0;
/// `RTC_ERROR_NONE`
const ERROR_NONE: c_int = 0;
/// `RTC_ERROR_OUT_OF_MEMORY`
const ERROR_OUT_OF_MEMORY: c_int = 4;
/// `RTC_ERROR_CANCELLED`
const ERROR_CANCELLED: c_int = 6;
/// `RTCDevice`, `RTCScene` or `RTCGeometry`.
pub(super) type Handle = *mut c_void;
type MemoryMonitor = extern "C" fn(*mut c_void, isize, bool) -> bool;
type SetBuffer = unsafe extern "C" fn(
    geometry: Handle,
    kind: c_int,
    slot: c_uint,
    format: c_int,
    data: *const c_void,
    byte_offset: usize,
    byte_stride: usize,
    count: usize,
);

/// Function that is asked whether a ray stops at a surface.
pub(super) type Filter = unsafe extern "C" fn(*const Met);
type SetFilter = unsafe extern "C" fn(geometry: Handle, Filter);
/// Functions of version 3 that follow rays take a context before them.
type QueryOfThree = unsafe extern "C" fn(*const Lanes<c_int>, Handle, *mut Context, *mut Packet);
/// Those of version 4 take arguments after them.
type QueryOfFour = unsafe extern "C" fn(*const Lanes<c_int>, Handle, *mut Packet, *mut Arguments);

/// Functions that follow the rays of a packet: to their closest hits, and to any.
pub(super) enum Queries {
    Three([QueryOfThree; 2]),
    Four([QueryOfFour; 2]),
}

/// The library and a device of it.
pub(crate) struct Embree {
    pub(super) queries: Queries,
    pub(super) new_scene: unsafe extern "C" fn(Handle) -> Handle,
    pub(super) set_scene_flags: unsafe extern "C" fn(Handle, c_int),
    pub(super) commit_scene: unsafe extern "C" fn(Handle),
    pub(super) release_scene: unsafe extern "C" fn(Handle),
    pub(super) new_geometry: unsafe extern "C" fn(Handle, c_int) -> Handle,
    pub(super) set_buffer: SetBuffer,
    pub(super) set_own: unsafe extern "C" fn(Handle, *const c_void),
    pub(super) set_closest_filter: SetFilter,
    pub(super) set_any_filter: SetFilter,
    pub(super) commit_geometry: unsafe extern "C" fn(Handle),
    pub(super) attach_geometry: unsafe extern "C" fn(Handle, Handle, c_uint),
    pub(super) release_geometry: unsafe extern "C" fn(Handle),
    device_error: unsafe extern "C" fn(Handle) -> c_int,
    release_device: unsafe extern "C" fn(Handle),
    pub(super) device: Handle,
    pub(crate) version: String,
    /// Never unloaded: threads of the library may outlive its device.
    _library: ManuallyDrop<Library>,
}

// SAFETY: the library's functions may be called from any thread; scenes are built by one at a time.
unsafe impl Send for Embree {}
// SAFETY: as above.
unsafe impl Sync for Embree {}

impl Embree {
    /// Loads the library and opens its device. Fails with [`Error::Device`] if there is no library, if it is
    /// of another version, or if it refuses the CPU.
    pub(crate) fn load() -> Result<Arc<Self>> {
        let (library, path) = library::open(LIBRARY_VARIABLE, &NAMES, None).map_err(|found| {
            missing(format!("the library Embree ({}), which cannot be loaded: {found}", NAMES[1]))
        })?;
        Self::of(library).map_err(|problem| {
            missing(format!("Embree of version 3 or 4: {}: {problem}", path.display()))
        })
    }

    fn of(library: Library) -> Result<Arc<Self>, String> {
        let new_device: unsafe extern "C" fn(*const c_char) -> Handle =
            function(&library, "rtcNewDevice")?;
        let property: unsafe extern "C" fn(Handle, c_int) -> isize =
            function(&library, "rtcGetDeviceProperty")?;
        let set_monitor: unsafe extern "C" fn(Handle, Option<MemoryMonitor>, *mut c_void) =
            function(&library, "rtcSetDeviceMemoryMonitorFunction")?;
        let release_device: unsafe extern "C" fn(Handle) = function(&library, "rtcReleaseDevice")?;
        let no_options: &CStr = c"";
        // SAFETY: the function has this type in rtcore.h; the options end in a zero byte.
        let device = unsafe { new_device(no_options.as_ptr()) };
        if device.is_null() {
            return Err("it opens no device on this CPU".to_owned());
        }
        // SAFETY: the device is alive; the number is one of its properties.
        let number = unsafe { property(device, PROPERTY_VERSION) };
        let version = format!("{}.{}.{}", number / 10_000, number / 100 % 100, number % 100);
        let queries = match number / 10_000 {
            3 => Queries::Three(queries(&library)?),
            4 => Queries::Four(queries(&library)?),
            _ => return Err(format!("found version {version}")),
        };
        // SAFETY: the device is alive; the monitor is a function that touches no state of its own.
        unsafe { set_monitor(device, Some(is_granted), ptr::null_mut()) };
        Ok(Arc::new(Self {
            queries,
            new_scene: function(&library, "rtcNewScene")?,
            set_scene_flags: function(&library, "rtcSetSceneFlags")?,
            commit_scene: function(&library, "rtcCommitScene")?,
            release_scene: function(&library, "rtcReleaseScene")?,
            new_geometry: function(&library, "rtcNewGeometry")?,
            set_buffer: function(&library, "rtcSetSharedGeometryBuffer")?,
            set_own: function(&library, "rtcSetGeometryUserData")?,
            set_closest_filter: function(&library, "rtcSetGeometryIntersectFilterFunction")?,
            set_any_filter: function(&library, "rtcSetGeometryOccludedFilterFunction")?,
            commit_geometry: function(&library, "rtcCommitGeometry")?,
            attach_geometry: function(&library, "rtcAttachGeometryByID")?,
            release_geometry: function(&library, "rtcReleaseGeometry")?,
            device_error: function(&library, "rtcGetDeviceError")?,
            release_device,
            device,
            version,
            _library: ManuallyDrop::new(library),
        }))
    }

    /// Turns the device's last error, if there is one, into ours.
    pub(super) fn check(&self, asker: &str) -> Result<()> {
        // SAFETY: the device is alive.
        match unsafe { (self.device_error)(self.device) } {
            ERROR_NONE => Ok(()),
            ERROR_OUT_OF_MEMORY | ERROR_CANCELLED => Err(Error::Memory {
                message: format!("not enough memory: {asker} needs more than is left"),
                help: Some("allow more by --max-memory, or take --tracer device"),
            }),
            code => Err(Error::Device {
                reason: format!("Embree {}: {asker} failed with error {code}", self.version),
                help: "take --tracer device".into(),
            }),
        }
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: the device is alive, and scenes, which hold it, are gone.
        unsafe { (self.release_device)(self.device) };
    }
}

fn missing(what: String) -> Error {
    Error::Device { reason: format!("tracing on the host needs {what}"), help: HELP.into() }
}

fn function<T: Copy>(library: &Library, name: &str) -> Result<T, String> {
    library::function(library, &[name]).ok_or_else(|| format!("it lacks {name}"))
}

fn queries<T: Copy>(library: &Library) -> Result<[T; 2], String> {
    Ok([function(library, "rtcIntersect8")?, function(library, "rtcOccluded8")?])
}

/// Says before the library allocates memory whether it may.
extern "C" fn is_granted(_: *mut c_void, bytes: isize, is_done: bool) -> bool {
    let asked = u64::try_from(bytes).unwrap_or(0);
    is_done || memory::check("Embree", asked).is_ok()
}
