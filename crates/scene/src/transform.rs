//! Placement of an object: scale, then rotations about X, Y and Z, then a translation.

use glam::{DMat3, DMat4, DVec3, Mat3, Vec3};

/// `world = Rz·Ry·Rx·scale · object + translate`, with the matrix for normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Linear part.
    pub linear: Mat3,
    /// Translation, metres.
    pub translate: Vec3,
    /// Inverse transpose of the linear part, up to a positive factor; transforms normals.
    pub normal: Mat3,
    /// True if the linear part mirrors: triangles must reverse their winding.
    pub mirrors: bool,
}

impl Transform {
    /// Builds the transform from the numbers of a scene file; no component of `scale` may be 0.
    pub fn new(scale: [f32; 3], rotate_deg: [f32; 3], translate: [f32; 3]) -> Self {
        let [x, y, z] = rotate_deg.map(sine_cosine_deg);
        let rotate_x =
            DMat3::from_cols(DVec3::X, DVec3::new(0.0, x.1, x.0), DVec3::new(0.0, -x.0, x.1));
        let rotate_y =
            DMat3::from_cols(DVec3::new(y.1, 0.0, -y.0), DVec3::Y, DVec3::new(y.0, 0.0, y.1));
        let rotate_z =
            DMat3::from_cols(DVec3::new(z.1, z.0, 0.0), DVec3::new(-z.0, z.1, 0.0), DVec3::Z);
        let rotation = rotate_z * rotate_y * rotate_x;
        let scale = DVec3::from_array(scale.map(f64::from));
        assert!(scale.min_element().abs() > 0.0 && scale.is_finite(), "scale must not be 0");
        Self {
            linear: (rotation * DMat3::from_diagonal(scale)).as_mat3(),
            translate: Vec3::from_array(translate),
            // Scale back to the size of the numbers in `rotation`, so that single precision neither
            // overflows nor underflows.
            normal: (rotation * DMat3::from_diagonal(scale.abs().min_element() / scale)).as_mat3(),
            mirrors: scale.x * scale.y * scale.z < 0.0,
        }
    }

    /// Takes an affine matrix; none if it is not finite or flattens objects.
    pub fn from_matrix(matrix: DMat4) -> Option<Self> {
        let linear = DMat3::from_mat4(matrix);
        let determinant = linear.determinant();
        let inverse = linear.inverse();
        let size = inverse.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
        if !matrix.is_finite() || determinant == 0.0 || !size.is_finite() || size == 0.0 {
            return None;
        }
        Some(Self {
            linear: linear.as_mat3(),
            translate: matrix.w_axis.truncate().as_vec3(),
            normal: (inverse.transpose() * size.recip()).as_mat3(),
            mirrors: determinant < 0.0,
        })
    }

    /// Transforms a position from object space to world space.
    pub fn position(&self, position: [f32; 3]) -> [f32; 3] {
        (self.linear * Vec3::from_array(position) + self.translate).to_array()
    }

    /// Transforms a normal to a unit normal in world space; zero if it has no direction.
    pub fn normal(&self, normal: [f32; 3]) -> [f32; 3] {
        let normal = self.normal * Vec3::from_array(normal).normalize_or_zero();
        normal.normalize_or_zero().to_array()
    }

    /// Transforms a tangent and the sign of its bitangent; a zero vector if it has no direction.
    pub fn tangent(&self, [x, y, z, sign]: [f32; 4]) -> [f32; 4] {
        let tangent = self.linear * Vec3::new(x, y, z).normalize_or_zero();
        let sign = if self.mirrors { -sign } else { sign };
        tangent.normalize_or_zero().extend(sign).to_array()
    }
}

/// Sine and cosine of an angle in degrees; exact for quarter turns.
pub(super) fn sine_cosine_deg(angle_deg: f32) -> (f64, f64) {
    let angle_deg = f64::from(angle_deg).rem_euclid(360.0);
    match angle_deg {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => angle_deg.to_radians().sin_cos(),
    }
}
