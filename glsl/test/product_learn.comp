// Teaches the cache of every path the outcome of its shadow ray, as sample_and_trace.comp does. For
// tests/product.rs.
#version 460

#include "layout.glsl"

UPDATES(visibility_cache)
UPDATES(close_lobes)
READS(visibility)

#include "product/mixture.glsl"
#include "visibility/blocked.glsl"

layout(scalar, PLACE_probe_output) writeonly buffer Answers {
    float densities[];
};

void main() {
    uint path = gl_GlobalInvocationID.x;
    if (path >= wave_path_count()) {
        return;
    }
    Mixture mixture = load_mixture(path, wave_path_count(), 0u);
    vec3 direction = load_shadow_ray(path).direction;
    densities[path] = mixture_lobe_density(mixture, direction);
    if (visibility[path] == 0u) {
        cache_blocked(mixture.lobes, direction);
        store_weights(mixture.lobes, 0u);
    }
}
