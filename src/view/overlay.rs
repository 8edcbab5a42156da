//! The controls as a picture: textured triangles → pixels with opacity.

use egui::{
    Color32, ImageData, Pos2, Rect,
    epaint::{ClippedPrimitive, Mesh, Primitive, Vertex},
    pos2,
};

use super::projector::Inset;

/// The texture of glyphs that all triangles read.
#[derive(Default)]
pub(super) struct Canvas {
    size: [usize; 2],
    texels: Vec<Color32>,
}

impl Canvas {
    /// Takes over what has changed in the texture.
    pub(super) fn update(&mut self, changed: &egui::TexturesDelta) {
        for (_, delta) in &changed.set {
            let ImageData::Color(image) = &delta.image;
            let [left, top] = delta.pos.unwrap_or_else(|| {
                self.size = image.size;
                self.texels = vec![Color32::TRANSPARENT; image.size[0] * image.size[1]];
                [0, 0]
            });
            for (row, texels) in image.pixels.chunks_exact(image.size[0].max(1)).enumerate() {
                let start = (top + row) * self.size[0] + left;
                if let Some(line) = self.texels.get_mut(start..start + texels.len()) {
                    line.copy_from_slice(texels);
                }
            }
        }
    }

    /// Draws triangles over nothing, on as many of `window` pixels from the upper left corner as they cover.
    pub(super) fn draw(&self, primitives: &[ClippedPrimitive], window: [u32; 2]) -> Inset {
        let screen = Rect::from_min_max(Pos2::ZERO, pos2(window[0] as f32, window[1] as f32));
        let meshes: Vec<(Rect, &Mesh)> = primitives
            .iter()
            .filter_map(|ClippedPrimitive { clip_rect, primitive }| match primitive {
                Primitive::Mesh(mesh) => Some((clip_rect.intersect(screen), mesh)),
                Primitive::Callback(_) => None,
            })
            .collect();
        let mut end = Pos2::ZERO;
        for (clip, mesh) in &meshes {
            end = end.max(clip.intersect(mesh.calc_bounds()).max);
        }
        let size = [end.x.ceil() as u32, end.y.ceil() as u32];
        let mut inset = Inset { size, pixels: vec![[0; 4]; (size[0] * size[1]) as usize] };
        for (clip, mesh) in meshes {
            for corners in mesh.indices.chunks_exact(3) {
                let corners = [0, 1, 2].map(|i| mesh.vertices[corners[i] as usize]);
                self.draw_triangle(&mut inset, clip, corners);
            }
        }
        inset
    }

    /// Draws a triangle of either orientation. A pixel belongs to it if its centre does; on an edge that two
    /// share, to one of them.
    fn draw_triangle(&self, inset: &mut Inset, clip: Rect, mut corners: [Vertex; 3]) {
        let cross = |a: Pos2, b: Pos2, c: Pos2| (b - a).x * (c - a).y - (b - a).y * (c - a).x;
        let mut area = cross(corners[0].pos, corners[1].pos, corners[2].pos);
        if area < 0.0 {
            corners.swap(1, 2);
            area = -area;
        }
        if area <= 0.0 || !area.is_finite() {
            return;
        }
        let [a, b, c] = corners.map(|corner| corner.pos);
        let owns = |from: Pos2, to: Pos2| to.y < from.y || (to.y == from.y && to.x > from.x);
        let edges = [(b, c), (c, a), (a, b)].map(|(from, to)| (from, to, owns(from, to)));
        let low = a.min(b).min(c).max(clip.min);
        let high = a.max(b).max(c).min(clip.max);
        let range = |low: f32, high: f32, end: u32| {
            (low - 0.5).ceil().max(0.0) as u32..((high - 0.5).ceil().max(0.0) as u32).min(end)
        };
        for y in range(low.y, high.y, inset.size[1]) {
            for x in range(low.x, high.x, inset.size[0]) {
                let at = pos2(x as f32 + 0.5, y as f32 + 0.5);
                let weights = edges.map(|(from, to, _)| cross(from, to, at));
                let is_inside = weights.iter().zip(&edges);
                if is_inside.into_iter().any(|(w, edge)| *w < 0.0 || (*w == 0.0 && !edge.2)) {
                    continue;
                }
                let weights = weights.map(|weight| weight / area);
                let source = self.colour(&corners, weights);
                let pixel = &mut inset.pixels[(y * inset.size[0] + x) as usize];
                let below = 1.0 - source[3] / 255.0;
                *pixel = std::array::from_fn(|i| {
                    (source[i] + below * f32::from(pixel[i])).round() as u8
                });
            }
        }
    }

