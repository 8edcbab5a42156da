//! Identifiers of Cryptomatte for the triangles, instances and materials of a scene.

use crate::{
    accel::Accel,
    film::cryptomatte::{self, NAMELESS},
    scene::Scene,
};

/// Identifiers as the pass `mattes` reads them.
pub(super) struct Mattes {
    /// By triangle in BVH order; those of meshes that instances place mean nothing.
    pub triangle_objects: Vec<u32>,
    /// By instance in the order of the scene.
    pub instance_objects: Vec<u32>,
    /// By material.
    pub materials: Vec<u32>,
}

impl Mattes {
    pub(super) fn new(scene: &Scene, accel: &Accel) -> Self {
        let geometry = &scene.geometry;
        let nameless = cryptomatte::identifier(NAMELESS);
        // Hash each name once.
        let starts: Vec<u32> =
            geometry.objects.iter().map(|start| cryptomatte::identifier(&start.name)).collect();
        let of = |next: usize| next.checked_sub(1).map_or(nameless, |start| starts[start]);
        let of_triangle = |&triangle: &u32| {
            let triangle = triangle as usize;
            of(geometry.objects.partition_point(|start| start.first_triangle <= triangle))
        };
        let of_instance = |instance: usize| {
            of(geometry.objects.partition_point(|start| start.first_instance <= instance))
        };
        let materials = scene.materials.iter();
        Self {
            triangle_objects: accel.scene_triangles.iter().map(of_triangle).collect(),
            instance_objects: (0..geometry.instances.len()).map(of_instance).collect(),
            materials: materials.map(|own| cryptomatte::identifier(&own.name)).collect(),
        }
    }
}
