//! Cells of the scene: how large they are, and where the surfaces in them point.

use glam::Vec3;

use crate::scene::{Scene, instance};

/// Smallest number of cells along the longest side of the scene.
const CELLS_PER_SCENE: f32 = 20.0;

/// Faces of a cube, in the order +x, −x, +y, −y, +z, −z.
pub const FACE_COUNT: usize = 6;

/// Outward normal of a face of the cube.
pub fn face_normal(face: usize) -> Vec3 {
    [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z][face % FACE_COUNT]
}

/// Returns the edge of cells that are `pixels` wide in the picture, per metre of distance to the camera,
/// and the largest edge, metres: a twentieth of the scene.
pub fn cell_edges(scene: &Scene, pixels: f32) -> [f32; 2] {
    let [low, high] = bounds_of(scene);
    let size = (high - low).max_element();
    let size = if size.is_finite() && size > 0.0 { size } else { 1.0 };
    let pixel_angle = 2.0 * (0.5 * scene.camera.vertical_fov_deg).to_radians().tan()
        / scene.film.height.max(1) as f32;
    [pixels * pixel_angle, size / CELLS_PER_SCENE]
}

/// Corners of the scene; infinite where it is empty.
pub fn bounds_of(scene: &Scene) -> [Vec3; 2] {
    let bounds = instance::bounds(scene.geometry.used_extent());
    bounds.unwrap_or([Vec3::INFINITY, Vec3::NEG_INFINITY])
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn cells_are_as_large_as_pixels_and_parts_of_the_scene() {
        let text = "[camera]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov_deg = 90\n\
                    [film]\nwidth = 400\nheight = 100\n\
                    [[material]]\nname = \"m\"\ntype = \"diffuse\"\nreflectance = [0, 0, 0]\n\
                    [[object]]\nshape = \"box\"\nsize = [1, 8, 2]\nmaterial = \"m\"\n";
        let scene = Scene::parse(Path::new("a.toml"), text).unwrap();
        // A pixel takes 2 tan 45° / 100 of the distance.
        let [pixels, largest] = cell_edges(&scene, 3.0);
        assert!((pixels - 0.06).abs() < 1e-6 && (largest - 0.4).abs() < 1e-6, "{pixels} {largest}");
    }
}
