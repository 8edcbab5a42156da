// Notes the lobes close to every path's shadow ray, as sample_lobes.comp does. For tests/product.rs.
#version 460

#include "layout.glsl"

READS(visibility_cache)

#include "product/mixture.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, set = SET_PROBE, binding = 33) writeonly buffer Answers {
    float densities[];
};

void main() {
    uint path = gl_GlobalInvocationID.x;
    if (path >= wave_path_count()) {
        return;
    }
    Mixture mixture = load_mixture(path, wave_path_count(), 0u);
    densities[path] = mixture_lobe_density(mixture, load_shadow_ray(path).direction, true);
}
