//! One file per subcommand: orchestration only, no mathematics, no Vulkan.

pub mod devices;
pub mod progress;
