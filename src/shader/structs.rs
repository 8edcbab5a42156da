//! Structs in buffers and push constants, in `scalar` layout: one declaration for Rust and GLSL.
//! `tests/interface.rs` compares every member with the offsets in the compiled SPIR-V.

/// Two floats in scalar layout: 8 bytes.
#[expect(non_camel_case_types, reason = "GLSL's name")]
pub type vec2 = [f32; 2];
/// Three floats in scalar layout: 12 bytes.
#[expect(non_camel_case_types, reason = "GLSL's name")]
pub type vec3 = [f32; 3];
/// Three unsigned words in scalar layout: 12 bytes.
#[expect(non_camel_case_types, reason = "GLSL's name")]
pub type uvec3 = [u32; 3];
/// An unsigned word.
#[expect(non_camel_case_types, reason = "GLSL's name")]
pub type uint = u32;
/// A single-precision number.
#[expect(non_camel_case_types, reason = "GLSL's name")]
pub type float = f32;

/// Description of a struct for both sides.
#[derive(Clone, Copy, Debug)]
pub struct SharedStruct {
    /// Name in Rust and GLSL.
    pub name: &'static str,
    /// Bytes.
    pub size: usize,
    /// Members in order.
    pub members: &'static [SharedMember],
}

/// A member of a [`SharedStruct`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SharedMember {
    /// Name in Rust and GLSL.
    pub name: &'static str,
    /// GLSL type.
    pub kind: &'static str,
    /// Bytes from the start of the struct.
    pub offset: usize,
}

