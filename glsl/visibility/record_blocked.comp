// Records blocked directions in the visibility cache of every hit: shadow_rays, visibility ->
// visibility_cache. [Wu & Shih 2009], section 4.2. A full cache forgets its oldest entry.
#version 460

#include "load.glsl"
#include "visibility/cache.glsl"
#include "wave.glsl"

READS(visibility)
UPDATES(visibility_cache)
UPDATES(counters)

layout(local_size_x = WORKGROUP_SIZE) in;

void main() {
    uint path = gl_GlobalInvocationID.x;
    uint path_count = wave_path_count();
    if (path >= path_count || load_hit_origin(path).material == NO_MATERIAL) {
        return;
    }
    uint film_index = 0u;
    if (CACHE_OF_PIXEL != 0u) {
        PathIndex index = wave_path(path);
        if (!index.inside) {
            return;
        }
        film_index = index.film_index;
    }
    uint head = cache_head(path, film_index);
    uint recorded = 0u;
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        ShadowRay ray = load_shadow_ray(i * path_count + path);
        // Rays without a contribution were not traced.
        if (ray.contribution != vec3(0.0) && visibility[i * path_count + path] == 0u) {
            uint count = visibility_cache[head] & ~CACHE_GROWN;
            visibility_cache[head + 1u + count % CACHE_CAPACITY] = pack_normal(ray.direction);
            visibility_cache[head] = (count + 1u) | CACHE_GROWN;
            recorded += 1u;
        }
    }
    if (recorded > 0u) {
        atomicAdd(counters.cache_entries, recorded);
    }
}
