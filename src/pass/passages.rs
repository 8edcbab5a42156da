//! Light that goes straight through surfaces, for rays that the host follows: twin of
//! `glsl/include/passage.glsl`, and of the chance in `trace.comp` by which paths go on.

use std::{
    mem::offset_of,
    sync::atomic::{AtomicU32, Ordering},
};

use glam::Vec3;

use super::{
    film_buffers::BLOCK_PIXELS,
    surfaces,
    texture_buffers::{ATTRIBUTE_PAGES, TEXTURE_PAGES, TextureAccess},
};
use crate::{
    accel::{
        Accel, MAX_TRIANGLE_PAGES,
        instances::Record,
        traverse::{edge_functions, placed},
    },
    brdf::fresnel::{pane_reflectance, pane_transmittance},
    error::Result,
    gpu::{DescriptorSet, embree_scene::Meeting},
    math::{
        colour::luminance,
        frame::frame_from_normal,
        random::{hash_4d, unit_float},
    },
    scene::material,
    shader::{
        bindings::{Binding, scene},
        constants::{
            ATTRIBUTE_FIRST_UVS, ATTRIBUTE_SECOND_UVS, DIMENSION_PASSAGE, DIMENSION_VERTEX,
            DIMENSIONS_PER_VERTEX, FILM_BLOCK, MATERIAL_THIN_DIELECTRIC,
        },
        structs::{Material, MaterialSurface, SceneParameters, TextureUse, Wave},
    },
    surface::{
        SurfaceTables,
        lookup::{AttributeWords, Words, surface_color, surface_opacity},
    },
};

pub(super) const TRIANGLE_PAGES: [Binding; MAX_TRIANGLE_PAGES] =
    [scene::TRIANGLES_0, scene::TRIANGLES_1, scene::TRIANGLES_2, scene::TRIANGLES_3];
/// Words of a vertex in the buffers of triangles.
const VERTEX_WORDS: usize = 4;

/// Surfaces of a scene, for the host to know what light passes them.
pub struct Passages {
    materials: Vec<Material>,
    surfaces: Vec<MaterialSurface>,
    uses: Vec<TextureUse>,
    access: TextureAccess,
    passes: Vec<bool>,
    instances: Vec<Record>,
    /// Base-2 logarithm of the triangles per page, three vertices each.
    page_shift: u32,
}

impl Passages {
    /// Takes the surfaces of `of`, whose `materials` and `tables` are those of the device; none if light
    /// passes nothing.
    pub(super) fn new(
        of: &[material::Material],
        materials: &[Material],
        tables: &SurfaceTables,
        access: TextureAccess,
        accel: &Accel,
    ) -> Option<Self> {
        let passes: Vec<bool> = of.iter().map(surfaces::passes).collect();
        passes.contains(&true).then(|| Self {
            materials: materials.to_vec(),
            surfaces: tables.surfaces.clone(),
            uses: tables.textures.uses.clone(),
            access,
            passes,
            instances: accel.instances.clone(),
            page_shift: accel.page_shift,
        })
    }

    /// Tests whether light may pass a surface of this material.
    pub(super) fn may_pass(&self, material: u32) -> bool {
        self.passes[material as usize]
    }

    /// Looks into the buffers of the scene's set. Fails if the host does not share the memory of one.
    pub(super) fn open<'a>(&'a self, set: &'a DescriptorSet) -> Result<OpenPassages<'a>> {
        Ok(OpenPassages {
            of: self,
            triangles: Pages::open(set, TRIANGLE_PAGES, self.page_shift)?,
            triangle_materials: set.buffer(scene::TRIANGLE_MATERIALS).words()?,
            textures: Pages::open(set, TEXTURE_PAGES, self.access.page_shift)?,
            attributes: Pages::open(set, ATTRIBUTE_PAGES, self.access.page_shift)?,
        })
    }
}

/// Buffers as arrays whose words go on from one to the next, `1 << shift` elements each.
struct Pages<'a> {
    pages: Vec<&'a [AtomicU32]>,
    shift: u32,
}

impl<'a> Pages<'a> {
    fn open(set: &'a DescriptorSet, pages: [Binding; 4], shift: u32) -> Result<Self> {
        let pages = pages.iter().map(|page| set.buffer(*page).words());
        Ok(Self { pages: pages.collect::<Result<_>>()?, shift })
    }

