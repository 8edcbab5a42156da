//! Graphics state of a scene description: the settings that the next shape or light takes from the
//! directives before it.

use std::{collections::HashMap, rc::Rc};

use glam::{DMat4, DVec3};

use super::{
    parameters::{Entity, Parameter},
    tokens::Place,
};
use crate::error::Result;

/// Most states that may be saved at a time.
const MAX_SAVED: usize = 1 << 12;

/// Material that shapes take.
#[derive(Clone, Debug, Default)]
pub(super) enum MaterialChoice {
    /// That of pbrt where a file chooses none: diffuse, 0.5.
    #[default]
    Default,
    Own(Rc<Entity>),
    Named(Rc<str>, Place),
}

/// Directives that `Attribute` gives parameters to.
#[derive(Clone, Debug, Default)]
pub(super) struct Attributes {
    /// Parameters of shapes, lights, materials, media and textures.
    lists: [Rc<Vec<Parameter>>; 5],
}

impl Attributes {
    const TARGETS: [&str; 5] = ["shape", "light", "material", "medium", "texture"];

    fn index(target: &str) -> Option<usize> {
        Self::TARGETS.iter().position(|name| *name == target)
    }

    pub(super) fn of(&self, target: &str) -> &[Parameter] {
        Self::index(target).map_or(&[], |index| &self.lists[index])
    }

    /// Adds parameters, which come before older ones of the same name.
    pub(super) fn add(
        &mut self,
        target: &str,
        mut parameters: Vec<Parameter>,
        place: &Place,
    ) -> Result<()> {
        let Some(index) = Self::index(target) else {
            let expected = Self::TARGETS.join(", ");
            return Err(
                place.error(format!("Attribute: expected one of {expected}, found `{target}`"))
            );
        };
        let list = Rc::make_mut(&mut self.lists[index]);
        list.retain(|old| parameters.iter().all(|new| new.name != old.name));
        parameters.append(list);
        *list = parameters;
        Ok(())
    }
}

/// Settings that the next shape or light takes.
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    /// Current transformation matrix: world from object, or camera from world before `Camera`.
    pub ctm: DMat4,
    /// True while transformations count for the end of the motion alone, which is not rendered.
    pub at_end: bool,
    /// True after an odd number of `ReverseOrientation`.
    pub reverse: bool,
    pub material: MaterialChoice,
    /// `AreaLightSource` of the shapes.
    pub area_light: Option<Rc<Entity>>,
    /// Name of the medium inside shapes, from `MediumInterface`.
    pub interior: Option<String>,
    pub attributes: Attributes,
}

/// Directive that saves the state, and that ends at its own counterpart; messages give its name as it
/// stands here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Saved {
    AttributeBegin,
    ObjectBegin,
    Import,
}

/// States saved by directives that have not ended yet.
#[derive(Debug, Default)]
pub(super) struct States {
    pub now: State,
    saved: Vec<(Saved, State, Place)>,
    /// Matrices that `CoordinateSystem` has named.
    pub named: HashMap<String, DMat4>,
}

impl States {
    /// Saves the state.
    pub(super) fn save(&mut self, why: Saved, place: Place) -> Result<()> {
        if self.saved.len() == MAX_SAVED {
            let message = format!("more than {MAX_SAVED} blocks in one another");
            return Err(place.error(message));
        }
        self.saved.push((why, self.now.clone(), place));
        Ok(())
    }

    /// Returns to the state saved last.
    pub(super) fn restore(&mut self, why: Saved, place: &Place) -> Result<()> {
        match self.saved.pop() {
            Some((found, state, _)) if found == why => {
                self.now = state;
                Ok(())
            }
            Some((found, _, begin)) => Err(place.error(format!(
                "an end without its beginning: the block open here is the {found:?} of line {}",
                begin.line
            ))),
            None => Err(place.error("an end without its beginning")),
        }
    }

    /// Checks that everything has ended.
    pub(super) fn check_end(&self) -> Result<()> {
        self.saved.last().map_or(Ok(()), |(why, _, place)| {
            Err(place.error(format!("{why:?} without an end in the file")))
        })
    }
}

/// Camera from world for a viewer at `eye` that looks to `target`; none if these coincide or `up`
/// lies along the view. The camera looks along +z with +x to the right and +y up.
pub(super) fn look_at(eye: DVec3, target: DVec3, up: DVec3) -> Option<DMat4> {
    let forward = (target - eye).try_normalize()?;
    let right = up.try_normalize()?.cross(forward).try_normalize()?;
    let columns = [right, forward.cross(right), forward].map(|axis| axis.extend(0.0));
    Some(DMat4::from_cols(columns[0], columns[1], columns[2], eye.extend(1.0)).inverse())
}
