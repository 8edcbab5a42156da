// Counts every shadow ray of the pilot, and the squared cosine of every visible one, in the sector of its hit
// and the tile of its direction. Sums of integers: the order of rays makes no difference.
#version 460

#include "load.glsl"
#include "path_list.glsl"
#include "tiles/sectors.glsl"
#include "wave.glsl"

UPDATES(tile_counts)

void count_ray(ListedRay listed) {
    Hit hit = load_hit(listed.path);
    if (hit.material == NO_MATERIAL) {
        return;
    }
    ShadowRay ray = load_shadow_ray(listed.ray);
    uint entry = sector_of(hit.position) * TILES + tile_of(ray.direction);
    atomicAdd(tile_counts[2u * entry], 1u);
    // Same test as in shadow.comp: rays without a contribution are not traced.
    if (ray.contribution != vec3(0.0) && reaches_light(listed.ray)) {
        float cosine = max(dot(hit.geometric_normal, ray.direction), 0.0);
        atomicAdd(
            tile_counts[2u * entry + 1u], uint(cosine * cosine * float(TILE_RESPONSE_UNITS) + 0.5));
    }
}

WALK_RAYS(count_ray)
