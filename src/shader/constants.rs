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
    /// Lobes between two sums of their weights; a power of two up to 32.
    LOBES_PER_SUM = 16;
    /// Specialization constant of the passes that traverse: pages of triangles in use.
    CONSTANT_TRIANGLE_PAGES = 0;
    /// Specialization constant: base-2 logarithm of the triangles per page.
    CONSTANT_TRIANGLE_PAGE_SHIFT = 1;
    /// Specialization constant: rays that one invocation traces, 1 to 32.
    CONSTANT_RAYS_PER_INVOCATION = 2;
    /// Specialization constant: lanes of a subgroup that have finished when they take their next rays.
    CONSTANT_REFILL_LANES = 3;
    /// Specialization constant of `sample`: which sampler, `SAMPLER_…`.
    CONSTANT_SAMPLER = 16;
    /// Specialization constant of `sample`: candidates per shadow ray.
    CONSTANT_CANDIDATES = 17;
    /// Specialization constant of `sample_guided`: candidates from the BRDF among the candidates.
    CONSTANT_BRDF_CANDIDATES = 24;
    /// Specialization constant of `bounce_guided`: directions from the BRDF that one is chosen from.
    CONSTANT_BOUNCE_CANDIDATES = 26;
    /// Specialization constant of `bounce` and `bounce_guided`: first vertex at which russian roulette may end a path.
    CONSTANT_ROULETTE_VERTEX = 18;
    /// Specialization constant of the passes that evaluate materials: bit `1 << kind` for every kind that
    /// the scene has. Devices that run both sides of a branch save the kinds that it has not.
    CONSTANT_MATERIAL_KINDS = 19;
    /// Specialization constant of `product`: lobes of the environment.
    CONSTANT_ENVIRONMENT_LOBES = 32;
    /// Specialization constant of `product`, bits of a float: logarithm of the largest integral of an
    /// environment lobe over 2π, or of the largest amplitude.
    CONSTANT_STRONGEST_ENVIRONMENT_LOBE = 46;
    /// Specialization constant of `product`: most lobes of a material in one view.
    CONSTANT_BRDF_LOBES = 33;
    /// Specialization constant of `product`: view elevations of a BRDF fit.
    CONSTANT_VIEWS = 34;
    /// Specialization constant of `product`: most lobes kept at a hit.
    CONSTANT_KEPT_LOBES = 35;
    /// Specialization constant of `product`: 1 keeps lobes by coefficient instead of integral.
    CONSTANT_ORDER_BY_COEFFICIENT = 36;
    /// Specialization constant of `product`, bits of a float: τ, closeness in deviations of a lobe.
    CONSTANT_THRESHOLD_SCALE = 37;
    /// Specialization constant of `product`: 1 uses one closeness for lobes of all bandwidths.
    CONSTANT_FIXED_THRESHOLD = 38;
    /// Specialization constant of `sample_lobes`, bits of a float: share of directions from the BRDF.
    CONSTANT_BRDF_SHARE = 39;
    /// Specialization constant of `sample_lobes`, bits of a float: share from the environment map.
    CONSTANT_ENVIRONMENT_SHARE = 40;
    /// Specialization constant of `sample_lobes`: 1 draws elevations by a random walk, which is biased.
    CONSTANT_METROPOLIS = 41;
    /// Specialization constant: directions that a visibility cache holds; 0 where there is none.
    CONSTANT_CACHE_CAPACITY = 42;
    /// Specialization constant: 1 keeps a cache for all samples of a pixel, 0 for one hit.
    CONSTANT_CACHE_OF_PIXEL = 43;
    /// Specialization constant of `cdf`, bits of a float: k of V = (1 / (1 + Num))^k.
    CONSTANT_VISIBILITY_EXPONENT = 45;
    /// Entries of the traversal stack; one group of nodes per level of the tree is stacked.
    BVH_STACK_ENTRIES = 32;
    /// Steps of traversal that one invocation may take for all its rays; Mesa 22.3 silently ends the
    /// loops of an invocation after 65,535 iterations in all, and two loops count every step here.
    TRAVERSAL_STEP_LIMIT = 30_000;
    /// Packed normal of the vertices of a flat triangle, which no unit vector packs to.
    FLAT_NORMAL = 0x8000_8000;
    /// Bit of [`Wave::aovs`](super::structs::Wave::aovs): write albedo.
    AOV_ALBEDO = 1;
    /// Bit of `Wave::aovs`: write the shading normal.
    AOV_NORMAL = 2;
    /// Bit of `Wave::aovs`: write the position.
    AOV_POSITION = 4;
    /// Bit of `Wave::aovs`: write visible and traced shadow rays.
    AOV_VISIBLE = 8;
    /// Bit of `Wave::aovs`: write how full the visibility caches are.
    AOV_CACHE_ENTRIES = 16;
    /// Bit of `Wave::aovs`: write the guide's cells.
    AOV_GUIDE_CELL = 32;
    /// Specialization constant `SAMPLER`: uniform over the hemisphere.
    SAMPLER_UNIFORM = 0;
    /// Proportional to the cosine.
    SAMPLER_COSINE = 1;
    /// The BRDF's own sampling.
    SAMPLER_BRDF = 2;
    /// The environment map's luminance.
    SAMPLER_ENV = 3;
    /// BRDF and environment by turns, one-sample balance heuristic.
    SAMPLER_MIS = 4;
    /// Resampling over the candidates of `mis`.
    SAMPLER_RIS = 5;
    /// Lobes of the product of environment and BRDF.
    SAMPLER_PRODUCT = 6;
    /// The same with a visibility cache per hit.
    SAMPLER_VISIBILITY = 7;
    /// Learned visibility; a shader of its own.
    SAMPLER_GUIDED = 8;
    /// Slots of the hash table of cells that are looked at for one key.
    GUIDE_PROBES = 8;
    /// Levels of the visibility in an entry.
    GUIDE_VISIBILITY_LEVELS = 64;
    /// Octaves of light by which rays are counted for the share of the BRDF, from 2^-32 on.
    GUIDE_SHARE_OCTAVES = 64;
    /// First bit of a cell's share of the BRDF in the hash table, 256ths.
    GUIDE_SHARE_SHIFT = 24;
    /// Bit in the hash table of a cell whose parts may be cells; below it is the cell's index.
    GUIDE_REFINED = 1 << 23;
    /// Key of no cell.
    GUIDE_NO_KEY = 0xffff_ffff;
    /// Learning target of a shadow ray that teaches nothing.
    NOTHING_TO_LEARN = 0xffff_ffff;
    /// What a shadow ray that was not drawn from one of two techniques teaches about the share of the BRDF.
    NO_SHARE_TO_LEARN = 0x1ff;
    /// First bit of what a shadow ray teaches about the share of the BRDF, 9 bits.
    LEARN_FROM_BRDF_SHIFT = 8;
    /// First bit of the response of a shadow ray.
    LEARN_RESPONSE_SHIFT = 17;
    /// A response of 1, in the whole numbers that are summed: two million rays of the greatest response fit a
    /// word between two rebuilds.
    GUIDE_RESPONSE_UNITS = 4096;
    /// Greatest response of one ray in those units, a half: what is reflected more strongly than that is the
    /// peak of a lobe, which the BRDF's own sampling finds, and few cells have one for all of their surfaces.
    GUIDE_RESPONSE_MOST = 2048;
    /// Samples after a rebuild whose rays are all counted.
    GUIDE_SAMPLES_THAT_ALL_TEACH = 16;
    /// Of the samples after those, one in as many is counted.
    GUIDE_TEACHING_STEP = 4;
    /// Directions along each side of the square of those that cells tell apart for arriving light.
    GUIDE_ARRIVAL_SIDE = 12;
    /// Words of a cell per region that are counted: trials, hits and the responses of the hits.
    GUIDE_COUNT_WORDS = 3;
    /// [`Hit::material`](super::structs::Hit::material) of a ray that left the scene or was not traced.
    NO_MATERIAL = 0xffff_ffff;
    /// [`Material::kind`](super::structs::Material::kind): Lambertian.
    MATERIAL_DIFFUSE = 0;
    /// Dielectric coat over a diffuse base.
    MATERIAL_PLASTIC = 1;
    /// Conductor.
    MATERIAL_CONDUCTOR = 2;
    /// Tabulated measurement.
    MATERIAL_MEASURED = 3;
    /// Intervals of the tables over the cosine 0…1 of a direction with the normal; one more node.
    BRDF_COSINE_INTERVALS = 64;
    /// Nodes of such a table.
    BRDF_COSINE_NODES = BRDF_COSINE_INTERVALS + 1;
    /// First word of a plastic's transmission table, from its `table_offset`; the albedo is at 0.
    PLASTIC_TRANSMISSION_OFFSET = 3 * BRDF_COSINE_NODES;
    /// First word of a plastic's probability of sampling the coat.
    PLASTIC_SPECULAR_SHARE_OFFSET = PLASTIC_TRANSMISSION_OFFSET + BRDF_COSINE_NODES;
    /// Bins of the measured grid in θ_h; the edge of bin k is at (k/90)²·90°.
    MEASURED_THETA_HALF_BINS = 90;
    /// Bins of the measured grid in θ_d, of equal width.
    MEASURED_THETA_DIFFERENCE_BINS = 90;
    /// Bins of the measured grid in φ_d, of equal width over 0…π.
    MEASURED_PHI_DIFFERENCE_BINS = 180;
    /// Bins of the outgoing polar angle in a measured material's sampling table, of equal width.
    MEASURED_ELEVATION_BINS = 32;
    /// Bins of θ_h in a measured material's sampling table; the edge of bin k is at (k/32)²·90°.
    MEASURED_POLAR_BINS = 32;
    /// Bins of |φ_h − φ_o| in a measured material's sampling table, of equal width over 0…π.
    MEASURED_AZIMUTH_BINS = 16;
    /// Cells of the sampling table for one outgoing elevation; a power of two.
    MEASURED_SAMPLING_CELLS = MEASURED_POLAR_BINS * MEASURED_AZIMUTH_BINS;
    /// First word of the probability of the cosine lobe by elevation, from `table_offset`; the albedo
    /// is at 0.
    MEASURED_COSINE_SHARE_OFFSET = 3 * BRDF_COSINE_NODES;
    /// First word of the cumulative probabilities of the sampling cells by elevation.
    MEASURED_CUMULATIVE_OFFSET = MEASURED_COSINE_SHARE_OFFSET + MEASURED_ELEVATION_BINS;
    /// First word of the densities of the sampling cells by elevation, per steradian of half vectors.
    MEASURED_DENSITY_OFFSET = MEASURED_CUMULATIVE_OFFSET + MEASURED_ELEVATION_BINS * MEASURED_SAMPLING_CELLS;
    /// First word of the grid cells, two words each: halves red and green, half blue.
    MEASURED_GRID_OFFSET = MEASURED_DENSITY_OFFSET + MEASURED_ELEVATION_BINS * MEASURED_SAMPLING_CELLS;
}
