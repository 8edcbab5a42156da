//! Groups of lights, whose layers add up to the picture.

use std::collections::BTreeSet;

use crate::Scene;

/// Group of the environment.
pub const ENVIRONMENT: &str = "environment";
/// Group of lamps and emitting surfaces that name none.
pub const LAMPS: &str = "lamps";

/// Names of the groups of a scene: that of the environment, then the others in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightGroups {
    /// Names of all.
    pub names: Vec<String>,
}

impl LightGroups {
    /// Lists the groups of the lights that `scene` has, and that of its environment.
    pub fn new(scene: &Scene) -> Self {
        let used: BTreeSet<u32> = scene.geometry.materials.iter().copied().collect();
        let surfaces = used.into_iter().map(|index| &scene.materials[index as usize].surface);
        let surfaces = surfaces.filter(|surface| surface.emission.is_some());
        let lamps = scene.lamps.iter().map(|lamp| &lamp.light_group);
        let named = surfaces.map(|surface| &surface.light_group).chain(lamps);
        let names: BTreeSet<&str> = named.map(|name| name.as_deref().unwrap_or(LAMPS)).collect();
        let others = names.into_iter().filter(|name| *name != ENVIRONMENT);
        Self { names: [ENVIRONMENT].into_iter().chain(others).map(str::to_owned).collect() }
    }

    /// Place of the group of a light that names this one; that of the environment for a group without lights.
    pub fn index(&self, light_group: Option<&str>) -> u32 {
        let name = light_group.unwrap_or(LAMPS);
        self.names.iter().position(|known| known == name).unwrap_or(0) as u32
    }
}
