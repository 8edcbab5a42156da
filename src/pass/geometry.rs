//! The arrays of [`Accel`] on the device, and how the passes that traverse them go through rays.

use std::sync::Arc;

use crate::{
    accel::{Accel, MAX_TRIANGLE_PAGES, TriangleRecord},
    error::Result,
    gpu::{Buffer, Capabilities, Device},
    shader::constants::{
        BINDING_BVH_NODES, BINDING_TRIANGLE_MATERIALS, BINDING_TRIANGLES_0,
        CONSTANT_RAYS_PER_INVOCATION, CONSTANT_REFILL_LANES, CONSTANT_TRIANGLE_PAGE_SHIFT,
        CONSTANT_TRIANGLE_PAGES, WORKGROUP_SIZE,
    },
};

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
    pub fn bindings(&self) -> Vec<(u32, &Buffer)> {
        let mut bindings =
            vec![(BINDING_BVH_NODES, &self.nodes), (BINDING_TRIANGLE_MATERIALS, &self.materials)];
        bindings.extend((0..MAX_TRIANGLE_PAGES).map(|page| {
            (BINDING_TRIANGLES_0 + page as u32, self.pages.get(page).unwrap_or(&self.pages[0]))
        }));
        bindings
    }

    /// Every buffer once, for reports of memory.
    pub fn buffers(&self) -> impl Iterator<Item = &Buffer> {
        [&self.nodes, &self.materials].into_iter().chain(&self.pages)
    }

    /// Specialization constants of a pass that traverses this geometry.
    pub(super) fn constants(&self, schedule: Schedule) -> [(u32, u32); 4] {
        [
            (CONSTANT_TRIANGLE_PAGES, self.pages.len() as u32),
            (CONSTANT_TRIANGLE_PAGE_SHIFT, self.page_shift),
            (CONSTANT_RAYS_PER_INVOCATION, schedule.rays_per_invocation),
            (CONSTANT_REFILL_LANES, schedule.refill_lanes),
        ]
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

    /// Invocations to dispatch for `rays` rays.
    pub(super) fn invocations(self, rays: u32) -> u32 {
        rays.div_ceil(WORKGROUP_SIZE * self.rays_per_invocation).max(1) * WORKGROUP_SIZE
    }
}
