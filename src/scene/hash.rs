//! SHA-256 of everything that changes the picture.

use glam::Vec3;
use sha2::{Digest, Sha256};

use super::{Filter, Scene};
use crate::{
    brdf::material::{ConductorFresnel, MaterialKind},
    files::hexadecimal,
};

/// Hashes camera, film, environment, materials and geometry; lower-case hexadecimal.
///
/// Names, paths and the order of the text do not enter. A length precedes every array and a tag
/// every variant, so that no two scenes give the same bytes.
pub fn hash(scene: &Scene) -> String {
    let mut hasher = Hasher(Sha256::new());
    let camera = &scene.camera;
    hasher.vectors(&[camera.position, camera.look_at, camera.up]);
    hasher.floats(&[camera.vertical_fov_deg, camera.aperture_radius, camera.focus_distance]);
    let filter = match scene.film.filter {
        Filter::Box => 0,
        Filter::Gaussian => 1,
    };
    hasher.integers(&[scene.film.width, scene.film.height, filter]);
    hasher.environment(scene);
    hasher.length(scene.materials.len());
    for material in &scene.materials {
        hasher.material(&material.kind);
    }
    let geometry = &scene.geometry;
    hasher.array(bytemuck::cast_slice(&geometry.positions));
    hasher.array(bytemuck::cast_slice(&geometry.normals));
    hasher.array(bytemuck::cast_slice(&geometry.triangles));
    hasher.array(bytemuck::cast_slice(&geometry.materials));
    hasher.finish()
}

/// Hashes the environment alone; lower-case hexadecimal.
pub fn environment_hash(scene: &Scene) -> String {
    let mut hasher = Hasher(Sha256::new());
    hasher.environment(scene);
    hasher.finish()
}

/// Hashes positions and triangles, all that can block light; lower-case hexadecimal.
pub fn geometry_hash(scene: &Scene) -> String {
    let mut hasher = Hasher(Sha256::new());
    hasher.array(bytemuck::cast_slice(&scene.geometry.positions));
    hasher.array(bytemuck::cast_slice(&scene.geometry.triangles));
    hasher.finish()
}

struct Hasher(Sha256);

impl Hasher {
    fn finish(self) -> String {
        hexadecimal(&self.0.finalize())
    }

    fn environment(&mut self, scene: &Scene) {
        let environment = &scene.environment;
        self.integers(&[environment.width, environment.height]);
        self.floats(&[environment.rotation_rad]);
        self.vectors(&environment.texels);
    }

    fn length(&mut self, length: usize) {
        self.0.update((length as u64).to_le_bytes());
    }

    fn array(&mut self, bytes: &[u8]) {
        self.length(bytes.len());
        self.0.update(bytes);
    }

    fn integers(&mut self, integers: &[u32]) {
        self.array(bytemuck::cast_slice(integers));
    }

    fn floats(&mut self, floats: &[f32]) {
        self.array(bytemuck::cast_slice(floats));
    }

    fn vectors(&mut self, vectors: &[Vec3]) {
        self.array(bytemuck::cast_slice(vectors));
    }

    fn material(&mut self, kind: &MaterialKind) {
        match kind {
            MaterialKind::Diffuse { reflectance } => {
                self.integers(&[0]);
                self.vectors(&[*reflectance]);
            }
            MaterialKind::Plastic { diffuse, alpha, ior } => {
                self.integers(&[1]);
                self.vectors(&[*diffuse]);
                self.floats(&[*alpha, *ior]);
            }
            MaterialKind::Conductor {
                alpha,
                fresnel: ConductorFresnel::Schlick { reflectance },
            } => {
                self.integers(&[2]);
                self.floats(&[*alpha]);
                self.vectors(&[*reflectance]);
            }
            MaterialKind::Conductor { alpha, fresnel: ConductorFresnel::Exact { eta, k } } => {
                self.integers(&[3]);
                self.floats(&[*alpha]);
                self.vectors(&[*eta, *k]);
            }
            MaterialKind::Measured { table, .. } => {
                self.integers(&[4]);
                self.integers(table.words());
            }
        }
    }
}
