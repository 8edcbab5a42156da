// Every struct and binding shared with the host: the twin of src/gpu/layout.rs, same names, same
// order. Bindings and tags are macros that build.rs defines from src/gpu/constants.rs.
//
// A shader defines NEEDS_<BUFFER> before it includes this file for every buffer it touches, with
// WRITES_<BUFFER> in addition where it writes; everything else is declared readonly, which
// synchronization validation relies on.

#ifndef LAYOUT_GLSL
#define LAYOUT_GLSL

#extension GL_EXT_scalar_block_layout : require

struct SceneParameters {
    vec3 camera_position;
    float camera_aperture_radius;
    vec3 camera_right;
    float camera_focus_distance;
    vec3 camera_up;
    float camera_tan_half_fov;
    vec3 camera_forward;
    uint film_width;
    uint film_height;
    uint crop_x;
    uint crop_y;
    uint crop_width;
    uint crop_height;
    uint film_filter;
    uint environment_width;
    uint environment_height;
    float environment_cos_rotation;
    float environment_sin_rotation;
    float environment_total;
};

struct Ray {
    vec3 origin;
    uint is_active;
    vec3 direction;
    uint reserved;
};

struct Hit {
    vec3 position;
    uint material;
    vec3 geometric_normal;
    float distance;
    vec3 shading_normal;
    uint triangle;
};

struct ShadowRay {
    vec3 direction;
    vec3 contribution;
};

struct PathState {
    vec3 throughput;
    vec3 radiance;
    uint shadow_rays_traced;
    uint shadow_rays_visible;
    uint rays_traced;
};

struct Counters {
    uint camera_rays;
    uint bounce_rays;
    uint shadow_rays_traced;
    uint shadow_rays_visible;
    uint dropped_samples;
    uint traversal_overruns;
    uint product_hits;
    uint lobes_kept;
    uint energy_kept;
    uint cache_entries;
    uint cdf_rebuilds;
};

struct Material {
    uint kind;
    uint table_offset;
    float alpha;
    float ior;
    vec3 reflectance;
    vec3 eta;
    vec3 k;
    vec3 reserved;
};

struct Wave {
    uint first_pixel;
    uint pixel_count;
    uint first_sample;
    uint sample_count;
    uint seed;
    uint vertex;
    uint shadow_ray_count;
    uint first_shadow_ray;
    uint total_shadow_rays;
    uint aovs;
    uint pixel_stride;
    uint is_training;
    uint epoch_seed;
    uint epoch_start;
};

struct GuideParameters {
    vec3 grid_origin;
    float finest_edge;
    float edge_per_distance;
    float largest_edge;
    uint region_count;
    uint table_mask;
    uint wanted_mask;
};

struct PathCell {
    uint cell;
    uint teaches;
};

#ifdef NEEDS_PARAMETERS
layout(scalar, set = SET_SCENE, binding = BINDING_PARAMETERS) readonly buffer ParametersBuffer {
    SceneParameters parameters;
};
#endif

// Geometry and the inputs of traversal are read through texel buffers: on lavapipe a texel of four
// words costs a fraction of four loads from a storage buffer (docs/traversal.md).
#ifdef NEEDS_GEOMETRY
layout(set = SET_SCENE, binding = BINDING_BVH_NODES) uniform usamplerBuffer bvh_nodes;
layout(set = SET_SCENE, binding = BINDING_TRIANGLES_0) uniform usamplerBuffer triangles_0;
layout(set = SET_SCENE, binding = BINDING_TRIANGLES_1) uniform usamplerBuffer triangles_1;
layout(set = SET_SCENE, binding = BINDING_TRIANGLES_2) uniform usamplerBuffer triangles_2;
layout(set = SET_SCENE, binding = BINDING_TRIANGLES_3) uniform usamplerBuffer triangles_3;
layout(scalar, set = SET_SCENE, binding = BINDING_TRIANGLE_MATERIALS)
    readonly buffer TriangleMaterialsBuffer {
    uint triangle_materials[];
};
#endif

#ifdef NEEDS_MATERIALS
layout(scalar, set = SET_SCENE, binding = BINDING_MATERIALS) readonly buffer MaterialsBuffer {
    Material materials[];
};
#endif

// The materials again, as texels of four words.
#ifdef NEEDS_MATERIAL_TEXELS
layout(set = SET_SCENE, binding = BINDING_MATERIAL_TEXELS) uniform usamplerBuffer material_texels;
Material load_material(uint index) {
    uvec4 first = texelFetch(material_texels, int(4u * index));
    uvec4 second = texelFetch(material_texels, int(4u * index + 1u));
    uvec4 third = texelFetch(material_texels, int(4u * index + 2u));
    uint last = texelFetch(material_texels, int(4u * index + 3u)).x;
    return Material(
        first.x, first.y, uintBitsToFloat(first.z), uintBitsToFloat(first.w),
        uintBitsToFloat(second.xyz), uintBitsToFloat(uvec3(second.w, third.xy)),
        uintBitsToFloat(uvec3(third.zw, last)), vec3(0.0));
}
#endif

