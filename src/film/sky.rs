//! Functions of direction as lat-long pictures, −Z in the middle and +Y on top.

use glam::{Vec2, Vec3};

use crate::math::{
    colour::display_from_linear,
    frame::{direction_from_lat_long, lat_long_from_direction},
};

/// Share of the pixels that may be over-exposed.
const CLIPPED: f32 = 0.005;
/// Factor that darkens colours below the horizon.
const BELOW: f32 = 0.25;
const HORIZON: [u8; 3] = [90, 160, 255];

/// Returns the value that a share of 0.5% of a function's pixels exceeds.
pub(crate) fn white_of(width: usize, value: impl Fn(Vec3) -> Vec3) -> f32 {
    let pixels = 0..width * (width / 2);
    let values = pixels.map(|pixel| value(direction_of(width, pixel)).max_element());
    white(values.collect(), CLIPPED)
}

/// Returns the value that a share `clipped` of the values exceeds, the largest if that is not positive.
pub(crate) fn white(mut values: Vec<f32>, clipped: f32) -> f32 {
    values.sort_by(f32::total_cmp);
    let largest = values.last().copied().unwrap_or(0.0);
    let index = ((1.0 - clipped) * values.len() as f32) as usize;
    values.get(index).copied().filter(|white| *white > 0.0).unwrap_or(largest)
}

/// A lat-long picture, half as high as wide.
pub struct Sky {
    width: usize,
    /// Display values, row by row from the top.
    pub(crate) pixels: Vec<[u8; 3]>,
}

impl Sky {
    /// Draws a function of direction, with `white` shown as white; what lies below the horizon of `normal`
    /// is darker.
    pub(crate) fn new(
        width: usize,
        normal: Vec3,
        white: f32,
        value: impl Fn(Vec3) -> Vec3,
    ) -> Self {
        let height = width / 2;
        let show = |pixel: usize| {
            let direction = direction_of(width, pixel);
            let cosine = direction.dot(normal);
            if cosine.abs() < 2.0 / height as f32 {
                return HORIZON;
            }
            let scale = if cosine < 0.0 { BELOW } else { 1.0 } / white.max(f32::MIN_POSITIVE);
            (value(direction) * scale).to_array().map(display_from_linear)
        };
        Self { width, pixels: (0..width * height).map(show).collect() }
    }

    /// Draws a dot with a black rim.
    pub(crate) fn mark(&mut self, direction: Vec3, colour: [u8; 3]) {
        let (width, height) = (self.width, self.width / 2);
        let uv = lat_long_from_direction(direction);
        let centre = [(uv.x * width as f32) as i32, (uv.y * height as f32) as i32];
        for dy in -4_i32..=4 {
            for dx in -4_i32..=4 {
                let squared = dx * dx + dy * dy;
                let row = centre[1] + dy;
                if squared > 18 || !(0..height as i32).contains(&row) {
                    continue;
                }
                let column = (centre[0] + dx).rem_euclid(width as i32);
                let colour = if squared > 9 { [0; 3] } else { colour };
                self.pixels[row as usize * width + column as usize] = colour;
            }
        }
    }
}

fn direction_of(width: usize, pixel: usize) -> Vec3 {
    let u = ((pixel % width) as f32 + 0.5) / width as f32;
    let v = ((pixel / width) as f32 + 0.5) / (width / 2) as f32;
    direction_from_lat_long(Vec2::new(u, v))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_the_values_is_above_white() {
        let values: Vec<f32> = (1..=1000_u16).rev().map(f32::from).collect();
        assert!((white(values.clone(), CLIPPED) - 995.5).abs() < 1.0);
        assert_eq!(white([vec![0.0; 1000], values[..1].to_vec()].concat(), CLIPPED), 1000.0);
    }

    #[test]
    fn the_sky_is_bright_above_and_dark_below_the_horizon() {
        let white = Sky::new(64, Vec3::Y, 2.0, |_| Vec3::splat(2.0));
        let pixel = |sky: &Sky, row: usize| sky.pixels[64 * row + 20];
        assert_eq!([pixel(&white, 0), pixel(&white, 12)], [[255; 3]; 2]);
        assert_eq!(pixel(&white, 16), HORIZON);
        assert_eq!(pixel(&white, 30), [display_from_linear(BELOW); 3]);
        // A dot toward +X, a quarter to the right of the middle.
        let mut marked = white;
        marked.mark(Vec3::X.with_y(0.5), [1, 2, 3]);
        let row = ((0.5 - 0.5_f32.atan() / std::f32::consts::PI) * 32.0) as usize;
        assert_eq!(marked.pixels[64 * row + 48], [1, 2, 3]);
        assert_eq!(marked.pixels[64 * row + 44], [0; 3], "its rim");
        // One behind goes on from one edge to the other.
        marked.mark(Vec3::Z.with_y(0.5), [4, 5, 6]);
        assert_eq!([0, 63].map(|column| marked.pixels[64 * row + column]), [[4, 5, 6]; 2]);
    }
}
