// Directions through tiles of the environment, by what a sector of the camera has learned of them. Densities
// in solid angle measure. Twin of tests/twin/tiles.rs.
//
// A sector's entries come from the pilot and do not change afterwards.

#include "regions.glsl"
#include "tiles/sectors.glsl"

TEXELS(tile_regions)
TEXELS(tile_aliases)

// Density of draw_from_tiles at a direction whose density in the whole map is `map_pdf`.
float tiles_pdf(uint sector, vec3 direction, float map_pdf) {
    uint ratio = texelFetch(tile_entries, int(sector * TILES + tile_of(direction))).x;
    return uintBitsToFloat(ratio) * map_pdf;
}

// Draws a tile by bits.x, one of its cells by bits.y, and a direction from the bilinear patch.
EnvironmentSample draw_from_tiles(uint sector, uvec2 bits, uvec4 more_bits) {
    uint first = sector * TILES;
    uint wanted = scaled(bits.x, TILE_SCALE);
    // Find the first tile whose cumulative probability exceeds the number: never one without any.
    uint tile = 0u;
    uint last = TILES - 1u;
    FIND_FIRST(tile, last, texelFetch(tile_entries, int(first + middle)).y > wanted)
    EnvironmentSample light =
        region_sample(tile_aliases, texelFetch(tile_regions, int(tile)), bits.y, more_bits);
    light.pdf *= uintBitsToFloat(texelFetch(tile_entries, int(first + tile)).x);
    return light;
}
