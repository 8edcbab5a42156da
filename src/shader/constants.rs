//! Numbers with one owner: `build.rs` hands each of these to the GLSL compiler as a macro of the
//! same name, so that host and shaders cannot differ.

/// Invocations of a workgroup along x; every pass is one-dimensional.
pub const WORKGROUP_SIZE: u32 = 64;

/// Descriptor set of the scene: constant during a render.
pub const SET_SCENE: u32 = 0;
/// Descriptor set of the SRBF tables (environment lobes, BRDF lobes).
pub const SET_SRBF: u32 = 1;
/// Descriptor set of per-invocation state, sized by the wave in flight.
pub const SET_WAVE: u32 = 2;
/// Descriptor set of the film.
pub const SET_FILM: u32 = 3;

/// Scene set: [`SceneParameters`](super::structs::SceneParameters), one element.
pub const BINDING_PARAMETERS: u32 = 0;
/// Scene set: CWBVH nodes, texels of four words, five to a node.
pub const BINDING_BVH_NODES: u32 = 1;
/// Scene set: triangle vertices in BVH order, texels of four words, three to a triangle; first page,
/// pages 1 to 3 follow.
pub const BINDING_TRIANGLES_0: u32 = 2;
/// Second page of triangles.
pub const BINDING_TRIANGLES_1: u32 = 3;
/// Third page of triangles.
pub const BINDING_TRIANGLES_2: u32 = 4;
/// Fourth page of triangles.
pub const BINDING_TRIANGLES_3: u32 = 5;
/// Scene set: material index per triangle in BVH order.
pub const BINDING_TRIANGLE_MATERIALS: u32 = 7;
/// Scene set: [`Material`](super::structs::Material) per material.
pub const BINDING_MATERIALS: u32 = 8;
/// Scene set: the materials again, texels of four words, four to a material.
pub const BINDING_MATERIAL_TEXELS: u32 = 13;
/// Scene set: 32-bit words of the BRDF tables; materials hold offsets into it.
pub const BINDING_BRDF_TABLE: u32 = 9;
/// Scene set: the same buffer as cells of four halves.
pub const BINDING_BRDF_CELLS: u32 = 6;
/// Scene set: radiance per texel of the environment map, the fourth component unused.
pub const BINDING_ENVIRONMENT_TEXELS: u32 = 10;
/// Scene set: cumulative probability over the rows of cells of the environment map.
pub const BINDING_ENVIRONMENT_ROWS: u32 = 11;
/// Scene set: cumulative probability over the cells of each row of the environment map.
pub const BINDING_ENVIRONMENT_CELLS: u32 = 12;

/// SRBF set: lobes of the environment in the world, largest integral first, texels of four floats:
/// bandwidth · axis and ln(amplitude) − bandwidth.
pub const BINDING_ENVIRONMENT_LOBES: u32 = 0;
/// SRBF set: lobes of BRDF · cosine by material and view, texels of four floats as for the environment,
/// in the frame of view and normal.
pub const BINDING_BRDF_LOBES: u32 = 1;
/// SRBF set: first lobe of each material and its lobes per view, texels of two words.
pub const BINDING_MATERIAL_LOBES: u32 = 2;
/// SRBF set: per cell and octave of light, visible rays and their c p_B / q in 256ths, since the last
/// rebuild.
pub const BINDING_GUIDE_SHARES: u32 = 3;
/// SRBF set: [`GuideParameters`](super::structs::GuideParameters), one element.
pub const BINDING_GUIDE_PARAMETERS: u32 = 4;
/// SRBF set: hash table from keys to cells of the scene, texels of two words: key, index of the cell.
pub const BINDING_GUIDE_TABLE: u32 = 5;
/// SRBF set: what is known of each cell and region, texels of two words (see `guide::decode_entry`).
pub const BINDING_GUIDE_ENTRIES: u32 = 6;
/// SRBF set: regions of the environment, texels of four words: first entry of the alias table,
/// columns, rows, first column and 65,536 times first row.
pub const BINDING_GUIDE_REGIONS: u32 = 7;
/// SRBF set: alias tables over the cells of each region, texels of two words: threshold, alias.
pub const BINDING_GUIDE_ALIASES: u32 = 8;
/// SRBF set: region of every cell of the environment, 16 bits each.
pub const BINDING_GUIDE_REGION_OF_CELL: u32 = 9;
/// SRBF set: rays traced and rays visible per cell and region since the last rebuild.
pub const BINDING_GUIDE_COUNTS: u32 = 10;
/// SRBF set: keys of the cells that a pass missed.
pub const BINDING_GUIDE_WANTED: u32 = 11;
/// SRBF set: two words per shadow ray: index into the counts, or `NOTHING_TO_LEARN`; octave of its
/// light, from bit `LEARN_FROM_BRDF_SHIFT` on c p_B / q in 256ths (see `guide::ShareEvidence`) or
/// `NO_SHARE_TO_LEARN`, from bit `LEARN_RESPONSE_SHIFT` on its response in units of 1 /
/// `GUIDE_RESPONSE_UNITS`.
pub const BINDING_LEARN_TARGETS: u32 = 12;
/// SRBF set: the likeliest regions of each cell, texels of four words (see
/// `guide::LikelyRegion`).
pub const BINDING_GUIDE_LIKELY: u32 = 13;
/// SRBF set: [`PathCell`](super::structs::PathCell) per path.
pub const BINDING_GUIDE_PATH_CELLS: u32 = 14;
/// SRBF set: per cell and direction the light that is believed to arrive by way of surfaces, relative to
/// the mean of the cell's directions, texels of one float.
pub const BINDING_GUIDE_ARRIVING: u32 = 15;
/// SRBF set: per cell the light that it reflects of what it learned, in whole units, texels of one word.
pub const BINDING_GUIDE_REFLECTED: u32 = 16;
/// SRBF set: per cell and direction, bounce rays and the sum of the light where they arrived, since the
/// last rebuild.
pub const BINDING_GUIDE_ARRIVALS: u32 = 17;

