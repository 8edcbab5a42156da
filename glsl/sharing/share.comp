// Adds the light of all second vertices of the tile that its first vertex sees to every path, each by
// its share in the balance heuristic. What the rest of the BRDF reflects
// stays with its own path, and so does a vertex that does not see its own first vertex.
#version 460

#include "load.glsl"
#include "tile.glsl"
#include "wave.glsl"

READS(second_vertices)
TEXELS(connection_texels)
TEXELS(tile_weight_texels)
UPDATES(paths)

layout(local_size_x = WORKGROUP_SIZE) in;

TileWeight load_weight(uint path) {
    uvec4 texel = texelFetch(tile_weight_texels, int(path));
    return TileWeight(uintBitsToFloat(texel.x), uintBitsToFloat(texel.y), texel.z, texel.w);
}

void main() {
    uint path = gl_GlobalInvocationID.x;
    uint path_count = wave_path_count();
    if (path >= path_count) {
        return;
    }
    Tile tile = tile_of(path);
    vec3 radiance = paths[path].radiance;
    SecondVertex second = second_vertices[path];
    if (second.scale > 0.0) {
        vec3 shared_light = is_seen(load_weight(path), tile.member)
            ? second.base + second.bounce_share * radiance
            : vec3(0.0);
        vec3 rest = second.direct + radiance - shared_light;
        radiance = second.radiance + second.throughput * (rest / second.scale);
    }
    for (uint member = 0u; member < TILE_PIXELS; ++member) {
        uint other = tile_path(tile, member);
        TileWeight weight = load_weight(other);
        if (is_seen(weight, tile.member) && is_seen(weight, member)) {
            vec3 contribution =
                texelFetch(connection_texels, int(tile.member * path_count + other)).xyz;
            radiance += contribution * (weight.density_ratio / weight.density);
        }
    }
    paths[path].radiance = radiance;
}
