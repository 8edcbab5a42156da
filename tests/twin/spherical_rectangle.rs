//! Rectangle seen from a point: twin of `glsl/include/spherical_rectangle.glsl`.
//!
//! Directions are uniform in solid angle \[Ureña, Fajardo & King 2013\] and, where that is below
//! [`LEAST_UNIFORM_SOLID_ANGLE`], uniform over the area, whose density per steradian is as exact.
//!
//! Deviation: solid angles are sums of arc tangents instead of inverse cosines, and the solid angle of the
//! whole rectangle that of two triangles \[van Oosterom & Strackee 1983\]. None of their terms cancel where
//! a rectangle is small or seen nearly edge on; those of inverse cosines lose all digits there.

use glam::{Vec2, Vec3};

/// Below this solid angle, directions are uniform over the area instead of over the solid angle.
pub const LEAST_UNIFORM_SOLID_ANGLE: f32 = 1e-2;

/// Distance from the plane of the rectangle, in lengths of its longer edge, below which it is not seen.
const LEAST_RECTANGLE_DISTANCE: f32 = 1e-3;

/// Rectangle seen from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphericalRectangle {
    /// Unit vectors along the edges, and from the point to the plane of the rectangle.
    pub axes: [Vec3; 3],
    /// Corner of least coordinates along the edges, from the point.
    pub low: Vec2,
    /// Corner of greatest coordinates.
    pub high: Vec2,
    /// Distance of the plane.
    pub distance: f32,
    /// Steradians, relative error below 1e-4; 0 if the rectangle is not sampled.
    pub solid_angle: f32,
}

/// Solid angle of the triangle a, b, c with |det(a, b, c)| = `volume`, at most 2π.
fn triangle_solid_angle([a, b, c]: [Vec3; 3], volume: f32) -> f32 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    2.0 * volume.atan2(la * lb * lc + a.dot(b) * lc + a.dot(c) * lb + b.dot(c) * la)
}

/// Solid angle between the axis and a corner at (x, y), signed.
fn corner_solid_angle(x: f32, y: f32, h: f32) -> f32 {
    (x * y).atan2(h * (x * x + y * y + h * h).sqrt())
}

impl SphericalRectangle {
    /// Makes the rectangle from `corner`, relative to the point, along two unit `axes` at a right angle.
    pub fn new(corner: Vec3, axes: [Vec3; 2], size: Vec2) -> Self {
        let [x_axis, y_axis] = axes;
        let normal = x_axis.cross(y_axis);
        let height = corner.dot(normal);
        let z_axis = if height < 0.0 { -normal } else { normal };
        let distance = height.abs();
        let low = Vec2::new(corner.dot(x_axis), corner.dot(y_axis));
        let high = low + size;
        let mut solid_angle = 0.0;
        if distance > LEAST_RECTANGLE_DISTANCE * size.max_element() {
            let a = low.extend(distance);
            let b = Vec3::new(high.x, low.y, distance);
            let c = high.extend(distance);
            let d = Vec3::new(low.x, high.y, distance);
            let volume = distance * size.x * size.y;
            solid_angle =
                triangle_solid_angle([a, b, c], volume) + triangle_solid_angle([a, c, d], volume);
        }
        Self { axes: [x_axis, y_axis, z_axis], low, high, distance, solid_angle }
    }

    /// Direction into the rectangle, if its solid angle is above 0; `u` in [0, 1)².
    pub fn sample(&self, u: Vec2) -> Vec3 {
        let h = self.distance;
        let mut at = self.low + u * (self.high - self.low);
        if self.solid_angle >= LEAST_UNIFORM_SOLID_ANGLE {
            let (y0, y1) = (self.low.y, self.high.y);
            let (r0, r1) = ((y0 * y0 + h * h).sqrt(), (y1 * y1 + h * h).sqrt());
            // Solid angle from x = 0 to the sampled x.
            let angle = u.x * self.solid_angle + corner_solid_angle(self.low.x, y1, h)
                - corner_solid_angle(self.low.x, y0, h);
            let half_sine = (0.5 * angle).sin();
            let s0 = y0 / r0;
            // Difference of the sines, without cancellation where both have one sign.
            let difference = if y0 * y1 > 0.0 {
                h * h * (y1 - y0) * (y1 + y0) / (r0 * r1 * (y1 * r0 + y0 * r1))
            } else {
                y1 / r1 - s0
            };
            let a = difference + 2.0 * s0 * half_sine * half_sine;
            let b = h / r0 * angle.sin();
            let x = h * angle.sin() / ((a - b) * (a + b)).max(1e-30).sqrt();
            at.x = x.clamp(self.low.x, self.high.x);
            let squared = at.x * at.x + h * h;
            let [start, end] = [y0, y1].map(|y| y / (squared + y * y).sqrt());
            let elevation = start + u.y * (end - start);
            let y = elevation * (squared / (1.0 - elevation * elevation).max(1e-30)).sqrt();
            at.y = y.clamp(y0, y1);
        }
        let [x_axis, y_axis, z_axis] = self.axes;
        (at.x * x_axis + at.y * y_axis + h * z_axis).normalize_or(z_axis)
    }

    /// Returns true if a direction from the point meets the rectangle.
    fn meets(&self, direction: Vec3) -> bool {
        let cosine = direction.dot(self.axes[2]);
        let across = Vec2::new(direction.dot(self.axes[0]), direction.dot(self.axes[1]));
        let across = across * self.distance;
        cosine > 0.0
            && across.cmpge(self.low * cosine).all()
            && across.cmple(self.high * cosine).all()
    }

    /// Density of [`Self::sample`], per steradian.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        if self.solid_angle <= 0.0 || !self.meets(direction) {
            return 0.0;
        }
        if self.solid_angle >= LEAST_UNIFORM_SOLID_ANGLE {
            return 1.0 / self.solid_angle;
        }
        let size = self.high - self.low;
        let cosine = direction.dot(self.axes[2]).max(1e-6);
        let along = self.distance / cosine;
        along * along / (cosine * size.x * size.y)
    }
}