/// Wave set: [`Ray`](super::structs::Ray) per path, the next one to trace.
pub const BINDING_RAYS: u32 = 0;
/// Wave set: [`Hit`](super::structs::Hit) per path.
pub const BINDING_HITS: u32 = 1;
/// Wave set: [`ShadowRay`](super::structs::ShadowRay) per path and direction.
pub const BINDING_SHADOW_RAYS: u32 = 2;
/// Wave set: 1 where the shadow ray reaches the environment, 0 where it is blocked.
pub const BINDING_VISIBILITY: u32 = 3;
/// Wave set: [`PathState`](super::structs::PathState) per path.
pub const BINDING_PATHS: u32 = 4;

/// Wave set: the rays again, texels of four words, two to a ray.
pub const BINDING_RAY_TEXELS: u32 = 5;
/// Wave set: the hits again, texels of four words, three to a hit.
pub const BINDING_HIT_TEXELS: u32 = 6;
/// Wave set: the shadow rays again, texels of two words, three to a shadow ray.
pub const BINDING_SHADOW_RAY_TEXELS: u32 = 7;

/// Wave set: lobes of the product, lobe `l` of path `i` at `l · path_count + i` (see `product.glsl`).
pub const BINDING_LOBES: u32 = 8;
/// Wave set: the lobes again, texels of two words.
pub const BINDING_LOBE_TEXELS: u32 = 9;
/// Wave set: lobes kept per path.
pub const BINDING_LOBE_COUNTS: u32 = 10;
/// Wave set: sums of the weights in force of the lobes of a path, from the first one to every
/// [`LOBES_PER_SUM`]th and to the last, sum `s` of path `i` at `s · path_count + i`.
pub const BINDING_LOBE_SUMS: u32 = 11;
/// Wave set: a bit for every lobe that a cached direction is close to, one word of 32 lobes per path
/// after the other (see `close_lobes_index` in `product.glsl`).
pub const BINDING_CLOSE_LOBES: u32 = 12;
/// Wave set: visibility caches, a head and `CACHE_CAPACITY` directions each, by path or by pixel of the
/// film.
pub const BINDING_CACHE: u32 = 13;
/// Wave set: the bits of close lobes again, texels of one word.
pub const BINDING_CLOSE_LOBE_TEXELS: u32 = 14;
/// Wave set: the sums of weights again, texels of one float.
pub const BINDING_LOBE_SUM_TEXELS: u32 = 15;

/// Lobes between two sums of their weights; a power of two up to 32.
pub const LOBES_PER_SUM: u32 = 16;

