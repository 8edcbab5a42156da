// Probe of tiles/: sector of a place, density of a direction, and a draw. For tests/tiles.rs.
#version 460

#include "test/answers.glsl"
#include "tiles/tiles.glsl"

struct TileQuery {
    vec3 position;
    vec3 direction;
    uint sector;
    uvec2 bits;
    uvec4 more_bits;
};

struct TileAnswer {
    uint sector;
    float pdf;
    vec3 sampled_direction;
    vec3 sampled_radiance;
    float sampled_pdf;
};

TileAnswer answer(TileQuery query) {
    float map_pdf = environment_pdf(query.direction, environment_light(query.direction));
    EnvironmentSample light = draw_from_tiles(query.sector, query.bits, query.more_bits);
    return TileAnswer(
        sector_of(query.position), tiles_pdf(query.sector, query.direction, map_pdf),
        light.direction, light.radiance, light.pdf);
}

ANSWER_QUERIES(TileQuery, TileAnswer, answer)
