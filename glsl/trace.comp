// Finds the closest hit of every ray of the wave: rays -> hits.
//
// Surfaces are evaluated afterwards, with all lanes in step.
//
// Where the host has answered (ANSWERED), hits and hit_instances hold what rays meet, and none is followed.
#version 460
#extension GL_KHR_shader_subgroup_ballot : require

#include "follow.glsl"
#include "passage.glsl"
#include "load.glsl"
#include "path_list.glsl"
#include "surfaces.glsl"
#include "wave.glsl"

UPDATES(hits)
UPDATES(hit_instances)
UPDATES(paths)
UPDATES(counters)

// First dimension of the sides from which paths go on, beyond those of all vertices and of sharing.
const uint DIMENSION_SIDE = 0x48000000u;

layout(constant_id = CONSTANT_ANSWERED) const uint ANSWERED = 0u;

// Tests whether light is sampled at a surface: not at a specular one, nor at the black back of a
// one-sided one.
bool samples_light(uint material, uint triangle, uint instance, vec3 direction) {
    if (HAS_SPECULAR && is_specular(load_material(material).kind)) {
        return false;
    }
    return !HAS_BACKS || (load_material_surface(material).flags & SURFACE_TWO_SIDED) != 0u
        || !is_back(triangle, instance, direction);
}

// Decides by chance whether the ray of a path goes through the surface that it has met, and weighs the
// path by the share of light over the probability. Sends the ray on beyond the surface if it does.
bool goes_through(uint path) {
    uint triangle = bvh_triangle;
    uint instance = bvh_hit_instance;
    vec3 weights = barycentric(triangle, instance, bvh_origin, bvh_direction);
    vec3 normal = front_normal(triangle, instance);
    Passing shares = passing(triangle, instance, weights, to_local(bvh_frame, normal));
    float passed = dot(shares.passed, LUMINANCE_WEIGHTS);
    if (passed <= 0.0) {
        return false;
    }
    PathIndex index = wave_path(path);
    uint bits = hash_4d(uvec4(
        index.pixel, index.sample_index, vertex_dimension() + DIMENSION_PASSAGE,
        wave.seed ^ hash_4d(uvec4(triangle, HAS_INSTANCES ? instance : 0u, 0u, 0u)).x)).x;
    float probability = passed / (passed + shares.kept);
    bool goes_on = unit_float(bits) < probability;
    vec3 weight = goes_on ? shares.passed / probability : vec3(shares.met / (1.0 - probability));
    paths[path].throughput *= weight;
    if (goes_on) {
        bvh_passed_distance = bvh_distance;
        bvh_restart(FAR_AWAY, false);
    }
    return goes_on;
}

// Decides by chance whether a path goes on from the other side of a sheet that scatters light to both.
bool goes_on_behind(uint path, uint material_index) {
    if ((MATERIAL_KINDS & (1u << MATERIAL_DIFFUSE_TRANSMISSION)) == 0u) {
        return false;
    }
    Material material = load_material(material_index);
    PathIndex index = wave_path(path);
    return material.kind == MATERIAL_DIFFUSE_TRANSMISSION
        && random_1d(
               index.pixel, index.sample_index - wave.epoch_start, DIMENSION_SIDE + wave.vertex,
               wave.seed ^ wave.epoch_seed)
            >= material.ior;
}

void start_ray(uint path) {
    Ray ray = load_ray(path);
    bvh_start(ray.origin, ray.direction, FAR_AWAY, false);
    bvh_nodes_waiting.y = ray.is_active != 0u ? bvh_nodes_waiting.y : 0u;
}

// Notes what the rays of an invocation meet.
void follow_rays(uint first, uint ray_count) {
    // Not in an array of the lane: drivers repeat the evaluation of a surface for each element.
    FOLLOW_RAYS(
        first, ray_count, false, start_ray(listed_path(first + turn * WORKGROUP_SIZE)),
        {
            uint path = listed_path(first + turn * WORKGROUP_SIZE);
            if (HAS_PASSAGES && !running && bvh_triangle != NO_TRIANGLE && goes_through(path)) {
                continue;
            }
            hits[path].triangle = bvh_triangle;
            if (HAS_INSTANCES) {
                hit_instances[path] = bvh_hit_instance;
            }
        },
        listed_path(first + lost * WORKGROUP_SIZE))
}

void main() {
    uint ray_count = listed_path_count();
    uint first = gl_WorkGroupID.x * WORKGROUP_SIZE * RAYS_PER_INVOCATION + gl_LocalInvocationID.x;
    if (ANSWERED == 0u) {
        follow_rays(first, ray_count);
    }
    for (uint turn = 0u; turn < RAYS_PER_INVOCATION && first + turn * WORKGROUP_SIZE < ray_count; turn++) {
        uint path = listed_path(first + turn * WORKGROUP_SIZE);
        Ray ray = load_ray(path);
        uint triangle = hits[path].triangle;
        uint instance = HAS_INSTANCES ? hit_instances[path] : NO_INSTANCE;
        if (triangle == NO_TRIANGLE) {
            hits[path] = no_surface();
        } else {
            Hit hit = surface_at(triangle, instance, ray.origin, ray.direction);
            if (goes_on_behind(path, hit.material)) {
                hit.geometric_normal = -hit.geometric_normal;
                hit.shading_normal = -hit.shading_normal;
            }
            hit.material = samples_light(hit.material, triangle, instance, ray.direction)
                ? hit.material
                : NO_MATERIAL;
            hits[path] = hit;
        }
    }
}