/// Film set: leading part of Σ radiance per pixel.
pub const BINDING_FILM_SUM: u32 = 0;
/// Film set: rest of Σ radiance per pixel.
pub const BINDING_FILM_COMPENSATION: u32 = 1;
/// Film set: Σ radiance² per pixel.
pub const BINDING_FILM_SQUARES: u32 = 2;
/// Film set: [`Counters`](super::structs::Counters), one element.
pub const BINDING_COUNTERS: u32 = 3;
/// Film set: Σ albedo at the first hit.
pub const BINDING_FILM_ALBEDO: u32 = 4;
/// Film set: Σ shading normal at the first hit.
pub const BINDING_FILM_NORMAL: u32 = 5;
/// Film set: Σ position of the first hit.
pub const BINDING_FILM_POSITION: u32 = 6;
/// Film set: shadow rays visible and traced per pixel.
pub const BINDING_FILM_VISIBLE: u32 = 7;
/// Film set: entries in the visibility caches and hits with such a cache, per pixel.
pub const BINDING_FILM_CACHE_ENTRIES: u32 = 8;
/// Film set: Σ colour of the guide's cell at the first hit.
pub const BINDING_FILM_GUIDE_CELL: u32 = 9;
/// Film set: number of first hits whose cell was that of its face, a coarse one, a fine one.
pub const BINDING_FILM_GUIDE_LEVEL: u32 = 10;

/// Specialization constant of the passes that traverse: pages of triangles in use.
pub const CONSTANT_TRIANGLE_PAGES: u32 = 0;
/// Specialization constant: base-2 logarithm of the triangles per page.
pub const CONSTANT_TRIANGLE_PAGE_SHIFT: u32 = 1;
/// Specialization constant: rays that one invocation traces, 1 to 32.
pub const CONSTANT_RAYS_PER_INVOCATION: u32 = 2;
/// Specialization constant: lanes of a subgroup that have finished when they take their next rays.
pub const CONSTANT_REFILL_LANES: u32 = 3;
/// Specialization constant of `sample`: which sampler, `SAMPLER_…`.
pub const CONSTANT_SAMPLER: u32 = 16;
/// Specialization constant of `sample`: candidates per shadow ray.
pub const CONSTANT_CANDIDATES: u32 = 17;
/// Specialization constant of `sample_guided`: candidates from the BRDF among the candidates.
pub const CONSTANT_BRDF_CANDIDATES: u32 = 24;
/// Specialization constant of `sample_guided`: 1 weights the likeliest regions of a cell with the BRDF
/// at every hit.
pub const CONSTANT_PRODUCT_WEIGHTS: u32 = 25;
/// Specialization constant of `bounce_guided`: directions from the BRDF that one is chosen from.
pub const CONSTANT_BOUNCE_CANDIDATES: u32 = 26;
/// Specialization constant of `bounce` and `bounce_guided`: first vertex at which russian roulette may end a path.
pub const CONSTANT_ROULETTE_VERTEX: u32 = 18;
/// Specialization constant of the passes that evaluate materials: bit `1 << kind` for every kind that
/// the scene has. Devices that run both sides of a branch save the kinds that it has not.
pub const CONSTANT_MATERIAL_KINDS: u32 = 19;
/// Specialization constant of `product`: lobes of the environment.
pub const CONSTANT_ENVIRONMENT_LOBES: u32 = 32;
/// Specialization constant of `product`, bits of a float: logarithm of the largest integral of an
/// environment lobe over 2π, or of the largest amplitude.
pub const CONSTANT_STRONGEST_ENVIRONMENT_LOBE: u32 = 46;
/// Specialization constant of `product`: most lobes of a material in one view.
pub const CONSTANT_BRDF_LOBES: u32 = 33;
/// Specialization constant of `product`: view elevations of a BRDF fit.
pub const CONSTANT_VIEWS: u32 = 34;
/// Specialization constant of `product`: most lobes kept at a hit.
pub const CONSTANT_KEPT_LOBES: u32 = 35;
/// Specialization constant of `product`: 1 keeps lobes by coefficient instead of integral.
pub const CONSTANT_ORDER_BY_COEFFICIENT: u32 = 36;
/// Specialization constant of `product`, bits of a float: τ, closeness in deviations of a lobe.
pub const CONSTANT_THRESHOLD_SCALE: u32 = 37;
/// Specialization constant of `product`: 1 uses one closeness for lobes of all bandwidths.
pub const CONSTANT_FIXED_THRESHOLD: u32 = 38;
/// Specialization constant of `sample_lobes`, bits of a float: share of directions from the BRDF.
pub const CONSTANT_BRDF_SHARE: u32 = 39;
/// Specialization constant of `sample_lobes`, bits of a float: share from the environment map.
pub const CONSTANT_ENVIRONMENT_SHARE: u32 = 40;
/// Specialization constant of `sample_lobes`: 1 draws elevations by a random walk, which is biased.
pub const CONSTANT_METROPOLIS: u32 = 41;
/// Specialization constant: directions that a visibility cache holds; 0 where there is none.
pub const CONSTANT_CACHE_CAPACITY: u32 = 42;
/// Specialization constant: 1 keeps a cache for all samples of a pixel, 0 for one hit.
pub const CONSTANT_CACHE_OF_PIXEL: u32 = 43;
/// Specialization constant of `cache`: 1 records visible directions too.
pub const CONSTANT_COUNT_VISIBLE: u32 = 44;
/// Specialization constant of `cdf`, bits of a float: k of V = (1 / (1 + Num))^k.
pub const CONSTANT_VISIBILITY_EXPONENT: u32 = 45;
/// Entries of the traversal stack; one group of nodes per level of the tree is stacked.
pub const BVH_STACK_ENTRIES: u32 = 32;
/// Steps of traversal that one invocation may take for all its rays; Mesa 22.3 silently ends the
/// loops of an invocation after 65,535 iterations in all, and two loops count every step here.
pub const TRAVERSAL_STEP_LIMIT: u32 = 30_000;
/// Packed normal of the vertices of a flat triangle, which no unit vector packs to.
pub const FLAT_NORMAL: u32 = 0x8000_8000;