    /// Page of an element, and its index there.
    fn find(&self, index: usize) -> (&'a [AtomicU32], usize) {
        (self.pages[index >> self.shift], index & ((1 << self.shift) - 1))
    }
}

impl Words for Pages<'_> {
    fn word(&self, index: usize) -> u32 {
        let (page, index) = self.find(index);
        page[index].load(Ordering::Relaxed)
    }
}

/// Light at a point of a surface, by what becomes of it.
pub(super) struct Passing {
    /// Share that goes straight through.
    pub(super) passed: Vec3,
    /// Share that meets the surface.
    met: f32,
    /// As much of it as counts for the chance to go on: of a pane that emits nothing, what it reflects.
    kept: f32,
}

/// [`Passages`] with their words at hand.
pub(super) struct OpenPassages<'a> {
    of: &'a Passages,
    triangles: Pages<'a>,
    triangle_materials: &'a [AtomicU32],
    textures: Pages<'a>,
    attributes: Pages<'a>,
}

impl OpenPassages<'_> {
    /// Light at the point where a ray meets a surface.
    pub(super) fn passing(&self, met: &Meeting) -> Passing {
        let of = self.of;
        let instance = of.instances.get(met.instance as usize);
        let (page, triangle) = self.triangles.find(met.triangle as usize);
        let frame = frame_from_normal(met.direction);
        let local = [0, 1, 2].map(|corner| {
            let first = VERTEX_WORDS * (3 * triangle + corner);
            let position = [0, 1, 2].map(|axis| page[first + axis].load(Ordering::Relaxed));
            frame.to_local(placed(instance, position.map(f32::from_bits)) - met.origin)
        });
        let areas = edge_functions(local);
        let weights = areas / (areas.x + areas.y + areas.z);

        let own = self.triangle_materials[met.triangle as usize].load(Ordering::Relaxed);
        let index = instance.map_or(own, |of| of.material(own));
        let attributes = AttributeWords { bits: of.access.attributes, words: &self.attributes };
        let surface = &of.surfaces[index as usize];
        let uvs = [ATTRIBUTE_FIRST_UVS, ATTRIBUTE_SECOND_UVS]
            .map(|set| attributes.interpolated_uv(met.triangle, weights, set));
        let color = attributes.color(met.triangle, weights);
        let opacity = surface_opacity(&self.textures, &of.uses, surface, uvs, color.w);
        let mut shares =
            Passing { passed: Vec3::splat(1.0 - opacity), met: opacity, kept: opacity };
        if of.materials[index as usize].kind == MATERIAL_THIN_DIELECTRIC {
            let mut material = of.materials[index as usize];
            let factor = surface_color(&self.textures, &of.uses, surface, uvs, color.truncate());
            material.eta =
                (Vec3::from(material.eta) * factor).clamp(Vec3::ZERO, Vec3::ONE).to_array();
            let [a, b, c] = local;
            let normal = (b - a).cross(c - a);
            let cosine = normal.z.abs() / normal.length().max(1e-37);
            shares.passed += opacity * pane_transmittance(&material, cosine);
            if surface.emission_radiance == [0.0; 3] {
                shares.kept = opacity * luminance(pane_reflectance(&material, cosine));
            }
        }
        shares
    }
}

/// Chances that paths of a wave take at the surfaces that their rays meet.
pub(super) struct Chances<'a> {
    wave: &'a Wave,
    crop_width: u32,
    /// Pixels of the whole film before the crop window, and in a row.
    crop_start: u32,
    film_width: u32,
    has_instances: bool,
}

impl<'a> Chances<'a> {
    /// `parameters` holds [`SceneParameters`].
    pub(super) fn new(wave: &'a Wave, parameters: &[AtomicU32], has_instances: bool) -> Self {
        let word = |offset: usize| parameters[offset / size_of::<u32>()].load(Ordering::Relaxed);
        let film_width = word(offset_of!(SceneParameters, film_width));
        let crop_start = word(offset_of!(SceneParameters, crop_y)) * film_width
            + word(offset_of!(SceneParameters, crop_x));
        let crop_width = word(offset_of!(SceneParameters, crop_width));
        Self { wave, crop_width, crop_start, film_width, has_instances }
    }

