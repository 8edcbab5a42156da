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

constants! {
    /// Invocations of a workgroup along x; every pass is one-dimensional.
    WORKGROUP_SIZE = 64;

    // Specialization constants of `trace`, `shadow` and, but for the last two, `sample_and_trace`.
    /// Number of triangle pages in use.
    CONSTANT_TRIANGLE_PAGES = 0;
    /// Base-2 logarithm of the triangles per page.
    CONSTANT_TRIANGLE_PAGE_SHIFT = 1;
    /// Rays that one invocation traces, 1 to 32.
    CONSTANT_RAYS_PER_INVOCATION = 2;
    /// Finished lanes of a subgroup at which they take their next rays.
    CONSTANT_REFILL_LANES = 3;

    // Specialization constants of the passes that read textures.
    /// Number of pages of texels in use.
    CONSTANT_TEXTURE_PAGES = 4;
    /// Base-2 logarithm of the words per page of texels.
    CONSTANT_TEXTURE_PAGE_SHIFT = 5;
    /// Number of pages of triangle attributes in use.
    CONSTANT_ATTRIBUTE_PAGES = 6;
    /// Base-2 logarithm of the words per page of triangle attributes.
    CONSTANT_ATTRIBUTE_PAGE_SHIFT = 7;
    /// Bits `ATTRIBUTE_…` of the attributes that triangles have; 0 if the scene needs none.
    CONSTANT_ATTRIBUTES = 8;

    // Specialization constants of the sampling and bounce passes.
    /// Sampler of `sample`, `SAMPLER_…`.
    CONSTANT_SAMPLER = 16;
    /// Candidates per shadow ray in `sample` and `sample_guided`.
    CONSTANT_CANDIDATES = 17;
    /// Candidates of `sample_guided` from the BRDF, among all.
    CONSTANT_BRDF_CANDIDATES = 24;
    /// Directions from the BRDF that `bounce_guided` chooses from.
    CONSTANT_BOUNCE_CANDIDATES = 26;
    /// First vertex at which russian roulette may end a path.
    CONSTANT_ROULETTE_VERTEX = 18;
    /// Throughput below which it may, a float.
    CONSTANT_ROULETTE_THROUGHPUT = 46;
    /// Bit `1 << kind` for every kind of material in the scene; saves devices that run both sides of a
    /// branch the others.
    CONSTANT_MATERIAL_KINDS = 19;
    /// Bits `SURFACES_…` of what the surfaces of the scene need.
    CONSTANT_SURFACES = 20;
    /// 1 lets only paths at specular surfaces go on: the ray after the last vertex.
    CONSTANT_ONLY_SPECULAR = 21;
    /// 1 samples the environment by its compensated density.
    CONSTANT_COMPENSATION = 27;
    /// Candidates of `sample_lamps` for its shadow ray.
    CONSTANT_LAMP_CANDIDATES = 22;

    // Specialization constant of the passes that share paths.
    /// Edge of a tile, pixels: 2, 4 or 8.
    CONSTANT_TILE_EDGE = 27;

    // Specialization constants of `multiply_lobes`.
    /// Lobes of the environment.
    CONSTANT_ENVIRONMENT_LOBES = 32;
    /// Largest number of lobes of a material in one view.
    CONSTANT_BRDF_LOBES = 33;
    /// View elevations of a BRDF fit.
    CONSTANT_VIEWS = 34;
    /// Largest number of lobes kept at a hit, in every pass over lobes.
    CONSTANT_KEPT_LOBES = 35;
    /// 1 keeps lobes by coefficient instead of integral.
    CONSTANT_ORDER_BY_COEFFICIENT = 36;
    /// Logarithm of an environment lobe's largest integral over 2π or largest amplitude, bits of a float.
    CONSTANT_STRONGEST_ENVIRONMENT_LOBE = 46;

    // Specialization constants of `sample_lobes` and `sample_and_trace`.
    /// Share of directions from the BRDF, bits of a float.
    CONSTANT_BRDF_SHARE = 39;
    /// Share of directions from the environment map, bits of a float.
    CONSTANT_ENVIRONMENT_SHARE = 40;
    /// 1 draws elevations by a random walk, which is biased.
    CONSTANT_METROPOLIS = 41;
    /// Density that directions from lobes are divided by, `READING_…`.
    CONSTANT_READING = 51;

    // Specialization constants of the passes over visibility caches.
    /// τ, closeness in deviations of a lobe, bits of a float.
    CONSTANT_THRESHOLD_SCALE = 37;
    /// 1 uses one closeness for lobes of all bandwidths.
    CONSTANT_FIXED_THRESHOLD = 38;
    /// Directions that a visibility cache holds; 0 without caches.
    CONSTANT_CACHE_CAPACITY = 42;
    /// 1 keeps a cache for all samples of a pixel, 0 for one hit.
    CONSTANT_CACHE_OF_PIXEL = 43;
    /// k of V = (1 / (1 + Num))^k, bits of a float.
    CONSTANT_VISIBILITY_EXPONENT = 45;

    // Specialization constants of `sample_portals`.
    /// Number of portals.
    CONSTANT_PORTALS = 47;
    /// Share of the portals among directions that are not from the BRDF, bits of a float.
    CONSTANT_PORTAL_SHARE = 48;

    // Specialization constants of the passes over nodes of the product.
    /// Base-2 logarithm of the nodes along each side of the square, at least 3.
    CONSTANT_HAAR_LEVEL = 49;
    /// The same of the texels of the environment, more than that of the nodes.
    CONSTANT_HAAR_DEPTH = 50;

    // Specialization constants of `sample_controlled` and `record_visibility`.
    /// Share of the expected visibility that is the control variate, bits of a float.
    CONSTANT_CONTROL_SHARE = 51;
    /// 1 chooses shadow rays where the records are in doubt, 0 by light alone.
    CONSTANT_CONTROL_CHOICE = 52;
    /// 1 rounds the expected visibility to a bit in the control variate.
    CONSTANT_CONTROL_BITS = 56;
    /// Bins of a record along each side of the square of directions.
    CONSTANT_RECORD_SIDE = 53;
    /// Edge of a record's cube per metre of distance to the camera, bits of a float.
    CONSTANT_RECORD_EDGE = 54;
    /// Largest edge of a record's cube, metres, bits of a float.
    CONSTANT_RECORD_LARGEST_EDGE = 55;

    // Specialization constants of `sample_tiles` and `count_tiles`.
    /// Number of tiles of the environment.
    CONSTANT_TILES = 57;
    /// 1 reads a sector at random among those around a hit, 0 the hit's own.
    CONSTANT_SECTOR_JITTER = 58;
    /// 1 draws all rays through tiles, for the pilot to learn from.
    CONSTANT_TILES_LEARN = 59;

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

    // Values of CONSTANT_READING.
    /// Density of all lobes with their weights in force.
    READING_MIXTURE = 0;
    /// Density of the chosen lobe; biased in practice.
    READING_CHOSEN_LOBE = 1;
    /// Density of the chosen lobe times its probability; biased.
    READING_CHOSEN_PAIR = 2;
    /// Density of all lobes with their weights before the cache lowered them; biased.
    READING_WEIGHTS_BEFORE = 3;

    // Bits of CONSTANT_SURFACES.
    /// Some surfaces reflect or transmit by paths alone: no light is sampled at them.
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

    // Bits of `Wave::aovs`: film layers to write.
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

    // Traversal.
    /// Entries of the traversal stack, one group of nodes per level of the tree.
    BVH_STACK_ENTRIES = 32;
    /// Traversal steps of an invocation for all its rays. Mesa 22.3 silently ends the loops of an
    /// invocation after 65,535 iterations in all, and two loops count every step here.
    TRAVERSAL_STEP_LIMIT = 30_000;
    /// Packed normal of the vertices of a flat triangle, which no unit vector packs to.
    FLAT_NORMAL = 0x8000_8000;
    /// [`Hit::material`](super::structs::Hit::material) where no light is sampled: the ray left the
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
    /// Bits `1 << kind` of the specular kinds, at which no light is sampled.
    SPECULAR_KINDS = 1 << MATERIAL_MIRROR | 1 << MATERIAL_DIELECTRIC | 1 << MATERIAL_THIN_DIELECTRIC;

    /// Bits `1 << kind` of the kinds with a base, whose light the pixels of a tile can share.
    KINDS_WITH_BASE = 1 << MATERIAL_DIFFUSE | 1 << MATERIAL_PLASTIC | 1 << MATERIAL_MEASURED
        | 1 << MATERIAL_PRINCIPLED;

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
    PLASTIC_TRANSMISSION_OFFSET = BRDF_COSINE_NODES;
    /// Probability of sampling a plastic's coat.
    PLASTIC_SPECULAR_SHARE_OFFSET = PLASTIC_TRANSMISSION_OFFSET + BRDF_COSINE_NODES;
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
    /// Factors of the separable base by cosine, three channels a node, square root of 1/sr.
    MEASURED_BASE_OFFSET = MEASURED_DENSITY_OFFSET + MEASURED_ELEVATION_BINS * MEASURED_SAMPLING_CELLS;
    /// Grid cells, two words each: halves red and green, half blue.
    MEASURED_GRID_OFFSET = MEASURED_BASE_OFFSET + 3 * BRDF_COSINE_NODES;

    /// Lists of living paths: that of a vertex, the one before, which it is made from, and the next, which
    /// is emptied meanwhile; a power of two.
    PATH_LISTS = 4;

    // Values of `Wave::is_training` other than 0.
    /// The paths only teach the guide.
    TRAINING_WAVE = 1;
    /// The light of the paths is only compared.
    MEASURED_WAVE = 2;

    // Lobes and learned visibility.
    /// Lobes between two sums of their weights; a power of two up to 32.
    LOBES_PER_SUM = 16;
    /// Slots probed for one key in the hash table of cells.
    GUIDE_PROBES = 8;
    /// Key of no cell.
    GUIDE_NO_KEY = 0xffff_ffff;
    /// First bit of a cell's share of the BRDF in the hash table, 256ths.
    GUIDE_SHARE_SHIFT = 24;
    /// Bit in the hash table of a cell whose parts may be cells; the cell's index is below it.
    GUIDE_REFINED = 1 << 23;
    /// Levels of the visibility in an entry.
    GUIDE_VISIBILITY_LEVELS = 64;
    /// Octaves of light by which rays are counted for the share of the BRDF, from 2^-32 on.
    GUIDE_SHARE_OCTAVES = 64;
    /// Words of a cell per region that are counted: trials, hits and the responses of the hits.
    GUIDE_COUNT_WORDS = 3;
    /// Fixed-point unit of a response: two million rays of the greatest one fit a word between rebuilds.
    GUIDE_RESPONSE_UNITS = 4096;
    /// Greatest response of one ray, a half: stronger reflection is the peak of a lobe, which the BRDF's
    /// own sampling finds, and few cells have one for all of their surfaces.
    GUIDE_RESPONSE_MOST = 2048;
    /// Samples after a rebuild whose rays are all counted.
    GUIDE_SAMPLES_THAT_ALL_TEACH = 16;
    /// After those, one in this many samples is counted.
    GUIDE_TEACHING_STEP = 4;
    /// Bins of arriving light along each side of the octahedral square.
    GUIDE_ARRIVAL_SIDE = 12;
    /// [`PathCell::cell`](super::structs::PathCell::cell) at a specular surface, which has no cell.
    SPECULAR_CELL = 0xffff_fffe;
    /// Learning target of a shadow ray that teaches nothing.
    NOTHING_TO_LEARN = 0xffff_ffff;
    /// Evidence for the share of the BRDF of a shadow ray that was not drawn from two techniques.
    NO_SHARE_TO_LEARN = 0x1ff;
    /// First bit of a shadow ray's evidence for the share of the BRDF, 9 bits.
    LEARN_FROM_BRDF_SHIFT = 8;
    /// First bit of the response of a shadow ray.
    LEARN_RESPONSE_SHIFT = 17;

    /// Visibility records; a power of two.
    VISIBILITY_RECORDS = 1 << 13;

    /// Parts in which probabilities of tiles are counted: single precision holds them exactly.
    TILE_SCALE = 1 << 24;
    /// Parts in which the squared cosine of a visible ray is counted.
    TILE_RESPONSE_UNITS = 64;

    // Layers that the pass `show` shows.
    /// Mean radiance.
    SHOW_PICTURE = 0;
    /// Relative standard error, in false colour from 1% (blue) to 100% (red).
    SHOW_ERROR = 1;
    /// Albedo at first hits.
    SHOW_ALBEDO = 2;
    /// Shading normal at first hits, −1 to 1 as 0 to 1.
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
