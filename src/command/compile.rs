//! `fenestra compile`: the driver's cache of compiled kernels is filled for another process.

use super::{own_program, self_test::forbid_core_dumps};
use crate::{
    error::Result,
    gpu::{Device, Tracer},
    pass::compilers,
};

const NAME: &str = "compile";

/// Arguments of `compile`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Index of the device.
    pub device: String,
    /// Kernels, as the process that needs them lists them.
    pub kernels: String,
}

/// Lets renders start `compile` where it saves time.
pub fn allow() {
    compilers::set_program(|| {
        let mut command = own_program()?;
        command.arg(NAME);
        Ok(command)
    });
}

/// Compiles the kernels.
///
/// # Errors
/// The device cannot be opened or fails, or there is no such kernel.
pub fn run(arguments: &Arguments) -> Result<()> {
    forbid_core_dumps();
    let device = Device::open_traced(Some(&arguments.device), false, Tracer::Device)?;
    compilers::compile(&device, &arguments.kernels)
}
