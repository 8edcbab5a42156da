// Next direction of a path, for bounce.comp and bounce_guided.comp. Densities in solid angle measure.

#ifndef BOUNCE_GLSL
#define BOUNCE_GLSL

#include "frame.glsl"
#include "load.glsl"
#include "random.glsl"
#include "wave.glsl"
#include "brdf.glsl"
#include "bvh.glsl"

UPDATES(rays)
READS(hits)
UPDATES(paths)

// First vertex at which russian roulette may end a path.
layout(constant_id = CONSTANT_ROULETTE_VERTEX) const uint ROULETTE_VERTEX = 8u;

// Returns BRDF * cosine / density of a direction drawn from the BRDF; 0 below either horizon.
vec3 bounce_factor(
    Hit hit, Material material, vec3 outgoing_local, vec3 incident_local, vec3 direction) {
    vec3 factor = vec3(0.0);
    if (incident_local.z > 0.0 && dot(direction, hit.geometric_normal) > 0.0) {
        vec3 value;
        float pdf;
        brdf_evaluate_and_pdf(material, outgoing_local, incident_local, value, pdf);
        factor = pdf > 0.0 ? value * (incident_local.z / pdf) : vec3(0.0);
    }
    return factor;
}

// Sends a path on unless it carries nothing or loses at roulette, which draws with `number` and `seed`.
// Returns true if it goes on.
bool follow_bounce(
    uint path, PathIndex index, Hit hit, vec3 direction, vec3 factor, uint number, uint seed) {
    PathState state = paths[path];
    vec3 throughput = state.throughput * factor;
    float strongest = max(throughput.r, max(throughput.g, throughput.b));
    if (wave.vertex + 1u >= ROULETTE_VERTEX && strongest > 0.0) {
        float survival = min(1.0, strongest);
        float u_roulette = random_1d(
            index.pixel, number, vertex_dimension() + DIMENSION_ROULETTE, seed);
        throughput = u_roulette < survival ? throughput / survival : vec3(0.0);
        strongest = u_roulette < survival ? strongest : 0.0;
    }
    bool alive = strongest > 0.0;
    state.throughput = throughput;
    state.rays_traced += alive ? 1u : 0u;
    paths[path] = state;
    rays[path] = Ray(
        offset_ray_origin(hit.position, hit.geometric_normal, direction), alive ? 1u : 0u,
        direction, 0u);
    return alive;
}

#endif
