// Chooses directions at every hit of the wave from the BRDF and from tiles of the environment, and writes
// one shadow ray for each by the density of both: the balance heuristic of `mis`. Densities are in solid
// angle measure.
#version 460

#include "mis_rays.glsl"
#include "path_list.glsl"
#include "tiles/tiles.glsl"

// True in the pilot, which learns from rays through tiles alone.
layout(constant_id = CONSTANT_TILES_LEARN) const bool LEARNS = false;

// Offsets from the first dimension of a vertex.
const uint DIMENSION_TILE = 24u;
const uint DIMENSION_TILE_PATCH = 25u;

DirectionSample draw_tile(Vertex vertex, uint sector, uint index) {
    uint pixel = vertex.index.pixel;
    EnvironmentSample light = draw_from_tiles(
        sector, random_bits_2d(pixel, index, vertex.dimension + DIMENSION_TILE, wave.seed),
        hash_4d(uvec4(pixel, index, vertex.dimension + DIMENSION_TILE_PATCH, wave.seed)));
    return evaluate_light(vertex, light);
}

// Draws from the BRDF, with the density of the tiles in place of the environment's.
DirectionSample draw_brdf(Vertex vertex, uint sector, uint index) {
    DirectionSample sampled = draw_brdf_ray(vertex, index, 0u);
    sampled.environment_pdf = tiles_pdf(sector, sampled.direction, sampled.environment_pdf);
    return sampled;
}

void sample_vertex(uint path, Vertex vertex) {
    uint sector = sector_of(vertex.hit.position);
    uint share = LEARNS ? 0u : mis_share(wave.total_shadow_rays, wave.bounce_rays);
    WRITE_MIS_RAYS(
        path, vertex, share, draw_tile(vertex, sector, index), draw_brdf(vertex, sector, index))
}

WALK_VERTICES(sample_vertex)