/// Bit of [`Wave::aovs`](super::structs::Wave::aovs): write albedo.
pub const AOV_ALBEDO: u32 = 1;
/// Bit of `Wave::aovs`: write the shading normal.
pub const AOV_NORMAL: u32 = 2;
/// Bit of `Wave::aovs`: write the position.
pub const AOV_POSITION: u32 = 4;
/// Bit of `Wave::aovs`: write visible and traced shadow rays.
pub const AOV_VISIBLE: u32 = 8;
/// Bit of `Wave::aovs`: write how full the visibility caches are.
pub const AOV_CACHE_ENTRIES: u32 = 16;
/// Bit of `Wave::aovs`: write the guide's cells.
pub const AOV_GUIDE_CELL: u32 = 32;

/// Specialization constant `SAMPLER`: uniform over the hemisphere.
pub const SAMPLER_UNIFORM: u32 = 0;
/// Proportional to the cosine.
pub const SAMPLER_COSINE: u32 = 1;
/// The BRDF's own sampling.
pub const SAMPLER_BRDF: u32 = 2;
/// The environment map's luminance.
pub const SAMPLER_ENV: u32 = 3;
/// BRDF and environment by turns, one-sample balance heuristic.
pub const SAMPLER_MIS: u32 = 4;
/// Resampling over the candidates of `mis`.
pub const SAMPLER_RIS: u32 = 5;

/// Lobes of the product of environment and BRDF.
pub const SAMPLER_PRODUCT: u32 = 6;
/// The same with a visibility cache per hit.
pub const SAMPLER_VISIBILITY: u32 = 7;
/// Learned visibility; a shader of its own.
pub const SAMPLER_GUIDED: u32 = 8;

/// Slots of the hash table of cells that are looked at for one key.
pub const GUIDE_PROBES: u32 = 8;
/// Regions of a cell that are weighted with the BRDF; a power of two.
pub const GUIDE_LIKELY_REGIONS: u32 = 16;
/// Levels of the visibility in an entry.
pub const GUIDE_VISIBILITY_LEVELS: u32 = 64;
/// Octaves of light by which rays are counted for the share of the BRDF, from 2^-32 on.
pub const GUIDE_SHARE_OCTAVES: u32 = 64;
/// First bit of a cell's share of the BRDF in the hash table, 256ths.
pub const GUIDE_SHARE_SHIFT: u32 = 24;
/// Bit in the hash table of a cell whose parts may be cells; below it is the cell's index.
pub const GUIDE_REFINED: u32 = 1 << 23;
/// Key of no cell.
pub const GUIDE_NO_KEY: u32 = 0xffff_ffff;
/// Learning target of a shadow ray that teaches nothing.
pub const NOTHING_TO_LEARN: u32 = 0xffff_ffff;

