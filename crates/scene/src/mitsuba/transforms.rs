//! Transforms: the elements of a `transform`, each applied after those above it.

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};

use super::{
    document::Node,
    values::{number, numbers, value},
};
use crate::error::Result;

/// Message on a placement that flattens.
pub(super) const NO_INVERSE: &str = "to_world: expected a matrix with an inverse";

/// Unit direction in the world of a direction of a placed object.
pub(super) fn turned(node: Node<'_>, matrix: DMat4, direction: DVec3) -> Result<DVec3> {
    let direction = matrix.transform_vector3(direction).try_normalize();
    direction.ok_or_else(|| node.error(NO_INVERSE))
}

/// Matrix of a `transform`.
pub(super) fn transform(node: Node<'_>) -> Result<DMat4> {
    let mut matrix = DMat4::IDENTITY;
    for child in node.children() {
        let next = match child.tag() {
            "translate" => DMat4::from_translation(vector(child, [0.0; 3])?),
            "scale" => DMat4::from_scale(vector(child, [1.0; 3])?),
            "rotate" => rotation(child)?,
            "matrix" => explicit(child)?,
            "lookat" | "look_at" | "lookAt" => look_at(child)?,
            found => {
                let expected = "expected translate, rotate, scale, matrix or lookat";
                return Err(child.error(format!("transform: {expected}, found `{found}`")));
            }
        };
        matrix = next * matrix;
    }
    if matrix.is_finite() {
        Ok(matrix)
    } else {
        Err(node.error("transform: expected finite numbers in the product of its elements"))
    }
}

/// Vector by `x`, `y`, `z`, with `absent` for those that are not there, or by `value` of one or three
/// numbers.
pub(super) fn vector(node: Node<'_>, absent: [f64; 3]) -> Result<DVec3> {
    if let Some(text) = node.attribute("value") {
        return match numbers(node, text)?[..] {
            [all] => Ok(DVec3::splat(all)),
            [x, y, z] => Ok(DVec3::new(x, y, z)),
            ref found => {
                let count = found.len();
                Err(node.error(format!("`{}`: expected 3 numbers, found {count}", node.tag())))
            }
        };
    }
    let mut vector = absent;
    for (component, name) in vector.iter_mut().zip(["x", "y", "z"]) {
        if let Some(text) = node.attribute(name) {
            *component = number(node, text)?;
        }
    }
    Ok(DVec3::from_array(vector))
}

/// Deviation: an axis counts as one of length 1; Mitsuba 3.9.1 takes its length for a distortion.
fn rotation(node: Node<'_>) -> Result<DMat4> {
    let Some(angle) = node.attribute("angle") else {
        return Err(node.error("rotate: expected the attribute `angle` in degrees"));
    };
    let angle = number(node, angle)?.to_radians();
    match vector(node, [0.0; 3])?.try_normalize() {
        Some(axis) => Ok(DMat4::from_quat(DQuat::from_axis_angle(axis, angle))),
        None if angle == 0.0 => Ok(DMat4::IDENTITY),
        None => Err(node.error("rotate: expected an axis, as y=\"1\", found none")),
    }
}

/// Matrix of 16 or 9 numbers, row by row.
fn explicit(node: Node<'_>) -> Result<DMat4> {
    let numbers = numbers(node, value(node)?)?;
    if let Ok(rows) = <[f64; 16]>::try_from(numbers.as_slice()) {
        let matrix = DMat4::from_cols_array(&rows).transpose();
        if matrix.row(3) == glam::DVec4::W {
            return Ok(matrix);
        }
        return Err(node.error("matrix: expected 0 0 0 1 as the last row"));
    }
    if let Ok(rows) = <[f64; 9]>::try_from(numbers.as_slice()) {
        return Ok(DMat4::from_mat3(DMat3::from_cols_array(&rows).transpose()));
    }
    Err(node.error(format!("matrix: expected 16 or 9 numbers, found {}", numbers.len())))
}

/// Places an object that looks along +Z, with +Y up and +X to the left.
fn look_at(node: Node<'_>) -> Result<DMat4> {
    let point = |name: &str| match node.attribute(name) {
        None => Ok(None),
        Some(text) => match numbers(node, text)?[..] {
            [x, y, z] => Ok(Some(DVec3::new(x, y, z))),
            _ => Err(node.error(format!("lookat: `{name}`: expected 3 numbers, found `{text}`"))),
        },
    };
    let (Some(origin), Some(target)) = (point("origin")?, point("target")?) else {
        return Err(node.error("lookat: expected `origin` and `target`"));
    };
    let Some(forward) = (target - origin).try_normalize() else {
        return Err(node.error("lookat: `origin` and `target` must differ"));
    };
    // Mitsuba takes any direction across the view if there is none upwards.
    let up = point("up")?.unwrap_or(DVec3::ZERO);
    let up = if up == DVec3::ZERO { forward.any_orthonormal_vector() } else { up };
    let Some(left) = up.cross(forward).try_normalize() else {
        return Err(node.error("lookat: `up` must not be along the view"));
    };
    let rotation = DMat3::from_cols(left, forward.cross(left), forward);
    Ok(DMat4::from(DAffine3::from_mat3_translation(rotation, origin)))
}
