// Writes the state that sampling passes expect, for tests/{product,guided_candidates,guided_bounces}.rs.
#version 460

#include "layout.glsl"

WRITES(rays)
WRITES(hits)
WRITES(shadow_rays)
WRITES(visibility)

struct PathInput {
    vec3 normal;
    uint material;
    vec3 outgoing;
    vec3 shadow_direction;
    uint is_visible;
};

layout(scalar, PLACE_probe_input) readonly buffer Inputs {
    PathInput inputs[];
};

void main() {
    uint path = gl_GlobalInvocationID.x;
    if (path >= inputs.length()) {
        return;
    }
    PathInput given = inputs[path];
    rays[path] = Ray(given.outgoing, 1u, -given.outgoing, 0u);
    hits[path] = Hit(vec3(0.0), given.material, given.normal, 1.0, given.normal, 0u);
    shadow_rays[path] = ShadowRay(given.shadow_direction, vec3(1.0));
    visibility[path] = given.is_visible;
}
