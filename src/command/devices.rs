//! `fenestra devices`: lists the Vulkan devices with their relevant limits, and the one chosen.

use super::print_line;
use crate::{
    error::Result,
    gpu::{
        Tracer,
        capabilities::{Capabilities, choose, list},
        device::{embree_for, tracer_name},
        instance::Instance,
        lavapipe::hint,
    },
};

/// Arguments of `devices`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Show which device the other commands' --device would choose: index or part of a name.
    #[arg(long, value_name = "INDEX|NAME")]
    pub device: Option<String>,
    /// Print JSON to standard output.
    #[arg(long)]
    pub json: bool,
}

/// Lists the Vulkan devices.
///
/// # Errors
/// No Vulkan loader, no device, or no suitable one.
pub fn run(arguments: &Arguments) -> Result<()> {
    let instance = Instance::new(false, None)?;
    let devices = list(&instance)?;
    let chosen = choose(&devices, arguments.device.as_deref());
    let chosen_index = chosen.as_ref().ok().map(|device| device.index);
    if arguments.json {
        let list: Vec<_> = devices
            .iter()
            .map(|device| {
                serde_json::json!({
                    "device": device,
                    "tracer": tracer(device),
                    "missing": device.missing(),
                    "chosen": Some(device.index) == chosen_index,
                    "hint": hint(&device.driver),
                })
            })
            .collect();
        print_line(&format!("{:#}", serde_json::Value::Array(list)))?;
    } else {
        for device in &devices {
            print_line(&describe(device, Some(device.index) == chosen_index))?;
        }
    }
    chosen.map(|_| ())
}

/// Names what traces for a device unless `--tracer` says otherwise.
fn tracer(device: &Capabilities) -> String {
    tracer_name(embree_for(device, Tracer::Auto).ok().flatten().as_ref())
}

/// Lists the limits of a device, one a line.
fn describe(device: &Capabilities, is_chosen: bool) -> String {
    const MEBI: f64 = (1 << 20) as f64;
    let (major, minor, patch) = device.api_version;
    let mark = if is_chosen { "   <- chosen" } else { "" };
    let mut lines = vec![
        format!("[{}] {} ({}){mark}", device.index, device.name, device.kind),
        format!("    driver               {}", device.driver),
        format!("    Vulkan               {major}.{minor}.{patch}"),
        format!("    device memory        {:.0} MiB", device.device_memory as f64 / MEBI),
        format!(
            "    one storage buffer   {:.0} MiB",
            device.max_storage_buffer_range as f64 / MEBI
        ),
        format!("    storage buffers      {} per stage", device.max_storage_buffers),
        format!("    texel buffers        {} per stage", device.max_texel_buffers),
        format!("    push constants       {} bytes", device.max_push_constants_size),
        format!("    shared memory        {} KiB", device.max_shared_memory / 1024),
        format!("    tracer               {}", tracer(device)),
        format!("    subgroup             {} invocations", device.subgroup_size),
        format!(
            "    timestamps           {} bits, {} ns per tick",
            device.timestamp_valid_bits, device.timestamp_period
        ),
    ];
    lines.extend(hint(&device.driver).map(|hint| format!("    hint                 {hint}")));
    let missing = device.missing();
    if !missing.is_empty() {
        lines.push(format!("    cannot be used       {}", missing.join("; ")));
    }
    lines.join("\n")
}
