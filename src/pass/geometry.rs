//! The arrays of [`Accel`] on the device, and how the passes that traverse them go through rays.

use std::sync::Arc;

use super::kernel::{Domain, Kernel};
use crate::{
    accel::{Accel, MAX_TRIANGLE_PAGES, TriangleRecord},
    error::Result,
    gpu::{Buffer, Capabilities, Device},
    shader::{
        bindings::{Binding, scene},
        constants::{
            CONSTANT_RAYS_PER_INVOCATION, CONSTANT_REFILL_LANES, CONSTANT_TRIANGLE_PAGE_SHIFT,
            CONSTANT_TRIANGLE_PAGES,
        },
    },
};

/// Bindings of the pages of triangles.
const PAGES: [Binding; MAX_TRIANGLE_PAGES] =
    [scene::TRIANGLES_0, scene::TRIANGLES_1, scene::TRIANGLES_2, scene::TRIANGLES_3];

/// Tree and triangles on the device.
pub struct GeometryBuffers {
    nodes: Buffer,
    pages: Vec<Buffer>,
    materials: Buffer,
    page_shift: u32,
}

/// Bytes that one page of triangles may take on a device.
pub fn triangle_page_bytes(capabilities: &Capabilities) -> u64 {
    capabilities.max_texel_buffer_elements.saturating_mul(16)
}

impl GeometryBuffers {
    /// Copies the arrays to the device; `accel` is not needed by the shaders afterwards.
    ///
    /// # Errors
    /// Memory or a limit of the device is not enough.
    pub fn new(device: &Arc<Device>, accel: &Accel) -> Result<Self> {
        let pages = accel
            .triangle_pages
            .iter()
            .enumerate()
            .map(|(index, page): (usize, &Vec<TriangleRecord>)| {
                Buffer::texels_from_slice(device, &format!("triangles {index}"), page)
            })
            .collect::<Result<_>>()?;
        Ok(Self {
            nodes: Buffer::texels_from_slice(device, "BVH nodes", &accel.nodes)?,
            pages,
            materials: Buffer::from_slice(device, "triangle materials", &accel.triangle_materials)?,
            page_shift: accel.page_shift,
        })
    }

    /// Buffers with their bindings in the scene set. Pages that do not exist are bound to the first.
    pub fn bindings(&self) -> Vec<(Binding, &Buffer)> {
        let page = |(index, binding)| (binding, self.pages.get(index).unwrap_or(&self.pages[0]));
        let mut bindings =
            vec![(scene::BVH_NODES, &self.nodes), (scene::TRIANGLE_MATERIALS, &self.materials)];
        bindings.extend(PAGES.into_iter().enumerate().map(page));
        bindings
    }

    /// Every buffer once, for reports of memory.
    pub fn buffers(&self) -> impl Iterator<Item = &Buffer> {
        [&self.nodes, &self.materials].into_iter().chain(&self.pages)
    }

    /// Specialization of the passes that traverse this geometry.
    pub fn traversal(&self) -> Traversal {
        Traversal { page_count: self.pages.len() as u32, page_shift: self.page_shift }
    }
}

/// Specialization of the passes that traverse a geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Traversal {
    /// Pages of triangles.
    pub page_count: u32,
    /// Base-2 logarithm of the triangles per page.
    pub page_shift: u32,
}

impl Traversal {
    fn kernel(self, shader: &'static str, domain: Domain, schedule: Schedule) -> Kernel {
        let constants = [
            (CONSTANT_TRIANGLE_PAGES, self.page_count),
            (CONSTANT_TRIANGLE_PAGE_SHIFT, self.page_shift),
            (CONSTANT_RAYS_PER_INVOCATION, schedule.rays_per_invocation),
            (CONSTANT_REFILL_LANES, schedule.refill_lanes),
        ];
        let per_invocation = schedule.rays_per_invocation;
        Kernel { per_invocation, ..Kernel::new(shader, domain, &constants) }
    }

    /// The pass that finds the closest hit of every ray: `ray_texels` → `hits`.
    pub fn trace(self, schedule: Schedule) -> Kernel {
        self.kernel("trace", Domain::Paths, schedule)
    }

    /// The pass that tests every shadow ray for any hit: `shadow_ray_texels`, `hit_texels` →
    /// `visibility`. Ray `direction_index · path_count + path_index` starts at hit `path_index`.
    pub fn shadow(self, schedule: Schedule) -> Kernel {
        self.kernel("shadow", Domain::ShadowRays, schedule)
    }
}

/// How invocations share out rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Rays that one invocation traces, 1 to 32.
    pub rays_per_invocation: u32,
    /// Lanes of a subgroup that have finished when they take their next rays.
    pub refill_lanes: u32,
}

impl Schedule {
    /// One ray per invocation: for rays that stay together, and for GPUs, which hide waiting lanes
    /// by other subgroups.
    pub const SINGLE: Self = Self { rays_per_invocation: 1, refill_lanes: u32::MAX };

    /// For rays that part soon. A software device gains by refilling lanes; measured in
    /// `docs/traversal.md`.
    pub fn incoherent(capabilities: &Capabilities) -> Self {
        if capabilities.kind == "software" {
            Self { rays_per_invocation: 16, refill_lanes: capabilities.subgroup_size.div_ceil(3) }
        } else {
            Self::SINGLE
        }
    }
}
