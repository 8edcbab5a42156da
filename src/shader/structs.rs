//! Structs shared with the shaders, `scalar` layout; twins of `glsl/include/layout.glsl`.
//! `tests/layout.rs` compares every member with the offsets in the compiled SPIR-V.

use bytemuck::{Pod, Zeroable};

/// Three floats in scalar layout: 12 bytes.
pub type Float3 = [f32; 3];

/// What is constant during a render: camera, environment and film.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SceneParameters {
    /// Centre of projection, metres.
    pub camera_position: Float3,
    /// Radius of the thin lens, metres; 0 is a pinhole.
    pub camera_aperture_radius: f32,
    /// Unit vector to the right of the image.
    pub camera_right: Float3,
    /// Distance of the plane in focus along the view axis, metres.
    pub camera_focus_distance: f32,
    /// Unit vector up in the image.
    pub camera_up: Float3,
    /// Tangent of half the vertical field of view.
    pub camera_tan_half_fov: f32,
    /// Unit view axis.
    pub camera_forward: Float3,
    /// Film width in pixels, of the whole image.
    pub film_width: u32,
    /// Film height in pixels, of the whole image.
    pub film_height: u32,
    /// Left edge of the crop window in pixels.
    pub crop_x: u32,
    /// Upper edge of the crop window in pixels.
    pub crop_y: u32,
    /// Width of the crop window in pixels.
    pub crop_width: u32,
    /// Height of the crop window in pixels.
    pub crop_height: u32,
    /// 0 box, 1 Gaussian.
    pub film_filter: u32,
    /// Environment map width in texels.
    pub environment_width: u32,
    /// Environment map height in texels.
    pub environment_height: u32,
    /// Cosine of the map's rotation about +Y.
    pub environment_cos_rotation: f32,
    /// Sine of the map's rotation about +Y.
    pub environment_sin_rotation: f32,
    /// Normalisation of the environment's density: see `environment_pdf`.
    pub environment_total: f32,
}

/// A ray to trace for its closest hit.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Ray {
    /// Start, metres.
    pub origin: Float3,
    /// 1 to trace, 0 for a path that has ended.
    pub is_active: u32,
    /// Unit direction.
    pub direction: Float3,
    /// Unused by traversal; keeps rays at 32 bytes.
    pub reserved: u32,
}

/// Where a ray met a surface, both normals on the side the ray came from.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Hit {
    /// Point on the triangle, metres, from barycentric coordinates.
    pub position: Float3,
    /// Material index, or `NO_MATERIAL` where nothing was hit.
    pub material: u32,
    /// Unit normal of the triangle, turned toward the ray's origin.
    pub geometric_normal: Float3,
    /// Distance along the ray, metres; −1 where nothing was hit.
    pub distance: f32,
    /// Unit interpolated normal, turned toward the ray's origin, with a positive cosine to it.
    pub shading_normal: Float3,
    /// Triangle in BVH order.
    pub triangle: u32,
}

/// One sampled direction at a hit with what it brings if the environment is visible there.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ShadowRay {
    /// Unit direction.
    pub direction: Float3,
    /// BRDF · radiance · cosine / pdf; a zero vector needs no tracing.
    pub contribution: Float3,
}

/// What a path carries from vertex to vertex.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PathState {
    /// Product of BRDF · cosine / pdf along the path.
    pub throughput: Float3,
    /// Radiance gathered so far.
    pub radiance: Float3,
    /// Shadow rays of this path that were traced; directions that bring nothing are not.
    pub shadow_rays_traced: u32,
    /// Shadow rays of this path that reached the environment.
    pub shadow_rays_visible: u32,
    /// Camera and bounce rays of this path.
    pub rays_traced: u32,
}

