//! Heights over a surface, as bump maps give them → normals.
//!
//! An image of heights bends a small surface more than a large one, so normals wait until the geometry is
//! there. Deviation: Mitsuba and pbrt divide by the size of the image on each triangle, this by its mean over
//! all triangles of a material, each weighted by its area, along either axis of the image.

use std::{collections::HashSet, sync::Arc};

use glam::{Mat3, Vec2, Vec3};
use half::f16;
use rayon::prelude::*;

use crate::{
    Geometry,
    material::Material,
    math::colour::luminance,
    texture::{Texels, Texture, TextureUse, lookup::wrapped_texel},
};

/// Heights, in units of the scene, that stand in the place of the normals of materials.
#[derive(Debug, Default)]
pub(crate) struct Reliefs(Vec<TextureUse>);

/// Area of triangles, and its sum over the lengths that an image has on them.
#[derive(Clone, Copy, Debug, Default)]
struct Spread {
    area: f32,
    images_per_unit: Vec2,
}

impl Reliefs {
    /// Takes note of heights, and returns them for [`Surface::normal`](crate::material::Surface::normal).
    pub(crate) fn keep(&mut self, heights: TextureUse) -> TextureUse {
        self.0.push(heights.clone());
        heights
    }

    /// Tests for normals that are heights as yet.
    pub(crate) fn hold(&self, normals: &TextureUse) -> bool {
        let is_same = |own: &TextureUse| {
            Arc::ptr_eq(&own.texture, &normals.texture) && own.scale == normals.scale
        };
        self.0.iter().any(is_same)
    }

    /// Turns the heights of materials into normals.
    pub(crate) fn settle(&self, materials: &mut [Material], geometry: &Geometry) {
        if self.0.is_empty() {
            return;
        }
        let spreads = spreads(materials, geometry);
        for (material, Spread { area, images_per_unit }) in materials.iter_mut().zip(spreads) {
            let normal = &mut material.surface.normal;
            if normal.as_ref().is_some_and(|normal| self.hold(normal)) {
                *normal = normal
                    .take()
                    .filter(|_| area > 0.0)
                    .map(|heights| normals(&heights, images_per_unit / area));
            }
        }
    }
}

/// Spread of the images of `normal` over the triangles of each material. One instance stands for all of a
/// prototype with the same materials.
fn spreads(materials: &[Material], geometry: &Geometry) -> Vec<Spread> {
    let mut spreads = vec![Spread::default(); materials.len()];
    let mut add = |mesh: &Geometry, linear: Mat3, material_of: &dyn Fn(u32) -> u32| {
        for (corners, own) in mesh.triangles.iter().zip(&mesh.materials) {
            let material = material_of(*own) as usize;
            let Some(used) = &materials[material].surface.normal else { continue };
            let uvs = &mesh.uvs[used.uv_set as usize];
            let [p, q, r] = corners.map(|at| linear * Vec3::from(mesh.positions[at as usize]));
            let [a, b, c] = corners.map(|at| {
                let uv = Vec2::from(uvs.get(at as usize).copied().unwrap_or_default()).extend(1.0);
                Vec2::from(used.image_from_uv.map(|row| Vec3::from(row).dot(uv)))
            });
            let ([u, v], [s, t]) = ([q - p, r - p], [b - a, c - a]);
            let (area, turns) = (0.5 * u.cross(v).length(), s.perp_dot(t));
            let along = Vec2::new((u * t.y - v * s.y).length(), (v * s.x - u * t.x).length());
            let each = turns.abs() / along;
            if area > 0.0 && each.is_finite() {
                spreads[material].area += area;
                spreads[material].images_per_unit += area * each;
            }
        }
    };
    add(geometry, Mat3::IDENTITY, &|own| own);
    let mut seen = HashSet::new();
    for instance in &geometry.instances {
        if seen.insert((instance.prototype, instance.first_material, instance.material_mask)) {
            let mesh = &geometry.prototypes[instance.prototype as usize];
            let material = |own: u32| instance.first_material + (own & instance.material_mask);
            add(mesh, instance.affine().matrix3.as_mat3(), &material);
        }
    }
    spreads
}

/// Normals at the centres of texels by the heights beside them, along the axes of the image.
fn normals(heights: &TextureUse, images_per_unit: Vec2) -> TextureUse {
    let Texture { width, height, ref name, .. } = *heights.texture;
    let values = heights.values();
    let at = |x: i32, y: i32| {
        let x = wrapped_texel(x, heights.wrap[0], width);
        let y = wrapped_texel(y, heights.wrap[1], height);
        let [red, green, blue, _] = values[(y * width + x) as usize];
        luminance(Vec3::new(red, green, blue))
    };
    let half_texels = 0.5 * images_per_unit * Vec2::new(width as f32, height as f32);
    let texel = |number: usize| {
        let (x, y) = ((number as u32 % width) as i32, (number as u32 / width) as i32);
        let right = (at(x + 1, y) - at(x - 1, y)) * half_texels.x;
        let up = (at(x, y - 1) - at(x, y + 1)) * half_texels.y;
        let normal = Vec3::new(-right, -up, 1.0).normalize_or(Vec3::Z);
        (0.5 * normal + 0.5).extend(1.0).to_array().map(f16::from_f32)
    };
    let texels = Texels::Halves((0..values.len()).into_par_iter().map(texel).collect());
    heights.clone().showing(Arc::new(Texture { name: name.clone(), width, height, texels }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{instance::Instance, material::MaterialKind, quadrics, transform::Transform};

    /// A square of 2 × 2 units under an image, stretched to 4 × 6: placed, and as an instance.
    #[test]
    fn images_spread_over_instances_as_over_what_is_placed() {
        let texels = Texels::Halves(vec![[f16::ONE; 4]]);
        let texture = Texture { name: "heights".into(), width: 1, height: 1, texels };
        let reflectance = Vec3::splat(0.5);
        let mut material = Material::new("bumpy", MaterialKind::Diffuse { reflectance });
        material.surface.normal = Some(TextureUse::new(Arc::new(texture)));
        let stretch = Transform::new([2.0, 3.0, 1.0], [0.0; 3], [0.0; 3]);
        let (mut placed, mut instanced) = (Geometry::default(), Geometry::default());
        placed.append(&quadrics::rectangle(), &stretch, |_| 0);
        let (prototype, _) = instanced.add_prototype(&quadrics::rectangle(), |_| 0);
        instanced.instances.extend(Instance::new(prototype.index, &stretch, 0, true));
        for geometry in [placed, instanced] {
            let Spread { area, images_per_unit } = spreads(&[material.clone()], &geometry)[0];
            let found = images_per_unit / area;
            assert!(found.abs_diff_eq(Vec2::new(0.25, 1.0 / 6.0), 1e-6), "{found}");
        }
    }
}
