//! Host and shaders agree on every struct and binding they share: what `build.rs` compiled is read
//! back, and each struct of `src/shader/structs.rs` compared with it member for member.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    any::type_name_of_val,
    collections::{BTreeMap, BTreeSet, HashMap},
    fs,
    mem::{offset_of, size_of},
    path::Path,
};

use bytemuck::Zeroable;
use fenestra::{
    gpu::descriptors::SET_BINDING_COUNTS,
    shader::{
        constants::{self, SET_FILM},
        spirv::PASSES,
        structs,
    },
};

/// One member on either side; `kind` is the name of the Rust type.
#[derive(Clone, Debug, PartialEq)]
struct Member {
    name: String,
    offset: usize,
    kind: String,
}

/// A struct of `src/shader/structs.rs`.
struct HostStruct {
    name: &'static str,
    size: usize,
    members: Vec<Member>,
}

/// The structs with their members in order. The pattern without `..` makes the compiler refuse a
/// list that lacks a member; `every_struct_of_the_host_is_listed` refuses one that lacks a struct.
macro_rules! host_structs {
    ($($name:ident { $($member:ident),* $(,)? })*) => {
        vec![$({
            let value = structs::$name::zeroed();
            let structs::$name { $($member: _),* } = value;
            HostStruct {
                name: stringify!($name),
                size: size_of::<structs::$name>(),
                members: vec![$(Member {
                    name: stringify!($member).into(),
                    offset: offset_of!(structs::$name, $member),
                    kind: type_name_of_val(&value.$member).into(),
                }),*],
            }
        }),*]
    };
}

fn host_structs() -> Vec<HostStruct> {
    host_structs! {
        SceneParameters {
            camera_position, camera_aperture_radius, camera_right, camera_focus_distance,
            camera_up, camera_tan_half_fov, camera_forward, film_width, film_height, crop_x,
            crop_y, crop_width, crop_height, film_filter, environment_width, environment_height,
            environment_cos_rotation, environment_sin_rotation, environment_total,
        }
        Ray { origin, is_active, direction, reserved }
        Hit {
            position, material, geometric_normal, distance, shading_normal, triangle,
        }
        ShadowRay { direction, contribution }
        PathState {
            throughput, radiance, shadow_rays_traced, shadow_rays_visible, rays_traced,
        }
        Counters {
            camera_rays, bounce_rays, shadow_rays_traced, shadow_rays_visible, dropped_samples,
            traversal_overruns, product_hits, lobes_kept, energy_kept, cache_entries, cdf_rebuilds,
        }
        Material { kind, table_offset, alpha, ior, reflectance, eta, k, reserved }
        Wave {
            first_pixel, pixel_count, first_sample, sample_count, seed, vertex, shadow_ray_count,
            first_shadow_ray, total_shadow_rays, aovs, pixel_stride, is_training,
            epoch_seed, epoch_start,
        }
        PathCell { cell, teaches }
        GuideParameters {
            grid_origin, finest_edge, edge_per_distance, largest_edge, region_count, table_mask,
            wanted_mask,
        }
    }
}

/// What is read of a SPIR-V module (SPIR-V specification 1.5, sections 2.3 and 3.32): types, names
/// and the decorations that place things in memory.
#[derive(Default)]
struct Module {
    names: HashMap<u32, String>,
    member_names: HashMap<(u32, u32), String>,
    member_offsets: HashMap<(u32, u32), u32>,
    array_strides: HashMap<u32, u32>,
    sets: HashMap<u32, u32>,
    bindings: HashMap<u32, u32>,
    blocks: BTreeSet<u32>,
    types: BTreeMap<u32, Type>,
    constants: HashMap<u32, u32>,
    /// Variable and the pointer type it has.
    variables: Vec<(u32, u32)>,
}

