//! Parameters of a plugin by name and type, and those that nobody asked for: numbers, transforms.

use std::cell::RefCell;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Vec3};

use super::document::Node;
use crate::{
    error::Result,
    features::{self, Ignored},
};

/// Child elements of a plugin.
#[derive(Debug)]
pub(super) struct Parameters<'a> {
    pub node: Node<'a>,
    used: RefCell<Vec<usize>>,
}

impl<'a> Parameters<'a> {
    pub(super) fn new(node: Node<'a>) -> Self {
        Self { node, used: RefCell::default() }
    }

    fn take(&self, node: Node<'a>) -> Node<'a> {
        self.used.borrow_mut().push(node.index);
        node
    }

    /// Child of a name, whatever it is; a `ref` as the element that it names.
    pub(super) fn any(&self, name: &str) -> Result<Option<Node<'a>>> {
        let child = self.node.children().find(|child| child.name() == name);
        child.map(|child| self.take(child).target()).transpose()
    }

    fn typed(&self, name: &str, tags: &[&str]) -> Result<Option<Node<'a>>> {
        let Some(node) = self.any(name)? else { return Ok(None) };
        if tags.contains(&node.tag()) {
            return Ok(Some(node));
        }
        let (expected, found) = (tags.join(" or "), node.tag());
        Err(node.error(format!("`{name}`: expected an element {expected}, found {found}")))
    }

    pub(super) fn float(&self, name: &str) -> Result<Option<f32>> {
        self.typed(name, &["float", "integer"])?.map(float).transpose()
    }

    /// Number from `low` to `high`, if it is there.
    pub(super) fn float_in(&self, name: &str, (low, high): (f32, f32)) -> Result<Option<f32>> {
        let Some(value) = self.float(name)? else { return Ok(None) };
        if (low..=high).contains(&value) {
            return Ok(Some(value));
        }
        let node = self.any(name)?.unwrap_or(self.node);
        Err(node.error(format!("`{name}`: expected {low} to {high}, found {value}")))
    }

    pub(super) fn integer(&self, name: &str) -> Result<Option<i64>> {
        let Some(node) = self.typed(name, &["integer"])? else { return Ok(None) };
        let text = value(node)?.trim();
        let message = || format!("`{name}`: expected a whole number, found `{text}`");
        text.parse().map(Some).map_err(|_| node.error(message()))
    }

    pub(super) fn boolean(&self, name: &str) -> Result<Option<bool>> {
        let Some(node) = self.typed(name, &["boolean"])? else { return Ok(None) };
        match value(node)?.trim().to_ascii_lowercase().as_str() {
            "true" | "1" => Ok(Some(true)),
            "false" | "0" => Ok(Some(false)),
            found => Err(node.error(format!("`{name}`: expected true or false, found `{found}`"))),
        }
    }

    pub(super) fn string(&self, name: &str) -> Result<Option<&'a str>> {
        self.typed(name, &["string"])?.map(value).transpose()
    }

    pub(super) fn vector(&self, name: &str) -> Result<Option<Vec3>> {
        let node = self.typed(name, &["point", "vector"])?;
        node.map(|node| vector(node, [0.0; 3]).map(|v| v.as_vec3())).transpose()
    }

    /// Transform; the identity if it is not there.
    pub(super) fn transform(&self, name: &str) -> Result<DMat4> {
        let node = self.typed(name, &["transform", "animation"])?;
        node.map_or(Ok(DMat4::IDENTITY), transform)
    }

    /// Takes the value of a parameter that must be there.
    pub(super) fn required<T>(&self, name: &str, found: Option<T>) -> Result<T> {
        let kind = self.node.kind();
        found.ok_or_else(|| self.node.error(format!("{kind}: expected the parameter `{name}`")))
    }

    /// First object of a kind, if there is one; the others count as unused.
    pub(super) fn object(&self, tag: &str) -> Result<Option<Node<'a>>> {
        self.of_tag(tag).next().transpose()
    }

    /// Objects of a kind (`bsdf`, `emitter`, …), references among them.
    pub(super) fn objects(&self, tag: &str) -> Result<Vec<Node<'a>>> {
        self.of_tag(tag).collect()
    }

    fn of_tag(&self, tag: &str) -> impl Iterator<Item = Result<Node<'a>>> {
        let found = move |child: Node<'a>| match child.target() {
            Ok(target) if target.tag() != tag => None,
            target => {
                self.take(child);
                Some(target)
            }
        };
        self.node.children().filter_map(found)
    }

    /// Counts as used what changes nothing in the picture; `names` have spaces between them.
    pub(super) fn without_effect(&self, names: &str) {
        let is_named = |child: &Node<'_>| names.split(' ').any(|name| name == child.name());
        for child in self.node.children().filter(is_named) {
            self.take(child);
        }
    }

    /// Names every parameter that has not been used.
    pub(super) fn finish(&self, ignored: &mut Ignored) {
        let used = self.used.borrow();
        let is_left = |child: &Node<'_>| child.tag() == "animation" || !used.contains(&child.index);
        for child in self.node.children().filter(is_left) {
            let owner = match self.node.kind() {
                "" => self.node.tag(),
                kind => kind,
            };
            let place = || child.place();
            match child.name() {
                "to_world" if child.tag() == "animation" => {
                    let name = format!("motion of `{owner}` after its first pose");
                    ignored.add_named(features::MI_ELEMENT, &name, place);
                }
                "" => {
                    let name = format!("`{}` in `{owner}`", child.tag());
                    ignored.add_named(features::MI_ELEMENT, &name, place);
                }
                name => {
                    let name = format!("`{name}` of `{owner}`");
                    ignored.add_named(features::MI_PARAMETER, &name, place);
                }
            }
        }
    }
}

