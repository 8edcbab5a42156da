// Cohorts: pixels of a block whose paths share their second vertices, one in each of the equal cells that
// the block is divided into, by another choice for every sample: neighbours are rarely in one cohort, and a
// reconstruction filter finds errors of their own in them.

#include "random.glsl"
#include "wave.glsl"

layout(constant_id = CONSTANT_COHORT_EDGE) const uint COHORT_EDGE = 4u;
const uint COHORT_PIXELS = COHORT_EDGE * COHORT_EDGE;

// Dimension of the members of the cohorts, beyond those of all vertices.
const uint DIMENSION_COHORT = 0x40000000u;
// Dimension of the choice of what a path offers.
const uint DIMENSION_OFFER = 0x40000001u;

// Edge of a cell, pixels; a block has as many cohorts as a cell has pixels.
const uint CELL_EDGE = FILM_BLOCK / COHORT_EDGE;
// Bits of a number below CELL_EDGE², which is 1, 4 or 16.
const uint CELL_BITS = CELL_EDGE & 6u;

struct Cohort {
    // Path of the first pixel of the block.
    uint block;
    // Number of the cohort in its block.
    uint number;
    // Keys of the cells, CELL_BITS each.
    uint keys;
    // Number of the path's own pixel in the cohort.
    uint member;
};

// Turns the number of a cohort into that of its pixel in a member's cell, and back.
uint exchanged(uint number, uint keys, uint member) {
    return number ^ ((keys >> (CELL_BITS * member)) & (CELL_EDGE * CELL_EDGE - 1u));
}

// Finds the cohort of a path; waves hold whole blocks.
Cohort cohort_of(uint path) {
    uint within = path % (FILM_BLOCK * FILM_BLOCK);
    PathIndex first = wave_path(path - within);
    uint keys = hash_4d(uvec4(first.pixel, first.sample_index, DIMENSION_COHORT, wave.seed)).x;
    uvec2 place = uvec2(within % FILM_BLOCK, within / FILM_BLOCK);
    uvec2 cell = place / CELL_EDGE;
    uvec2 inside = place % CELL_EDGE;
    uint member = cell.y * COHORT_EDGE + cell.x;
    uint number = exchanged(inside.y * CELL_EDGE + inside.x, keys, member);
    return Cohort(path - within, number, keys, member);
}

// Path of a pixel of the cohort.
uint cohort_path(Cohort cohort, uint member) {
    uint inside = exchanged(cohort.number, cohort.keys, member);
    uvec2 cell = uvec2(member % COHORT_EDGE, member / COHORT_EDGE);
    uvec2 place = cell * CELL_EDGE + uvec2(inside % CELL_EDGE, inside / CELL_EDGE);
    return cohort.block + place.y * FILM_BLOCK + place.x;
}

// Tests the bit of a pixel of the cohort.
bool is_seen(uvec2 seen_pixels, uint member) {
    return (((member < 32u ? seen_pixels.x : seen_pixels.y) >> (member & 31u)) & 1u) != 0u;
}
