// Portals of the scene as a vertex sees them: a choice among them in proportion to their solid angles,
// those below the horizon left out, and a direction into the chosen one.

#include "spherical_rectangle.glsl"
#include "vertex.glsl"

TEXELS(portals)

layout(constant_id = CONSTANT_PORTALS) const uint PORTALS = 0u;
// Share of the portals among directions that are not from the BRDF; the rest is the environment's.
layout(constant_id = CONSTANT_PORTAL_SHARE) const float PORTAL_SHARE = 0.5;

// Portal from a vertex; its solid angle is 0 where no light through it is reflected.
SphericalRectangle load_portal(Vertex vertex, uint portal) {
    int texel = int(3u * portal);
    vec4 corner = texelFetch(portals, texel);
    vec4 first = texelFetch(portals, texel + 1);
    vec4 second = texelFetch(portals, texel + 2);
    SphericalRectangle seen = spherical_rectangle(
        corner.xyz - vertex.hit.position, first.xyz, second.xyz, vec2(corner.w, first.w));
    if (is_below(seen, vertex.hit.geometric_normal) || is_below(seen, vertex.frame.normal)) {
        seen.solid_angle = 0.0;
    }
    return seen;
}

// Sum of the solid angles of all portals.
float portal_total(Vertex vertex) {
    float total = 0.0;
    for (uint portal = 0u; portal < PORTALS; ++portal) {
        total += load_portal(vertex, portal).solid_angle;
    }
    return total;
}

// Density per steradian of portal_sample, all portals together, for a total above 0.
float portal_pdf(Vertex vertex, float total, vec3 direction) {
    float sum = 0.0;
    for (uint portal = 0u; portal < PORTALS; ++portal) {
        SphericalRectangle seen = load_portal(vertex, portal);
        sum += seen.solid_angle * spherical_rectangle_pdf(seen, direction);
    }
    return sum / total;
}

// Direction through a portal that `choice` in [0, 1) picks; u in [0, 1)^2, and a total above 0.
vec3 portal_sample(Vertex vertex, float total, float choice, vec2 u) {
    float rest = choice * total;
    SphericalRectangle chosen = load_portal(vertex, 0u);
    for (uint portal = 1u; portal < PORTALS && rest >= chosen.solid_angle; ++portal) {
        SphericalRectangle next = load_portal(vertex, portal);
        // Rounding must not end at a portal that is not sampled.
        if (next.solid_angle > 0.0) {
            rest -= chosen.solid_angle;
            chosen = next;
        }
    }
    return spherical_rectangle_sample(chosen, u);
}
