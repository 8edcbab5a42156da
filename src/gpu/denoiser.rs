//! Open Image Denoise, loaded from its shared library when a picture is to be denoised.
//!
//! The functions are those of its C API (`OpenImageDenoise/oidn.h`), which versions 1.2 to 2.x share; two
//! that version 2.0 renamed are looked up under both names. The filter is `RT`, its device always the CPU,
//! whose memory is ours.

use std::{
    ffi::{CStr, c_char, c_int, c_void},
    mem::ManuallyDrop,
    path::{Path, PathBuf},
    ptr,
};

use libloading::Library;

use super::library;
use crate::{
    error::{Error, Result},
    files,
};

/// Environment variable with the library's file, or the folder that holds it.
pub(crate) const LIBRARY_VARIABLE: &str = "FENESTRA_OIDN";
const NAMES: [&str; 3] =
    ["libOpenImageDenoise.so.2", "libOpenImageDenoise.so.1", "libOpenImageDenoise.so"];
const HELP: &str = "install the library: `./setup` does where it can, openimagedenoise.org offers it for \
                    all; name its folder in FENESTRA_OIDN if the system does not find it";

/// `OIDN_DEVICE_TYPE_CPU`
const DEVICE_CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`
const FORMAT_FLOAT3: c_int = 3;
/// `OIDN_ERROR_NONE`
const ERROR_NONE: c_int = 0;

/// `OIDNDevice` or `OIDNFilter`.
type Handle = *mut c_void;
type SetImage = unsafe extern "C" fn(
    filter: Handle,
    name: *const c_char,
    pixels: *mut c_void,
    format: c_int,
    width: usize,
    height: usize,
    byte_offset: usize,
    pixel_byte_stride: usize,
    row_byte_stride: usize,
);

/// A picture and what guides its filter, row by row from the top.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Noisy<'a> {
    pub width: u32,
    pub height: u32,
    /// Linear radiance; finite.
    pub color: &'a [[f32; 3]],
    /// Albedo of the first surfaces, 0…1.
    pub albedo: Option<&'a [[f32; 3]]>,
    /// Shading normals of the first surfaces, −1…1. They serve only beside albedo.
    pub normal: Option<&'a [[f32; 3]]>,
}

/// The library and a device of it.
pub(crate) struct Denoiser {
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_image: SetImage,
    set_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
    release_filter: unsafe extern "C" fn(Handle),
    device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    release_device: unsafe extern "C" fn(Handle),
    device: Handle,
    pub(crate) version: String,
    path: PathBuf,
    /// Never unloaded: threads of the library may outlive its device.
    _library: ManuallyDrop<Library>,
}

impl Denoiser {
    /// Loads the library and opens its device. Fails with [`Error::Denoiser`] if there is no library, if it
    /// lacks a function, or if it refuses the device.
    pub(crate) fn load() -> Result<Self> {
        let (library, path) = open_library()?;
        let new_device: unsafe extern "C" fn(c_int) -> Handle =
            function(&library, &path, &["oidnNewDevice"])?;
        let commit_device: unsafe extern "C" fn(Handle) =
            function(&library, &path, &["oidnCommitDevice"])?;
        let device_int: unsafe extern "C" fn(Handle, *const c_char) -> c_int =
            function(&library, &path, &["oidnGetDeviceInt", "oidnGetDevice1i"])?;
        let mut denoiser = Self {
            new_filter: function(&library, &path, &["oidnNewFilter"])?,
            set_image: function(&library, &path, &["oidnSetSharedFilterImage"])?,
            set_bool: function(&library, &path, &["oidnSetFilterBool", "oidnSetFilter1b"])?,
            commit_filter: function(&library, &path, &["oidnCommitFilter"])?,
            execute_filter: function(&library, &path, &["oidnExecuteFilter"])?,
            release_filter: function(&library, &path, &["oidnReleaseFilter"])?,
            device_error: function(&library, &path, &["oidnGetDeviceError"])?,
            release_device: function(&library, &path, &["oidnReleaseDevice"])?,
            device: ptr::null_mut(),
            version: String::new(),
            path,
            _library: ManuallyDrop::new(library),
        };
        // SAFETY: the function has this type in oidn.h; the number is one of its device types.
        denoiser.device = unsafe { new_device(DEVICE_CPU) };
        if denoiser.device.is_null() {
            denoiser.check("oidnNewDevice")?;
            return Err(denoiser.failure("oidnNewDevice gives no device"));
        }
        // SAFETY: the device is alive; it is committed once, before its first use.
        unsafe { commit_device(denoiser.device) };
        denoiser.check("oidnCommitDevice")?;
        // SAFETY: the device is alive and committed, the name ends in a zero byte.
        let version = unsafe { device_int(denoiser.device, c"version".as_ptr()) };
        denoiser.check("the version")?;
        denoiser.version =
            format!("{}.{}.{}", version / 10_000, version / 100 % 100, version % 100);
        Ok(denoiser)
    }

    /// Filters a picture. Fails with [`Error::Denoiser`] for layers of another size than the picture, and
    /// with the library's message.
    pub(crate) fn denoise(&self, noisy: &Noisy<'_>) -> Result<Vec<[f32; 3]>> {
        let [width, height] = [noisy.width as usize, noisy.height as usize];
        let guides = [("albedo", noisy.albedo), ("normal", noisy.normal)];
        let layers = [("picture", Some(noisy.color))].into_iter().chain(guides);
        for (name, pixels) in layers.filter_map(|(name, pixels)| Some((name, pixels?))) {
            if width.checked_mul(height) != Some(pixels.len()) || pixels.is_empty() {
                return Err(self.failure(&format!(
                    "the {name} has {} pixels, expected {width}x{height}",
                    pixels.len()
                )));
            }
        }
        let mut output = vec![[0.0_f32; 3]; noisy.color.len()];
        // SAFETY: the device is alive and committed, the name ends in a zero byte.
        let filter = unsafe { (self.new_filter)(self.device, c"RT".as_ptr()) };
        if filter.is_null() {
            self.check("oidnNewFilter")?;
            return Err(self.failure("oidnNewFilter gives no filter"));
        }
        let set = |name: &CStr, pixels: *mut c_void| {
            // SAFETY: the filter is alive; `pixels` points to width × height tightly packed triples of
            // floats, which outlive it.
            unsafe {
                (self.set_image)(
                    filter,
                    name.as_ptr(),
                    pixels,
                    FORMAT_FLOAT3,
                    width,
                    height,
                    0,
                    0,
                    0,
                );
            }
        };
        // The filter only reads its inputs.
        let read = |pixels: &[[f32; 3]]| pixels.as_ptr().cast_mut().cast::<c_void>();
        set(c"color", read(noisy.color));
        if let Some(albedo) = noisy.albedo {
            set(c"albedo", read(albedo));
            if let Some(normal) = noisy.normal {
                set(c"normal", read(normal));
            }
        }
        set(c"output", output.as_mut_ptr().cast());
        // SAFETY: the filter is alive, its images too; the name ends in a zero byte. Execution ends
        // before the function returns.
        unsafe {
            (self.set_bool)(filter, c"hdr".as_ptr(), true);
            (self.commit_filter)(filter);
            (self.execute_filter)(filter);
        }
        let result = self.check("the filter");
        // SAFETY: the filter is alive, and nobody uses it after this.
        unsafe { (self.release_filter)(filter) };
        result.map(|()| output)
    }

    /// Turns the device's last error, if there is one, into ours.
    fn check(&self, call: &str) -> Result<()> {
        let mut message: *const c_char = ptr::null();
        // SAFETY: a null device asks for the error of this thread; the message is a text of the library
        // that lives until its next call.
        let (code, message) = unsafe {
            let code = (self.device_error)(self.device, &raw mut message);
            let is_there = code != ERROR_NONE && !message.is_null();
            (code, is_there.then(|| CStr::from_ptr(message).to_string_lossy().into_owned()))
        };
        if code == ERROR_NONE {
            return Ok(());
        }
        let message = message.unwrap_or_else(|| format!("error {code}"));
        Err(self.failure(&format!("{call} failed: {message}")))
    }

    fn failure(&self, message: &str) -> Error {
        Error::Denoiser {
            reason: format!("Open Image Denoise ({}): {message}", self.path.display()),
            help: None,
        }
    }
}

impl Drop for Denoiser {
    fn drop(&mut self) {
        if !self.device.is_null() {
            // SAFETY: the device is alive, and nobody uses it after this.
            unsafe { (self.release_device)(self.device) };
        }
    }
}

/// Opens the library that [`LIBRARY_VARIABLE`] names, or the system's, or that which `./setup` brought.
fn open_library() -> Result<(Library, PathBuf)> {
    let own = files::data_folder("oidn").map(|folder| folder.join("lib"));
    library::open(LIBRARY_VARIABLE, &NAMES, own.as_deref()).map_err(|found| Error::Denoiser {
        reason: format!(
            "--denoise needs the library Open Image Denoise ({}), which cannot be loaded: {found}",
            NAMES[0]
        ),
        help: Some(HELP),
    })
}

/// Looks up a function, whose type in oidn.h is `T`, under the first of its names that is there.
fn function<T: Copy>(library: &Library, path: &Path, names: &[&str]) -> Result<T> {
    library::function(library, names).ok_or_else(|| Error::Denoiser {
        reason: format!(
            "{} is no Open Image Denoise of version 1.2 or later: it lacks {}",
            path.display(),
            names.join(" or ")
        ),
        help: Some(HELP),
    })
}
