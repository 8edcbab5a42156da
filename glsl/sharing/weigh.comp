// Adds the connections that meet nothing to the weights of the second vertices. Visibility belongs into
// these sums: a path cannot come from a first vertex to a place that is hidden from it. Light through
// panes and surfaces that are not opaque is left to the path itself.
#version 460

#include "load.glsl"
#include "wave.glsl"

READS(visibility)
TEXELS(connection_texels)
UPDATES(paths)
UPDATES(tile_weights)

layout(local_size_x = WORKGROUP_SIZE) in;

void main() {
    uint path = gl_GlobalInvocationID.x;
    uint path_count = wave_path_count();
    if (path >= path_count || load_hit_origin(path).material == NO_MATERIAL) {
        return;
    }
    TileWeight weight = tile_weights[path];
    uint traced = 0u;
    uint visible = 0u;
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint ray = i * path_count + path;
        uint member = wave.first_shadow_ray + i;
        float density = texelFetch(connection_texels, int(member * path_count + path)).w;
        traced += density > 0.0 ? 1u : 0u;
        // What is let through dims the contribution.
        if (density > 0.0 && visibility[ray] != 0u
            && load_shadow_ray(ray).contribution == vec3(1.0)) {
            visible += 1u;
            weight.density += density;
            weight.seen_low |= member < 32u ? 1u << member : 0u;
            weight.seen_high |= member < 32u ? 0u : 1u << (member - 32u);
        }
    }
    tile_weights[path] = weight;
    paths[path].shadow_rays_traced += traced;
    paths[path].shadow_rays_visible += visible;
}
