// Multiplies environment and BRDF at every hit: hits, haar_tree -> haar_nodes and the sums of their
// weights, and an empty cache. [Clarberg & Akenine-Möller 2008].
#version 460

#include "haar/reflectance.glsl"
#include "haar/sums.glsl"
#include "hit_surface.glsl"
#include "load.glsl"
#include "wave.glsl"

TEXELS(haar_centres)
WRITES(haar_nodes)
WRITES(haar_cache)

layout(constant_id = CONSTANT_CACHE_CAPACITY) const uint CACHE_CAPACITY = 0u;

void multiply_path(uint path) {
    uint path_count = wave_path_count();
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL) {
        return;
    }
    Frame frame = frame_from_normal(hit.shading_normal);
    Reflector reflector = reflector_from(
        widened(load_surface(path, hit.material)), to_local(frame, -load_ray(path).direction));
    for (uint group = 0u; group < 1u << 2u * (LEVEL - 2u); ++group) {
        float sum = 0.0;
        for (uint i = 0u; i < 4u; ++i) {
            uint quad = 4u * group + i;
            vec4 light = tree_children(LEVEL - 1u, quad);
            vec4 reflectances = vec4(0.0);
            for (uint k = 0u; k < 4u; ++k) {
                vec3 centre = texelFetch(haar_centres, int(4u * quad + k)).xyz;
                vec3 centre_local = to_local(frame, centre);
                bool is_above = centre_local.z > -node_radius() && light[k] > 0.0
                    && dot(hit.geometric_normal, centre) > -node_radius();
                if (is_above) {
                    reflectances[k] = node_reflectance(reflector, centre_local);
                }
            }
            uvec2 halves = pack_quad(reflectances);
            haar_nodes[quad * path_count + path] = halves;
            // Sum what the halves hold.
            sum += sum_of_four(light * unpack_quad(halves));
        }
        add_group(path, path_count, group, sum);
    }
    if (CACHE_CAPACITY > 0u) {
        haar_cache[path] = 0u;
    }
}

RUN_PATHS(multiply_path)
