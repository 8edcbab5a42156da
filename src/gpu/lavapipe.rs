//! Versions and settings of drivers that a render must know of, lavapipe's above all.

use std::env;

use super::capabilities::Capabilities;
use crate::error::{Error, Result};

/// First Mesa whose lavapipe loads tables without a loop over lanes.
const FAST_MESA: u32 = 25;
/// Mesa whose shader cache is known to tell vector widths apart; that of 25.0 does not.
const SOUND_CACHE_MESA: u32 = 22;
const VECTOR_WIDTH: &str = "LP_NATIVE_VECTOR_WIDTH";
const CACHE_DISABLE: &str = "MESA_SHADER_CACHE_DISABLE";
/// First letters of the variables by which loader and drivers change the code that they make or run.
const PREFIXES: [&str; 10] =
    ["ANV_", "GALLIVM_", "INTEL_", "LP_", "LVP_", "MESA_", "NIR_", "NVK_", "RADV_", "VK_"];

/// Returns the major version of Mesa if `driver` is lavapipe.
fn lavapipe(driver: &str) -> Option<u32> {
    driver.strip_prefix("llvmpipe Mesa ")?.split('.').next()?.parse().ok()
}

/// Returns a line that names the remedy for a slow old lavapipe.
pub(crate) fn hint(driver: &str) -> Option<String> {
    let mesa = lavapipe(driver).filter(|mesa| *mesa < FAST_MESA)?;
    Some(format!(
        "lavapipe of Mesa {mesa} takes up to twice the time of Mesa {FAST_MESA}'s; ./setup as root \
         installs the newer one where the distribution has it"
    ))
}

/// Lists the environment variables that change loader and drivers, as `NAME=value` in order of names.
pub(crate) fn settings() -> Vec<String> {
    let all = env::vars_os().filter_map(|(name, value)| {
        let name = name.into_string().ok()?;
        let is_setting = PREFIXES.iter().any(|prefix| name.starts_with(prefix));
        is_setting.then(|| format!("{name}={}", value.to_string_lossy()))
    });
    let mut settings: Vec<String> = all.collect();
    settings.sort();
    settings
}

/// Refuses another vector width than the driver's own where Mesa's shader cache would mix code of both:
/// such code traces no shadow ray, in this process or in later ones, and no call fails.
pub(super) fn check_vector_width(capabilities: &Capabilities) -> Result<()> {
    match mixed_width(&capabilities.driver, &settings()) {
        Some(width) => Err(Error::Device {
            reason: format!(
                "{} would mix code for vectors of {width} bits with other code in its shader cache, \
                 and pictures would be wrong without a word",
                capabilities.driver
            ),
            help: format!("unset {VECTOR_WIDTH}, or set {CACHE_DISABLE}=1 as well"),
        }),
        None => Ok(()),
    }
}

/// Returns the vector width that `settings` force on a lavapipe whose shader cache mixes widths.
fn mixed_width<'a>(driver: &str, settings: &'a [String]) -> Option<&'a str> {
    lavapipe(driver).filter(|mesa| *mesa > SOUND_CACHE_MESA)?;
    let value =
        |name| settings.iter().find_map(|setting| setting.strip_prefix(name)?.strip_prefix('='));
    let is_uncached = value(CACHE_DISABLE).is_some_and(|set| ["1", "true"].contains(&set));
    value(VECTOR_WIDTH).filter(|_| !is_uncached)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OLD: &str = "llvmpipe Mesa 22.3.6 (LLVM 15.0.6)";
    const NEW: &str = "llvmpipe Mesa 25.0.7-2~bpo12+1 (LLVM 15.0.6)";

    #[test]
    fn only_an_old_lavapipe_has_a_remedy() {
        assert!(hint(OLD).is_some_and(|hint| hint.contains("Mesa 22") && hint.contains("./setup")));
        for driver in [NEW, "radv Mesa 22.3.6", "NVIDIA 535.183.01", ""] {
            assert_eq!(hint(driver), None, "{driver}");
        }
    }

    #[test]
    fn widths_are_refused_where_the_cache_mixes_them() {
        let mixed = |driver, settings: &[&str]| {
            let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
            mixed_width(driver, &settings).map(str::to_owned)
        };
        let wide = "LP_NATIVE_VECTOR_WIDTH=512";
        assert_eq!(mixed(NEW, &[wide]).as_deref(), Some("512"));
        assert_eq!(mixed(NEW, &[wide, "MESA_SHADER_CACHE_DISABLE=0"]).as_deref(), Some("512"));
        assert_eq!(mixed(NEW, &[wide, "MESA_SHADER_CACHE_DISABLE=true"]), None);
        assert_eq!(mixed(NEW, &["LP_NUM_THREADS=1"]), None);
        assert_eq!(mixed(OLD, &[wide]), None);
        assert_eq!(mixed("NVIDIA 535.183.01", &[wide]), None);
    }
}
