// Lowers the nodes near the directions of blocked shadow rays at every hit: shadow_rays, visibility ->
// haar_cache, haar_nodes and the sums of their weights. The visibility weight is that of
// [Wu & Shih 2009], section 4.2, for nodes of the product in place of its lobes.
//
// Deviation: V = (1 / (1 + Num))^k, as in visibility/weights.glsl. A node takes the factor from one count
// to the next as soon as it counts another direction.
#version 460

#include "frame.glsl"
#include "haar/sums.glsl"
#include "load.glsl"
#include "wave.glsl"

TEXELS(haar_centres)
UPDATES(haar_nodes)
UPDATES(haar_cache)

layout(constant_id = CONSTANT_THRESHOLD_SCALE) const float THRESHOLD_SCALE = 1.0;
layout(constant_id = CONSTANT_VISIBILITY_EXPONENT) const float VISIBILITY_EXPONENT = 2.0;

// Deviation of a lobe of bandwidth 20: nodes are all of one size, as lobes are under `threshold=fixed`.
const float DEVIATION = 0.0707;

// Tests whether a direction is near the centre of a node, within 1 - cos of a multiple of the deviation.
bool is_near(vec3 centre, vec3 direction) {
    vec3 d = centre - direction;
    return 0.5 * dot(d, d) < THRESHOLD_SCALE * DEVIATION;
}

// Index of the number of cached directions of a path, entry 0, and of its directions, from 1 on.
uint cache_place(uint path, uint path_count, uint entry) {
    return entry * path_count + path;
}

// V of a node with one more direction near it than the `count` cached ones, over its V so far.
float next_factor(uint path, uint path_count, uint recorded, vec3 centre) {
    float near = 0.0;
    for (uint entry = 1u; entry <= recorded; ++entry) {
        vec3 direction = unpack_normal(haar_cache[cache_place(path, path_count, entry)]);
        near += is_near(centre, direction) ? 1.0 : 0.0;
    }
    return pow((1.0 + near) / (2.0 + near), VISIBILITY_EXPONENT);
}

void lower_path(uint path) {
    uint path_count = wave_path_count();
    if (load_hit(path).material == NO_MATERIAL) {
        return;
    }
    // Rays without a contribution were not traced.
    ShadowRay ray = load_shadow_ray(path);
    if (ray.contribution == vec3(0.0) || reaches_light(path)) {
        return;
    }
    // Count the direction as the cache holds it.
    uint packed_direction = pack_normal(ray.direction);
    vec3 direction = unpack_normal(packed_direction);
    uint recorded = haar_cache[path];
    for (uint group = 0u; group < 1u << 2u * (LEVEL - 2u); ++group) {
        float sum = 0.0;
        for (uint i = 0u; i < 4u; ++i) {
            uint quad = 4u * group + i;
            uvec2 halves = haar_nodes[quad * path_count + path];
            vec4 reflectances = unpack_quad(halves);
            bool has_near = false;
            for (uint k = 0u; k < 4u; ++k) {
                vec3 centre = texelFetch(haar_centres, int(4u * quad + k)).xyz;
                bool near = reflectances[k] > 0.0 && is_near(centre, direction);
                if (near) {
                    reflectances[k] *= next_factor(path, path_count, recorded, centre);
                    has_near = true;
                }
            }
            if (has_near) {
                halves = pack_quad(reflectances);
                haar_nodes[quad * path_count + path] = halves;
                reflectances = unpack_quad(halves);
            }
            sum += sum_of_four(tree_children(LEVEL - 1u, quad) * reflectances);
        }
        add_group(path, path_count, group, sum);
    }
    haar_cache[cache_place(path, path_count, recorded + 1u)] = packed_direction;
    haar_cache[path] = recorded + 1u;
}

RUN_PATHS(lower_path)