enum Type {
    Scalar(&'static str, usize),
    Vector { component: u32, count: u32 },
    Matrix { column: u32, count: u32 },
    Array { element: u32, length: u32 },
    RuntimeArray { element: u32 },
    Struct(Vec<u32>),
    Pointer { pointee: u32 },
}

/// The string literal at the start of `words`.
fn literal(words: &[u32]) -> String {
    let bytes = words.iter().flat_map(|word| word.to_le_bytes());
    String::from_utf8(bytes.take_while(|byte| *byte != 0).collect()).expect("names are UTF-8")
}

fn words_of(spirv: &[u8]) -> Vec<u32> {
    assert_eq!(spirv.len() % 4, 0, "SPIR-V is a sequence of words");
    spirv.chunks_exact(4).map(|bytes| u32::from_le_bytes(bytes.try_into().unwrap())).collect()
}

impl Module {
    fn read(words: &[u32]) -> Self {
        assert_eq!(words[0], 0x0723_0203, "SPIR-V begins with its magic number");
        let mut module = Self::default();
        let mut at = 5;
        while at < words.len() {
            let (length, opcode) = ((words[at] >> 16) as usize, words[at] & 0xffff);
            assert!(length > 0 && at + length <= words.len(), "an instruction ends in the module");
            module.read_instruction(opcode, &words[at + 1..at + length]);
            at += length;
        }
        module
    }

    fn read_instruction(&mut self, opcode: u32, operands: &[u32]) {
        let mut define = |kind| self.types.insert(operands[0], kind);
        match (opcode, operands) {
            (5, [target, name @ ..]) => {
                self.names.insert(*target, literal(name));
            }
            (6, [target, member, name @ ..]) => {
                self.member_names.insert((*target, *member), literal(name));
            }
            (21, [_, 32, 0]) => drop(define(Type::Scalar("u32", 4))),
            (21, [_, 32, 1]) => drop(define(Type::Scalar("i32", 4))),
            (21, [_, 64, 0]) => drop(define(Type::Scalar("u64", 8))),
            (22, [_, 32, ..]) => drop(define(Type::Scalar("f32", 4))),
            (22, [_, 64, ..]) => drop(define(Type::Scalar("f64", 8))),
            (23, [_, component, count]) => {
                define(Type::Vector { component: *component, count: *count });
            }
            (24, [_, column, count]) => {
                define(Type::Matrix { column: *column, count: *count });
            }
            (28, [_, element, length]) => {
                define(Type::Array { element: *element, length: *length });
            }
            (29, [_, element]) => drop(define(Type::RuntimeArray { element: *element })),
            (30, [_, members @ ..]) => drop(define(Type::Struct(members.to_vec()))),
            (32, [_, _, pointee]) => drop(define(Type::Pointer { pointee: *pointee })),
            (43, [_, result, value, ..]) => drop(self.constants.insert(*result, *value)),
            (59, [pointer, result, ..]) => self.variables.push((*result, *pointer)),
            (71, [target, 2 | 3]) => drop(self.blocks.insert(*target)),
            (71, [target, 6, stride]) => drop(self.array_strides.insert(*target, *stride)),
            (71, [target, 33, binding]) => drop(self.bindings.insert(*target, *binding)),
            (71, [target, 34, set]) => drop(self.sets.insert(*target, *set)),
            (72, [target, member, 35, offset]) => {
                self.member_offsets.insert((*target, *member), *offset);
            }
            _ => {}
        }
    }

    fn name(&self, id: u32) -> &str {
        self.names.get(&id).map_or("", String::as_str)
    }

    /// The Rust type of the same layout, and its size.
    fn rust_type(&self, id: u32) -> (String, usize) {
        let array = |element, count: u32| {
            let (kind, size) = self.rust_type(element);
            (format!("[{kind}; {count}]"), size * count as usize)
        };
        match &self.types.get(&id) {
            Some(Type::Scalar(kind, size)) => ((*kind).into(), *size),
            Some(Type::Vector { component, count }) => array(*component, *count),
            Some(Type::Matrix { column, count }) => array(*column, *count),
            Some(Type::Array { element, length }) => array(*element, self.constants[length]),
            Some(Type::Struct(members)) => {
                let end = |(index, kind): (usize, &u32)| {
                    self.member_offsets[&(id, index as u32)] as usize + self.rust_type(*kind).1
                };
                let size = members.iter().enumerate().map(end).max().unwrap_or(0);
                (format!("fenestra::shader::structs::{}", self.name(id)), size)
            }
            _ => (format!("no type that can be shared (id {id})"), 0),
        }
    }