/// What a shadow ray that was not drawn from one of two techniques teaches about the share of the BRDF.
pub const NO_SHARE_TO_LEARN: u32 = 0x1ff;
/// First bit of what a shadow ray teaches about the share of the BRDF, 9 bits.
pub const LEARN_FROM_BRDF_SHIFT: u32 = 8;
/// First bit of the response of a shadow ray.
pub const LEARN_RESPONSE_SHIFT: u32 = 17;
/// A response of 1, in the whole numbers that are summed: two million rays of the greatest response fit a
/// word between two rebuilds.
pub const GUIDE_RESPONSE_UNITS: u32 = 4096;
/// Greatest response of one ray in those units, a half: what is reflected more strongly than that is the
/// peak of a lobe, which the BRDF's own sampling finds, and few cells have one for all of their surfaces.
pub const GUIDE_RESPONSE_MOST: u32 = 2048;
/// Samples after a rebuild whose rays are all counted.
pub const GUIDE_SAMPLES_THAT_ALL_TEACH: u32 = 16;
/// Of the samples after those, one in as many is counted.
pub const GUIDE_TEACHING_STEP: u32 = 4;
/// Directions along each side of the square of those that cells tell apart for arriving light.
pub const GUIDE_ARRIVAL_SIDE: u32 = 12;
/// Words of a cell per region that are counted: trials, hits and the responses of the hits.
pub const GUIDE_COUNT_WORDS: u32 = 3;

/// [`Hit::material`](super::structs::Hit::material) of a ray that left the scene or was not traced.
pub const NO_MATERIAL: u32 = 0xffff_ffff;

/// [`Material::kind`](super::structs::Material::kind): Lambertian.
pub const MATERIAL_DIFFUSE: u32 = 0;
/// Dielectric coat over a diffuse base.
pub const MATERIAL_PLASTIC: u32 = 1;
/// Conductor.
pub const MATERIAL_CONDUCTOR: u32 = 2;
/// Tabulated measurement.
pub const MATERIAL_MEASURED: u32 = 3;

/// Intervals of the tables over the cosine 0…1 of a direction with the normal; one more node.
pub const BRDF_COSINE_INTERVALS: u32 = 64;
/// Nodes of such a table.
pub const BRDF_COSINE_NODES: u32 = BRDF_COSINE_INTERVALS + 1;
/// First word of a plastic's transmission table, from its `table_offset`; the albedo is at 0.
pub const PLASTIC_TRANSMISSION_OFFSET: u32 = 3 * BRDF_COSINE_NODES;
/// First word of a plastic's probability of sampling the coat.
pub const PLASTIC_SPECULAR_SHARE_OFFSET: u32 = PLASTIC_TRANSMISSION_OFFSET + BRDF_COSINE_NODES;

/// Bins of the measured grid in θ_h; the edge of bin k is at (k/90)²·90°.
pub const MEASURED_THETA_HALF_BINS: u32 = 90;
/// Bins of the measured grid in θ_d, of equal width.
pub const MEASURED_THETA_DIFFERENCE_BINS: u32 = 90;
/// Bins of the measured grid in φ_d, of equal width over 0…π.
pub const MEASURED_PHI_DIFFERENCE_BINS: u32 = 180;
/// Bins of the outgoing polar angle in a measured material's sampling table, of equal width.
pub const MEASURED_ELEVATION_BINS: u32 = 32;
/// Bins of θ_h in a measured material's sampling table; the edge of bin k is at (k/32)²·90°.
pub const MEASURED_POLAR_BINS: u32 = 32;
/// Bins of |φ_h − φ_o| in a measured material's sampling table, of equal width over 0…π.
pub const MEASURED_AZIMUTH_BINS: u32 = 16;
/// Cells of the sampling table for one outgoing elevation; a power of two.
pub const MEASURED_SAMPLING_CELLS: u32 = MEASURED_POLAR_BINS * MEASURED_AZIMUTH_BINS;
/// First word of the probability of the cosine lobe by elevation, from `table_offset`; the albedo
/// is at 0.
pub const MEASURED_COSINE_SHARE_OFFSET: u32 = 3 * BRDF_COSINE_NODES;
/// First word of the cumulative probabilities of the sampling cells by elevation.
pub const MEASURED_CUMULATIVE_OFFSET: u32 = MEASURED_COSINE_SHARE_OFFSET + MEASURED_ELEVATION_BINS;
/// First word of the densities of the sampling cells by elevation, per steradian of half vectors.
pub const MEASURED_DENSITY_OFFSET: u32 =
    MEASURED_CUMULATIVE_OFFSET + MEASURED_ELEVATION_BINS * MEASURED_SAMPLING_CELLS;
/// First word of the grid cells, two words each: halves red and green, half blue.
pub const MEASURED_GRID_OFFSET: u32 =
    MEASURED_DENSITY_OFFSET + MEASURED_ELEVATION_BINS * MEASURED_SAMPLING_CELLS;

