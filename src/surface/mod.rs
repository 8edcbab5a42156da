//! Textures, opacity and emission of the scene's materials → the buffers of the device.

pub mod lookup;
pub mod textures;

use glam::Vec2;

use crate::{
    scene::material::{Anisotropy, Material, Surface},
    shader::{
        constants::{
            ATTRIBUTE_COLOR, ATTRIBUTE_FIRST_UVS, ATTRIBUTE_SECOND_UVS, ATTRIBUTE_TANGENT,
            SURFACE_EMISSION_TWO_SIDED, SURFACE_TWO_SIDED, SURFACE_VERTEX_COLOR,
        },
        structs::MaterialSurface,
    },
    texture::TextureUse,
};
pub use textures::TextureTables;

/// Surfaces of all materials, and the textures that they use.
#[derive(Clone, Debug, Default)]
pub struct SurfaceTables {
    /// Surfaces in the order of the materials.
    pub surfaces: Vec<MaterialSurface>,
    /// Uses of textures, which the surfaces index.
    pub textures: TextureTables,
    /// Bits `ATTRIBUTE_…` of the attributes of triangles that the surfaces need.
    pub attributes: u32,
}

impl SurfaceTables {
    /// Lays out the surfaces of `materials`.
    pub fn new(materials: &[Material]) -> Self {
        let mut tables = Self::default();
        for material in materials {
            tables.add(&material.surface);
        }
        tables
    }

    fn add(&mut self, surface: &Surface) {
        let mut texture = |used: Option<&TextureUse>| {
            if let Some(used) = used {
                let uvs = [ATTRIBUTE_FIRST_UVS, ATTRIBUTE_SECOND_UVS];
                self.attributes |= uvs[usize::from(used.uv_set == 1)];
            }
            self.textures.add(used)
        };
        let emission = surface.emission.as_ref();
        let Anisotropy { strength, rotation, .. } = surface.anisotropy;
        let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
        let converted = MaterialSurface {
            color: texture(surface.color.as_ref()),
            roughness: texture(surface.roughness.as_ref()),
            metallic: texture(surface.metallic.as_ref()),
            normal: texture(surface.normal.as_ref()),
            opacity: texture(surface.opacity.texture.as_ref()),
            anisotropy_direction: texture(surface.anisotropy.direction.as_ref()),
            emission: texture(emission.and_then(|emission| emission.texture.as_ref())),
            normal_scale: surface.normal_scale,
            opacity_factor: surface.opacity.factor,
            opacity_cutoff: surface.opacity.cutoff.unwrap_or(-1.0),
            emission_radiance: emission.map_or([0.0; 3], |emission| emission.radiance.to_array()),
            flags: flag(surface.vertex_color, SURFACE_VERTEX_COLOR)
                | flag(surface.two_sided, SURFACE_TWO_SIDED)
                | flag(
                    emission.is_some_and(|emission| emission.two_sided),
                    SURFACE_EMISSION_TWO_SIDED,
                ),
            emission_density: 0.0,
            light_group: 0,
            anisotropy: (strength * Vec2::from_angle(rotation)).to_array(),
            reserved: [0.0; 2],
        };
        self.attributes |= flag(surface.tangent_uv_set().is_some(), ATTRIBUTE_TANGENT)
            | flag(strength > 0.0, ATTRIBUTE_FIRST_UVS)
            | flag(surface.vertex_color, ATTRIBUTE_COLOR);
        self.surfaces.push(converted);
    }
}