    /// Structs that lie in buffers or push constants, apart from the blocks themselves.
    fn structs_in_memory(&self) -> impl Iterator<Item = (u32, &[u32])> {
        self.types.iter().filter_map(|(id, kind)| match kind {
            Type::Struct(members)
                if self.member_offsets.contains_key(&(*id, 0)) && !self.blocks.contains(id) =>
            {
                Some((*id, members.as_slice()))
            }
            _ => None,
        })
    }

    fn members(&self, id: u32, kinds: &[u32]) -> Vec<Member> {
        let member = |(index, kind): (usize, &u32)| {
            let key = (id, index as u32);
            Member {
                name: self.member_names.get(&key).cloned().unwrap_or_default(),
                offset: self.member_offsets[&key] as usize,
                kind: self.rust_type(*kind).0,
            }
        };
        kinds.iter().enumerate().map(member).collect()
    }

    /// Name of the block (of the variable, for texel buffers), set and binding of every buffer.
    fn buffers(&self) -> impl Iterator<Item = (&str, u32, u32)> {
        self.variables.iter().filter_map(|(variable, pointer)| {
            let (set, binding) = (*self.sets.get(variable)?, *self.bindings.get(variable)?);
            let Type::Pointer { pointee } = self.types[pointer] else { return None };
            let block = self.name(pointee);
            Some((if block.is_empty() { self.name(*variable) } else { block }, set, binding))
        })
    }
}

/// How the members of a struct differ, one line each.
fn member_drifts(host: &HostStruct, shader: &[Member]) -> Vec<String> {
    let mut drifts = Vec::new();
    for here in &host.members {
        let label = format!("{}.{}", host.name, here.name);
        match shader.iter().find(|there| there.name == here.name) {
            None => drifts.push(format!("{label}: missing in the shader")),
            Some(there) if there.offset != here.offset => {
                drifts.push(format!("{label}: host {}, shader {}", here.offset, there.offset));
            }
            Some(there) if there.kind != here.kind => {
                drifts.push(format!("{label}: host {}, shader {}", here.kind, there.kind));
            }
            Some(_) => {}
        }
    }
    for there in shader {
        if !host.members.iter().any(|here| here.name == there.name) {
            drifts.push(format!("{}.{}: missing on the host", host.name, there.name));
        }
    }
    drifts
}

/// How a module differs from the host, one line each; the structs it uses join `used`. A struct
/// that the host does not have is a drift where `is_pass`; probes may have their own.
fn drifts(module: &Module, is_pass: bool, used: &mut BTreeSet<&'static str>) -> Vec<String> {
    let hosts = host_structs();
    let host = |name: &str| hosts.iter().find(|host| host.name == name);
    let mut drifts = Vec::new();
    for (id, kinds) in module.structs_in_memory() {
        let name = module.name(id);
        if let Some(host) = host(name) {
            used.insert(host.name);
            drifts.extend(member_drifts(host, &module.members(id, kinds)));
            let size = module.rust_type(id).1;
            if size != host.size {
                drifts.push(format!("{name}: host {} bytes, shader {size}", host.size));
            }
        } else if is_pass {
            drifts.push(format!("{name}: not in src/shader/structs.rs"));
        }
    }
    for (array, stride) in &module.array_strides {
        let (Type::Array { element, .. } | Type::RuntimeArray { element }) = module.types[array]
        else {
            continue;
        };
        let (kind, shader_size) = module.rust_type(element);
        let size = host(module.name(element)).map_or(shader_size, |host| host.size);
        if *stride as usize != size {
            drifts.push(format!("array of {kind}: host stride {size}, shader {stride}"));
        }
    }
    drifts
}

/// SPIR-V of the probe kernels by name. Only those whose source is there: the build folder may
/// still hold the output of one that was removed.
fn probes() -> Vec<(String, Vec<u8>)> {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl/test");
    let mut probes = Vec::new();
    for entry in fs::read_dir(&sources).expect("glsl/test is readable") {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "comp") {
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            let spirv = fs::read(format!("{}/test/{name}.spv", env!("OUT_DIR"))).unwrap();
            probes.push((name, spirv));
        }
    }
    probes
}

