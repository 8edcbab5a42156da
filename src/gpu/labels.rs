//! Debug names for objects and labels around passes; free unless a tool listens.

use std::{
    ffi::CString,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use ash::vk;

use super::device::Device;

/// Held by what changes the labels of any command buffer: validation layers up to 1.3.239 forget those of a
/// destroyed pool without a lock of their own, and crash where another thread records
/// (KhronosGroup/Vulkan-ValidationLayers, pull request 5312).
pub(super) fn lock() -> MutexGuard<'static, ()> {
    static CHANGE: Mutex<()> = Mutex::new(());
    CHANGE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Gives `object` the name shown by validation messages and capture tools.
pub(super) fn name_object<T: vk::Handle>(device: &Arc<Device>, object: T, name: &str) {
    let (Some(functions), Ok(name)) = (device.debug_names.as_ref(), CString::new(name)) else {
        return;
    };
    let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
    // SAFETY: `object` is a live handle of this device. A failure only loses the name.
    let _ = unsafe { functions.set_debug_utils_object_name(&info) };
}

/// Opens a labelled region of a command buffer.
pub(super) fn begin(device: &Device, commands: vk::CommandBuffer, name: &str) {
    let (Some(functions), Ok(name)) = (device.debug_names.as_ref(), CString::new(name)) else {
        return;
    };
    let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
    let _changes = lock();
    // SAFETY: `commands` is in the recording state.
    unsafe { functions.cmd_begin_debug_utils_label(commands, &label) };
}

/// Closes the region that [`begin`] opened.
pub(super) fn end(device: &Device, commands: vk::CommandBuffer) {
    let Some(functions) = device.debug_names.as_ref() else { return };
    let _changes = lock();
    // SAFETY: `commands` is in the recording state with an open label.
    unsafe { functions.cmd_end_debug_utils_label(commands) };
}
