//! Vulkan loader, instance, and validation layers with their messages.

use std::{
    ffi::{CStr, c_void},
    sync::{Arc, Mutex, PoisonError},
};

use ash::{ext, khr, vk};
use winit::raw_window_handle::RawDisplayHandle;

use super::{Called, vulkan_error};
use crate::{
    error::{Error, Result},
    memory,
};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

pub(crate) const NO_VULKAN_HELP: &str =
    "run ./setup, which installs the Vulkan loader and the software device lavapipe";

/// Messages of the validation layers, oldest first.
pub type Messages = Mutex<Vec<String>>;

/// A Vulkan 1.2 instance, with surface extensions if it was made for a display.
pub struct Instance {
    pub(super) raw: ash::Instance,
    debug: Option<DebugMessenger>,
    messages: Arc<Messages>,
    pub(super) has_debug_utils: bool,
    // Last, since the loader must outlive everything loaded from it.
    pub(super) entry: ash::Entry,
}

struct DebugMessenger {
    functions: ext::debug_utils::Instance,
    messenger: vk::DebugUtilsMessengerEXT,
}

impl Instance {
    /// Loads Vulkan and creates an instance. `validate` enables the Khronos validation layer,
    /// including synchronization validation; `display` asks for the extensions that show windows there. Fails
    /// with [`Error::Device`] if the Vulkan loader, the requested layer or such an extension is missing, with
    /// [`Error::Memory`] if the address space does not suffice for a driver.
    pub(crate) fn new(validate: bool, display: Option<RawDisplayHandle>) -> Result<Self> {
        memory::check_driver().map_err(Error::memory)?;
        // SAFETY: loading the Vulkan loader runs its initialisers; it is the system's own library.
        let entry = unsafe { ash::Entry::load() }.map_err(|error| Error::Device {
            reason: format!("no Vulkan loader (libvulkan.so.1) on this system: {error}"),
            help: NO_VULKAN_HELP.into(),
        })?;

        // SAFETY: `entry` is a loaded Vulkan loader.
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }
            .called("vkEnumerateInstanceExtensionProperties")?;
        let has = |name: &CStr| {
            extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name))
        };
        let has_debug_utils = has(ext::debug_utils::NAME);
        let surfaces = display.map_or(Ok(Vec::new()), surface_extensions)?;
        if let Some(missing) = surfaces.iter().find(|name| !has(name)) {
            return Err(Error::Device {
                reason: format!(
                    "no window: the Vulkan loader and its drivers lack {}",
                    missing.to_string_lossy()
                ),
                help: "`fenestra render` needs no window; a driver with this extension shows one"
                    .into(),
            });
        }

        let mut layers = Vec::new();
        if validate {
            // SAFETY: as above.
            let available = unsafe { entry.enumerate_instance_layer_properties() }
                .called("vkEnumerateInstanceLayerProperties")?;
            if !available.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
                return Err(Error::Device {
                    reason: "--validate needs the Vulkan layer VK_LAYER_KHRONOS_validation, \
                             which is not installed"
                        .into(),
                    help: "run ./setup, which installs the validation layers".into(),
                });
            }
            layers.push(VALIDATION_LAYER.as_ptr());
        }

        let application = vk::ApplicationInfo::default()
            .application_name(c"fenestra")
            .engine_name(c"fenestra")
            .api_version(vk::API_VERSION_1_2);
        let mut extension_names: Vec<_> = surfaces.iter().map(|name| name.as_ptr()).collect();
        if has_debug_utils {
            extension_names.push(ext::debug_utils::NAME.as_ptr());
        }
        // Drivers that lack a part of Vulkan, as MoltenVK does, are listed for those who ask.
        let mut flags = vk::InstanceCreateFlags::empty();
        if has(khr::portability_enumeration::NAME) {
            extension_names.push(khr::portability_enumeration::NAME.as_ptr());
            flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        }
        if validate {
            extension_names.push(ext::validation_features::NAME.as_ptr());
        }

        let messages = Arc::new(Messages::default());
        let messenger_info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                    | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(record_message))
            .user_data(Arc::as_ptr(&messages).cast_mut().cast::<c_void>());
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let mut info = vk::InstanceCreateInfo::default()
            .flags(flags)
            .application_info(&application)
            .enabled_extension_names(&extension_names)
            .enabled_layer_names(&layers);
        if validate {
            info = info.push_next(&mut features);
        }

        // SAFETY: every pointer in `info` refers to a local that outlives the call.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| {
            if result == vk::Result::ERROR_INCOMPATIBLE_DRIVER {
                no_driver()
            } else {
                vulkan_error("vkCreateInstance", result)
            }
        })?;

        let debug = if validate && has_debug_utils {
            let functions = ext::debug_utils::Instance::new(&entry, &raw);
            // SAFETY: the instance was created with VK_EXT_debug_utils; `user_data` points into
            // `messages`, which lives until after the messenger is destroyed (see `Drop`).
            let messenger =
                unsafe { functions.create_debug_utils_messenger(&messenger_info, None) }
                    .called("vkCreateDebugUtilsMessengerEXT")?;
            Some(DebugMessenger { functions, messenger })
        } else {
            None
        };
        Ok(Self { raw, debug, messages, has_debug_utils, entry })
    }

    /// Messages of the validation layers so far; empty without validation.
    pub(crate) fn validation_messages(&self) -> Vec<String> {
        self.messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: devices hold the instance in an `Arc`, so none is left; the messenger goes first.
        unsafe {
            if let Some(debug) = &self.debug {
                debug.functions.destroy_debug_utils_messenger(debug.messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

/// Returns the extensions that show windows on a kind of display.
fn surface_extensions(display: RawDisplayHandle) -> Result<Vec<&'static CStr>> {
    let names = ash_window::enumerate_required_extensions(display)
        .called("surface of this kind of display")?;
    // SAFETY: the crate returns constants that end with a zero byte.
    Ok(names.iter().map(|name| unsafe { CStr::from_ptr(*name) }).collect())
}

/// Returns the error for a system with a loader but no driver.
pub(super) fn no_driver() -> Error {
    Error::Device {
        reason: "the Vulkan loader finds no driver: expected at least one Vulkan 1.2 device, \
                 found none"
            .into(),
        help: format!(
            "{NO_VULKAN_HELP}; if VK_DRIVER_FILES or VK_ICD_FILENAMES is set, check that it names \
             an existing driver file"
        ),
    }
}

/// Records one message of the validation layers.
///
/// # Safety
/// Called by the Vulkan loader with valid `data` and the `user_data` given at creation.
unsafe extern "system" fn record_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user_data: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the loader passes a valid structure, and `user_data` is the `Messages` of `new`,
    // which outlives the messenger.
    let (text, messages) = unsafe {
        let text = (*data).message_as_c_str().map(|text| text.to_string_lossy().into_owned());
        (text, &*user_data.cast::<Messages>().cast_const())
    };
    let text = text.unwrap_or_default();
    log::error!("validation: {text}");
    messages.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    vk::FALSE
}
