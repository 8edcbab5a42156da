//! Opens any scene file and walks it: `cargo run --release --example walk -- scene.gltf`.

use fenestra_scene::Scene;

fn main() -> fenestra_scene::Result<()> {
    for path in std::env::args_os().skip(1) {
        let scene = Scene::load(path.as_ref())?;
        println!("{}: {} triangles", scene.name, scene.geometry.triangle_count());
        for material in &scene.materials {
            println!("  {}: {:?}", material.name, material.kind);
        }
        for warning in &scene.warnings {
            println!("  {warning}");
        }
    }
    Ok(())
}
