//! Compiles `glsl/**/*.comp` to SPIR-V against the declarations of `src/shader` and of the rooms in
//! `src/sampler`, and writes the table of shaders.

#[path = "src/shader"]
#[expect(dead_code, reason = "the crate uses the rest")]
mod shader {
    pub mod bindings;
    pub mod constants;
    pub mod rooms;
    pub mod structs;
}

use std::{
    cell::RefCell,
    collections::BTreeSet,
    env,
    fmt::Write,
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
    rc::Rc,
};

use shader::{
    bindings::{Binding, Kind},
    constants, rooms,
    structs::SharedStruct,
};

/// Folder of the common passes; one folder in it for the passes of each technique.
const SHADER_FOLDER: &str = "glsl";
/// Folder of the probe kernels, which only tests run.
const PROBE_FOLDER: &str = "glsl/test";
/// Name by which shaders include the declarations of `src/shader`.
const INTERFACE: &str = "interface.glsl";

fn main() -> ExitCode {
    for input in ["build.rs", "src/shader", "glsl"] {
        println!("cargo::rerun-if-changed={input}");
    }
    match compile_all() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            for line in message.lines() {
                println!("cargo::error={line}");
            }
            ExitCode::FAILURE
        }
    }
}

/// Sorted paths in `folder`.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut paths: Vec<PathBuf> =
        entries.filter_map(|entry| entry.ok().map(|entry| entry.path())).collect();
    paths.sort();
    Ok(paths)
}

/// Sorted `.comp` files of `folder`, not of the folders in it.
fn entry_points(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let is_entry_point =
        |path: &PathBuf| path.extension().is_some_and(|extension| extension == "comp");
    Ok(entries(folder)?.into_iter().filter(is_entry_point).collect())
}

/// A macro that defines `load(index)`, which puts a struct together from its texels: of four words each, or
/// of two where it does not fill those.
fn loader(shared: &SharedStruct) -> String {
    let words = shared.size / 4;
    let width = if words.is_multiple_of(4) { 4 } else { 2 };
    let texels = words / width;
    let mut text = format!("#define LOADS_{0}(load, texels) {0} load(uint index) {{", shared.name);
    for texel in 0..texels {
        let fetch = format!("texelFetch(texels, int({texels}u * index + {texel}u))");
        let _ = write!(text, " uvec{width} texel_{texel} = uvec{width}({fetch});");
    }
    let member = |kind: &str, first: usize| {
        let count = kind.chars().last().and_then(|last| last.to_digit(10)).unwrap_or(1) as usize;
        let part = |word: usize, count: usize| {
            format!("texel_{}.{}", word / width, &"xyzw"[word % width..][..count])
        };
        let bits = if first % width + count <= width {
            part(first, count)
        } else {
            let words: Vec<String> = (first..first + count).map(|word| part(word, 1)).collect();
            format!("uvec{count}({})", words.join(", "))
        };
        if kind.starts_with('u') { bits } else { format!("uintBitsToFloat({bits})") }
    };
    let members = shared.members.iter().map(|own| member(own.kind, own.offset / 4));
    text + &format!(" return {}({}); }}", shared.name, members.collect::<Vec<_>>().join(", "))
}

/// GLSL of every struct with a macro that loads it, and macros for every buffer and its place.
fn interface() -> String {
    let mut text = String::new();
    for shared in rooms::structs() {
        let members = shared.members.iter().fold(String::new(), |mut members, member| {
            let _ = write!(members, "{} {}; ", member.kind, member.name);
            members
        });
        let _ = writeln!(text, "struct {} {{ {members}}};\n{}", shared.name, loader(shared));
    }
    for binding in rooms::tables().flat_map(|table| table.bindings) {
        let Binding { set, number, kind, .. } = *binding;
        let name = binding.glsl_name();
        let place = format!("set = {set}, binding = {number}");
        let _ = writeln!(text, "#define PLACE_{name} {place}");
        let buffer = |element: &str, brackets: &str| {
            format!(
                "BUFFER_{name}(access) layout(scalar, {place}) access buffer {name}_buffer \
                 {{ {element} {name}{brackets}; }};"
            )
        };
        let declaration = match kind {
            Kind::One(element) => buffer(element, ""),
            Kind::Array(element) => buffer(element, "[]"),
            Kind::Texels(format) => {
                format!("TEXELS_{name} layout({place}) uniform {} {name};", format.sampler())
            }
        };
        let _ = writeln!(text, "#define {declaration}");
    }
    text
}

