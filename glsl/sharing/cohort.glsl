// Cohorts: pixels of a block whose paths share their second vertices. The cohorts of a block move from
// sample to sample, around its edges, so that the errors they have in common do not line up.

#include "random.glsl"
#include "wave.glsl"

layout(constant_id = CONSTANT_COHORT_EDGE) const uint COHORT_EDGE = 4u;
const uint COHORT_PIXELS = COHORT_EDGE * COHORT_EDGE;

// Dimension of the place of the cohorts, beyond those of all vertices.
const uint DIMENSION_COHORT = 0x40000000u;
// Dimension of the choice of what a path offers.
const uint DIMENSION_OFFER = 0x40000001u;

struct Cohort {
    // Path of the first pixel of the block.
    uint block;
    // Places in the block are moved by this, modulo its edge.
    uvec2 shift;
    // Moved place of the cohort's first pixel.
    uvec2 corner;
    // Number of the path's own pixel in the cohort.
    uint member;
};

// Finds the cohort of a path; waves hold whole blocks.
Cohort cohort_of(uint path) {
    uint within = path % (FILM_BLOCK * FILM_BLOCK);
    PathIndex first = wave_path(path - within);
    uint bits = hash_4d(uvec4(first.pixel, first.sample_index, DIMENSION_COHORT, wave.seed)).x;
    uvec2 shift = uvec2(bits >> 16u, bits >> 24u) % FILM_BLOCK;
    uvec2 place = (uvec2(within % FILM_BLOCK, within / FILM_BLOCK) + shift) % FILM_BLOCK;
    uvec2 inside = place % COHORT_EDGE;
    return Cohort(path - within, shift, place - inside, inside.y * COHORT_EDGE + inside.x);
}

// Path of a pixel of the cohort.
uint cohort_path(Cohort cohort, uint member) {
    uvec2 moved = cohort.corner + uvec2(member % COHORT_EDGE, member / COHORT_EDGE);
    uvec2 place = (moved + FILM_BLOCK - cohort.shift) % FILM_BLOCK;
    return cohort.block + place.y * FILM_BLOCK + place.x;
}

// Tests the bit of a pixel of the cohort.
bool is_seen(uvec2 seen_pixels, uint member) {
    return (((member < 32u ? seen_pixels.x : seen_pixels.y) >> (member & 31u)) & 1u) != 0u;
}