/// Every compiled shader: name, whether it is a pass, words.
fn shaders() -> Vec<(String, bool, Vec<u32>)> {
    let passes = PASSES.iter().map(|(name, spirv)| ((*name).to_owned(), true, words_of(spirv)));
    let probes = probes();
    let probes = probes.iter().map(|(name, spirv)| (name.clone(), false, words_of(spirv)));
    passes.chain(probes).collect()
}

#[test]
fn every_struct_of_the_host_is_listed() {
    let source = include_str!("../src/shader/structs.rs");
    let declared: BTreeSet<&str> = source
        .lines()
        .filter_map(|line| line.strip_prefix("pub struct ")?.split([' ', '<', '(', '{']).next())
        .collect();
    let listed: BTreeSet<&str> = host_structs().iter().map(|host| host.name).collect();
    assert_eq!(declared, listed, "the list in tests/layout.rs and src/shader/structs.rs differ");
}

#[test]
fn shaders_and_host_agree_on_every_struct() {
    let mut used = BTreeSet::new();
    let mut found = Vec::new();
    for (name, is_pass, words) in shaders() {
        let module = Module::read(&words);
        let of_shader = drifts(&module, is_pass, &mut used);
        found.extend(of_shader.into_iter().map(|drift| format!("{name}: {drift}")));
    }
    for host in host_structs() {
        if !used.contains(host.name) {
            found.push(format!("{}: no shader uses it", host.name));
        }
    }
    assert!(found.is_empty(), "host and shaders differ:\n{}", found.join("\n"));
}

/// The member decorations of `struct_name` in `words`: positions of the offset's word by member.
fn offset_words(words: &[u32], struct_name: &str) -> Vec<usize> {
    let module = Module::read(words);
    let (id, _) = module
        .structs_in_memory()
        .find(|(id, _)| module.name(*id) == struct_name)
        .expect("the module has the struct");
    let mut positions = Vec::new();
    let mut at = 5;
    while at < words.len() {
        if words[at] == (5 << 16 | 72) && words[at + 1] == id && words[at + 3] == 35 {
            positions.push(at + 4);
        }
        at += (words[at] >> 16) as usize;
    }
    positions
}

/// The first shader that has `Hit` in a buffer.
fn shader_with_hits() -> Vec<u32> {
    let has_hits = |words: &Vec<u32>| {
        let module = Module::read(words);
        module.structs_in_memory().any(|(id, _)| module.name(id) == "Hit")
    };
    let (_, _, words) = shaders().into_iter().find(|(.., words)| has_hits(words)).unwrap();
    words
}

#[test]
fn a_planted_drift_is_found() {
    let words = shader_with_hits();
    let drifts_of = |words: &[u32]| drifts(&Module::read(words), true, &mut BTreeSet::new());
    assert_eq!(drifts_of(&words), [""; 0], "the unchanged shader agrees");

    let mut moved = words.clone();
    moved[offset_words(&words, "Hit")[1]] += 4;
    assert_eq!(drifts_of(&moved), ["Hit.material: host 12, shader 16"]);

    let mut longer = words.clone();
    longer[*offset_words(&words, "Hit").last().unwrap()] += 4;
    let found = drifts_of(&longer);
    assert_eq!(found, ["Hit.triangle: host 44, shader 48", "Hit: host 48 bytes, shader 52"]);

    let stride = words.windows(4).position(|w| w[0] == (4 << 16 | 71) && w[2] == 6 && w[3] == 48);
    let mut strided = words.clone();
    strided[stride.expect("hits lie in an array") + 3] = 64;
    let kind = "fenestra::shader::structs::Hit";
    assert_eq!(drifts_of(&strided), [format!("array of {kind}: host stride 48, shader 64")]);
}

