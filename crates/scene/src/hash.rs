//! SHA-256 of everything that changes the picture.

use bytemuck::NoUninit;
use sha2::{Digest, Sha256};

use super::Scene;
use crate::{
    Geometry,
    files::hexadecimal,
    instance::Instance,
    lamp::LampKind,
    material::{Anisotropy, Distribution, MaterialKind, Surface},
    texture::{Texels, TextureUse},
};

/// Hashes camera, film, environment, materials and geometry; lower-case hexadecimal.
///
/// Names, but for those of groups of lights, paths and the order of the text do not enter. A length precedes
/// every array and a tag every variant, so that no two scenes give the same bytes.
pub(crate) fn hash(scene: &Scene) -> String {
    hashed(|hasher| {
        let camera = &scene.camera;
        hasher.array(&[camera.position, camera.look_at, camera.up]);
        hasher.array(&[camera.vertical_fov_deg, camera.aperture_radius, camera.focus_distance]);
        // Few cameras have these: the hashes of all others are those of before.
        if (camera.shift, camera.mirrored) != ([0.0; 2], false) {
            hasher.array(&camera.shift);
            hasher.array(&[u32::from(camera.mirrored)]);
        }
        hasher.still(scene);
    })
}

/// Hashes all but the camera; lower-case hexadecimal. It is the same as long as the camera alone moves.
pub fn still_hash(scene: &Scene) -> String {
    hashed(|hasher| hasher.still(scene))
}

/// Hashes the environment alone; lower-case hexadecimal.
pub fn environment_hash(scene: &Scene) -> String {
    hashed(|hasher| hasher.environment(scene))
}

/// Hashes positions and triangles, all that can block light; lower-case hexadecimal.
pub fn geometry_hash(scene: &Scene) -> String {
    hashed(|hasher| {
        let geometry = &scene.geometry;
        for mesh in [geometry].into_iter().chain(&geometry.prototypes) {
            hasher.array(&mesh.positions);
            hasher.array(&mesh.triangles);
        }
        geometry.instances.iter().for_each(|instance| hasher.instance(instance));
    })
}

fn hashed(feed: impl FnOnce(&mut Hasher)) -> String {
    let mut hasher = Hasher(Sha256::new());
    feed(&mut hasher);
    hexadecimal(&hasher.0.finalize())
}

/// Follows the tags of lamps.
const PORTAL_TAG: u32 = 3;
/// Follows that of portals.
const LIGHT_GROUP_TAG: u32 = 4;
/// Follows that of light groups.
const ANISOTROPY_TAG: u32 = 5;
/// Marks the hash of a surface with Beckmann's normals.
const BECKMANN_TAG: u32 = 6;

struct Hasher(Sha256);

impl Hasher {
    /// All but the camera.
    fn still(&mut self, scene: &Scene) {
        self.array(&[scene.film.width, scene.film.height, scene.film.filter as u32]);
        self.environment(scene);
        self.length(scene.materials.len());
        for material in &scene.materials {
            self.material(&material.kind);
        }
        self.triangles(&scene.geometry);
        // These enter only where they are there, tagged, so that scenes without keep their hashes.
        for (index, material) in scene.materials.iter().enumerate() {
            if material.surface != Surface::default() {
                self.length(index);
                self.surface(&material.surface);
            }
        }
        self.attributes(&scene.geometry);
        for prototype in &scene.geometry.prototypes {
            self.triangles(prototype);
            self.attributes(prototype);
        }
        for instance in &scene.geometry.instances {
            self.instance(instance);
        }
        for lamp in &scene.lamps {
            self.lamp(&lamp.kind);
            self.light_group(lamp.light_group.as_deref());
        }
        for portal in &scene.portals {
            self.array(&[PORTAL_TAG]);
            self.array(&[portal.corner, portal.axes[0], portal.axes[1]]);
            self.array(&portal.size);
        }
    }

    fn environment(&mut self, scene: &Scene) {
        let environment = &scene.environment;
        self.array(&[environment.width, environment.height]);
        self.array(&[environment.rotation_rad]);
        self.array(&environment.texels);
    }

