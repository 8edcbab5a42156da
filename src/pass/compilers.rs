//! Processes that compile kernels ahead of this one.
//!
//! A software driver compiles one kernel after the other, on the thread of its queue, and keeps what it has
//! compiled in a cache on disk. Here other processes fill that cache from the last kernel on, while this one
//! begins with the first; where they have been, it only reads. A driver that crashes in them harms nobody.

use std::{
    io::Result as IoResult,
    process::{Child, Command, Stdio},
    sync::{Arc, OnceLock},
    thread::available_parallelism,
    time::Duration,
};

use serde_json::json;

use super::kernel::{Domain, Kernel, Pass};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Commands, DescriptorSet, Device},
    shader::{rooms, spirv, structs::Wave},
};

/// Time of an empty dispatch from which on its kernel was compiled for it: a cached one takes 1 to 3 ms.
pub(super) const COMPILATION: Duration = Duration::from_millis(30);
/// Least number of kernels that are worth a process.
const LEAST_KERNELS: usize = 3;
/// Most processes: each takes a device's memory.
const MOST_PROCESSES: usize = 3;

static PROGRAM: OnceLock<fn() -> IoResult<Command>> = OnceLock::new();

/// Lets this process start others, by a command that is given the index of the device and what [`compile`]
/// reads.
pub(crate) fn set_program(program: fn() -> IoResult<Command>) {
    PROGRAM.set(program).ok();
}

/// Processes that compile; they end with this.
pub(super) struct Compilers(Vec<Child>);

impl Compilers {
    /// Starts processes for `kernels`, which this process is about to compile in their order. Starts none for
    /// devices that compile by themselves, and none without a free core.
    pub(super) fn start<'a>(
        device: &Device,
        kernels: impl DoubleEndedIterator<Item = &'a Kernel>,
    ) -> Self {
        let capabilities = device.capabilities();
        let Some(program) = PROGRAM.get().filter(|_| capabilities.is_software()) else {
            return Self(Vec::new());
        };
        let last_first: Vec<&Kernel> =
            kernels.rev().filter(|kernel| kernel.is_dispatched()).collect();
        let free = available_parallelism().map_or(0, |cores| cores.get() - 1);
        let count = free.min(MOST_PROCESSES).min(last_first.len() / LEAST_KERNELS);
        let children = lists(&last_first, count).into_iter().map(|list| {
            let mut command = program()?;
            command.args([capabilities.index.to_string(), list]);
            command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn()
        });
        let children = children.filter_map(|child| {
            child.inspect_err(|error| log::debug!("no process compiles ahead: {error}")).ok()
        });
        let compilers = Self(children.collect());
        log::debug!("processes that compile ahead: {}", compilers.0.len());
        compilers
    }
}

/// Deals kernels to so many processes, as they read them.
fn lists(kernels: &[&Kernel], count: usize) -> Vec<String> {
    let list = |number: usize| {
        let own = kernels.iter().skip(number).step_by(count);
        json!(own.map(|kernel| (kernel.shader, &kernel.constants)).collect::<Vec<_>>()).to_string()
    };
    (0..count).map(list).collect()
}

impl Drop for Compilers {
    fn drop(&mut self) {
        for child in &mut self.0 {
            // One that has ended already is as good.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Compiles kernels, of which `list` is what [`Compilers`] wrote, in a process of its own. Fails with
/// [`Error::Usage`] if there is no such kernel, and as the device does.
pub(crate) fn compile(device: &Arc<Device>, list: &str) -> Result<()> {
    let list: Vec<(String, Vec<(u32, u32)>)> =
        serde_json::from_str(list).map_err(|error| Error::usage(error.to_string()))?;
    let spare = Buffer::zeroed(device, "spare", 256)?;
    let sets = rooms::tables()
        .map(|table| DescriptorSet::filled(device, table, &[], &spare))
        .collect::<Result<Vec<_>>>()?;
    let sets: Vec<&DescriptorSet> = sets.iter().collect();
    for (shader, constants) in list {
        let known = spirv::PASSES.iter().find(|(pass, _)| *pass == shader);
        let (shader, _) = known.ok_or_else(|| Error::usage(format!("no pass is {shader}")))?;
        let pass = Pass::new(device, Kernel::new(shader, Domain::Paths, &constants))?;
        let mut commands = Commands::begin(device)?;
        pass.record(&mut commands, &sets, &Wave::default(), None)?;
        commands.submit_and_wait()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_are_dealt_in_turn() {
        let kernel = |number: u32| Kernel::new("trace", Domain::Paths, &[(7, number)]);
        let kernels: Vec<Kernel> = (0..5).map(kernel).collect();
        let lists = lists(&kernels.iter().collect::<Vec<_>>(), 2);
        let read = |list: &String| -> Vec<(String, Vec<(u32, u32)>)> {
            serde_json::from_str(list).unwrap()
        };
        let numbers = |list| read(list).iter().map(|(_, constants)| constants[0].1).collect();
        let numbers: Vec<Vec<u32>> = lists.iter().map(numbers).collect();
        assert_eq!(numbers, [vec![0, 2, 4], vec![1, 3]]);
        assert_eq!(read(&lists[1])[0], ("trace".to_owned(), vec![(7, 1)]));
    }
}
