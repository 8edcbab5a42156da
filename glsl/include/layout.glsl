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
    uint active;
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
};

struct Material {
    uint kind;
    uint table_offset;
    float alpha;
    float ior;
    vec3 reflectance;
    vec3 eta;
    vec3 k;
};

struct Wave {
    uint first_pixel;
    uint pixel_count;
    uint first_sample;
    uint sample_count;
    uint seed;
    uint vertex;
    uint shadow_ray_count;
    uint aovs;
};

#ifdef NEEDS_PARAMETERS
layout(scalar, set = SET_SCENE, binding = BINDING_PARAMETERS) readonly buffer ParametersBuffer {
    SceneParameters parameters;
};
#endif

#ifdef NEEDS_GEOMETRY
layout(scalar, set = SET_SCENE, binding = BINDING_BVH_NODES) readonly buffer BvhNodesBuffer {
    uvec4 bvh_nodes[];
};
layout(scalar, set = SET_SCENE, binding = BINDING_TRIANGLES_0) readonly buffer Triangles0Buffer {
    float triangles_0[];
};
layout(scalar, set = SET_SCENE, binding = BINDING_TRIANGLES_1) readonly buffer Triangles1Buffer {
    float triangles_1[];
};
layout(scalar, set = SET_SCENE, binding = BINDING_TRIANGLES_2) readonly buffer Triangles2Buffer {
    float triangles_2[];
};
layout(scalar, set = SET_SCENE, binding = BINDING_TRIANGLES_3) readonly buffer Triangles3Buffer {
    float triangles_3[];
};
layout(scalar, set = SET_SCENE, binding = BINDING_TRIANGLE_NORMALS) readonly buffer NormalsBuffer {
    uint triangle_normals[];
};
layout(scalar, set = SET_SCENE, binding = BINDING_TRIANGLE_MATERIALS)
    readonly buffer TriangleMaterialsBuffer {
    uint triangle_materials[];
};
#endif

#ifdef NEEDS_MATERIALS
layout(scalar, set = SET_SCENE, binding = BINDING_MATERIALS) readonly buffer MaterialsBuffer {
    Material materials[];
};
layout(scalar, set = SET_SCENE, binding = BINDING_BRDF_TABLE) readonly buffer BrdfTableBuffer {
    uint brdf_table[];
};
#endif

#ifdef NEEDS_ENVIRONMENT
layout(scalar, set = SET_SCENE, binding = BINDING_ENVIRONMENT_TEXELS)
    readonly buffer EnvironmentTexelsBuffer {
    vec3 environment_texels[];
};
layout(scalar, set = SET_SCENE, binding = BINDING_ENVIRONMENT_ROWS)
    readonly buffer EnvironmentRowsBuffer {
    float environment_rows[];
};
layout(scalar, set = SET_SCENE, binding = BINDING_ENVIRONMENT_CELLS)
    readonly buffer EnvironmentCellsBuffer {
    float environment_cells[];
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

#ifdef NEEDS_PATHS
layout(scalar, set = SET_WAVE, binding = BINDING_PATHS) buffer PathsBuffer {
    PathState paths[];
};
#endif

#ifdef NEEDS_WAVE
layout(scalar, push_constant) uniform WaveConstants {
    Wave wave;
};
#endif

#endif
