// Chooses directions at every hit of the wave from the BRDF and from tiles of the environment, and writes
// one shadow ray for each by the density of both: the balance heuristic of `mis`. Densities are in solid
// angle measure.
//
// With `sector-jitter=on` a hit reads a sector at random among those around it. The choice knows no
// direction, and all rays of the hit have the density of that sector, so no bias comes of it.
#version 460

#include "mis.glsl"
#include "path_list.glsl"
#include "tiles/tiles.glsl"
#include "vertex.glsl"

layout(constant_id = CONSTANT_SECTOR_JITTER) const bool SECTOR_JITTER = false;
// True in the pilot, which learns from rays through tiles alone.
layout(constant_id = CONSTANT_TILES_LEARN) const bool LEARNS = false;

// Offsets from the first dimension of a vertex.
const uint DIMENSION_SECTOR = 6u;
const uint DIMENSION_TILE = 24u;
const uint DIMENSION_TILE_PATCH = 25u;

// Density of both techniques; that of the tiles is in place of the environment's.
float density(DirectionSample sampled) {
    return mis_pdf(
        sampled.brdf_pdf, sampled.environment_pdf, wave.total_shadow_rays, wave.bounce_rays);
}

uint sector_at(Vertex vertex) {
    uvec4 bits = hash_4d(uvec4(
        vertex.index.pixel, vertex.index.sample_index, vertex.dimension + DIMENSION_SECTOR,
        wave.seed));
    vec2 shift = SECTOR_JITTER ? vec2(unit_float(bits.x), unit_float(bits.y)) - 0.5 : vec2(0.0);
    return sector_of(vertex.hit.position, shift);
}

void sample_path(uint path) {
    uint path_count = wave_path_count();
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL) {
        return;
    }
    Vertex vertex = load_vertex(path, hit);
    uint sector = sector_at(vertex);
    uint pixel = vertex.index.pixel;
    // Number the rays through all samples: they share one sequence.
    uint first_ray = vertex.index.sample_index * wave.total_shadow_rays + wave.first_shadow_ray;

    uint share = LEARNS ? 0u : mis_share(wave.total_shadow_rays, wave.bounce_rays);
    MisTurns turns = mis_turns(
        first_ray, wave.shadow_ray_count, share,
        block_random_bits(vertex.index, DIMENSION_TECHNIQUE).x);
    uint index = turns.light_index;
    uint left = ~turns.from_brdf & ((1u << wave.shadow_ray_count) - 1u);
    while (left != 0u) {
        uint i = uint(findLSB(left));
        left &= left - 1u;
        EnvironmentSample light = draw_from_tiles(
            sector, random_bits_2d(pixel, index, vertex.dimension + DIMENSION_TILE, wave.seed),
            hash_4d(uvec4(pixel, index, vertex.dimension + DIMENSION_TILE_PATCH, wave.seed)));
        index++;
        DirectionSample sampled = evaluate_direction(
            vertex, light.direction, to_local(vertex.frame, light.direction), light.radiance,
            light.pdf);
        write_sample(i * path_count + path, sampled, density(sampled));
    }
    index = turns.brdf_index;
    left = turns.from_brdf;
    while (left != 0u) {
        uint i = uint(findLSB(left));
        left &= left - 1u;
        vec2 u =
            random_2d(pixel, index, vertex.dimension + DIMENSION_BRDF_DIRECTION, wave.seed);
        float lobe = random_1d(pixel, index, vertex.dimension + DIMENSION_BRDF_LOBE, wave.seed);
        index++;
        DirectionSample sampled = draw_from_brdf(vertex, vec3(u, lobe));
        sampled.environment_pdf =
            tiles_pdf(sector, sampled.direction, sampled.environment_pdf);
        write_sample(i * path_count + path, sampled, density(sampled));
    }
}

WALK_PATHS(sample_path)