#if defined(NEEDS_MATERIALS) || defined(NEEDS_MATERIAL_TEXELS)
// One buffer seen as floats, and as cells of four halves.
layout(set = SET_SCENE, binding = BINDING_BRDF_TABLE) uniform samplerBuffer brdf_table;
layout(set = SET_SCENE, binding = BINDING_BRDF_CELLS) uniform samplerBuffer brdf_cells;
#endif

#ifdef NEEDS_ENVIRONMENT
layout(set = SET_SCENE, binding = BINDING_ENVIRONMENT_TEXELS) uniform samplerBuffer
    environment_texels;
layout(set = SET_SCENE, binding = BINDING_ENVIRONMENT_ROWS) uniform samplerBuffer environment_rows;
layout(set = SET_SCENE, binding = BINDING_ENVIRONMENT_CELLS) uniform samplerBuffer
    environment_cells;
#endif

#if defined(NEEDS_GUIDE) || defined(NEEDS_GUIDE_COUNTS)
layout(scalar, set = SET_SRBF, binding = BINDING_GUIDE_PARAMETERS)
    readonly buffer GuideParametersBuffer {
    GuideParameters guide;
};
#endif

#ifdef NEEDS_GUIDE
layout(set = SET_SRBF, binding = BINDING_GUIDE_TABLE) uniform usamplerBuffer guide_table;
layout(set = SET_SRBF, binding = BINDING_GUIDE_ENTRIES) uniform usamplerBuffer guide_entries;
layout(set = SET_SRBF, binding = BINDING_GUIDE_REGIONS) uniform usamplerBuffer guide_regions;
layout(set = SET_SRBF, binding = BINDING_GUIDE_ALIASES) uniform usamplerBuffer guide_aliases;
layout(set = SET_SRBF, binding = BINDING_GUIDE_REGION_OF_CELL) uniform usamplerBuffer
    guide_region_of_cell;
layout(set = SET_SRBF, binding = BINDING_GUIDE_LIKELY) uniform usamplerBuffer guide_likely;
layout(scalar, set = SET_SRBF, binding = BINDING_GUIDE_WANTED) buffer GuideWantedBuffer {
    uint guide_wanted[];
};
#endif

#ifdef NEEDS_GUIDE_COUNTS
layout(scalar, set = SET_SRBF, binding = BINDING_GUIDE_COUNTS) buffer GuideCountsBuffer {
    uint guide_counts[];
};
layout(scalar, set = SET_SRBF, binding = BINDING_GUIDE_SHARES) buffer GuideSharesBuffer {
    uint guide_shares[];
};
#endif

#ifdef NEEDS_LEARN_TARGETS
#ifdef WRITES_LEARN_TARGETS
#define ACCESS_LEARN_TARGETS writeonly
#else
#define ACCESS_LEARN_TARGETS readonly
#endif
layout(scalar, set = SET_SRBF, binding = BINDING_LEARN_TARGETS)
    ACCESS_LEARN_TARGETS buffer LearnTargetsBuffer {
    uvec2 learn_targets[];
};
#endif

#ifdef NEEDS_ARRIVING
layout(set = SET_SRBF, binding = BINDING_GUIDE_ARRIVING) uniform samplerBuffer guide_arriving;
#endif

#ifdef NEEDS_ARRIVALS
layout(set = SET_SRBF, binding = BINDING_GUIDE_REFLECTED) uniform usamplerBuffer guide_reflected;
layout(scalar, set = SET_SRBF, binding = BINDING_GUIDE_ARRIVALS) buffer GuideArrivalsBuffer {
    uint guide_arrivals[];
};
#endif

#ifdef NEEDS_PATH_CELLS
#ifdef WRITES_PATH_CELLS
#define ACCESS_PATH_CELLS
#else
#define ACCESS_PATH_CELLS readonly
#endif
layout(scalar, set = SET_SRBF, binding = BINDING_GUIDE_PATH_CELLS)
    ACCESS_PATH_CELLS buffer PathCellsBuffer {
    PathCell path_cells[];
};
#endif

#ifdef NEEDS_RAYS
#ifdef WRITES_RAYS
#define ACCESS_RAYS
#else
#define ACCESS_RAYS readonly
#endif
layout(scalar, set = SET_WAVE, binding = BINDING_RAYS) ACCESS_RAYS buffer RaysBuffer {
    Ray rays[];
};
#endif

