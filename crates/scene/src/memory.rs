//! The memory that this process may use, asked before every large allocation.
//!
//! The limit is one number for the whole process (`--max-memory`). A request states its size and who
//! makes it; it is refused if the resident memory of the process and the request together pass the
//! limit. Buffers of a software device are memory of the process and count, those of a GPU do not.
//! A limit of the address space (`ulimit -v`) counts as well: past it allocations abort.

use std::{
    fmt, fs,
    sync::atomic::{AtomicU64, Ordering},
};

/// Requests below this are granted without a look at the process.
const SMALL_BYTES: u64 = 1 << 20;
/// Share of the machine's memory that is the limit unless `--max-memory` says otherwise.
const DEFAULT_SHARE: f64 = 0.75;

/// Address space that a driver with its compiler takes before it renders. Lavapipe of Mesa 22.3 frees
/// memory twice where it gets less.
const DRIVER_ADDRESS_SPACE: u64 = 3 << 29;

/// Bytes; 0 before it is known.
static LIMIT: AtomicU64 = AtomicU64::new(0);

/// A request for memory that the limit refuses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shortage {
    /// Part of the program or of the input that asks.
    asker: String,
    asked: u64,
    bound: Bound,
}

/// A limit of the process and how much of it is used, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Bound {
    /// Option or command that sets the limit.
    set_by: &'static str,
    limit: u64,
    in_use: u64,
}

impl Bound {
    fn room(&self) -> u64 {
        self.limit.saturating_sub(self.in_use)
    }

    fn check(self, asker: impl fmt::Display, asked: u64) -> Result<(), Shortage> {
        if asked <= self.room() {
            return Ok(());
        }
        Err(Shortage { asker: asker.to_string(), asked, bound: self })
    }
}

impl fmt::Display for Shortage {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            to,
            "not enough memory: {} asks for {}, and {} of the {} that {} allows are in use; \
             allow more, or make it smaller",
            self.asker,
            size(self.asked),
            size(self.bound.in_use),
            size(self.bound.limit),
            self.bound.set_by
        )
    }
}

/// Formats bytes as `512 B`, `1.5 MiB` or `3.2 GiB`.
pub fn size(bytes: u64) -> String {
    let mut value = bytes as f64;
    let mut unit = "B";
    for larger in ["KiB", "MiB", "GiB", "TiB", "PiB", "EiB"] {
        if value < 1024.0 {
            break;
        }
        (value, unit) = (value / 1024.0, larger);
    }
    if unit == "B" { format!("{bytes} B") } else { format!("{value:.1} {unit}") }
}

/// Sets the limit, bytes.
pub fn set_limit(bytes: u64) {
    LIMIT.store(bytes.max(1), Ordering::Relaxed);
}

/// Limit of this process, bytes: that of [`set_limit`], else three quarters of the memory of the
/// machine or of the container; none where neither is known.
pub fn limit() -> u64 {
    let known = LIMIT.load(Ordering::Relaxed);
    if known > 0 {
        return known;
    }
    let limit =
        machine_bytes().map_or(u64::MAX, |bytes| (bytes as f64 * DEFAULT_SHARE) as u64).max(1);
    LIMIT.store(limit, Ordering::Relaxed);
    limit
}

/// Bytes that may still be asked for.
pub fn room() -> u64 {
    tightest_bound().room()
}

/// Returns the limit that leaves the least.
fn tightest_bound() -> Bound {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    // Where the system has no `/proc`, nothing is known to be in use.
    let in_use = kibibytes(&status, "VmRSS:").unwrap_or(0);
    let memory = Bound { set_by: "--max-memory", limit: limit(), in_use };
    match address_space(&status) {
        Some(space) if space.room() < memory.room() => space,
        _ => memory,
    }
}

/// Checks, before the driver is loaded, that it has address space to work in.
///
/// # Errors
/// A limit (`ulimit -v`) leaves less than 1.5 GiB.
pub fn check_driver() -> Result<(), Shortage> {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let bound = address_space(&status);
    bound.map_or(Ok(()), |bound| bound.check("the Vulkan driver", DRIVER_ADDRESS_SPACE))
}

/// Returns the limit of the address space, if there is one; `status` is that of the process.
fn address_space(status: &str) -> Option<Bound> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let limit = line.split_whitespace().next()?.parse().ok()?;
    Some(Bound { set_by: "ulimit -v", limit, in_use: kibibytes(status, "VmSize:")? })
}

/// Checks that `bytes` more fit under the limit, before they are allocated; `asker` says what for.
///
/// # Errors
/// The request does not fit.
pub fn check(asker: impl fmt::Display, bytes: u64) -> Result<(), Shortage> {
    if bytes < SMALL_BYTES { Ok(()) } else { tightest_bound().check(asker, bytes) }
}

/// As [`check`], for `count` elements of `size` bytes.
///
/// # Errors
/// The request does not fit.
pub fn check_count(asker: impl fmt::Display, count: usize, size: usize) -> Result<(), Shortage> {
    check(asker, (count as u64).saturating_mul(size as u64))
}

/// Memory of the machine, or less in a container that has a limit.
fn machine_bytes() -> Option<u64> {
    let machine = kibibytes(&fs::read_to_string("/proc/meminfo").ok()?, "MemTotal:")?;
    let container = ["/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"]
        .into_iter()
        .find_map(|path| fs::read_to_string(path).ok()?.trim().parse().ok());
    Some(container.unwrap_or(u64::MAX).min(machine))
}

/// Finds a line such as `VmRSS:  1234 kB`; returns bytes.
fn kibibytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

/// Parses a size such as `512M`, `2.5GiB` or `1000000` bytes; the units are powers of 1024.
///
/// # Errors
/// Returns a message about text that is no size above 0.
pub fn parse_size(text: &str) -> Result<u64, String> {
    let split = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let power = match unit.to_ascii_lowercase().trim_end_matches("ib").trim_end_matches('b') {
        "" => Some(0),
        "k" => Some(10),
        "m" => Some(20),
        "g" => Some(30),
        "t" => Some(40),
        _ => None,
    };
    number
        .trim()
        .parse::<f64>()
        .ok()
        .zip(power)
        .map(|(number, power)| number * f64::from(power).exp2())
        .filter(|bytes| (1.0..=u64::MAX as f64).contains(bytes))
        .map(|bytes| bytes as u64)
        .ok_or_else(|| format!("expected a size such as 512M or 8G, found {text:?}"))
}
