// Notes which lobes of every path its shadow ray is close to, as the sampling pass does for the rays it
// draws. For tests/product.rs.
#version 460

#define NEEDS_PARAMETERS
#define NEEDS_WAVE
#define NEEDS_RAY_TEXELS
#define NEEDS_HIT_TEXELS
#define NEEDS_SHADOW_RAYS
#define WRITES_SHADOW_RAYS
#define NEEDS_SHADOW_RAY_TEXELS
#define NEEDS_MATERIAL_TEXELS
#define NEEDS_ENVIRONMENT
#define NEEDS_LOBE_TEXELS
#define NEEDS_LOBE_COUNTS
#define NEEDS_LOBE_SUM_TEXELS
#define NEEDS_CACHE
#define NEEDS_CLOSE_LOBES
#define WRITES_CLOSE_LOBES
#define NEEDS_CLOSE_LOBE_TEXELS
#include "mixture.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, set = SET_FILM, binding = 1) writeonly buffer Answers {
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