// The rays again, as texels of four words.
#ifdef NEEDS_RAY_TEXELS
layout(set = SET_WAVE, binding = BINDING_RAY_TEXELS) uniform usamplerBuffer ray_texels;
Ray load_ray(uint index) {
    uvec4 first = texelFetch(ray_texels, int(2u * index));
    uvec4 second = texelFetch(ray_texels, int(2u * index + 1u));
    return Ray(uintBitsToFloat(first.xyz), first.w, uintBitsToFloat(second.xyz), second.w);
}
#endif

#ifdef NEEDS_HITS
#ifdef WRITES_HITS
#define ACCESS_HITS writeonly
#else
#define ACCESS_HITS readonly
#endif
layout(scalar, set = SET_WAVE, binding = BINDING_HITS) ACCESS_HITS buffer HitsBuffer {
    Hit hits[];
};
#endif

// What a ray that starts at a hit needs to know of it, from texels of four words.
#ifdef NEEDS_HIT_TEXELS
layout(set = SET_WAVE, binding = BINDING_HIT_TEXELS) uniform usamplerBuffer hit_texels;
struct HitOrigin {
    vec3 position;
    uint material;
    vec3 geometric_normal;
};
HitOrigin load_hit_origin(uint index) {
    uvec4 first = texelFetch(hit_texels, int(3u * index));
    uvec4 second = texelFetch(hit_texels, int(3u * index + 1u));
    return HitOrigin(uintBitsToFloat(first.xyz), first.w, uintBitsToFloat(second.xyz));
}
Hit load_hit(uint index) {
    uvec4 first = texelFetch(hit_texels, int(3u * index));
    uvec4 second = texelFetch(hit_texels, int(3u * index + 1u));
    uvec4 third = texelFetch(hit_texels, int(3u * index + 2u));
    return Hit(
        uintBitsToFloat(first.xyz), first.w, uintBitsToFloat(second.xyz), uintBitsToFloat(second.w),
        uintBitsToFloat(third.xyz), third.w);
}
#endif

#ifdef NEEDS_SHADOW_RAYS
#ifdef WRITES_SHADOW_RAYS
#define ACCESS_SHADOW_RAYS writeonly
#else
#define ACCESS_SHADOW_RAYS readonly
#endif
layout(scalar, set = SET_WAVE, binding = BINDING_SHADOW_RAYS)
    ACCESS_SHADOW_RAYS buffer ShadowRaysBuffer {
    ShadowRay shadow_rays[];
};
#endif

// The shadow rays again, as texels of two words.
#ifdef NEEDS_SHADOW_RAY_TEXELS
layout(set = SET_WAVE, binding = BINDING_SHADOW_RAY_TEXELS) uniform usamplerBuffer shadow_ray_texels;
ShadowRay load_shadow_ray(uint index) {
    uvec2 first = texelFetch(shadow_ray_texels, int(3u * index)).xy;
    uvec2 second = texelFetch(shadow_ray_texels, int(3u * index + 1u)).xy;
    uvec2 third = texelFetch(shadow_ray_texels, int(3u * index + 2u)).xy;
    return ShadowRay(uintBitsToFloat(uvec3(first, second.x)), uintBitsToFloat(uvec3(second.y, third)));
}
#endif

#ifdef NEEDS_VISIBILITY
#ifdef WRITES_VISIBILITY
#define ACCESS_VISIBILITY writeonly
#else
#define ACCESS_VISIBILITY readonly
#endif
layout(scalar, set = SET_WAVE, binding = BINDING_VISIBILITY)
    ACCESS_VISIBILITY buffer VisibilityBuffer {
    uint visibility[];
};
#endif

#ifdef NEEDS_FITS
layout(set = SET_SRBF, binding = BINDING_ENVIRONMENT_LOBES) uniform samplerBuffer environment_lobes;
layout(set = SET_SRBF, binding = BINDING_BRDF_LOBES) uniform samplerBuffer brdf_lobes;
layout(set = SET_SRBF, binding = BINDING_MATERIAL_LOBES) uniform usamplerBuffer material_lobes;
#endif

#ifdef NEEDS_LOBES
#ifdef WRITES_LOBES
#define ACCESS_LOBES writeonly
#else
#define ACCESS_LOBES readonly
#endif
layout(scalar, set = SET_WAVE, binding = BINDING_LOBES) ACCESS_LOBES buffer LobesBuffer {
    uvec2 lobes[];
};
#endif