    fn triangles(&mut self, geometry: &Geometry) {
        self.array(&geometry.positions);
        self.array(&geometry.normals);
        self.array(&geometry.triangles);
        self.array(&geometry.materials);
    }

    fn attributes(&mut self, geometry: &Geometry) {
        let attributes: [&[u8]; 4] = [
            bytemuck::cast_slice(&geometry.uvs[0]),
            bytemuck::cast_slice(&geometry.uvs[1]),
            bytemuck::cast_slice(&geometry.tangents),
            bytemuck::cast_slice(&geometry.colors),
        ];
        let there = attributes.into_iter().enumerate().filter(|(_, bytes)| !bytes.is_empty());
        for (tag, bytes) in there {
            self.length(tag);
            self.array(bytes);
        }
    }

    fn instance(&mut self, instance: &Instance) {
        let Instance { prototype, world_from_object, first_material, material_mask } = *instance;
        self.array(&[prototype, first_material, material_mask]);
        self.array(&world_from_object);
    }

    fn length(&mut self, length: usize) {
        self.0.update((length as u64).to_le_bytes());
    }

    fn array<T: NoUninit>(&mut self, elements: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(elements);
        self.length(bytes.len());
        self.0.update(bytes);
    }

    fn material(&mut self, kind: &MaterialKind) {
        let (_, number, groups) = kind.parameters();
        self.array(&[number]);
        groups.iter().for_each(|group| self.array(group));
        if let MaterialKind::Measured { table, .. } = kind {
            self.array(table.words());
        }
    }

    fn surface(&mut self, surface: &Surface) {
        surface.uses().into_iter().for_each(|used| self.texture(used));
        let cutoff = surface.opacity.cutoff.unwrap_or(-1.0);
        self.array(&[surface.normal_scale, surface.opacity.factor, cutoff]);
        self.array(&[u32::from(surface.vertex_color), u32::from(surface.two_sided)]);
        if let Some(emission) = &surface.emission {
            self.array(&[emission.radiance]);
            self.array(&[u32::from(emission.two_sided)]);
        }
        let Anisotropy { strength, rotation, direction } = &surface.anisotropy;
        if *strength > 0.0 {
            self.array(&[ANISOTROPY_TAG]);
            self.array(&[*strength, *rotation]);
            self.texture(direction.as_ref());
        }
        if surface.distribution == Distribution::Beckmann {
            self.array(&[BECKMANN_TAG]);
        }
        self.light_group(surface.light_group.as_deref());
    }

    /// Layers of lights depend on their groups.
    fn light_group(&mut self, name: Option<&str>) {
        if let Some(name) = name {
            self.array(&[LIGHT_GROUP_TAG]);
            self.array(name.as_bytes());
        }
    }

    fn texture(&mut self, texture: Option<&TextureUse>) {
        let Some(used) = texture else {
            self.length(0);
            return;
        };
        let image = &used.texture;
        self.array(&[image.width, image.height, used.channels as u32, used.encoding as u32]);
        self.array(&[used.uv_set, used.wrap[0] as u32, used.wrap[1] as u32]);
        self.array(&[used.interpolation as u32]);
        self.array(used.image_from_uv.as_flattened());
        self.array(&[used.scale, used.bias].concat());
        match &image.texels {
            Texels::Bytes(texels) => self.array(texels),
            Texels::Shorts(texels) => {
                self.array(&[1_u32]);
                self.array(texels);
            }
            Texels::Halves(texels) => self.array(texels),
        }
    }

    fn lamp(&mut self, lamp: &LampKind) {
        match *lamp {
            LampKind::Point { position, intensity } => {
                self.array(&[0_u32]);
                self.array(&[position, intensity]);
            }
            LampKind::Spot(spot) => {
                self.array(&[1, spot.falloff as u32]);
                self.array(&[spot.position, spot.direction, spot.intensity]);
                self.array(&[spot.inner_angle_rad, spot.outer_angle_rad]);
            }
            LampKind::Directional { direction, irradiance } => {
                self.array(&[2_u32]);
                self.array(&[direction, irradiance]);
            }
        }
    }
}
