//! Buffers of the shaders by descriptor set: one declaration for Rust and GLSL.
//!
//! Sets go by rate of change: 0 the scene, 1 the sampler, 2 the wave, 3 the film. Set 1 has a table for
//! each room of samplers ([`rooms`](super::rooms)), one for what pixels share and one for the window;
//! no two buffers have the same number, which tells the table of a shader. GLSL names are in lower case;
//! shaders say `READS(hits)`, `WRITES(rays)`, `UPDATES(paths)` or `TEXELS(hit_texels)`.

use super::constants::place;

/// A descriptor set: its number and its buffers.
#[derive(Clone, Copy, Debug)]
pub struct BindingTable {
    /// Name in debug tools.
    pub name: &'static str,
    /// Number of the descriptor set.
    pub set: u32,
    /// Buffers in ascending order of number.
    pub bindings: &'static [Binding],
}

/// A buffer of a descriptor set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Number of the descriptor set.
    pub set: u32,
    /// Number within the set.
    pub number: u32,
    /// Name in upper case, as in Rust.
    pub name: &'static str,
    /// Type of its elements.
    pub kind: Kind,
    /// The same buffer as texels, if shaders read it so too.
    pub again: &'static [Binding],
    /// One sentence for the documentation.
    pub about: &'static str,
}

impl Binding {
    /// Name in GLSL.
    pub fn glsl_name(&self) -> String {
        self.name.to_lowercase()
    }
}

/// Type of a buffer's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Storage buffer with a single element of this GLSL type.
    One(&'static str),
    /// Storage buffer with an array of elements of this GLSL type.
    Array(&'static str),
    /// Uniform texel buffer, which lavapipe loads several times as fast as a storage buffer.
    Texels(TexelFormat),
}

/// Format of a uniform texel buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelFormat {
    /// One word of 16 bits.
    R16Uint,
    /// One word.
    R32Uint,
    /// Two words.
    Rg32Uint,
    /// Four words.
    Rgba32Uint,
    /// One float.
    R32Float,
    /// Four floats.
    Rgba32Float,
    /// Four halves.
    Rgba16Float,
}

impl TexelFormat {
    /// Bytes of a texel.
    pub fn bytes(self) -> u64 {
        match self {
            Self::R16Uint => 2,
            Self::R32Uint | Self::R32Float => 4,
            Self::Rg32Uint | Self::Rgba16Float => 8,
            Self::Rgba32Uint | Self::Rgba32Float => 16,
        }
    }

    /// GLSL type of the buffer.
    pub fn sampler(self) -> &'static str {
        match self {
            Self::R16Uint | Self::R32Uint | Self::Rg32Uint | Self::Rgba32Uint => "usamplerBuffer",
            Self::R32Float | Self::Rgba32Float | Self::Rgba16Float => "samplerBuffer",
        }
    }
}

macro_rules! kind {
    (one $of:ident) => {
        $crate::shader::bindings::Kind::One(stringify!($of))
    };
    (array $of:ident) => {
        $crate::shader::bindings::Kind::Array(stringify!($of))
    };
    (texels $of:ident) => {
        $crate::shader::bindings::Kind::Texels($crate::shader::bindings::TexelFormat::$of)
    };
}
pub(crate) use kind;