#ifdef NEEDS_LOBE_COUNTS
#ifdef WRITES_LOBE_COUNTS
#define ACCESS_LOBE_COUNTS writeonly
#else
#define ACCESS_LOBE_COUNTS readonly
#endif
layout(scalar, set = SET_WAVE, binding = BINDING_LOBE_COUNTS)
    ACCESS_LOBE_COUNTS buffer LobeCountsBuffer {
    uint lobe_counts[];
};
#endif

#ifdef NEEDS_LOBE_SUMS
#ifdef WRITES_LOBE_SUMS
#define ACCESS_LOBE_SUMS writeonly
#else
#define ACCESS_LOBE_SUMS readonly
#endif
layout(scalar, set = SET_WAVE, binding = BINDING_LOBE_SUMS)
    ACCESS_LOBE_SUMS buffer LobeSumsBuffer {
    float lobe_sums[];
};
#endif

#ifdef NEEDS_LOBE_TEXELS
layout(set = SET_WAVE, binding = BINDING_LOBE_TEXELS) uniform usamplerBuffer lobe_texels;
#endif
#ifdef NEEDS_LOBE_SUM_TEXELS
layout(set = SET_WAVE, binding = BINDING_LOBE_SUM_TEXELS) uniform samplerBuffer lobe_sum_texels;
#endif

#ifdef NEEDS_CLOSE_LOBES
#ifdef WRITES_CLOSE_LOBES
#define ACCESS_CLOSE_LOBES writeonly
#else
#define ACCESS_CLOSE_LOBES readonly
#endif
layout(scalar, set = SET_WAVE, binding = BINDING_CLOSE_LOBES)
    ACCESS_CLOSE_LOBES buffer CloseLobesBuffer {
    uint close_lobes[];
};
#endif

#ifdef NEEDS_CLOSE_LOBE_TEXELS
layout(set = SET_WAVE, binding = BINDING_CLOSE_LOBE_TEXELS) uniform usamplerBuffer close_lobe_texels;
#endif

#ifdef NEEDS_CACHE
#ifdef WRITES_CACHE
#define ACCESS_CACHE
#else
#define ACCESS_CACHE readonly
#endif
layout(scalar, set = SET_WAVE, binding = BINDING_CACHE) ACCESS_CACHE buffer CacheBuffer {
    uint visibility_cache[];
};
#endif

#ifdef NEEDS_PATHS
#ifdef WRITES_PATHS
#define ACCESS_PATHS
#else
#define ACCESS_PATHS readonly
#endif
layout(scalar, set = SET_WAVE, binding = BINDING_PATHS) ACCESS_PATHS buffer PathsBuffer {
    PathState paths[];
};
#endif

#ifdef NEEDS_FILM
layout(scalar, set = SET_FILM, binding = BINDING_FILM_SUM) buffer FilmSumBuffer {
    vec3 film_sum[];
};
layout(scalar, set = SET_FILM, binding = BINDING_FILM_COMPENSATION) buffer FilmCompensationBuffer {
    vec3 film_compensation[];
};
layout(scalar, set = SET_FILM, binding = BINDING_FILM_SQUARES) buffer FilmSquaresBuffer {
    vec3 film_squares[];
};
#endif

#if defined(NEEDS_FILM) || defined(NEEDS_COUNTERS)
layout(scalar, set = SET_FILM, binding = BINDING_COUNTERS) buffer CountersBuffer {
    Counters counters;
};
#endif

#ifdef NEEDS_FILM_AOVS
layout(scalar, set = SET_FILM, binding = BINDING_FILM_ALBEDO) buffer FilmAlbedoBuffer {
    vec3 film_albedo[];
};
layout(scalar, set = SET_FILM, binding = BINDING_FILM_NORMAL) buffer FilmNormalBuffer {
    vec3 film_normal[];
};
layout(scalar, set = SET_FILM, binding = BINDING_FILM_POSITION) buffer FilmPositionBuffer {
    vec3 film_position[];
};
layout(scalar, set = SET_FILM, binding = BINDING_FILM_VISIBLE) buffer FilmVisibleBuffer {
    uvec2 film_visible[];
};
layout(scalar, set = SET_FILM, binding = BINDING_FILM_CACHE_ENTRIES)
    buffer FilmCacheEntriesBuffer {
    uvec2 film_cache_entries[];
};
layout(scalar, set = SET_FILM, binding = BINDING_FILM_GUIDE_CELL) buffer FilmGuideCellBuffer {
    vec3 film_guide_cell[];
};
layout(scalar, set = SET_FILM, binding = BINDING_FILM_GUIDE_LEVEL) buffer FilmGuideLevelBuffer {
    vec3 film_guide_level[];
};
#endif

#ifdef NEEDS_WAVE
layout(scalar, push_constant) uniform WaveConstants {
    Wave wave;
};
#endif

#endif
