//! Declarations of the rooms of samplers for shaders, each from the file `shader.rs` of its room, and the
//! numbers of their specialization constants and buffers: places in the order of the registry.

use super::{
    bindings::{self, BindingTable},
    constants,
    structs::{self, SharedStruct},
};

#[path = "../../sampler/registry.rs"]
mod registry;
pub(crate) use registry::registry;

/// Number of the descriptor set of a sampler.
pub const SET: u32 = 1;

/// Declares a room: specialization constants, constants, structs and buffers, as far as it has them.
macro_rules! room {
    (
        $(specializations { $($specializations:tt)* })?
        $(constants { $($constants:tt)* })?
        $(structs { $($structs:tt)* })?
        $(buffers { $($buffers:tt)* })?
    ) => {
        $crate::shader::constants::specializations! {
            $crate::shader::rooms::specialization; $($($specializations)*)?
        }
        $crate::shader::constants::constants! { $($($constants)*)? }
        $crate::shader::structs::structs! { $($($structs)*)? }
        $crate::shader::bindings::buffers! {
            $crate::shader::rooms::SET, $crate::shader::rooms::buffer_number; $($($buffers)*)?
        }
    };
}

macro_rules! rooms {
    (basic { $($basic:tt)* } rooms {
        $($(#[$doc:meta])* $sampler:ident $name:literal $key:literal = $room:ident $entry:ident
            $parameters:ident;)*
    }) => {
        #[path = "../../sampler"]
        mod declared {
            $(
                #[doc = concat!("What the shaders of `", $name, "` see.")]
                pub mod $room {
                    mod shader;

                    pub use shader::*;

                    /// Descriptor set of the room.
                    pub const TABLE: $crate::shader::bindings::BindingTable =
                        $crate::shader::bindings::BindingTable {
                            name: stringify!($room),
                            set: $crate::shader::rooms::SET,
                            bindings: BUFFERS,
                        };
                }
            )*
        }
        pub use declared::{$($room),*};

        const TABLES: &[&BindingTable] = &[$(&$room::TABLE),*];
        const STRUCTS: &[&[SharedStruct]] = &[structs::STRUCTS, $($room::STRUCTS),*];
        /// Names of all specialization constants: each one's identifier is its place among all.
        const SPECIALIZATIONS: &[&[&str]] =
            &[constants::SPECIALIZATIONS, $($room::SPECIALIZATIONS),*];
        /// Names of the rooms' buffers: each one's number is its place after those of other tables.
        const BUFFER_NAMES: &[&[&str]] = &[$($room::BUFFER_NAMES),*];
        /// Names of all constants that have a value.
        const CONSTANTS: &[&[(&str, u32)]] = &[constants::CONSTANTS, $($room::CONSTANTS),*];
    };
}
registry!(rooms);

/// Returns the identifier of a specialization constant.
pub const fn specialization(name: &str) -> u32 {
    constants::place(SPECIALIZATIONS, name)
}

/// Returns the number of a room's buffer in its set.
pub const fn buffer_number(name: &str) -> u32 {
    let last = bindings::TABLES[bindings::TABLES.len() - 1].bindings;
    last[last.len() - 1].number + 1 + constants::place(BUFFER_NAMES, name)
}

/// Returns every table of buffers.
pub fn tables() -> impl Iterator<Item = &'static BindingTable> {
    let of_rooms = TABLES.iter().filter(|table| !table.bindings.is_empty());
    bindings::TABLES.iter().chain(of_rooms).copied()
}

/// Returns every struct that host and shaders share.
pub fn structs() -> impl Iterator<Item = &'static SharedStruct> {
    STRUCTS.iter().flat_map(|list| list.iter())
}

/// Returns name and value of every constant of the shaders; of specialization constants the identifier.
pub fn constants() -> impl Iterator<Item = (&'static str, u32)> {
    let names = SPECIALIZATIONS.iter().flat_map(|names| names.iter());
    let identifiers = names.map(|name| (*name, specialization(name)));
    CONSTANTS.iter().flat_map(|list| list.iter().copied()).chain(identifiers)
}
