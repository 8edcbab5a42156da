//! Frames of surfaces and the numbers of samplers.

use fenestra_scene::{
    math::{frame::frame_from_normal, random::reversed_sobol_1},
    texture::lookup::gradient_tangent,
};
use glam::{Mat3, Vec2, Vec3, Vec4};

#[test]
fn frames_are_right_handed_and_of_unit_length() {
    for normal in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.6, 0.48, 0.64], [0.48, 0.6, -0.64]] {
        let frame = frame_from_normal(normal.into());
        let matrix = Mat3::from_cols(frame.tangent, frame.bitangent, normal.into());
        assert!((matrix.transpose() * matrix).abs_diff_eq(Mat3::IDENTITY, 1e-6), "{matrix}");
        assert!((matrix.determinant() - 1.0).abs() < 1e-6, "{matrix}");
    }
}

/// The image lies on the triangle with u along y and v, which points down in it, along x.
#[test]
fn tangents_follow_u_and_bitangents_point_up_in_the_image() {
    let tangent = gradient_tangent([Vec3::X, Vec3::Y], [Vec2::Y, Vec2::X], Vec3::Z);
    assert_eq!(tangent, Vec4::new(0.0, 1.0, 0.0, 1.0));
}

/// Rows of Pascal's triangle are odd where the bits of the column are bits of the row.
#[test]
fn the_second_coordinate_of_sobol_is_pascals_triangle() {
    for row in 0..32_u32 {
        let odd = (0..=row).filter(|column| column & !row == 0);
        let expected = odd.map(|column| 1 << column).sum::<u32>();
        assert_eq!(reversed_sobol_1(1 << row), expected, "{row}");
    }
}