/// Declares the buffers of a table in descriptor set `$set`, which `$number` numbers by their names. One that
/// shaders read as texels too has a second name and a format.
macro_rules! buffers {
    ($set:expr, $number:path; $($(#[doc = $doc:literal])* $name:ident: $kind:ident $of:ident
        $(, $again:ident $format:ident)?;)*) => {
        /// Names of the buffers, in the order of declaration.
        pub const BUFFER_NAMES: &[&str] = &[$(stringify!($name) $(, stringify!($again))?),*];
        /// Every buffer.
        pub const BUFFERS: &[$crate::shader::bindings::Binding] = &[$($name $(, $again)?),*];
        $($(#[doc = $doc])*
        pub const $name: $crate::shader::bindings::Binding = $crate::shader::bindings::Binding {
            set: $set,
            number: $number(stringify!($name)),
            name: stringify!($name),
            kind: $crate::shader::bindings::kind!($kind $of),
            again: &[$($again)?],
            about: concat!($($doc),*),
        };
        $(#[doc = concat!("[`", stringify!($name), "`] as texels.")]
        pub const $again: $crate::shader::bindings::Binding = $crate::shader::bindings::Binding {
            set: $set,
            number: $number(stringify!($again)),
            name: stringify!($again),
            kind: $crate::shader::bindings::kind!(texels $format),
            again: &[],
            about: concat!(stringify!($name), " as texels."),
        };)?)*
    };
}
pub(crate) use buffers;

macro_rules! binding_tables {
    ($($(#[$doc:meta])* $table:ident = $module:ident: $set:literal { $($buffers:tt)* })*) => {
        $(
            $(#[$doc])*
            pub mod $module {
                buffers! { $set, super::number; $($buffers)* }
            }

            $(#[$doc])*
            pub const $table: BindingTable =
                BindingTable { name: stringify!($module), set: $set, bindings: $module::BUFFERS };
        )*

        /// Every table but those of rooms.
        pub const TABLES: &[&BindingTable] = &[$(&$table),*];
        const BUFFER_NAMES: &[&[&str]] = &[$($module::BUFFER_NAMES),*];
    };
}

/// Number of a buffer that belongs to no room, its place among all of these; those of rooms follow.
const fn number(name: &str) -> u32 {
    place(BUFFER_NAMES, name)
}

binding_tables! {
    /// Set 0: the scene, constant during a render.
    SCENE = scene: 0 {
        /// Camera, film, crop window and environment.
        PARAMETERS: one SceneParameters;
        /// Nodes of the wide BVH, five texels a node.
        BVH_NODES: texels Rgba32Uint;
        /// First page of triangles in BVH order, three texels a triangle.
        TRIANGLES_0: texels Rgba32Uint;
        /// Second page of triangles; a missing page repeats the first.
        TRIANGLES_1: texels Rgba32Uint;
        /// Third page of triangles.
        TRIANGLES_2: texels Rgba32Uint;
        /// Fourth page of triangles.
        TRIANGLES_3: texels Rgba32Uint;
        /// Material index of each triangle in BVH order.
        TRIANGLE_MATERIALS: texels R32Uint;
        /// Materials.
        MATERIALS: array Material, MATERIAL_TEXELS Rgba32Uint;
        /// Words of the BRDF tables, addressed by offsets in the materials; as texels, cells of four halves.
        BRDF_TABLE: texels R32Float, BRDF_CELLS Rgba16Float;
        /// Radiance of each texel of the environment map, and its compensated luminance.
        ENVIRONMENT_TEXELS: texels Rgba32Float;
        /// Cumulative probability over the rows of cells of the environment map.
        ENVIRONMENT_ROWS: texels R32Float;
        /// Cumulative probability over the cells of each row.
        ENVIRONMENT_CELLS: texels R32Float;
        /// Alias table over lamps and emitting triangles, a `LampChoice` of two texels each.
        LAMP_CHOICE_TEXELS: texels Rgba32Uint;
        /// Lights without a surface, a `Lamp` of four texels each.
        LAMP_TEXELS: texels Rgba32Uint;
        /// First entry of the list of each cell and cube face.
        LAMP_CELLS: texels R32Uint;
        /// Lists of lamps, a `LampEntry` of two texels each.
        LAMP_ENTRY_TEXELS: texels Rgba32Uint;
        /// `environment_rows` of the compensated density.
        COMPENSATED_ROWS: texels R32Float;
        /// `environment_cells` of the compensated density.
        COMPENSATED_CELLS: texels R32Float;
        /// First page of the texels of all textures: a word a texel of bytes, two words a deeper one.
        TEXTURE_WORDS_0: texels R32Uint;
        /// Second page of texels; a missing page repeats the first.
        TEXTURE_WORDS_1: texels R32Uint;
        /// Third page of texels.
        TEXTURE_WORDS_2: texels R32Uint;
        /// Fourth page of texels.
        TEXTURE_WORDS_3: texels R32Uint;
        /// Textures as the properties of materials read them, a `TextureUse` of four texels each.
        TEXTURE_USE_TEXELS: texels Rgba32Uint;
        /// Textures, opacity and emission of each material, a `MaterialSurface` of four texels each.
        MATERIAL_SURFACE_TEXELS: texels Rgba32Uint;
        /// First page of what `CONSTANT_ATTRIBUTES` names for the three corners of each triangle in BVH
        /// order.
        TRIANGLE_ATTRIBUTES_0: texels R32Uint;
        /// Second page of attributes; a missing page repeats the first.
        TRIANGLE_ATTRIBUTES_1: texels R32Uint;
        /// Third page of attributes.
        TRIANGLE_ATTRIBUTES_2: texels R32Uint;
        /// Fourth page of attributes.
        TRIANGLE_ATTRIBUTES_3: texels R32Uint;
        /// Instances in the order of the upper level of the tree, eight texels each.
        INSTANCES: texels Rgba32Uint;
        /// Cluster of each placed triangle that emits.
        LAMP_CLUSTERS: texels R32Uint;
        /// Cryptomatte's identifier of the object of each triangle in BVH order, where it is placed.
        TRIANGLE_OBJECTS: array uint;
        /// That of the object of each instance, in the order of the scene.
        INSTANCE_OBJECTS: array uint;
        /// That of each material.
        MATERIAL_IDENTIFIERS: array uint;
    }

    /// Set 1 of the passes by which pixels share paths.
    SHARING = sharing: 1 {
        /// First vertex of each path.
        FIRST_VERTICES: array FirstVertex, FIRST_VERTEX_TEXELS Rgba32Uint;
        /// Second vertex of each path.
        SECOND_VERTICES: array SecondVertex, SECOND_VERTEX_TEXELS Rgba32Uint;
        /// Light that the second vertex of each path has found.
        SECOND_LIGHTS: array SecondLight, SECOND_LIGHT_TEXELS Rgba32Uint;
        /// Offer of each path to the pixels of its cohort.
        OFFERS: array Offer, OFFER_TEXELS Rgba32Uint;
        /// Weight of each offer.
        OFFER_WEIGHTS: array float, OFFER_WEIGHT_TEXELS R32Float;
        /// Connections of path `i` with the offer of pixel `k` of its cohort at `k · path_count + i`.
        CONNECTIONS: array Connection, CONNECTION_TEXELS Rgba32Float;
        /// Bits of the pixels of the cohort whose offers each path sees.
        SEEN: array uvec2, SEEN_TEXELS Rg32Uint;
    }

    /// Set 2: the wave in flight, rewritten by every pass.
    WAVE = wave: 2 {
        /// Next ray of each path.
        RAYS: array Ray, RAY_TEXELS Rgba32Uint;
        /// Hit of each path.
        HITS: array Hit, HIT_TEXELS Rgba32Uint;
        /// Shadow rays: direction `k` of path `i` at `k · path_count + i`.
        SHADOW_RAYS: array ShadowRay, SHADOW_RAY_TEXELS Rg32Uint;
        /// One where a shadow ray reaches the light, else zero.
        VISIBILITY: array uint, VISIBILITY_TEXELS R32Uint;
        /// State of each path.
        PATHS: array PathState, PATH_TEXELS Rgba32Uint;
        /// Surface at the hit of each path, in scenes with textures.
        HIT_SURFACES: array Surface, HIT_SURFACE_TEXELS Rgba32Uint;
        /// Instance that each path has hit, in scenes with instances.
        HIT_INSTANCES: array uint, HIT_INSTANCE_TEXELS R32Uint;
        /// Lengths of `PATH_LISTS` lists of paths, then the lists themselves: even and odd ones share a
        /// place each.
        PATH_LISTS: array uint, PATH_LIST_TEXELS R32Uint;
        /// First entry of the list that lamps were drawn from at the last vertex of each path.
        LAMP_LISTS: array uint, LAMP_LIST_TEXELS R32Uint;
        /// Layers of surfaces of each path, where they are asked for.
        FEATURES: array Feature;
        /// Radiance of each path by groups of lights, where they are asked for: that of group `g` of path `i`
        /// at `g · path_count + i`.
        GROUP_RADIANCE: array vec3;
        /// Group of the lamp of each path's last shadow ray to one, where groups are asked for.
        LAMP_GROUPS: array uint, LAMP_GROUP_TEXELS R32Uint;
    }

    /// Set 1 of the passes that show films in a window.
    VIEW = view: 1 {
        /// The controls: as the inset, with opacity, by which the colours are multiplied.
        OVERLAY: array uint;
        /// Pixels of a film as they are shown: linear radiance, or the colours of a layer.
        SHOWN: array vec3;
        /// The same of the film to its right, if there are two.
        SHOWN_RIGHT: array vec3;
        /// A picture over the window, a word of bytes a pixel, red lowest.
        INSET: array uint;
        /// Pixels of the window in its own order of bytes.
        WINDOW_PIXELS: array uint;
    }

    /// Set 3: the film, which grows by every wave.
    FILM = film: 3 {
        /// Leading part of the sum of radiance.
        FILM_SUM: array vec3;
        /// Rest of that sum.
        FILM_COMPENSATION: array vec3;
        /// Leading part of the sum of squared radiance.
        FILM_SQUARES: array vec3;
        /// Totals over all pixels.
        COUNTERS: one Counters;
        /// Sum of the albedo of surfaces, as in `Feature`.
        FILM_ALBEDO: array vec3;
        /// Sum of the shading normal of surfaces, as in `Feature`.
        FILM_NORMAL: array vec3;
        /// Sum of the position of first hits.
        FILM_POSITION: array vec3;
        /// Visible and traced shadow rays.
        FILM_VISIBLE: array uvec2;
        /// Entries of visibility caches, and hits that have one.
        FILM_CACHE_ENTRIES: array uvec2;
        /// Sum of the colours of the guide's cells at first hits.
        FILM_GUIDE_CELL: array vec3;
        /// First hits by the kind of their cell: of a face, coarse, fine.
        FILM_GUIDE_LEVEL: array vec3;
        /// Rest of the sum of squared radiance.
        FILM_SQUARES_COMPENSATION: array vec3;
        /// Radiance of the samples of one sweep, pixel by pixel, between one row of the page before and one
        /// of the page after; that of the groups of lights follows each.
        FILM_RADIANCE: array vec3;
        /// Sum of the radiance of the pixel's own samples.
        FILM_UNFILTERED: array vec3;
        /// Identifiers of objects and their numbers of samples: `MATTE_SLOTS` a pixel.
        FILM_OBJECTS: array uvec2;
        /// The same of materials.
        FILM_MATERIALS: array uvec2;
        /// Sum of the radiance of each group of lights, and its rest.
        FILM_GROUPS: array vec3;
    }

    /// Set 3 of the probe kernels in `glsl/test`, which declare their own element types.
    PROBE = probe: 3 {
        /// Queries of a test.
        PROBE_INPUT: array uint;
        /// Answers of the kernel.
        PROBE_OUTPUT: array uint;
    }
}