    /// Colour of a point, 0 to 255 and multiplied by its opacity: that between the corners, times the texel.
    fn colour(&self, corners: &[Vertex; 3], weights: [f32; 3]) -> [f32; 4] {
        let mut uv = egui::Vec2::ZERO;
        let mut colour = [0.0; 4];
        for (corner, weight) in corners.iter().zip(weights) {
            uv += weight * corner.uv.to_vec2();
            let [red, green, blue, alpha] = corner.color.to_array();
            for (sum, value) in colour.iter_mut().zip([red, green, blue, alpha]) {
                *sum += weight * f32::from(value);
            }
        }
        let at = |share: f32, length: usize| {
            ((share * length as f32) as usize).min(length.saturating_sub(1))
        };
        let place = at(uv.y, self.size[1]) * self.size[0] + at(uv.x, self.size[0]);
        let texel = self.texels.get(place).copied().unwrap_or(Color32::WHITE).to_array();
        std::array::from_fn(|i| colour[i] * f32::from(texel[i]) / 255.0)
    }
}

#[cfg(test)]
mod tests {
    use egui::epaint::WHITE_UV;

    use super::*;

    fn drawn(corners: &[[f32; 2]], indices: &[u32], colour: Color32, clip: Rect) -> Inset {
        let vertex =
            |at: &[f32; 2]| Vertex { pos: pos2(at[0], at[1]), uv: WHITE_UV, color: colour };
        let vertices = corners.iter().map(vertex).collect();
        let mesh = Mesh { vertices, indices: indices.to_vec(), ..Mesh::default() };
        let primitive = Primitive::Mesh(mesh);
        Canvas::default().draw(&[ClippedPrimitive { clip_rect: clip, primitive }], [8, 8])
    }

    #[test]
    fn triangles_cover_the_pixels_whose_centres_they_hold() {
        let red = Color32::from_rgba_premultiplied(100, 0, 0, 128);
        let square = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [4.0, 4.0]];
        let half = drawn(&square, &[0, 1, 2], red, Rect::EVERYTHING);
        assert_eq!(half.size, [4, 4]);
        let covered = half.pixels.iter().filter(|pixel| **pixel == [100, 0, 0, 128]).count();
        assert!((6..=10).contains(&covered), "{covered} of 16, half of them on the edge");
        assert!(half.pixels[0] == [100, 0, 0, 128] && half.pixels[15] == [0; 4]);
        // Two triangles, one turned the other way, cover each pixel once.
        let both = drawn(&square, &[0, 1, 2, 2, 1, 3], red, Rect::EVERYTHING);
        assert_eq!(both.pixels, [[100, 0, 0, 128]; 16]);
        let both = drawn(&square, &[0, 1, 2, 1, 2, 3], red, Rect::EVERYTHING);
        assert_eq!(both.pixels, [[100, 0, 0, 128]; 16]);
        // A second layer covers by its opacity: 100 + (1 − 128/255) 100 = 149.8.
        let twice = drawn(&square, &[0, 1, 2, 2, 1, 3, 0, 1, 2, 2, 1, 3], red, Rect::EVERYTHING);
        assert_eq!(twice.pixels[5], [150, 0, 0, 192]);
        let clip = Rect::from_min_max(pos2(0.0, 0.0), pos2(2.0, 3.0));
        let clipped = drawn(&square, &[0, 1, 2, 2, 1, 3], red, clip);
        assert_eq!((clipped.size, clipped.pixels.len()), ([2, 3], 6));
    }

    #[test]
    fn texels_are_taken_and_replaced() {
        let image = |size: [usize; 2], value: u8| {
            let pixels = vec![Color32::from_gray(value); size[0] * size[1]];
            egui::ColorImage::new(size, pixels)
        };
        let mut canvas = Canvas::default();
        let set = |canvas: &mut Canvas, delta| {
            let set = vec![(egui::TextureId::default(), delta)];
            canvas.update(&egui::TexturesDelta { set, free: Vec::new() });
        };
        let options = egui::TextureOptions::NEAREST;
        set(&mut canvas, egui::epaint::ImageDelta::full(image([4, 2], 50), options));
        set(&mut canvas, egui::epaint::ImageDelta::partial([2, 1], image([1, 1], 200), options));
        let corner =
            |u: f32, v: f32| Vertex { pos: Pos2::ZERO, uv: pos2(u, v), color: Color32::WHITE };
        let at = |u, v| canvas.colour(&[corner(u, v); 3], [0.5, 0.25, 0.25])[0];
        assert_eq!([at(0.6, 0.7), at(0.6, 0.2), at(0.4, 0.7)], [200.0, 50.0, 50.0]);
    }
}