#[test]
fn missing_and_retyped_members_are_found() {
    let hosts = host_structs();
    let ray = hosts.iter().find(|host| host.name == "Ray").unwrap();
    assert_eq!(member_drifts(ray, &ray.members), [""; 0]);
    assert_eq!(member_drifts(ray, &ray.members[..3]), ["Ray.reserved: missing in the shader"]);
    let mut renamed = ray.members.clone();
    renamed[3].name = "time".into();
    assert_eq!(
        member_drifts(ray, &renamed),
        ["Ray.reserved: missing in the shader", "Ray.time: missing on the host"]
    );
    let mut retyped = ray.members.clone();
    retyped[1].kind = "f32".into();
    assert_eq!(member_drifts(ray, &retyped), ["Ray.is_active: host u32, shader f32"]);
}

/// Blocks and texel buffers declared in `layout.glsl`: name → (set, binding).
fn declared_blocks() -> BTreeMap<String, (u32, u32)> {
    let macro_value = |name: &str| {
        let found = constants::SHADER_MACROS.iter().find(|(other, _)| *other == name);
        found.unwrap_or_else(|| panic!("{name} is not in SHADER_MACROS")).1
    };
    let source = include_str!("../glsl/include/layout.glsl");
    let mut blocks = BTreeMap::new();
    for declaration in source.split("layout(scalar, set = ").skip(1) {
        let (set, rest) = declaration.split_once(", binding = ").expect("a binding follows");
        let (binding, rest) = rest.split_once(')').expect("the parenthesis closes");
        let (_, rest) = rest.split_once(" buffer ").expect("every binding is a buffer");
        let (name, _) = rest.split_once(" {").expect("the block opens");
        assert!(set.starts_with("SET_") && binding.starts_with("BINDING_"), "{set} {binding}");
        blocks.insert(name.to_owned(), (macro_value(set), macro_value(binding)));
    }
    for declaration in source.split("layout(set = ").skip(1) {
        let (set, rest) = declaration.split_once(", binding = ").expect("a binding follows");
        let (binding, rest) = rest.split_once(") uniform ").expect("a texel buffer");
        let (_, rest) = rest.split_once("samplerBuffer").expect("a texel buffer");
        let (name, _) = rest.trim_start().split_once(';').expect("the declaration ends");
        blocks.insert(name.to_owned(), (macro_value(set), macro_value(binding)));
    }
    blocks
}

#[test]
fn bindings_are_those_of_the_constants() {
    let declared = declared_blocks();
    let mut taken: BTreeMap<(u32, u32), &str> = BTreeMap::new();
    for (name, place) in &declared {
        assert!(
            place.1 < SET_BINDING_COUNTS[place.0 as usize],
            "{name}: set {} has no binding {}",
            place.0,
            place.1
        );
        if let Some(other) = taken.insert(*place, name) {
            panic!("{name} and {other} share set {} binding {}", place.0, place.1);
        }
    }
    for (shader, is_pass, words) in shaders() {
        for (block, set, binding) in Module::read(&words).buffers() {
            match declared.get(block) {
                Some(place) => {
                    assert_eq!((set, binding), *place, "{shader}: place of {block}");
                }
                None => assert!(
                    !is_pass && set == SET_FILM && binding < 2,
                    "{shader}: {block} at set {set} binding {binding} is not in layout.glsl"
                ),
            }
        }
    }
}

#[test]
fn test_data_is_small() {
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data")];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = fs::read_dir(&folder) else { continue };
        for entry in entries {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let length = path.metadata().unwrap().len();
                assert!(length <= 4096, "{}: {length} bytes, 4096 allowed", path.display());
            }
        }
    }
}
