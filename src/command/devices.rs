//! `fenestra devices`.

use crate::error::Result;

/// Arguments of `devices`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Print JSON to standard output.
    #[arg(long)]
    pub json: bool,
}

/// Lists the Vulkan devices.
///
/// # Errors
/// No Vulkan loader.
pub fn run(_arguments: &Arguments) -> Result<()> {
    Ok(())
}