/// Text of the attribute `value`.
pub(super) fn value(node: Node<'_>) -> Result<&str> {
    node.attribute("value")
        .ok_or_else(|| node.error(format!("`{}`: expected the attribute `value`", node.tag())))
}

/// Finite number in single precision.
pub(super) fn float(node: Node<'_>) -> Result<f32> {
    number(node, value(node)?).map(|number| number as f32)
}

/// Finite number of an attribute or of a part of one.
pub(super) fn number(node: Node<'_>, text: &str) -> Result<f64> {
    let text = text.trim();
    // Version 2 reads numbers as C does, with a suffix.
    let parsed: Option<f64> = text.trim_end_matches('f').parse().ok();
    parsed.filter(|number| (*number as f32).is_finite()).ok_or_else(|| {
        node.error(format!("`{}`: expected a finite number, found `{text}`", node.name()))
    })
}

/// Numbers with commas or spaces between them.
pub(super) fn numbers(node: Node<'_>, text: &str) -> Result<Vec<f64>> {
    let words = text.split(|c: char| c == ',' || c.is_whitespace());
    words.filter(|word| !word.is_empty()).map(|word| number(node, word)).collect()
}

/// Message on a placement that flattens.
pub(super) const NO_INVERSE: &str = "to_world: expected a matrix with an inverse";

/// Unit direction in the world of a direction of a placed object.
pub(super) fn turned(node: Node<'_>, matrix: DMat4, direction: DVec3) -> Result<DVec3> {
    let direction = matrix.transform_vector3(direction).try_normalize();
    direction.ok_or_else(|| node.error(NO_INVERSE))
}

/// Matrix of a `transform`, or of the first one of an `animation`.
pub(super) fn transform(node: Node<'_>) -> Result<DMat4> {
    if let Some(pose) = node.children().find(|child| child.tag() == "transform") {
        return transform(pose);
    }
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
    // Mitsuba takes this direction across the view if there is none upwards.
    let up = point("up")?.unwrap_or(DVec3::ZERO);
    let up = if up == DVec3::ZERO { forward.any_orthonormal_pair().0 } else { up };
    let Some(left) = up.cross(forward).try_normalize() else {
        return Err(node.error("lookat: `up` must not be along the view"));
    };
    let rotation = DMat3::from_cols(left, forward.cross(left), forward);
    Ok(DMat4::from(DAffine3::from_mat3_translation(rotation, origin)))
}