/// Totals over the film since the host last set them to zero.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Counters {
    /// Camera rays.
    pub camera_rays: u32,
    /// Bounce rays.
    pub bounce_rays: u32,
    /// Shadow rays that were traced.
    pub shadow_rays_traced: u32,
    /// Shadow rays that reached the environment.
    pub shadow_rays_visible: u32,
    /// Samples left out of the film because their radiance was not finite.
    pub dropped_samples: u32,
    /// Rays given up after `TRAVERSAL_STEP_LIMIT` steps, counted as blocked or by the nearest hit so
    /// far.
    pub traversal_overruns: u32,
    /// Hits with lobes of a product.
    pub product_hits: u32,
    /// Lobes kept at these hits.
    pub lobes_kept: u32,
    /// Share of the product's energy that was kept, summed over these hits, in 256ths.
    pub energy_kept: u32,
    /// Directions recorded in visibility caches.
    pub cache_entries: u32,
    /// Rebuilds of a cumulative distribution because a cache had grown.
    pub cdf_rebuilds: u32,
}

/// A material; which members mean something depends on `kind`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Material {
    /// `MATERIAL_…`.
    pub kind: u32,
    /// First word of this material's table in the BRDF table buffer.
    pub table_offset: u32,
    /// GGX width α.
    pub alpha: f32,
    /// Refractive index of a dielectric coat; for conductors 1 chooses exact Fresnel, 0 Schlick.
    pub ior: f32,
    /// Diffuse albedo, or reflectance at normal incidence of a Schlick conductor.
    pub reflectance: Float3,
    /// Refractive index of a conductor.
    pub eta: Float3,
    /// Extinction coefficient of a conductor.
    pub k: Float3,
    /// Zero; fills up the last of four texels of four words.
    pub reserved: Float3,
}

/// Push constants of the passes that work on a wave of paths.
///
/// Path `i` of the wave belongs to pixel `first_pixel + (i % pixel_count) · pixel_stride` in film order and to sample
/// `first_sample + i / pixel_count`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Wave {
    /// First pixel of the wave, in film order.
    pub first_pixel: u32,
    /// Pixels in the wave.
    pub pixel_count: u32,
    /// First sample of every pixel.
    pub first_sample: u32,
    /// Samples per pixel in this wave.
    pub sample_count: u32,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Path vertex this dispatch works at; 0 is the first hit of the camera ray.
    pub vertex: u32,
    /// Shadow rays per hit in this dispatch.
    pub shadow_ray_count: u32,
    /// Index of the first of them among all shadow rays of the hit.
    pub first_shadow_ray: u32,
    /// Shadow rays per hit over all dispatches.
    pub total_shadow_rays: u32,
    /// Bits `AOV_…`: which extra film buffers are written.
    pub aovs: u32,
    /// Pixels in film order from one pixel of the wave to the next; 0 counts as 1.
    pub pixel_stride: u32,
    /// 1 where the paths only teach the guide: their rays are counted, their light is not.
    pub is_training: u32,
    /// Seed of the numbers of `guided`, another one after every rebuild.
    pub epoch_seed: u32,
    /// First sample after the last rebuild.
    pub epoch_start: u32,
}

/// What a path tells the guide about its bounces.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PathCell {
    /// Cell of the vertex it is at, or `NOTHING_TO_LEARN` where it left the scene.
    pub cell: u32,
    /// Cell and direction that its last bounce ray teaches, or `NOTHING_TO_LEARN`.
    pub teaches: u32,
}

/// How the cells of the guide follow from places in the scene.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct GuideParameters {
    /// Corner of the grids, metres.
    pub grid_origin: Float3,
    /// Edge of a cell of level 0, metres.
    pub finest_edge: f32,
    /// Edge of a cell per metre of distance to the camera.
    pub edge_per_distance: f32,
    /// Largest edge of a cell, metres.
    pub largest_edge: f32,
    /// Regions of the environment.
    pub region_count: u32,
    /// Slots of the hash table less one.
    pub table_mask: u32,
    /// Slots for missed keys less one.
    pub wanted_mask: u32,
}