/// Names and values that become GLSL macros.
pub const SHADER_MACROS: &[(&str, u32)] = &[
    ("WORKGROUP_SIZE", WORKGROUP_SIZE),
    ("SET_SCENE", SET_SCENE),
    ("SET_SRBF", SET_SRBF),
    ("SET_WAVE", SET_WAVE),
    ("SET_FILM", SET_FILM),
    ("BINDING_PARAMETERS", BINDING_PARAMETERS),
    ("BINDING_BVH_NODES", BINDING_BVH_NODES),
    ("BINDING_TRIANGLES_0", BINDING_TRIANGLES_0),
    ("BINDING_TRIANGLES_1", BINDING_TRIANGLES_1),
    ("BINDING_TRIANGLES_2", BINDING_TRIANGLES_2),
    ("BINDING_TRIANGLES_3", BINDING_TRIANGLES_3),
    ("BINDING_TRIANGLE_MATERIALS", BINDING_TRIANGLE_MATERIALS),
    ("BINDING_MATERIALS", BINDING_MATERIALS),
    ("BINDING_MATERIAL_TEXELS", BINDING_MATERIAL_TEXELS),
    ("BINDING_BRDF_TABLE", BINDING_BRDF_TABLE),
    ("BINDING_BRDF_CELLS", BINDING_BRDF_CELLS),
    ("BINDING_ENVIRONMENT_TEXELS", BINDING_ENVIRONMENT_TEXELS),
    ("BINDING_ENVIRONMENT_ROWS", BINDING_ENVIRONMENT_ROWS),
    ("BINDING_ENVIRONMENT_CELLS", BINDING_ENVIRONMENT_CELLS),
    ("BINDING_RAYS", BINDING_RAYS),
    ("BINDING_HITS", BINDING_HITS),
    ("BINDING_SHADOW_RAYS", BINDING_SHADOW_RAYS),
    ("BINDING_VISIBILITY", BINDING_VISIBILITY),
    ("BINDING_PATHS", BINDING_PATHS),
    ("BINDING_RAY_TEXELS", BINDING_RAY_TEXELS),
    ("BINDING_HIT_TEXELS", BINDING_HIT_TEXELS),
    ("BINDING_SHADOW_RAY_TEXELS", BINDING_SHADOW_RAY_TEXELS),
    ("BINDING_FILM_SUM", BINDING_FILM_SUM),
    ("BINDING_FILM_COMPENSATION", BINDING_FILM_COMPENSATION),
    ("BINDING_FILM_SQUARES", BINDING_FILM_SQUARES),
    ("BINDING_COUNTERS", BINDING_COUNTERS),
    ("BINDING_FILM_ALBEDO", BINDING_FILM_ALBEDO),
    ("BINDING_FILM_NORMAL", BINDING_FILM_NORMAL),
    ("BINDING_FILM_POSITION", BINDING_FILM_POSITION),
    ("BINDING_FILM_VISIBLE", BINDING_FILM_VISIBLE),
    ("BINDING_FILM_CACHE_ENTRIES", BINDING_FILM_CACHE_ENTRIES),
    ("BINDING_FILM_GUIDE_CELL", BINDING_FILM_GUIDE_CELL),
    ("BINDING_FILM_GUIDE_LEVEL", BINDING_FILM_GUIDE_LEVEL),
    ("CONSTANT_TRIANGLE_PAGES", CONSTANT_TRIANGLE_PAGES),
    ("CONSTANT_TRIANGLE_PAGE_SHIFT", CONSTANT_TRIANGLE_PAGE_SHIFT),
    ("CONSTANT_RAYS_PER_INVOCATION", CONSTANT_RAYS_PER_INVOCATION),
    ("CONSTANT_REFILL_LANES", CONSTANT_REFILL_LANES),
    ("CONSTANT_SAMPLER", CONSTANT_SAMPLER),
    ("CONSTANT_CANDIDATES", CONSTANT_CANDIDATES),
    ("CONSTANT_ROULETTE_VERTEX", CONSTANT_ROULETTE_VERTEX),
    ("CONSTANT_MATERIAL_KINDS", CONSTANT_MATERIAL_KINDS),
    ("BVH_STACK_ENTRIES", BVH_STACK_ENTRIES),
    ("TRAVERSAL_STEP_LIMIT", TRAVERSAL_STEP_LIMIT),
    ("FLAT_NORMAL", FLAT_NORMAL),
    ("AOV_ALBEDO", AOV_ALBEDO),
    ("AOV_NORMAL", AOV_NORMAL),
    ("AOV_POSITION", AOV_POSITION),
    ("AOV_VISIBLE", AOV_VISIBLE),
    ("AOV_CACHE_ENTRIES", AOV_CACHE_ENTRIES),
    ("AOV_GUIDE_CELL", AOV_GUIDE_CELL),
    ("SAMPLER_UNIFORM", SAMPLER_UNIFORM),
    ("SAMPLER_COSINE", SAMPLER_COSINE),
    ("SAMPLER_BRDF", SAMPLER_BRDF),
    ("SAMPLER_ENV", SAMPLER_ENV),
    ("SAMPLER_MIS", SAMPLER_MIS),
    ("SAMPLER_RIS", SAMPLER_RIS),
    ("SAMPLER_GUIDED", SAMPLER_GUIDED),
    ("BINDING_ENVIRONMENT_LOBES", BINDING_ENVIRONMENT_LOBES),
    ("BINDING_BRDF_LOBES", BINDING_BRDF_LOBES),
    ("BINDING_MATERIAL_LOBES", BINDING_MATERIAL_LOBES),
    ("BINDING_LOBES", BINDING_LOBES),
    ("BINDING_LOBE_TEXELS", BINDING_LOBE_TEXELS),
    ("BINDING_LOBE_COUNTS", BINDING_LOBE_COUNTS),
    ("BINDING_LOBE_SUMS", BINDING_LOBE_SUMS),
    ("BINDING_CLOSE_LOBES", BINDING_CLOSE_LOBES),
    ("BINDING_CACHE", BINDING_CACHE),
    ("BINDING_CLOSE_LOBE_TEXELS", BINDING_CLOSE_LOBE_TEXELS),
    ("BINDING_LOBE_SUM_TEXELS", BINDING_LOBE_SUM_TEXELS),
    ("LOBES_PER_SUM", LOBES_PER_SUM),
    ("CONSTANT_ENVIRONMENT_LOBES", CONSTANT_ENVIRONMENT_LOBES),
    ("CONSTANT_STRONGEST_ENVIRONMENT_LOBE", CONSTANT_STRONGEST_ENVIRONMENT_LOBE),
    ("CONSTANT_BRDF_LOBES", CONSTANT_BRDF_LOBES),
    ("CONSTANT_VIEWS", CONSTANT_VIEWS),
    ("CONSTANT_KEPT_LOBES", CONSTANT_KEPT_LOBES),
    ("CONSTANT_ORDER_BY_COEFFICIENT", CONSTANT_ORDER_BY_COEFFICIENT),
    ("CONSTANT_THRESHOLD_SCALE", CONSTANT_THRESHOLD_SCALE),
    ("CONSTANT_FIXED_THRESHOLD", CONSTANT_FIXED_THRESHOLD),
    ("CONSTANT_BRDF_SHARE", CONSTANT_BRDF_SHARE),
    ("CONSTANT_ENVIRONMENT_SHARE", CONSTANT_ENVIRONMENT_SHARE),
    ("CONSTANT_METROPOLIS", CONSTANT_METROPOLIS),
    ("CONSTANT_CACHE_CAPACITY", CONSTANT_CACHE_CAPACITY),
    ("CONSTANT_CACHE_OF_PIXEL", CONSTANT_CACHE_OF_PIXEL),
    ("CONSTANT_COUNT_VISIBLE", CONSTANT_COUNT_VISIBLE),
    ("CONSTANT_VISIBILITY_EXPONENT", CONSTANT_VISIBILITY_EXPONENT),
    ("SAMPLER_PRODUCT", SAMPLER_PRODUCT),
    ("SAMPLER_VISIBILITY", SAMPLER_VISIBILITY),
    ("NO_MATERIAL", NO_MATERIAL),
    ("MATERIAL_DIFFUSE", MATERIAL_DIFFUSE),
    ("MATERIAL_PLASTIC", MATERIAL_PLASTIC),
    ("MATERIAL_CONDUCTOR", MATERIAL_CONDUCTOR),
    ("MATERIAL_MEASURED", MATERIAL_MEASURED),
    ("BRDF_COSINE_INTERVALS", BRDF_COSINE_INTERVALS),
    ("BRDF_COSINE_NODES", BRDF_COSINE_NODES),
    ("PLASTIC_TRANSMISSION_OFFSET", PLASTIC_TRANSMISSION_OFFSET),
    ("PLASTIC_SPECULAR_SHARE_OFFSET", PLASTIC_SPECULAR_SHARE_OFFSET),
    ("MEASURED_THETA_HALF_BINS", MEASURED_THETA_HALF_BINS),
    ("MEASURED_THETA_DIFFERENCE_BINS", MEASURED_THETA_DIFFERENCE_BINS),
    ("MEASURED_PHI_DIFFERENCE_BINS", MEASURED_PHI_DIFFERENCE_BINS),
    ("MEASURED_ELEVATION_BINS", MEASURED_ELEVATION_BINS),
    ("MEASURED_POLAR_BINS", MEASURED_POLAR_BINS),
    ("MEASURED_AZIMUTH_BINS", MEASURED_AZIMUTH_BINS),
    ("MEASURED_SAMPLING_CELLS", MEASURED_SAMPLING_CELLS),
    ("MEASURED_COSINE_SHARE_OFFSET", MEASURED_COSINE_SHARE_OFFSET),
    ("MEASURED_CUMULATIVE_OFFSET", MEASURED_CUMULATIVE_OFFSET),
    ("MEASURED_DENSITY_OFFSET", MEASURED_DENSITY_OFFSET),
    ("MEASURED_GRID_OFFSET", MEASURED_GRID_OFFSET),
    ("BINDING_GUIDE_PARAMETERS", BINDING_GUIDE_PARAMETERS),
    ("BINDING_GUIDE_TABLE", BINDING_GUIDE_TABLE),
    ("BINDING_GUIDE_ENTRIES", BINDING_GUIDE_ENTRIES),
    ("BINDING_GUIDE_REGIONS", BINDING_GUIDE_REGIONS),
    ("BINDING_GUIDE_ALIASES", BINDING_GUIDE_ALIASES),
    ("BINDING_GUIDE_REGION_OF_CELL", BINDING_GUIDE_REGION_OF_CELL),
    ("BINDING_GUIDE_COUNTS", BINDING_GUIDE_COUNTS),
    ("BINDING_GUIDE_WANTED", BINDING_GUIDE_WANTED),
    ("BINDING_LEARN_TARGETS", BINDING_LEARN_TARGETS),
    ("BINDING_GUIDE_LIKELY", BINDING_GUIDE_LIKELY),
    ("BINDING_GUIDE_PATH_CELLS", BINDING_GUIDE_PATH_CELLS),
    ("BINDING_GUIDE_ARRIVING", BINDING_GUIDE_ARRIVING),
    ("BINDING_GUIDE_REFLECTED", BINDING_GUIDE_REFLECTED),
    ("BINDING_GUIDE_ARRIVALS", BINDING_GUIDE_ARRIVALS),
    ("CONSTANT_BOUNCE_CANDIDATES", CONSTANT_BOUNCE_CANDIDATES),
    ("BINDING_GUIDE_SHARES", BINDING_GUIDE_SHARES),
    ("CONSTANT_BRDF_CANDIDATES", CONSTANT_BRDF_CANDIDATES),
    ("CONSTANT_PRODUCT_WEIGHTS", CONSTANT_PRODUCT_WEIGHTS),
    ("GUIDE_PROBES", GUIDE_PROBES),
    ("GUIDE_LIKELY_REGIONS", GUIDE_LIKELY_REGIONS),
    ("GUIDE_VISIBILITY_LEVELS", GUIDE_VISIBILITY_LEVELS),
    ("GUIDE_SHARE_OCTAVES", GUIDE_SHARE_OCTAVES),
    ("GUIDE_SHARE_SHIFT", GUIDE_SHARE_SHIFT),
    ("GUIDE_REFINED", GUIDE_REFINED),
    ("NO_SHARE_TO_LEARN", NO_SHARE_TO_LEARN),
    ("LEARN_FROM_BRDF_SHIFT", LEARN_FROM_BRDF_SHIFT),
    ("LEARN_RESPONSE_SHIFT", LEARN_RESPONSE_SHIFT),
    ("GUIDE_RESPONSE_UNITS", GUIDE_RESPONSE_UNITS),
    ("GUIDE_RESPONSE_MOST", GUIDE_RESPONSE_MOST),
    ("GUIDE_COUNT_WORDS", GUIDE_COUNT_WORDS),
    ("GUIDE_ARRIVAL_SIDE", GUIDE_ARRIVAL_SIDE),
    ("GUIDE_SAMPLES_THAT_ALL_TEACH", GUIDE_SAMPLES_THAT_ALL_TEACH),
    ("GUIDE_TEACHING_STEP", GUIDE_TEACHING_STEP),
    ("GUIDE_NO_KEY", GUIDE_NO_KEY),
    ("NOTHING_TO_LEARN", NOTHING_TO_LEARN),
];
