//! Textures, surfaces of materials and attributes of triangles on the device.

use std::sync::Arc;

use crate::{
    accel::attributes::TriangleAttributes,
    error::{Error, Result},
    gpu::{Buffer, Device},
    shader::{
        bindings::{Binding, scene},
        constants::{
            CONSTANT_ATTRIBUTE_PAGE_SHIFT, CONSTANT_ATTRIBUTE_PAGES, CONSTANT_ATTRIBUTES,
            CONSTANT_TEXTURE_PAGE_SHIFT, CONSTANT_TEXTURE_PAGES,
        },
    },
    surface::{
        SurfaceTables,
        textures::{MAX_PAGES, page_shift},
    },
};

pub(super) const TEXTURE_PAGES: [Binding; MAX_PAGES] = [
    scene::TEXTURE_WORDS_0,
    scene::TEXTURE_WORDS_1,
    scene::TEXTURE_WORDS_2,
    scene::TEXTURE_WORDS_3,
];
pub(super) const ATTRIBUTE_PAGES: [Binding; MAX_PAGES] = [
    scene::TRIANGLE_ATTRIBUTES_0,
    scene::TRIANGLE_ATTRIBUTES_1,
    scene::TRIANGLE_ATTRIBUTES_2,
    scene::TRIANGLE_ATTRIBUTES_3,
];

/// Buffers that shaders read by `glsl/include/texture.glsl`. A scene without textures has buffers of one
/// element, which no shader reads.
pub(crate) struct TextureBuffers {
    /// The buffers at their bindings in the scene set. Missing pages repeat the first.
    pub(super) bound: Vec<(Binding, Buffer)>,
    /// Specialization of the passes that read textures.
    pub(crate) access: TextureAccess,
}

impl TextureBuffers {
    /// Copies everything to the device. Fails with [`Error::Usage`] and sizes if four pages do not hold the
    /// texels or the attributes, and as [`Buffer`]s do.
    pub(crate) fn new(
        device: &Arc<Device>,
        tables: &SurfaceTables,
        attributes: &TriangleAttributes,
    ) -> Result<Self> {
        let shift = page_shift(device.capabilities().max_texel_buffer_elements);
        tables.textures.check(shift)?;
        let limit = MAX_PAGES << shift;
        if attributes.words.len() > limit {
            return Err(Error::usage(format!(
                "texture coordinates, tangents and colours of the triangles need {} MiB, but this \
                 device's buffers hold {} MiB: use simpler meshes or another device (--device)",
                attributes.words.len().div_ceil(1 << 18),
                limit >> 18
            )));
        }
        let page_words = 1_u64 << shift;
        let texture_pages = (0..tables.textures.word_count.div_ceil(page_words).max(1))
            .map(|page| {
                let words = tables.textures.words(page * page_words..(page + 1) * page_words);
                Buffer::texels_from_slice(device, &format!("textures {page}"), &words)
            })
            .collect::<Result<Vec<_>>>()?;
        let words = if attributes.words.is_empty() { &[0] } else { &attributes.words[..] };
        let attribute_pages = words
            .chunks(1 << shift)
            .enumerate()
            .map(|(page, words)| {
                Buffer::texels_from_slice(device, &format!("triangle attributes {page}"), words)
            })
            .collect::<Result<Vec<_>>>()?;
        let access = TextureAccess {
            texture_pages: texture_pages.len() as u32,
            attribute_pages: attribute_pages.len() as u32,
            page_shift: shift,
            attributes: attributes.bits,
        };
        let uses = Buffer::from_slice(device, "texture uses", &tables.textures.uses)?;
        let surfaces = Buffer::from_slice(device, "material surfaces", &tables.surfaces)?;
        let mut bound =
            vec![(scene::TEXTURE_USE_TEXELS, uses), (scene::MATERIAL_SURFACE_TEXELS, surfaces)];
        for (names, pages) in [(TEXTURE_PAGES, &texture_pages), (ATTRIBUTE_PAGES, &attribute_pages)]
        {
            let page = |(index, name)| (name, pages.get(index).unwrap_or(&pages[0]).clone());
            bound.extend(names.into_iter().enumerate().map(page));
        }
        Ok(Self { bound, access })
    }
}

/// Specialization of the passes that include `texture.glsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TextureAccess {
    /// Number of pages of texels.
    pub texture_pages: u32,
    /// Number of pages of triangle attributes.
    pub attribute_pages: u32,
    /// Base-2 logarithm of the words per page of either.
    pub page_shift: u32,
    /// Bits `ATTRIBUTE_…` of the attributes that triangles have.
    pub attributes: u32,
}

impl TextureAccess {
    /// Specialization constants with their values.
    pub(crate) fn constants(self) -> [(u32, u32); 5] {
        [
            (CONSTANT_TEXTURE_PAGES, self.texture_pages),
            (CONSTANT_TEXTURE_PAGE_SHIFT, self.page_shift),
            (CONSTANT_ATTRIBUTE_PAGES, self.attribute_pages),
            (CONSTANT_ATTRIBUTE_PAGE_SHIFT, self.page_shift),
            (CONSTANT_ATTRIBUTES, self.attributes),
        ]
    }
}
