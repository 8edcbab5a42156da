//! A pass as data: shader, specialization and domain.

use std::sync::Arc;

use crate::{
    error::Result,
    gpu::{Commands, DescriptorSet, Device, Pipeline},
    shader::{
        constants::{CONSTANT_LIGHT_GROUPS, WORKGROUP_SIZE},
        spirv,
        structs::Wave,
    },
};

/// Elements that the invocations of a pass run over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Domain {
    /// Paths of the wave.
    Paths,
    /// Paths that had a surface at the vertex before, where the wave lists them.
    Arrivals,
    /// Paths that have a surface at this vertex, where the wave lists them.
    Surfaces,
    /// Pixels of the wave.
    Pixels,
    /// Shadow rays of one group, of paths that have a surface at this vertex.
    ShadowRays,
}

/// Question of a pass to the host before its dispatch, where the host traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Question {
    /// Closest hits of rays.
    Closest,
    /// Visibility along shadow rays: nothing is left to dispatch.
    Visible,
}

/// A compute shader with its specialization. The shader names the pass in debug tools and timings.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Kernel {
    /// Name of the `.comp` file.
    pub shader: &'static str,
    /// Specialization constants: identifier and 32-bit value.
    pub constants: Vec<(u32, u32)>,
    /// Elements that the invocations run over.
    pub domain: Domain,
    /// Elements per invocation, 1 to 32.
    pub per_invocation: u32,
    /// Question to the host.
    pub question: Option<Question>,
}

impl Kernel {
    /// Makes a kernel with one invocation per element of `domain`.
    pub(crate) fn new(shader: &'static str, domain: Domain, constants: &[(u32, u32)]) -> Self {
        Self { shader, constants: constants.to_vec(), domain, per_invocation: 1, question: None }
    }

    /// Keeps the light of this many groups of lights apart.
    pub(super) fn with_light_groups(mut self, groups: u32) -> Self {
        if groups > 0 {
            self.constants.push((CONSTANT_LIGHT_GROUPS, groups));
        }
        self
    }

    /// True unless the host does all.
    pub(super) fn is_dispatched(&self) -> bool {
        self.question != Some(Question::Visible)
    }

    /// Number of invocations for a wave whose lists hold `most_listed` paths at most, where the host knows
    /// that; at least one, so that an empty wave makes drivers compile.
    pub fn invocations(&self, wave: &Wave, most_listed: Option<u32>) -> u32 {
        let all = wave.pixel_count * wave.sample_count;
        let listed = most_listed.filter(|_| wave.path_list != 0);
        let paths = listed.map_or(all, |most| most.min(all));
        let elements = match self.domain {
            Domain::Paths | Domain::Arrivals | Domain::Surfaces => paths,
            Domain::Pixels => wave.pixel_count,
            Domain::ShadowRays => paths * wave.shadow_ray_count,
        };
        if self.per_invocation == 1 {
            return elements.max(1);
        }
        elements.div_ceil(WORKGROUP_SIZE * self.per_invocation).max(1) * WORKGROUP_SIZE
    }
}

/// A kernel and the push constants it runs with.
#[derive(Clone, Debug, PartialEq)]
pub struct Dispatch {
    /// Shader and specialization.
    pub kernel: Kernel,
    /// Push constants.
    pub wave: Wave,
}

/// A kernel compiled for a device.
pub struct Pass {
    pub(super) kernel: Kernel,
    /// None where the host does all.
    pipeline: Option<Pipeline>,
}

impl Pass {
    /// Compiles `kernel`; [`crate::Error::Vulkan`] if the driver refuses it.
    pub fn new(device: &Arc<Device>, kernel: Kernel) -> Result<Self> {
        let spirv = spirv::pass(kernel.shader);
        let pipeline = kernel
            .is_dispatched()
            .then(|| Pipeline::new(device, kernel.shader, spirv, &kernel.constants))
            .transpose()?;
        Ok(Self { kernel, pipeline })
    }

    /// Records the dispatch over `wave`, binding those of `sets` that its shader uses, with as many
    /// invocations as [`Kernel::invocations`] returns.
    ///
    /// # Errors
    /// Those of [`Commands::dispatch`].
    pub fn record(
        &self,
        commands: &mut Commands,
        sets: &[&DescriptorSet],
        wave: &Wave,
        most_listed: Option<u32>,
    ) -> Result<()> {
        if let Some(pipeline) = &self.pipeline {
            let invocations = self.kernel.invocations(wave, most_listed);
            commands.dispatch(pipeline, sets, bytemuck::bytes_of(wave), invocations)?;
        }
        Ok(())
    }
}
