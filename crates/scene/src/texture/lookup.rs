//! Values of an image between and beyond its texels, and its directions on a triangle: twin of
//! `glsl/include/texture.glsl`, which has the comments on how and why.

use glam::{Vec2, Vec3, Vec4, vec2};

use super::{Interpolation, TextureUse, Wrap};

/// Place of an image coordinate in texels.
fn texture_place(coordinate: f32, wrap: Wrap, size: u32) -> f32 {
    let coordinate = if coordinate.abs() < 1e9 { coordinate } else { 0.0 };
    let coordinate = match wrap {
        Wrap::Repeat => coordinate - coordinate.floor(),
        Wrap::Mirror => coordinate - 2.0 * (0.5 * coordinate).floor(),
        Wrap::Clamp => coordinate.clamp(-1.0, 2.0),
    };
    coordinate * size as f32
}

/// Index of the texel at a place that may lie up to one image beyond the edges.
pub(crate) fn wrapped_texel(place: i32, wrap: Wrap, size: u32) -> u32 {
    let (size, last) = (size as i32, size as i32 - 1);
    let place = match wrap {
        Wrap::Repeat if place < 0 => place + size,
        Wrap::Repeat if place > last => place - size,
        Wrap::Mirror => {
            let place = if place < 0 { -1 - place } else { place };
            let place = if place > last { 2 * last + 1 - place } else { place };
            if place < 0 { -1 - place } else { place }
        }
        _ => place.clamp(0, last),
    };
    place as u32
}

/// Texels of an image as a look-up finds them.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// Width and height in texels.
    pub size: [u32; 2],
    /// Continuation along u and v.
    pub wrap: [Wrap; 2],
    /// Interpolation between texels.
    pub interpolation: Interpolation,
}

impl Grid {
    /// Value at image coordinates, from those of texels by column and row. Centres of texels lie at +0.5.
    pub fn value(&self, image: Vec2, texel: impl Fn([u32; 2]) -> Vec4) -> Vec4 {
        let ([width, height], [wrap_u, wrap_v]) = (self.size, self.wrap);
        let place =
            vec2(texture_place(image.x, wrap_u, width), texture_place(image.y, wrap_v, height));
        let is_nearest = self.interpolation == Interpolation::Nearest;
        let place = place - if is_nearest { 0.0 } else { 0.5 };
        let low = place.floor().as_ivec2();
        let left = wrapped_texel(low.x, wrap_u, width);
        let top = wrapped_texel(low.y, wrap_v, height);
        if is_nearest {
            return texel([left, top]);
        }
        let right = wrapped_texel(low.x + 1, wrap_u, width);
        let bottom = wrapped_texel(low.y + 1, wrap_v, height);
        let share = place - place.floor();
        let upper = texel([left, top]).lerp(texel([right, top]), share.x);
        let lower = texel([left, bottom]).lerp(texel([right, bottom]), share.x);
        upper.lerp(lower, share.y)
    }
}

impl TextureUse {
    /// Value at image coordinates as a property reads it, by channel, and opacity.
    pub fn value(&self, image: Vec2) -> Vec4 {
        let texture = &self.texture;
        let size = [texture.width, texture.height];
        let grid = Grid { size, wrap: self.wrap, interpolation: self.interpolation };
        let texel = grid.value(image, |[x, y]| {
            texture.linear_texel(self.encoding, (y * texture.width + x) as usize).into()
        });
        self.read(texel.to_array()).into()
    }
}

/// Direction of increasing u of the image along a triangle, at right angles to a unit normal, and the
/// sign of the bitangent, which points up in the image; 0 if the coordinates do not span the triangle.
/// The edges are those from the first corner, in the world and in the image.
pub fn gradient_tangent(edges: [Vec3; 2], image: [Vec2; 2], normal: Vec3) -> Vec4 {
    let area = image[0].x * image[1].y - image[1].x * image[0].y;
    let turn = if area < 0.0 { -1.0 } else { 1.0 };
    let along_u = turn * (image[1].y * edges[0] - image[0].y * edges[1]);
    let along_v = turn * (image[0].x * edges[1] - image[1].x * edges[0]);
    let tangent = along_u - along_u.dot(normal) * normal;
    let largest = tangent.abs().max_element();
    if area == 0.0 || largest.is_nan() || largest <= 0.0 {
        return Vec4::ZERO;
    }
    let tangent = (tangent / largest).normalize();
    tangent.extend(if normal.cross(tangent).dot(along_v) > 0.0 { -1.0 } else { 1.0 })
}
