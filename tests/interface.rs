//! Host and shaders agree on every struct and buffer: the SPIR-V that `build.rs` compiled from the
//! declarations of `src/shader` is read back and compared with the Rust types.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    fs,
    path::Path,
};

use fenestra::shader::{
    bindings::{Binding, Kind},
    rooms,
    spirv::PASSES,
    structs::SharedStruct,
};

use crate::support;

/// One member on either side; `kind` is the GLSL type.
#[derive(Clone, Debug, PartialEq)]
struct Member {
    name: String,
    offset: usize,
    kind: String,
}

fn members_of(shared: &SharedStruct) -> Vec<Member> {
    let member = |member: &fenestra::shader::structs::SharedMember| Member {
        name: member.name.into(),
        offset: member.offset,
        kind: member.kind.into(),
    };
    shared.members.iter().map(member).collect()
}

/// Types and names of a SPIR-V module, and the decorations that place things in memory (SPIR-V
/// specification 1.5, sections 2.3 and 3.32).
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
            (21, [_, 32, 0]) => drop(define(Type::Scalar("uint", 4))),
            (21, [_, 32, 1]) => drop(define(Type::Scalar("int", 4))),
            (21, [_, 64, 0]) => drop(define(Type::Scalar("uint64_t", 8))),
            (22, [_, 32, ..]) => drop(define(Type::Scalar("float", 4))),
            (22, [_, 64, ..]) => drop(define(Type::Scalar("double", 8))),
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

    /// GLSL name of a type, and its size.
    fn type_of(&self, id: u32) -> (String, usize) {
        let array = |element, count: u32| {
            let (kind, size) = self.type_of(element);
            (format!("[{kind}; {count}]"), size * count as usize)
        };
        match &self.types.get(&id) {
            Some(Type::Scalar(kind, size)) => ((*kind).into(), *size),
            Some(Type::Vector { component, count }) => {
                let (kind, size) = self.type_of(*component);
                let prefix = if kind == "float" { "" } else { &kind[..1] };
                (format!("{prefix}vec{count}"), size * *count as usize)
            }
            Some(Type::Matrix { column, count }) => array(*column, *count),
            Some(Type::Array { element, length }) => array(*element, self.constants[length]),
            Some(Type::Struct(members)) => {
                let end = |(index, kind): (usize, &u32)| {
                    self.member_offsets[&(id, index as u32)] as usize + self.type_of(*kind).1
                };
                let size = members.iter().enumerate().map(end).max().unwrap_or(0);
                (self.name(id).to_owned(), size)
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
                kind: self.type_of(*kind).0,
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
fn member_drifts(name: &str, host: &[Member], shader: &[Member]) -> Vec<String> {
    let mut drifts = Vec::new();
    for here in host {
        let label = format!("{name}.{}", here.name);
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
        if !host.iter().any(|here| here.name == there.name) {
            drifts.push(format!("{name}.{}: missing on the host", there.name));
        }
    }
    drifts
}

/// How a module differs from the host, one line each; the structs it uses join `used`. A struct
/// that the host does not have is a drift where `is_pass`; probes may have their own.
fn drifts(module: &Module, is_pass: bool, used: &mut BTreeSet<&'static str>) -> Vec<String> {
    let host = |name: &str| rooms::structs().find(|host| host.name == name);
    let mut drifts = Vec::new();
    for (id, kinds) in module.structs_in_memory() {
        let name = module.name(id);
        if let Some(host) = host(name) {
            used.insert(host.name);
            drifts.extend(member_drifts(name, &members_of(host), &module.members(id, kinds)));
            let size = module.type_of(id).1;
            if size != host.size {
                drifts.push(format!("{name}: host {} bytes, shader {size}", host.size));
            }
        } else if is_pass {
            drifts.push(format!("{name}: neither in src/shader/structs.rs nor in a room"));
        }
    }
    for (array, stride) in &module.array_strides {
        let (Type::Array { element, .. } | Type::RuntimeArray { element }) = module.types[array]
        else {
            continue;
        };
        let (kind, shader_size) = module.type_of(element);
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
            let spirv = support::spirv(&name);
            probes.push((name, spirv));
        }
    }
    probes
}

/// Tests whether a shader in a folder of `glsl`, or in one below, loads a struct from texels. `build.rs`
/// makes the loader from the host's declaration.
fn is_loaded(name: &str, folder: &Path) -> bool {
    let loader = format!("LOADS({name}, ");
    fs::read_dir(folder).expect("glsl is readable").any(|entry| {
        let path = entry.unwrap().path();
        if path.is_dir() {
            is_loaded(name, &path)
        } else {
            fs::read_to_string(path).is_ok_and(|text| text.contains(&loader))
        }
    })
}

/// Every compiled shader: name, whether it is a pass, words.
fn shaders() -> Vec<(String, bool, Vec<u32>)> {
    let passes = PASSES.iter().map(|(name, spirv)| ((*name).to_owned(), true, words_of(spirv)));
    let probes = probes();
    let probes = probes.iter().map(|(name, spirv)| (name.clone(), false, words_of(spirv)));
    passes.chain(probes).collect()
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
    let glsl = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    for host in rooms::structs() {
        if !used.contains(host.name) && !is_loaded(host.name, &glsl) {
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
    let kind = "Hit";
    assert_eq!(drifts_of(&strided), [format!("array of {kind}: host stride 48, shader 64")]);
}

#[test]
fn missing_and_retyped_members_are_found() {
    let ray = members_of(rooms::structs().find(|host| host.name == "Ray").unwrap());
    let drifts = |shader: &[Member]| member_drifts("Ray", &ray, shader);
    assert_eq!(drifts(&ray), [""; 0]);
    assert_eq!(drifts(&ray[..3]), ["Ray.brdf_pdf: missing in the shader"]);
    let mut renamed = ray.clone();
    renamed[3].name = "time".into();
    assert_eq!(
        drifts(&renamed),
        ["Ray.brdf_pdf: missing in the shader", "Ray.time: missing on the host"]
    );
    let mut retyped = ray.clone();
    retyped[1].kind = "float".into();
    assert_eq!(drifts(&retyped), ["Ray.is_active: host uint, shader float"]);
}

/// Every declared buffer by set and number.
fn declared() -> BTreeMap<(u32, u32), Binding> {
    let bindings = rooms::tables().flat_map(|table| table.bindings);
    bindings.map(|binding| ((binding.set, binding.number), *binding)).collect()
}

#[test]
fn tables_are_in_order_and_share_no_number() {
    let all = rooms::tables().flat_map(|table| table.bindings).count();
    assert_eq!(declared().len(), all, "two buffers share a place");
    for table in rooms::tables() {
        assert!(table.bindings.windows(2).all(|pair| pair[0].number < pair[1].number));
        assert!(table.bindings.iter().all(|binding| binding.set == table.set));
        assert!(table.bindings.iter().all(|binding| !binding.about.is_empty()));
    }
}

#[test]
fn constants_of_rooms_share_neither_name_nor_identifier() {
    let all: Vec<_> = rooms::constants().collect();
    let names: BTreeSet<_> = all.iter().map(|(name, _)| name).collect();
    assert_eq!(names.len(), all.len(), "two rooms declare the same name");
    let is_identifier = |(name, _): &&(&str, u32)| name.starts_with("CONSTANT_");
    let identifiers: BTreeSet<_> = all.iter().filter(is_identifier).map(|(_, id)| id).collect();
    assert_eq!(identifiers.len(), all.iter().filter(is_identifier).count());
}

#[test]
fn shaders_use_the_declared_buffers_of_one_table_a_set() {
    let declared = declared();
    let table_of = |place: (u32, u32)| {
        rooms::tables().position(|table| {
            let at = |binding: &Binding| (binding.set, binding.number);
            table.bindings.iter().any(|binding| at(binding) == place)
        })
    };
    let mut used = BTreeSet::new();
    for (shader, is_pass, words) in shaders() {
        let mut tables: BTreeMap<u32, usize> = BTreeMap::new();
        for (name, set, number) in Module::read(&words).buffers() {
            let place = (set, number);
            let binding = declared.get(&place);
            let binding = binding.unwrap_or_else(|| panic!("{shader}: {name} at {place:?}"));
            let expected = match binding.kind {
                Kind::Texels(_) => binding.glsl_name(),
                Kind::One(_) | Kind::Array(_) => binding.glsl_name() + "_buffer",
            };
            let is_probe = binding.name.starts_with("PROBE_");
            assert!(name == expected || (is_probe && !is_pass), "{shader}: {name}, {expected}");
            let table = table_of(place).unwrap();
            let first = *tables.entry(set).or_insert(table);
            assert_eq!(first, table, "{shader}: two tables of set {set}");
            used.insert(place);
        }
    }
    for (place, binding) in declared {
        assert!(used.contains(&place), "{}: no shader uses it", binding.name);
    }
}

#[test]
fn test_data_is_small() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/scene/tests/data");
    for entry in fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let length = entry.metadata().unwrap().len();
        assert!(length <= 4096, "{:?}: {length} bytes, 4096 allowed", entry.file_name());
    }
}
