//! Compiles `glsl/*.comp` and `glsl/test/*.comp` to SPIR-V and writes the table of shaders.

#[path = "src/shader/constants.rs"]
mod constants;

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::ExitCode,
};

fn main() -> ExitCode {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=src/shader/constants.rs");
    println!("cargo::rerun-if-changed=glsl");
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

/// Sorted `.comp` files of `folder`.
fn entry_points(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "comp"))
        .collect();
    files.sort();
    Ok(files)
}

fn compile_all() -> Result<(), String> {
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let compiler = shaderc::Compiler::new().map_err(|error| format!("shaderc: {error}"))?;
    let mut options =
        shaderc::CompileOptions::new().map_err(|error| format!("shaderc: {error}"))?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    // Optimised and with debug information: `-O` alone strips the names the layout test reads.
    options.set_optimization_level(shaderc::OptimizationLevel::Performance);
    options.set_generate_debug_info();
    options.set_warnings_as_errors();
    for (name, value) in constants::SHADER_MACROS {
        options.add_macro_definition(name, Some(&format!("{value}u")));
    }
    options.set_include_callback(|requested, _, _, _| {
        let path = Path::new("glsl/include").join(requested);
        let content =
            fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(shaderc::ResolvedInclude { resolved_name: path.display().to_string(), content })
    });

    let mut table = String::from(
        "/// SPIR-V of every pass, by name, sorted.\npub const PASSES: &[(&str, &[u8])] = &[\n",
    );
    for (folder, is_pass) in [("glsl", true), ("glsl/test", false)] {
        let target = if is_pass { out.clone() } else { out.join("test") };
        fs::create_dir_all(&target).map_err(|error| format!("{}: {error}", target.display()))?;
        for path in entry_points(Path::new(folder))? {
            let source = fs::read_to_string(&path)
                .map_err(|error| format!("{}: {error}", path.display()))?;
            let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
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
            if is_pass {
                table += &format!("    ({name:?}, include_bytes!({:?})),\n", file.display());
            }
        }
    }
    table += "];\n";
    fs::write(out.join("shaders.rs"), table).map_err(|error| format!("shaders.rs: {error}"))
}