    /// Pixel in the whole film and sample of a path, as `wave_path` in `wave.glsl`.
    fn pixel_and_sample(&self, path: u32) -> [u32; 2] {
        let wave = self.wave;
        let index = path % wave.pixel_count;
        let skipped = index / BLOCK_PIXELS * (wave.block_stride.max(1) - 1);
        let position =
            wave.first_pixel + (index + skipped * BLOCK_PIXELS) * wave.pixel_stride.max(1);
        let (block, within) = (position / BLOCK_PIXELS, position % BLOCK_PIXELS);
        let blocks_per_row = self.crop_width.div_ceil(FILM_BLOCK);
        let row = block / blocks_per_row * FILM_BLOCK + within / FILM_BLOCK;
        let column = block % blocks_per_row * FILM_BLOCK + within % FILM_BLOCK;
        [
            (self.crop_start + row * self.film_width).wrapping_add(column),
            wave.first_sample + path / wave.pixel_count,
        ]
    }

    /// Decides whether the ray of a path goes through a surface that it has met, as `goes_through` in
    /// `trace.comp`. Returns that, and the weight of the path if the decision counts.
    pub(super) fn take(&self, path: u32, met: &Meeting, shares: &Passing) -> (bool, Vec3) {
        let passed = luminance(shares.passed);
        if passed <= 0.0 {
            return (false, Vec3::ONE);
        }
        let wave = self.wave;
        let instance = if self.has_instances { met.instance } else { 0 };
        let [pixel, sample] = self.pixel_and_sample(path);
        let dimension = DIMENSION_VERTEX + wave.vertex * DIMENSIONS_PER_VERTEX + DIMENSION_PASSAGE;
        let seed = wave.seed ^ hash_4d([met.triangle, instance, 0, 0])[0];
        let [bits, ..] = hash_4d([pixel, sample, dimension, seed]);
        let probability = passed / (passed + shares.kept);
        if unit_float(bits) < probability {
            (true, shares.passed / probability)
        } else {
            (false, Vec3::splat(shares.met / (1.0 - probability)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{film::Window, pass::film_buffers::position_in_film_order};

    /// All pixels of a window, every fifth one, and those of every third block.
    #[test]
    fn paths_know_their_pixels() {
        let window = Window { x: 5, y: 3, width: 21, height: 19 };
        let parameters = [SceneParameters {
            film_width: 40,
            crop_x: 5,
            crop_y: 3,
            crop_width: 21,
            ..SceneParameters::default()
        }];
        let words = bytemuck::cast_slice::<_, u32>(&parameters).iter();
        let words: Vec<AtomicU32> = words.map(|word| AtomicU32::new(*word)).collect();
        let whole = Wave { pixel_count: 9 * BLOCK_PIXELS, first_sample: 9, ..Wave::default() };
        let strided = Wave { first_pixel: 2, pixel_count: 100, pixel_stride: 5, ..whole };
        let measured = Wave {
            first_pixel: BLOCK_PIXELS,
            pixel_count: 3 * BLOCK_PIXELS,
            block_stride: 3,
            ..whole
        };
        let mut seen = [0; 3];
        for (row, column) in (0..19).flat_map(|row| (0..21).map(move |column| (row, column))) {
            let position = position_in_film_order(window, column, row);
            let (block, within) = (position / BLOCK_PIXELS, position % BLOCK_PIXELS);
            let places = [
                Some(position),
                (position % 5 == 2).then_some(position / 5),
                (block % 3 == 1).then_some(block / 3 * BLOCK_PIXELS + within),
            ];
            for ((wave, place), seen) in
                [whole, strided, measured].iter().zip(places).zip(&mut seen)
            {
                let Some(place) = place.filter(|place| *place < wave.pixel_count) else { continue };
                let found =
                    Chances::new(wave, &words, false).pixel_and_sample(wave.pixel_count + place);
                assert_eq!(found, [40 * (3 + row) + 5 + column, 10], "{wave:?}");
                *seen += 1;
            }
        }
        assert!(seen[0] == 21 * 19 && seen[1] > 60 && seen[2] > 100, "{seen:?}");
    }
}
