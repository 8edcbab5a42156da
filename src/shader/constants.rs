//! Numbers with one owner: `build.rs` hands each of these to the GLSL compiler as a macro of the same
//! name, so that host and shaders cannot differ.

/// Weights of linear Rec.709 in luminance; a `vec3` of the same name in GLSL.
pub const LUMINANCE_WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Declares constants for Rust, and lists them for the GLSL compiler.
macro_rules! constants {
    ($($(#[$doc:meta])* $name:ident = $value:expr;)*) => {
        $($(#[$doc])* pub const $name: u32 = $value;)*

        /// Name and value of every constant, in the order of declaration.
        pub const CONSTANTS: &[(&str, u32)] = &[$((stringify!($name), $name)),*];
    };
}
pub(crate) use constants;

/// Declares specialization constants, which `$number` numbers by their names.
macro_rules! specializations {
    ($number:path; $($(#[$doc:meta])* $name:ident;)*) => {
        $($(#[$doc])* pub const $name: u32 = $number(stringify!($name));)*

        /// Name of every specialization constant, in the order of declaration.
        pub const SPECIALIZATIONS: &[&str] = &[$(stringify!($name)),*];
    };
}
pub(crate) use specializations;

/// Place of a name among those of all lists. Fails to compile if it is in none, or twice.
pub(crate) const fn place(lists: &[&[&str]], name: &str) -> u32 {
    let (mut list, mut passed, mut found) = (0, 0, None);
    while list < lists.len() {
        let mut index = 0;
        while index < lists[list].len() {
            if is_same(lists[list][index], name) {
                assert!(found.is_none(), "two rooms declare the same name");
                found = Some(passed);
            }
            (index, passed) = (index + 1, passed + 1);
        }
        list += 1;
    }
    match found {
        Some(place) => place,
        None => panic!("no room declares the name"),
    }
}

const fn is_same(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let mut index = 0;
    while index < one.len() && index < other.len() && one[index] == other[index] {
        index += 1;
    }
    index == one.len() && index == other.len()
}

/// Identifier of a specialization constant that belongs to no room; those of rooms follow.
const fn number(name: &str) -> u32 {
    place(&[SPECIALIZATIONS], name)
}

specializations! {
    number;

    // Specialization constants of `trace`, `shadow` and, but for the last three, `sample_and_trace`.
    /// Number of triangle pages in use.
    CONSTANT_TRIANGLE_PAGES;
    /// Base-2 logarithm of the triangles per page.
    CONSTANT_TRIANGLE_PAGE_SHIFT;
    /// Rays that one invocation traces, 1 to 32.
    CONSTANT_RAYS_PER_INVOCATION;
    /// Finished lanes of a subgroup at which they take their next rays.
    CONSTANT_REFILL_LANES;
    /// 1 where the host has answered.
    CONSTANT_ANSWERED;

    // Specialization constants of the passes that read textures.
    /// Number of pages of texels in use.
    CONSTANT_TEXTURE_PAGES;
    /// Base-2 logarithm of the words per page of texels.
    CONSTANT_TEXTURE_PAGE_SHIFT;
    /// Number of pages of triangle attributes in use.
    CONSTANT_ATTRIBUTE_PAGES;
    /// Base-2 logarithm of the words per page of triangle attributes.
    CONSTANT_ATTRIBUTE_PAGE_SHIFT;
    /// Bits `ATTRIBUTE_…` of the attributes that triangles have; 0 if the scene needs none.
    CONSTANT_ATTRIBUTES;

    // Specialization constants of the sampling and bounce passes.
    /// Sampler of `sample`, `SAMPLER_…`.
    CONSTANT_SAMPLER;
    /// Candidates per shadow ray in `sample` and `sample_guided`.
    CONSTANT_CANDIDATES;
    /// First vertex at which russian roulette may end a path.
    CONSTANT_ROULETTE_VERTEX;
    /// Throughput below which it may, a float.
    CONSTANT_ROULETTE_THROUGHPUT;
    /// Bit `1 << kind` for every kind of material in the scene; saves devices that run both sides of a
    /// branch the others.
    CONSTANT_MATERIAL_KINDS;
    /// Bits `SURFACES_…` of what the surfaces of the scene need.
    CONSTANT_SURFACES;
    /// 1 lets only paths at specular surfaces go on: the ray after the last vertex.
    CONSTANT_ONLY_SPECULAR;
    /// 1 samples the environment by its compensated density.
    CONSTANT_COMPENSATION;
    /// Candidates of `sample_lamps` for its shadow ray.
    CONSTANT_LAMP_CANDIDATES;
    /// Groups of lights that all passes of a wave keep apart.
    CONSTANT_LIGHT_GROUPS;
    /// Bits `AOV_…` of the extra film buffers that `deposit` and `mattes` write.
    CONSTANT_AOVS;

    // Specialization constant of the passes that share paths.
    /// Edge of a cohort, pixels: 2, 4 or 8.
    CONSTANT_COHORT_EDGE;
}

constants! {
    /// Invocations of a workgroup along x; every pass is one-dimensional.
    WORKGROUP_SIZE = 64;

    // Values of CONSTANT_SAMPLER.
    /// Uniform over the hemisphere.
    SAMPLER_UNIFORM = 0;
    /// Proportional to the cosine.
    SAMPLER_COSINE = 1;
    /// The BRDF's own sampling.
    SAMPLER_BRDF = 2;
    /// Proportional to the environment map's luminance.
    SAMPLER_ENV = 3;
    /// BRDF and environment in turns, one-sample balance heuristic.
    SAMPLER_MIS = 4;
    /// Resampling over the candidates of `mis`.
    SAMPLER_RIS = 5;

    // Bits of CONSTANT_SURFACES.
    /// Some surfaces reflect or transmit by paths: no sampler draws light at them.
    SURFACES_SPECULAR = 1;
    /// Some surfaces let light straight through.
    SURFACES_PASSING = 2;
    /// Some surfaces are black from behind.
    SURFACES_ONE_SIDED = 4;
    /// Textures or vertex colours vary some material.
    SURFACES_TEXTURED = 8;
    /// Some surfaces emit light.
    SURFACES_EMITTING = 16;
    /// Meshes are placed by instances: the tree has two levels.
    SURFACES_INSTANCED = 32;
    /// Lamps are chosen by place.
    SURFACES_LAMP_CELLS = 64;
    /// Some widths of GGX differ by direction.
    SURFACES_ANISOTROPIC = 128;
    /// Textures or vertex colours tint some thin panes.
    SURFACES_TINTED_PANES = 256;
    /// Some normals of microfacets are Beckmann's.
    SURFACES_BECKMANN = 512;
    /// Some dielectrics are rough: `sample_lamps` samples light there.
    SURFACES_ROUGH_GLASS = 1024;

    // Dimensions of random numbers that the host draws too.
    /// First dimension of the first vertex of a path.
    DIMENSION_VERTEX = 2;
    /// Dimensions of a vertex.
    DIMENSIONS_PER_VERTEX = 32;
    /// Offset from a vertex's first dimension: whether a ray goes through a surface that it meets.
    DIMENSION_PASSAGE = 5;
    /// Where a sample lies in its pixel.
    DIMENSION_FILTER = 0;
    /// Pixel number of random numbers that all pixels share.
    EVERY_PIXEL = 0xffff_ffff;
    /// Value of `Parameters::film_filter`: each sample counts in its pixel alone.
    FILTER_BOX = 0;
    /// Value of `Parameters::film_filter`: each sample counts in nine pixels.
    FILTER_GAUSSIAN = 1;
    /// Edge of the blocks of pixels that film order goes by, so that neighbouring invocations trace
    /// neighbouring rays.
    FILM_BLOCK = 8;

    // Bits of `CONSTANT_AOVS`: film layers to write.
    /// Albedo.
    AOV_ALBEDO = 1;
    /// Shading normal.
    AOV_NORMAL = 2;
    /// Position.
    AOV_POSITION = 4;
    /// Visible and traced shadow rays.
    AOV_VISIBLE = 8;
    /// Fill of the visibility caches.
    AOV_CACHE_ENTRIES = 16;
    /// Cells of the guide.
    AOV_GUIDE_CELL = 32;
    /// Radiance of the pixel's own samples.
    AOV_UNFILTERED = 64;
    /// Coverage by objects.
    AOV_OBJECTS = 128;
    /// Coverage by materials.
    AOV_MATERIALS = 256;
    /// Objects or materials that a pixel tells apart.
    MATTE_SLOTS = 6;
    /// Most groups of lights that a film keeps apart.
    MOST_LIGHT_GROUPS = 8;

    // Traversal.
    /// Entries of the traversal stack, one group of nodes per level of the tree.
    BVH_STACK_ENTRIES = 32;
    /// Traversal steps of an invocation for all its rays. Mesa 22.3 silently ends the loops of an
    /// invocation after 65,535 iterations in all, and two loops count every step here.
    TRAVERSAL_STEP_LIMIT = 30_000;
    /// Packed normal of the vertices of a flat triangle, which no unit vector packs to.
    FLAT_NORMAL = 0x8000_8000;
    /// [`Hit::material`](super::structs::Hit::material) where no sampler draws light: the ray left the
    /// scene, was not traced, or met a specular surface, which `Hit::triangle` tells apart.
    NO_MATERIAL = 0xffff_ffff;
    /// [`Hit::triangle`](super::structs::Hit::triangle) of a ray that met nothing.
    NO_TRIANGLE = 0xffff_ffff;
    /// Instance of a ray in the upper level of the tree, and of hits in scenes without instances.
    NO_INSTANCE = 0xffff_ffff;

    // Instances, as `accel::instances::Record` lays them out.
    /// Texels of a record: three rows of object from world, three of world from object, places of
    /// node and material, margins.
    INSTANCE_TEXELS = 8;
    /// Bit of a record's flags: its transform mirrors.
    INSTANCE_MIRRORS = 1;

    // Values of `Material::kind`.
    /// Lambertian.
    MATERIAL_DIFFUSE = 0;
    /// Dielectric coat over a diffuse base.
    MATERIAL_PLASTIC = 1;
    /// Conductor.
    MATERIAL_CONDUCTOR = 2;
    /// Tabulated measurement.
    MATERIAL_MEASURED = 3;
    /// Metallic-roughness material of glTF.
    MATERIAL_PRINCIPLED = 4;
    /// Perfect mirror.
    MATERIAL_MIRROR = 5;
    /// Interface to a solid dielectric.
    MATERIAL_DIELECTRIC = 6;
    /// Thin pane of a dielectric.
    MATERIAL_THIN_DIELECTRIC = 7;
    /// Thin sheet that scatters light to both sides.
    MATERIAL_DIFFUSE_TRANSMISSION = 8;
    /// Metallic-roughness material below a clear coat.
    MATERIAL_COATED = 9;
    /// Metallic-roughness material below a sheen.
    MATERIAL_SHEEN = 10;
    /// Thin pane whose surfaces are rough.
    MATERIAL_ROUGH_PANE = 11;
    /// Bits `1 << kind` of the specular kinds, at which no sampler draws light.
    SPECULAR_KINDS = 1 << MATERIAL_MIRROR | 1 << MATERIAL_DIELECTRIC | 1 << MATERIAL_THIN_DIELECTRIC
        | 1 << MATERIAL_ROUGH_PANE;

    // Lamps.
    /// Marks a lamp without a surface in [`LampChoice::source`](super::structs::LampChoice::source).
    LAMP_BIT = 1 << 31;
    /// Shines from a point into all directions.
    LAMP_POINT = 0;
    /// Shines from a point into a cone; falls off as t², t linear in the cosine.
    LAMP_SPOT_SQUARED_COSINE = 1;
    /// The same, as 3t² − 2t³.
    LAMP_SPOT_SMOOTH_COSINE = 2;
    /// The same, linear in the angle.
    LAMP_SPOT_LINEAR_ANGLE = 3;
    /// Shines from infinitely far away.
    LAMP_DIRECTIONAL = 4;

    // Textures.
    /// Index of no texture.
    NO_TEXTURE = 0xffff_ffff;
    /// Mask of the format in `TextureUse::flags`, `TEXTURE_BYTES` to `TEXTURE_HALVES`.
    TEXTURE_FORMAT_MASK = 3;
    /// A word a texel: four numbers of 8 bits, 255 for one.
    TEXTURE_BYTES = 0;
    /// Two words a texel: four numbers of 16 bits, 65,535 for one.
    TEXTURE_SHORTS = 1;
    /// Two words a texel: four halves.
    TEXTURE_HALVES = 2;
    /// Flag of colours that follow IEC 61966-2-1.
    TEXTURE_SRGB = 4;
    /// Flag of a texture without interpolation.
    TEXTURE_NEAREST = 8;
    /// Flag of a texture on the second set of coordinates.
    TEXTURE_SECOND_UVS = 16;
    /// First bit of the continuation along u, two bits: `TEXTURE_REPEAT` to `TEXTURE_CLAMP`.
    TEXTURE_WRAP_U_SHIFT = 5;
    /// First bit of the continuation along v.
    TEXTURE_WRAP_V_SHIFT = 7;
    /// First bit of the channel, three bits: 0 for all, 1 to 4 for red, green, blue or opacity alone.
    TEXTURE_CHANNEL_SHIFT = 9;
    /// Repeats the image.
    TEXTURE_REPEAT = 0;
    /// Repeats the image, every second time mirrored.
    TEXTURE_MIRROR = 1;
    /// Repeats the texels of the edge.
    TEXTURE_CLAMP = 2;

    // Bits of `CONSTANT_ATTRIBUTES`, in the order in which a corner has them, two words each.
    /// First set of texture coordinates: two floats.
    ATTRIBUTE_FIRST_UVS = 1;
    /// Second set: two floats.
    ATTRIBUTE_SECOND_UVS = 2;
    /// Tangent by the octahedral map, or `FLAT_NORMAL` for none; sign of the bitangent, a float.
    ATTRIBUTE_TANGENT = 4;
    /// Colour and opacity: four numbers of 16 bits.
    ATTRIBUTE_COLOR = 8;

    // Bits of `MaterialSurface::flags`.
    /// Vertex colours are a factor of colour and opacity.
    SURFACE_VERTEX_COLOR = 1;
    /// The back reflects and transmits too.
    SURFACE_TWO_SIDED = 2;
    /// The back emits too.
    SURFACE_EMISSION_TWO_SIDED = 4;

    // Tables of materials; offsets are in words from `Material::table_offset`.
    /// Intervals of the tables over the cosine 0…1 of a direction with the normal; one more node.
    BRDF_COSINE_INTERVALS = 64;
    /// Nodes of such a table.
    BRDF_COSINE_NODES = BRDF_COSINE_INTERVALS + 1;
    /// Transmission of a plastic; the albedo of the coat is at 0.
    COAT_TRANSMISSION_OFFSET = BRDF_COSINE_NODES;
    /// Probability of sampling a plastic's coat.
    PLASTIC_SPECULAR_SHARE_OFFSET = COAT_TRANSMISSION_OFFSET + BRDF_COSINE_NODES;
    /// Intervals in the roughness √α of the albedo of all GGX surfaces with a Schlick reflectance.
    GGX_ROUGHNESS_INTERVALS = 16;
    /// Words of one roughness: factors of the reflectance at normal and at grazing incidence, by cosine.
    GGX_ROUGHNESS_WORDS = 2 * BRDF_COSINE_NODES;
    /// Mean rise of Schlick's reflectance over a diffuse base, by cosine; the albedo of GGX is at 0.
    DIFFUSE_RISE_OFFSET = (GGX_ROUGHNESS_INTERVALS + 1) * GGX_ROUGHNESS_WORDS;
    /// Bins of the measured grid in θ_h; the edge of bin k is at (k/90)²·90°.
    MEASURED_THETA_HALF_BINS = 90;
    /// Bins of the measured grid in θ_d, of equal width.
    MEASURED_THETA_DIFFERENCE_BINS = 90;
    /// Bins of the measured grid in φ_d, of equal width over 0…π.
    MEASURED_PHI_DIFFERENCE_BINS = 180;
    /// Bins of the outgoing polar angle in a measured material's sampling table, of equal width.
    MEASURED_ELEVATION_BINS = 32;
    /// Bins of θ_h in the sampling table; the edge of bin k is at (k/32)²·90°.
    MEASURED_POLAR_BINS = 32;
    /// Bins of |φ_h − φ_o| in the sampling table, of equal width over 0…π.
    MEASURED_AZIMUTH_BINS = 16;
    /// Cells of the sampling table for one outgoing elevation; a power of two.
    MEASURED_SAMPLING_CELLS = MEASURED_POLAR_BINS * MEASURED_AZIMUTH_BINS;
    /// Probability of the cosine lobe by elevation; the albedo is at 0.
    MEASURED_COSINE_SHARE_OFFSET = 3 * BRDF_COSINE_NODES;
    /// Cumulative probabilities of the sampling cells by elevation.
    MEASURED_CUMULATIVE_OFFSET = MEASURED_COSINE_SHARE_OFFSET + MEASURED_ELEVATION_BINS;
    /// Densities of the sampling cells by elevation, per steradian of half vectors.
    MEASURED_DENSITY_OFFSET = MEASURED_CUMULATIVE_OFFSET + MEASURED_ELEVATION_BINS * MEASURED_SAMPLING_CELLS;
    /// Grid cells, two words each: halves red and green, half blue.
    MEASURED_GRID_OFFSET = MEASURED_DENSITY_OFFSET + MEASURED_ELEVATION_BINS * MEASURED_SAMPLING_CELLS;
    /// Bins of φ_h in the turns of an anisotropic table, of equal width over −π…π from the tangent.
    MEASURED_TURN_BINS = 96;
    /// Bins of θ_d there, of equal width; those of θ_h are the grid's.
    MEASURED_TURN_THETA_DIFFERENCE_BINS = 8;
    /// Bins of φ_d there, of equal width over 0…π.
    MEASURED_TURN_PHI_DIFFERENCE_BINS = 16;
    /// Factors of the values by θ_h, θ_d, φ_h and φ_d, as cells of the grid, if the table is anisotropic.
    MEASURED_TURN_OFFSET = MEASURED_GRID_OFFSET
        + 2 * MEASURED_THETA_HALF_BINS * MEASURED_THETA_DIFFERENCE_BINS * MEASURED_PHI_DIFFERENCE_BINS;
    /// Lists of living paths: that of a vertex, the one before, which it is made from, and the next, which
    /// is emptied meanwhile; a power of two.
    PATH_LISTS = 4;

    // Values of `Wave::is_training` other than 0.
    /// The paths only teach the guide.
    TRAINING_WAVE = 1;
    /// The light of the paths is only compared.
    MEASURED_WAVE = 2;

    // Layers that the pass `show` shows.
    /// Mean radiance.
    SHOW_PICTURE = 0;
    /// Relative standard error, in false colour from 1% (blue) to 100% (red).
    SHOW_ERROR = 1;
    /// Albedo, as in the image's layer.
    SHOW_ALBEDO = 2;
    /// Shading normal, as in that layer, −1 to 1 as 0 to 1.
    SHOW_NORMAL = 3;
    /// Share of shadow rays that reached the environment.
    SHOW_VISIBLE = 4;
    /// Cells of the guide.
    SHOW_CELLS = 5;
    /// Kinds of these cells: of a face (red), coarse (green), fine (blue).
    SHOW_LEVELS = 6;

    // Tone curves of the pass `compose`: `film::Curve` in its order.
    /// None.
    CURVE_CLIP = 0;
    /// Reinhard et al. 2002.
    CURVE_REINHARD = 1;
    /// Narkowicz 2015.
    CURVE_FILMIC = 2;
}