fn compile_all() -> Result<(), String> {
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let compiler = shaderc::Compiler::new().map_err(|error| format!("shaderc: {error}"))?;
    let mut options =
        shaderc::CompileOptions::new().map_err(|error| format!("shaderc: {error}"))?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    // Optimised and with debug information: `-O` alone strips the names that tests read.
    options.set_optimization_level(shaderc::OptimizationLevel::Performance);
    options.set_generate_debug_info();
    options.set_warnings_as_errors();
    for (name, value) in rooms::constants() {
        options.add_macro_definition(name, Some(&format!("{value}u")));
    }
    let [red, green, blue] = constants::LUMINANCE_WEIGHTS;
    let weights = format!("vec3({red}, {green}, {blue})");
    options.add_macro_definition("LUMINANCE_WEIGHTS", Some(&weights));
    let interface = interface();
    // Includes that the shader under way has had: each is given once, so that they need no guards.
    let included = Rc::new(RefCell::new(BTreeSet::new()));
    let seen = Rc::clone(&included);
    options.set_include_callback(move |requested, _, _, _| {
        // Includes of a room are named with its folder.
        let folder = if requested.contains('/') { "" } else { "include" };
        let path = Path::new(SHADER_FOLDER).join(folder).join(requested);
        let content = if !seen.borrow_mut().insert(requested.to_owned()) {
            String::new()
        } else if requested == INTERFACE {
            interface.clone()
        } else {
            fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?
        };
        Ok(shaderc::ResolvedInclude { resolved_name: path.display().to_string(), content })
    });

    let compile = |path: &Path, target: &Path| -> Result<(String, PathBuf), String> {
        included.borrow_mut().clear();
        let source =
            fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default().to_owned();
        let spirv = compiler
            .compile_into_spirv(
                &source,
                shaderc::ShaderKind::Compute,
                &path.display().to_string(),
                "main",
                Some(&options),
            )
            .map_err(|error| error.to_string())?;
        let file = target.join(format!("{name}.spv"));
        fs::write(&file, spirv.as_binary_u8())
            .map_err(|error| format!("{}: {error}", file.display()))?;
        Ok((name, file))
    };
    let probes = out.join("test");
    fs::create_dir_all(&probes).map_err(|error| format!("{}: {error}", probes.display()))?;
    let probe_folder = Path::new(PROBE_FOLDER);
    for path in entry_points(probe_folder)? {
        compile(&path, &probes)?;
    }
    let shader_folder = Path::new(SHADER_FOLDER);
    let rooms = entries(shader_folder)?.into_iter().filter(|path| path.is_dir());
    let mut passes = Vec::new();
    for folder in [shader_folder.to_owned()].into_iter().chain(rooms) {
        if folder != probe_folder {
            for path in entry_points(&folder)? {
                passes.push(compile(&path, &out)?);
            }
        }
    }
    passes.sort();
    let mut table = String::from(
        "/// SPIR-V of every pass, by name, sorted.\npub const PASSES: &[(&str, &[u8])] = &[\n",
    );
    for (name, file) in passes {
        let _ = writeln!(table, "    ({name:?}, include_bytes!({:?})),", file.display());
    }
    table += "];\n";
    fs::write(out.join("shaders.rs"), table).map_err(|error| format!("shaders.rs: {error}"))
}
