//! Geometry on the device: the arrays of [`Accel`], who traces it, and how passes schedule rays through it.

use std::sync::Arc;

use super::{
    host_tracer::HostTracer,
    kernel::{Domain, Kernel, Question},
    passages::{Passages, TRIANGLE_PAGES},
    surfaces::Surfaces,
};
use crate::{
    accel::{Accel, MAX_TRIANGLE_PAGES, TriangleRecord},
    error::{Error, Result},
    gpu::{Buffer, Capabilities, Device, Tracer},
    shader::{
        bindings::{Binding, scene},
        constants::{
            CONSTANT_ANSWERED, CONSTANT_RAYS_PER_INVOCATION, CONSTANT_REFILL_LANES,
            CONSTANT_TRIANGLE_PAGE_SHIFT, CONSTANT_TRIANGLE_PAGES, SURFACES_INSTANCED,
        },
    },
};

/// Tree and triangles on the device.
pub struct GeometryBuffers {
    /// The buffers at their bindings in the scene set. Missing pages repeat the first.
    pub bound: Vec<(Binding, Buffer)>,
    pages: Vec<Buffer>,
    /// Specialization of the passes that traverse this geometry.
    pub traversal: Traversal,
    /// The host's tracer, if the host traces.
    pub host_tracer: Option<HostTracer>,
}

/// Largest number of bytes in one page of triangles on a device, such that one buffer holds the materials of
/// all pages.
pub(crate) fn triangle_page_bytes(capabilities: &Capabilities) -> u64 {
    let by_texels = capabilities.max_texel_buffer_elements.saturating_mul(16);
    let with_material = capabilities.max_storage_buffer_range / size_of::<u32>() as u64;
    let by_materials = with_material / MAX_TRIANGLE_PAGES as u64;
    by_texels.min(by_materials.saturating_mul(size_of::<TriangleRecord>() as u64))
}

impl GeometryBuffers {
    /// Copies `accel` to the device; shaders no longer need the original. Fails if memory or a
    /// limit does not suffice.
    pub fn new(device: &Arc<Device>, accel: &Accel) -> Result<Self> {
        let pages: Vec<Buffer> = accel
            .triangle_pages
            .iter()
            .enumerate()
            .map(|(index, page): (usize, &Vec<TriangleRecord>)| {
                Buffer::texels_from_slice(device, &format!("triangles {index}"), page)
            })
            .collect::<Result<_>>()?;
        let materials =
            Buffer::texels_from_slice(device, "triangle materials", &accel.triangle_materials)?;
        let mut bound = vec![
            (scene::BVH_NODES, Buffer::texels_from_slice(device, "BVH nodes", &accel.nodes)?),
            (scene::TRIANGLE_MATERIALS, materials),
            (scene::INSTANCES, Buffer::texels_from_slice(device, "instances", &accel.instances)?),
        ];
        let page = |(index, binding)| (binding, pages.get(index).unwrap_or(&pages[0]).clone());
        bound.extend(TRIANGLE_PAGES.into_iter().enumerate().map(page));
        let traversal = Traversal {
            page_count: pages.len() as u32,
            page_shift: accel.page_shift,
            is_instanced: accel.is_instanced(),
            is_on_host: false,
        };
        Ok(Self { bound, pages, traversal, host_tracer: None })
    }

    /// Lets the host trace where the device is opened for that; `passages` are those of light, in a scene in
    /// which it may pass some surfaces. Where memory does not suffice for the host's tree, the device traces,
    /// unless the host was asked for.
    ///
    /// # Errors
    /// The library fails, or memory does not suffice for it and the host was asked for.
    pub fn traced_by_host(
        self,
        device: &Device,
        accel: &Accel,
        passages: Option<Passages>,
    ) -> Result<Self> {
        let Some(embree) = &device.embree else { return Ok(self) };
        let must_trace = device.tracer == Tracer::Host;
        match HostTracer::new(embree, accel, &self.pages, passages, must_trace) {
            Ok(tracer) => {
                let traversal = Traversal { is_on_host: true, ..self.traversal };
                Ok(Self { traversal, host_tracer: Some(tracer), ..self })
            }
            Err(Error::Memory { message, .. }) if !must_trace => {
                log::warn!("{message}; the device traces");
                Ok(self)
            }
            Err(error) => Err(error),
        }
    }
}

/// Specialization of the passes that traverse a geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Traversal {
    /// Number of triangle pages.
    pub page_count: u32,
    /// Base-2 logarithm of the triangles per page.
    pub page_shift: u32,
    /// True if the tree has two levels.
    pub is_instanced: bool,
    /// True if the host traces.
    pub is_on_host: bool,
}

impl Traversal {
    /// Specialization constants of a pass that traverses and knows the surfaces of the scene.
    pub(crate) fn constants(self, mut surfaces: Surfaces) -> Vec<(u32, u32)> {
        if self.is_instanced {
            surfaces.features |= SURFACES_INSTANCED;
        }
        let own = [
            (CONSTANT_TRIANGLE_PAGES, self.page_count),
            (CONSTANT_TRIANGLE_PAGE_SHIFT, self.page_shift),
        ];
        [&own[..], &surfaces.constants()].concat()
    }

    fn kernel(
        self,
        shader: &'static str,
        domain: Domain,
        schedule: Schedule,
        surfaces: Surfaces,
        question: Question,
    ) -> Kernel {
        // Rays that the host has answered take no turns.
        let schedule = if self.is_on_host { Schedule::SINGLE } else { schedule };
        let own = [
            (CONSTANT_RAYS_PER_INVOCATION, schedule.rays_per_invocation),
            (CONSTANT_REFILL_LANES, schedule.refill_lanes),
            (CONSTANT_ANSWERED, self.is_on_host.into()),
        ];
        let constants = [&own[..], &self.constants(surfaces)].concat();
        let per_invocation = schedule.rays_per_invocation;
        let question = self.is_on_host.then_some(question);
        Kernel { per_invocation, question, ..Kernel::new(shader, domain, &constants) }
    }

    /// Finds the closest hit of every ray: `ray_texels` → `hits`.
    pub fn trace(self, schedule: Schedule, surfaces: Surfaces) -> Kernel {
        self.kernel("trace", Domain::Arrivals, schedule, surfaces, Question::Closest)
    }

    /// Tests shadow rays for any hit: `shadow_ray_texels`, `hit_texels` → `visibility`. Ray
    /// `direction_index · path_count + path_index` starts at hit `path_index`.
    pub fn shadow(self, schedule: Schedule, surfaces: Surfaces) -> Kernel {
        self.kernel("shadow", Domain::ShadowRays, schedule, surfaces, Question::Visible)
    }
}

/// Distribution of rays over invocations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Rays per invocation, 1 to 32.
    pub rays_per_invocation: u32,
    /// Number of finished lanes in a subgroup at which they take their next rays.
    pub refill_lanes: u32,
}

impl Schedule {
    /// One ray per invocation: for coherent rays, and for GPUs, which hide waiting lanes behind
    /// other subgroups.
    pub const SINGLE: Self = Self { rays_per_invocation: 1, refill_lanes: u32::MAX };

    /// For incoherent rays. Software devices gain by refilling lanes (`docs/traversal.md`).
    pub(crate) fn incoherent(capabilities: &Capabilities) -> Self {
        if capabilities.is_software() {
            Self { rays_per_invocation: 16, refill_lanes: capabilities.subgroup_size.div_ceil(3) }
        } else {
            Self::SINGLE
        }
    }
}
