// Connects the second vertex of every path with the first vertices of some pixels of its tile, by a
// shadow ray each. Paths that found no light have nothing to share and trace no rays.
//
// [Bekaert, Sbert & Halton 2002]: all paths of a tile are one sample of many techniques, the BRDFs
// of its first vertices, weighted by the balance heuristic.
#version 460

#include "base.glsl"
#include "brdf.glsl"
#include "bvh.glsl"
#include "first_vertex.glsl"
#include "frame.glsl"
#include "load.glsl"
#include "tile.glsl"
#include "wave.glsl"

READS(paths)
READS(second_vertices)
WRITES(hits)
WRITES(shadow_rays)
WRITES(connections)
WRITES(tile_weights)

layout(local_size_x = WORKGROUP_SIZE) in;

// Squared distance below which vertices are not connected, square metres: its inverse is finite.
const float LEAST_SQUARED_DISTANCE = 1.0e-18;

// Tests whether the shading normal of a second vertex looks the same from a direction: `trace.comp`
// turns those that could not be seen. A little stricter, so that turned ones fail from all sides.
bool keeps_normal(SecondVertex second, vec3 to_first, float cosine) {
    return dot(second.shading_normal, to_first)
        > 1.01 * max(min(LEAST_SHADING_COSINE, cosine), 1.0e-6);
}

void main() {
    uint path = gl_GlobalInvocationID.x;
    uint path_count = wave_path_count();
    if (path >= path_count) {
        return;
    }
    SecondVertex second = second_vertices[path];
    vec3 radiance = second.base + second.bounce_share * paths[path].radiance;
    bool is_shared = second.scale > 0.0 && radiance != vec3(0.0);
    if (wave.first_shadow_ray == 0u) {
        hits[path] = Hit(
            second.position, is_shared ? 0u : NO_MATERIAL, second.geometric_normal, 0.0,
            second.shading_normal, 0u);
        tile_weights[path] = TileWeight(second.density_ratio, 0.0, 0u, 0u);
    }
    if (!is_shared) {
        return;
    }
    Material material = load_material(second.material);
    radiance /=
        second.scale * base_view(material, dot(second.shading_normal, second.outgoing));
    Tile tile = tile_of(path);
    float offset = ray_offset();
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint member = wave.first_shadow_ray + i;
        FirstVertex first = load_first_vertex(tile_path(tile, member));
        vec3 to_first = first.position - second.position;
        float squared = dot(to_first, to_first);
        vec3 direction = to_first * inversesqrt(max(squared, LEAST_SQUARED_DISTANCE));
        float cosine = dot(second.geometric_normal, direction);
        bool is_joined = first.material != NO_MATERIAL && squared > LEAST_SQUARED_DISTANCE
            && cosine > 0.0 && keeps_normal(second, direction, cosine);
        vec3 throughput = vec3(0.0);
        float pdf = 0.0;
        if (is_joined) {
            evaluate_first(first, -direction, throughput, pdf);
        }
        // From solid angle at the first vertex to area at the second.
        float geometry = cosine / squared;
        float view = base_view(material, max(dot(second.shading_normal, direction), 0.0));
        connections[member * path_count + path] =
            Connection(throughput * radiance * (geometry * view), pdf * geometry);
        vec3 end = moved_off_surface(first.position, first.geometric_normal, -direction, offset);
        shadow_rays[i * path_count + path] =
            ShadowRay(end - second.position, vec3(pdf > 0.0 ? 1.0 : 0.0));
    }
}