/// Declares structs for Rust, and lists them for GLSL.
macro_rules! structs {
    ($($(#[$doc:meta])* struct $name:ident {
        $($(#[$member_doc:meta])* $member:ident: $kind:ident,)*
    })*) => {
        $(
            $(#[$doc])*
            #[repr(C)]
            #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
            pub struct $name {
                $($(#[$member_doc])* pub $member: $kind,)*
            }
        )*

        /// Every struct, in the order of declaration.
        pub const STRUCTS: &[$crate::shader::structs::SharedStruct] =
            &[$($crate::shader::structs::SharedStruct {
                name: stringify!($name),
                size: std::mem::size_of::<$name>(),
                members: &[$($crate::shader::structs::SharedMember {
                    name: stringify!($member),
                    kind: stringify!($kind),
                    offset: std::mem::offset_of!($name, $member),
                }),*],
            }),*];
    };
}
pub(crate) use structs;

structs! {
    /// Constants of a render: camera, environment and film.
    struct SceneParameters {
        /// Centre of projection, metres.
        camera_position: vec3,
        /// Radius of the thin lens, metres; 0 is a pinhole.
        camera_aperture_radius: float,
        /// Unit vector to the right of the image.
        camera_right: vec3,
        /// Distance of the plane in focus along the view axis, metres.
        camera_focus_distance: float,
        /// Unit vector up in the image.
        camera_up: vec3,
        /// Tangent of half the vertical field of view.
        camera_tan_half_fov: float,
        /// Unit view axis.
        camera_forward: vec3,
        /// Place of the image's centre right of and below the view axis, in halves of the image's height.
        camera_shift: vec2,
        /// Film width in pixels, of the whole image.
        film_width: uint,
        /// Film height in pixels, of the whole image.
        film_height: uint,
        /// Left edge of the crop window in pixels.
        crop_x: uint,
        /// Upper edge of the crop window in pixels.
        crop_y: uint,
        /// Width of the crop window in pixels.
        crop_width: uint,
        /// Height of the crop window in pixels.
        crop_height: uint,
        /// 0 box, 1 Gaussian.
        film_filter: uint,
        /// Environment map width in texels.
        environment_width: uint,
        /// Environment map height in texels.
        environment_height: uint,
        /// Cosine of the map's rotation about +Y.
        environment_cos_rotation: float,
        /// Sine of the map's rotation about +Y.
        environment_sin_rotation: float,
        /// Normalisation of the environment's density, see `environment_pdf`.
        environment_total: float,
        /// The same of the compensated density.
        compensated_total: float,
        /// Columns of the alias table over all lamps.
        lamp_count: uint,
        /// Corner of the grid of cells that choose lamps, metres.
        lamp_grid_origin: vec3,
        /// Cells a metre.
        lamp_cells_per_metre: float,
        /// Cells along each axis.
        lamp_grid_size: uvec3,
        /// Entries of a list, a power of two.
        lamp_list_length: uint,
    }

    /// A ray to trace for its closest hit.
    struct Ray {
        /// Start, metres.
        origin: vec3,
        /// 1 to trace, 0 for a path that has ended.
        is_active: uint,
        /// Unit direction.
        direction: vec3,
        /// Density of the BRDF's sampling in this direction, per steradian; 0 if no other technique
        /// samples the light that the ray meets: camera rays, and those from specular surfaces. Negative
        /// from rough glass, where `sample_lamps` samples the environment.
        brdf_pdf: float,
    }

    /// Intersection of a ray with a surface; both normals are on the side of the ray's origin.
    struct Hit {
        /// Point on the triangle, metres, from barycentric coordinates.
        position: vec3,
        /// Material index, or `NO_MATERIAL` where no sampler draws light.
        material: uint,
        /// Unit normal of the triangle, turned toward the ray's origin.
        geometric_normal: vec3,
        /// Distance along the ray, metres; −1 without a hit.
        distance: float,
        /// Unit interpolated normal, turned toward the ray's origin, with a positive cosine to it.
        shading_normal: vec3,
        /// Triangle in BVH order, or `NO_TRIANGLE` without a hit.
        triangle: uint,
    }

    /// Properties of the surface at a hit that textures vary.
    struct Surface {
        /// [`Material::reflectance`] there; of glass [`Material::eta`].
        reflectance: vec3,
        /// GGX width α there.
        alpha: float,
        /// Share of metal there, of a principled material.
        metallic: float,
        /// [`Material::anisotropy`] there.
        anisotropy: vec2,
        /// Zero; pads the last of two texels of four words.
        reserved: float,
    }

    /// Layers of surfaces at the sample of a path.
    struct Feature {
        /// Albedo of the first surface that is not perfectly specular, times the throughput up to it.
        albedo: vec3,
        /// 1 as long as every surface was perfectly specular.
        is_open: uint,
        /// Shading normal of that surface.
        normal: vec3,
        /// Position of the first hit, metres.
        position: vec3,
    }

    /// Light without a surface.
    struct Lamp {
        /// `LAMP_…`.
        kind: uint,
        /// Place, metres.
        position: vec3,
        /// Unit direction of the light along the axis.
        direction: vec3,
        /// Radiant intensity along the axis; irradiance of a directional lamp.
        intensity: vec3,
        /// Cosine of the inner angle; for a falloff linear in the angle, that angle.
        inner: float,
        /// Cosine of the outer angle; for a falloff linear in the angle, that angle.
        outer: float,
        /// Group of its light.
        light_group: uint,
        /// Zero; pads the last of four texels of four words.
        reserved: vec3,
    }

    /// Column of the alias table over lamps and emitting triangles.
    struct LampChoice {
        /// The column keeps `source` if a number of 32 bits is below this.
        threshold: uint,
        /// Column drawn otherwise.
        alias: uint,
        /// Triangle in BVH order, or `LAMP_BIT` and a lamp.
        source: uint,
        /// Probability with which the table of all draws `source`.
        probability: float,
        /// First column of the table of its cluster.
        cluster: uint,
        /// Zero; pads the last of two texels of four words.
        reserved: vec3,
    }

    /// Entry of a list of lamps: the first stands for all lamps, the others for clusters, by `first`.
    struct LampEntry {
        /// Probability of the entries before, in units of 2⁻³².
        before: uint,
        /// Probability of a lamp of the cluster, over that by power alone.
        ratio: float,
        /// First column of the alias table.
        first: uint,
        /// Number of columns.
        count: uint,
        /// Factor on the weight of a candidate.
        visibility: float,
        /// Zero; pads the last of two texels of four words.
        reserved: vec3,
    }

    /// Direction sampled at a hit, with its contribution if the environment is visible there.
    struct ShadowRay {
        /// Unit direction.
        direction: vec3,
        /// BRDF · radiance · cosine / pdf; a zero vector needs no tracing.
        contribution: vec3,
    }

    /// State that a path carries from vertex to vertex.
    struct PathState {
        /// Product of BRDF · cosine / pdf along the path.
        throughput: vec3,
        /// Traced shadow rays of this path; directions without a contribution are not traced.
        shadow_rays_traced: uint,
        /// Radiance gathered so far.
        radiance: vec3,
        /// Shadow rays of this path that reached the environment.
        shadow_rays_visible: uint,
        /// Camera and bounce rays of this path.
        rays_traced: uint,
        /// Zero; pads the last of three texels of four words.
        reserved: vec3,
    }

    /// First vertex of a path, to be connected with the second vertices of its cohort.
    struct FirstVertex {
        /// Point on the surface, metres.
        position: vec3,
        /// Material index, or `NO_MATERIAL` where no sampler draws light.
        material: uint,
        /// Unit normal of the triangle on the viewer's side.
        geometric_normal: vec3,
        /// [`Surface::alpha`], in scenes with textures.
        alpha: float,
        /// Unit shading normal.
        shading_normal: vec3,
        /// [`Surface::metallic`], in scenes with textures.
        metallic: float,
        /// Unit vector to the viewer.
        outgoing: vec3,
        /// [`PathState::throughput`] of the path before it bounces here.
        throughput: vec3,
        /// [`Surface::reflectance`], in scenes with textures.
        reflectance: vec3,
        /// [`Surface::anisotropy`], in scenes with textures.
        anisotropy: vec2,
        /// Zero; pads the last of six texels of four words.
        reserved: float,
    }

    /// Second vertex of a path, offered to the other pixels of its cohort.
    struct SecondVertex {
        /// Point on the surface, metres.
        position: vec3,
        /// Unit normal of the triangle on the side of the first vertex.
        geometric_normal: vec3,
        /// Unit shading normal.
        shading_normal: vec3,
        /// Unit vector to the first vertex.
        outgoing: vec3,
        /// [`PathState::throughput`] of the path up to here.
        throughput: vec3,
        /// [`PathState::radiance`] of the path up to here.
        radiance: vec3,
        /// [`Surface::reflectance`], in scenes with textures.
        reflectance: vec3,
        /// [`Surface::alpha`], in scenes with textures.
        alpha: float,
        /// [`Surface::metallic`], in scenes with textures.
        metallic: float,
        /// [`Surface::anisotropy`], in scenes with textures.
        anisotropy: vec2,
        /// Material index.
        material: uint,
        /// Throughput with which the path goes on instead; 0 if the vertex is not shared.
        scale: float,
        /// Density of the BRDF's sampling over that with which the path came here.
        density_ratio: float,
    }

    /// Light that a second vertex has found.
    struct SecondLight {
        /// Direct light that it reflects, times [`SecondVertex::scale`].
        direct: vec3,
        /// Light that the shared part of its BRDF reflects, times `scale`, but for that from beyond the next
        /// ray.
        shared_light: vec3,
        /// Direction of the path's next ray.
        bounce_direction: vec3,
        /// Value of the BRDF there, 1/sr.
        bounce_value: vec3,
        /// Direction of the light that is offered, chosen among all that the path found here.
        incident: vec3,
        /// That light before it is reflected, times `scale`.
        arriving: vec3,
        /// Sum of the weights of all light in that choice.
        weight_sum: float,
        /// Weight of the chosen light.
        weight: float,
        /// Number in [0, 1) for the next choice.
        random_number: float,
        /// Zero; pads the last of six texels of four words.
        reserved: vec3,
    }

    /// Second vertex of a path as the other pixels of its cohort see it.
    struct Offer {
        /// Point on the surface, metres.
        position: vec3,
        /// Material index, or `NO_MATERIAL` if there is nothing to share.
        material: uint,
        /// Unit normal of the triangle on the side of its own first vertex.
        geometric_normal: vec3,
        /// [`SecondVertex::density_ratio`].
        density_ratio: float,
        /// Unit shading normal.
        shading_normal: vec3,
        /// [`Surface::alpha`], in scenes with textures.
        alpha: float,
        /// Radiance of a diffuse surface; else light that arrives from `incident`, to be multiplied by the
        /// value of the shared part of the BRDF.
        radiance: vec3,
        /// [`Surface::metallic`], in scenes with textures.
        metallic: float,
        /// Unit vector to where that light comes from.
        incident: vec3,
        /// [`Surface::reflectance`], in scenes with textures.
        reflectance: vec3,
        /// [`Surface::anisotropy`], in scenes with textures.
        anisotropy: vec2,
    }

    /// Connection of the first vertex of a path with the second vertex of another.
    struct Connection {
        /// Light that it carries, if nothing is in between and no other path came to this place.
        contribution: vec3,
        /// Density of the BRDF's sampling at the first vertex, per square metre at the second.
        density: float,
    }

    /// Totals over the film since the host last cleared them.
    struct Counters {
        /// Camera rays.
        camera_rays: uint,
        /// Bounce rays.
        bounce_rays: uint,
        /// Shadow rays that were traced.
        shadow_rays_traced: uint,
        /// Shadow rays that reached the environment.
        shadow_rays_visible: uint,
        /// Samples left out of the film because their radiance was not finite.
        dropped_samples: uint,
        /// Rays abandoned after `TRAVERSAL_STEP_LIMIT` steps: blocked, or with the nearest hit so far.
        traversal_overruns: uint,
        /// Bounds of their pixels in the crop window: the complements of left and top, then right and
        /// bottom, excluded.
        overrun_left: uint,
        /// See `overrun_left`.
        overrun_top: uint,
        /// See `overrun_left`.
        overrun_right: uint,
        /// See `overrun_left`.
        overrun_bottom: uint,
        /// Hits with product lobes.
        product_hits: uint,
        /// Lobes kept at these hits.
        lobes_kept: uint,
        /// Share of the product's energy kept, summed over these hits, in 256ths.
        energy_kept: uint,
        /// Directions recorded in visibility caches.
        cache_entries: uint,
        /// Times that a hit's lobe weights were summed again because its cache had grown.
        cdf_rebuilds: uint,
    }

    /// Material; the meaning of its members depends on `kind`.
    struct Material {
        /// `MATERIAL_…`.
        kind: uint,
        /// First word of this material's table in the BRDF table buffer.
        table_offset: uint,
        /// GGX width α.
        alpha: float,
        /// Refractive index of a dielectric; for conductors 1 selects exact Fresnel, 0 Schlick;
        /// share of metal in a principled material, or of light that the back of a mirror keeps.
        ior: float,
        /// Diffuse albedo, base colour, factor of reflected light, also of an exact conductor, or reflectance
        /// at normal incidence of a Schlick conductor.
        reflectance: vec3,
        /// Refractive index of a conductor, factor of light transmitted by a dielectric, or
        /// reflectance of a principled dielectric at normal incidence.
        eta: vec3,
        /// Extinction coefficient of a conductor, absorption per metre inside a dielectric, or reflectance
        /// of a principled dielectric at grazing incidence.
        k: vec3,
        /// Share of a principled material that a coat covers, in all channels, or colour of its sheen.
        cover: vec3,
        /// Width α of the coat or the sheen; without these, 1 selects Beckmann's normals, 0 GGX.
        cover_alpha: float,
        /// First word of the table of coat or sheen in the BRDF table buffer.
        cover_table: uint,
        /// Stretch of the widths of GGX, as `GgxWidth` has it; then `alpha` is their mean.
        anisotropy: vec2,
    }

    /// Texture as a property of a material reads it: value = scale · texel + bias.
    struct TextureUse {
        /// First word of its texels among those of all textures.
        first_word: uint,
        /// Width in texels.
        width: uint,
        /// Height in texels.
        height: uint,
        /// `TEXTURE_…`: format, encoding, interpolation, set of coordinates, continuation, channel.
        flags: uint,
        /// Image coordinate u, 0 to 1 from left to right, is the scalar product with (u, v, 1).
        image_u: vec3,
        /// Image coordinate v, 0 to 1 from top to bottom, likewise.
        image_v: vec3,
        /// Factor.
        scale: vec3,
        /// Added after the factor.
        bias: vec3,
    }

    /// Properties of a material beside its reflection model; textures are indices of uses, or
    /// `NO_TEXTURE`.
    struct MaterialSurface {
        /// Factor of the model's colour.
        color: uint,
        /// Factor of the roughness √α.
        roughness: uint,
        /// Factor of the metallic share.
        metallic: uint,
        /// Normals in the tangent frame.
        normal: uint,
        /// Factor of the opacity.
        opacity: uint,
        /// Factor of the emitted radiance.
        emission: uint,
        /// Direction and factor of `anisotropy`.
        anisotropy_direction: uint,
        /// Factor of the tangential components of `normal`.
        normal_scale: float,
        /// Opacity without its texture.
        opacity_factor: float,
        /// Opacity from which the surface is opaque, and below which it is not there; −1 blends.
        opacity_cutoff: float,
        /// Emitted radiance without its texture, linear Rec.709; 0 without emission.
        emission_radiance: vec3,
        /// Bits `SURFACE_…`.
        flags: uint,
        /// Density of sampling points on its emitting triangles, per square metre.
        emission_density: float,
        /// Group of the emitted light.
        light_group: uint,
        /// Strength of the anisotropy along tangent and bitangent; 0 for a round width.
        anisotropy: vec2,
        /// Zero; pads the last of five texels of four words.
        reserved: vec2,
    }

    /// Push constants of the passes over a wave of paths. Path `i` belongs to sample `first_sample + i
    /// / pixel_count` of the pixel at `first_pixel + (i % pixel_count) · pixel_stride` in film order.
    struct Wave {
        /// First pixel of the wave, in film order.
        first_pixel: uint,
        /// Pixels in the wave.
        pixel_count: uint,
        /// First sample of every pixel.
        first_sample: uint,
        /// Samples per pixel in this wave.
        sample_count: uint,
        /// Seed of the random numbers.
        seed: uint,
        /// Path vertex this dispatch works at; 0 is the first hit of the camera ray.
        vertex: uint,
        /// Shadow rays per hit in this dispatch.
        shadow_ray_count: uint,
        /// Index of the first of these among all shadow rays of the hit.
        first_shadow_ray: uint,
        /// Shadow rays per hit over all dispatches.
        total_shadow_rays: uint,
        /// Step in film order from one pixel of the wave to the next; 0 counts as 1.
        pixel_stride: uint,
        /// Step from one block of 8×8 pixels of the wave to the next, in blocks; 0 counts as 1.
        block_stride: uint,
        /// 0 for the picture; `TRAINING_WAVE` if the paths only teach the guide, `MEASURED_WAVE` if their
        /// light is only compared: their rays are counted, their light is not.
        is_training: uint,
        /// Seed of the numbers of `guided`; changes with every rebuild.
        epoch_seed: uint,
        /// First sample after the last rebuild.
        epoch_start: uint,
        /// 1 if the shadow rays lead to lamps: they end there, and their directions are not unit
        /// vectors but lead from the surface to the lamp.
        to_lamps: uint,
        /// 1 if the bounce ray that leaves this vertex is a sample of the environment too.
        bounce_rays: uint,
        /// Shadow rays at the vertex before, if the bounce ray from there is a sample of the environment;
        /// else 0.
        arriving_shadow_rays: uint,
        /// Pixels of the crop window before the page of the film that the wave writes.
        film_start: uint,
        /// List of paths that the dispatch walks, from 1 on; 0 for all paths.
        path_list: uint,
    }

    /// Push constants of the pass `show`: a page of a film, and what it shows.
    struct ShownFilm {
        /// Pixels of the film before the page.
        first_pixel: uint,
        /// First pixel of the dispatch in the page.
        first_place: uint,
        /// End of its pixels there.
        end_place: uint,
        /// Samples per pixel in the film.
        sample_count: uint,
        /// One of `SHOW_…`.
        layer: uint,
        /// Mean radiance of the film, the floor of its relative error.
        mean_radiance: float,
    }

    /// Push constants of the pass `compose`: films, window and tone.
    struct WindowFrame {
        /// Width of the window, pixels.
        width: uint,
        /// Height of the window, pixels.
        height: uint,
        /// Left edge of the film in the window, pixels.
        left: uint,
        /// Upper edge of the film in the window, pixels.
        top: uint,
        /// Width of the film in the window, pixels.
        shown_width: uint,
        /// Height of the film in the window, pixels.
        shown_height: uint,
        /// Width of the film, pixels.
        film_width: uint,
        /// Height of the film, pixels.
        film_height: uint,
        /// Width of the film to its right, pixels.
        right_width: uint,
        /// Height of the film to its right, pixels.
        right_height: uint,
        /// 1 if the films have fewer pixels than the scene's, which are interpolated.
        is_reduced: uint,
        /// First column of the window that shows the film to the right; its width where there is none.
        split: uint,
        /// First pixel of the dispatch in the window.
        first_index: uint,
        /// Factor of the exposure.
        exposure: float,
        /// One of `CURVE_…`.
        curve: uint,
        /// 1 if blue comes first in memory.
        is_bgra: uint,
        /// Width of the inset, pixels; 0 for none. It lies in the lower right corner of the film.
        inset_width: uint,
        /// Height of the inset, pixels.
        inset_height: uint,
        /// Width of the controls, pixels; 0 for none. They lie in the upper left corner of the window.
        overlay_width: uint,
        /// Height of the controls, pixels.
        overlay_height: uint,
    }
}
