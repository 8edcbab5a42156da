// Tiles: pixels of a block whose paths share their second vertices. The tiles of a block move from
// sample to sample, around its edges, so that the errors they have in common do not line up.

#include "random.glsl"
#include "wave.glsl"

layout(constant_id = CONSTANT_TILE_EDGE) const uint TILE_EDGE = 4u;
const uint TILE_PIXELS = TILE_EDGE * TILE_EDGE;

// Dimension of the place of the tiles, beyond those of all vertices.
const uint DIMENSION_TILE = 0x40000000u;

struct Tile {
    // Path of the first pixel of the block.
    uint block;
    // Places in the block are moved by this, modulo its edge.
    uvec2 shift;
    // Moved place of the tile's first pixel.
    uvec2 corner;
    // Number of the path's own pixel in the tile.
    uint member;
};

// Finds the tile of a path; waves hold whole blocks.
Tile tile_of(uint path) {
    uint within = path % (FILM_BLOCK * FILM_BLOCK);
    PathIndex first = wave_path(path - within);
    uint bits = hash_4d(uvec4(first.pixel, first.sample_index, DIMENSION_TILE, wave.seed)).x;
    uvec2 shift = uvec2(bits >> 16u, bits >> 24u) % FILM_BLOCK;
    uvec2 place = (uvec2(within % FILM_BLOCK, within / FILM_BLOCK) + shift) % FILM_BLOCK;
    uvec2 inside = place % TILE_EDGE;
    return Tile(path - within, shift, place - inside, inside.y * TILE_EDGE + inside.x);
}

// Path of a pixel of the tile.
uint tile_path(Tile tile, uint member) {
    uvec2 moved = tile.corner + uvec2(member % TILE_EDGE, member / TILE_EDGE);
    uvec2 place = (moved + FILM_BLOCK - tile.shift) % FILM_BLOCK;
    return tile.block + place.y * FILM_BLOCK + place.x;
}

// Tests the bit of a pixel of the tile.
bool is_seen(uvec2 seen_pixels, uint member) {
    return (((member < 32u ? seen_pixels.x : seen_pixels.y) >> (member & 31u)) & 1u) != 0u;
}
