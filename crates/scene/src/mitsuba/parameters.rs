//! Parameters of a plugin by name and type, and those that nobody asked for.

use std::cell::RefCell;

use glam::{DMat4, Vec3};

use super::{
    document::Node,
    transforms,
    values::{float, value},
};
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
        match value(node)?.trim() {
            "true" | "True" | "1" => Ok(Some(true)),
            "false" | "False" | "0" => Ok(Some(false)),
            found => Err(node.error(format!("`{name}`: expected true or false, found `{found}`"))),
        }
    }

    pub(super) fn string(&self, name: &str) -> Result<Option<&'a str>> {
        self.typed(name, &["string"])?.map(value).transpose()
    }

    pub(super) fn vector(&self, name: &str) -> Result<Option<Vec3>> {
        let node = self.typed(name, &["point", "vector"])?;
        node.map(|node| transforms::vector(node, [0.0; 3]).map(|v| v.as_vec3())).transpose()
    }

    /// Transform; the identity if it is not there.
    pub(super) fn transform(&self, name: &str) -> Result<DMat4> {
        let node = self.typed(name, &["transform"])?;
        node.map_or(Ok(DMat4::IDENTITY), transforms::transform)
    }

    /// Takes the value of a parameter that must be there.
    pub(super) fn required<T>(&self, name: &str, found: Option<T>) -> Result<T> {
        let kind = self.node.kind();
        found.ok_or_else(|| self.node.error(format!("{kind}: expected the parameter `{name}`")))
    }

    /// First object of a kind, if there is one; the others count as unused.
    pub(super) fn object(&self, tag: &str) -> Result<Option<Node<'a>>> {
        for child in self.node.children() {
            let target = child.target()?;
            if target.tag() == tag {
                self.take(child);
                return Ok(Some(target));
            }
        }
        Ok(None)
    }

    /// Objects of a kind (`bsdf`, `emitter`, …), references among them.
    pub(super) fn objects(&self, tag: &str) -> Result<Vec<Node<'a>>> {
        let mut objects = Vec::new();
        for child in self.node.children() {
            let target = child.target()?;
            if target.tag() == tag {
                self.take(child);
                objects.push(target);
            }
        }
        Ok(objects)
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
        for child in self.node.children().filter(|child| !used.contains(&child.index)) {
            let owner = match self.node.kind() {
                "" => self.node.tag(),
                kind => kind,
            };
            let place = || child.place();
            match child.name() {
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
