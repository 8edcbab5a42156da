// Learned visibility: cells of the scene, regions of the environment, and directions drawn from
// them. Densities in solid angle measure. Twin of src/sampler/guided.
//
// A pass reads only tables from earlier passes, so no density changes while it runs.

#include "divide.glsl"
#include "regions.glsl"
#include "vertex.glsl"

READS(guide)
TEXELS(guide_table)
TEXELS(guide_entries)
TEXELS(guide_regions)
TEXELS(guide_aliases)
TEXELS(guide_region_of_cell)
UPDATES(guide_missing)

// Key bit of coarse cells. Cells 0 to 5 are those of the cube faces, for places without their own.
const uint GUIDE_COARSE = 0x80000000u;

// Offset from the first dimension of a vertex, for the choice of its cell.
const uint DIMENSION_GUIDE_CELL = 5u;

struct GuideEntry {
    // Probability of the region over its share of the map's energy: density relative to the whole map.
    float ratio;
    // Factor on the weight of a candidate in this region, by its visibility.
    float visibility;
};

// Word of a region in a cell: cumulative probability of the regions before it, in 65,536ths; from bit 16 on
// the first region that reaches into the interval of its index among region_count equal ones, at index 0 the
// last region to draw; from bit 26 on the level of its visibility.
uint guide_word(uint index) {
    return texelFetch(guide_entries, int(index)).x;
}

GuideEntry guide_entry(uint index, uvec4 region) {
    uint word = guide_word(index);
    // That of the next region, or of the first one of the next cell, which is 0. Only regions without energy
    // have no probability, and their factor is 0.
    uint part = ((guide_word(index + 1u) - word - 1u) & 0xffffu) + 1u;
    float level = float(word >> 26u);
    return GuideEntry(
        float(part) * (1.0 / 65536.0) * uintBitsToFloat(region.z),
        exp2(-level * (10.5 / float(GUIDE_VISIBILITY_LEVELS - 1u))));
}

// Returns the level of a place by its distance to the camera: its edge is the finest one times
// 2^level. `bits` blurs the levels.
uint guide_level(vec3 position, uint bits) {
    float wanted = min(
        guide.largest_edge,
        guide.edge_per_distance * distance(position, parameters.camera_position));
    float blurred = wanted / guide.finest_edge * (1.0 + unit_float(bits));
    return uint(clamp(int(floatBitsToUint(blurred) >> 23u) - 127, 0, 15));
}

// Returns the key of the fine cell around a place. Cells nest in those of the next level.
uint guide_key(vec3 position, uint face, uint level) {
    float edge = guide.finest_edge * uintBitsToFloat((level + 127u) << 23u);
    vec3 place = floor((position - guide.grid_origin) / edge);
    place -= 256.0 * floor(place / 256.0);
    ivec3 cell = ivec3(whole(place.x), whole(place.y), whole(place.z)) & 255;
    return uint(cell.x) | (uint(cell.y) << 8u) | (uint(cell.z) << 16u) | (level << 24u)
        | (face << 28u);
}

uint guide_coarse_key(uint key) {
    return ((key >> 2u) & 0x003f3f3fu) | (key & 0x7f000000u) | GUIDE_COARSE;
}

// Finalizer of MurmurHash3 (Appleby 2011).
uint guide_hash(uint key) {
    key ^= key >> 16u;
    key *= 0x85ebca6bu;
    key ^= key >> 13u;
    key *= 0xc2b2ae35u;
    return key ^ (key >> 16u);
}

uint guide_cell_bits(PathIndex index, uint dimension) {
    return hash_4d(uvec4(
        index.pixel, index.sample_index, dimension + DIMENSION_GUIDE_CELL, wave.epoch_seed)).w;
}

// Returns the index of the cell with a key, or GUIDE_NO_KEY.
uint guide_find(uint key) {
    uint slot = guide_hash(key);
    uint found = GUIDE_NO_KEY;
    for (uint probe = 0u; probe < GUIDE_PROBES; ++probe) {
        uvec2 words = texelFetch(guide_table, int((slot + probe) & guide.table_mask)).xy;
        if (words.x == key) {
            found = words.y;
        }
        if (words.x == key || words.x == GUIDE_NO_KEY) {
            break;
        }
    }
    return found;
}

// Notes that a cell is missing. A smaller key takes the slot of a larger one, which moves on to the next
// slot, as long as that is one of its own: the noted keys do not depend on the order of threads
// (Shun & Blelloch 2014). Keys that find no slot are noted after another pass.
void guide_note_missing(uint key) {
    uint home = guide_hash(key);
    for (uint slot = home; slot - home < GUIDE_PROBES;) {
        uint before = atomicMin(guide_missing[slot & guide.missing_mask], key);
        if (before == GUIDE_NO_KEY || before == key) {
            break;
        }
        slot++;
        if (before > key) {
            // The displaced key goes on from here. Slots count up from its own home.
            key = before;
            home = guide_hash(key);
            slot = home + ((slot - home) & guide.missing_mask);
        }
    }
}

struct GuideCell {
    // Key of the cell, or GUIDE_NO_KEY for that of a face.
    uint key;
    // Index of the cell; GUIDE_REFINED if its parts may be cells; from bit GUIDE_SHARE_SHIFT on the
    // share of the BRDF in 256ths, 0 if none was learned.
    uint found;
};

// Finds the cell for a place: the smallest part of the fine one, else the coarse one, else the face's. One
// loop looks for all of them: compilers copy what is called at several places.
GuideCell guide_cell(vec3 position, uint face, uint bits) {
    uint level = guide_level(position, bits);
    uint key = guide_key(position, face, level);
    GuideCell cell = GuideCell(GUIDE_NO_KEY, face);
    bool looks = true;
    while (looks) {
        uint found = guide_find(key);
        bool is_fine = (key & GUIDE_COARSE) == 0u;
        if (found != GUIDE_NO_KEY) {
            cell = GuideCell(key, found);
            looks = (found & GUIDE_REFINED) != 0u && level > 0u;
            level = max(level, 1u) - 1u;
            key = guide_key(position, face, level);
        } else {
            if (is_fine) {
                guide_note_missing(key);
            }
            looks = is_fine && cell.key == GUIDE_NO_KEY;
            key = guide_coarse_key(key);
        }
    }
    return cell;
}

GuideCell guide_cell_of(Vertex vertex) {
    return guide_cell(
        vertex.hit.position, cube_face(vertex.hit.geometric_normal),
        guide_cell_bits(vertex.index, vertex.dimension));
}

uint guide_cell_index(GuideCell cell) {
    return cell.found & (GUIDE_REFINED - 1u);
}

// Direction with its region and that region's entry in the cell.
struct Guided {
    DirectionSample sampled;
    uint region;
    GuideEntry entry;
};

// Draws a region from the cell's cumulative probabilities by bits.x, a texel cell from the region's
// alias table by bits.y, and a direction from the bilinear patch. The guide cell's entries begin at
// `first`. Regions close in the map are mostly close in order, which keeps the strata.
Guided draw_guided(Vertex vertex, uint first, uvec2 bits, uvec4 more_bits) {
    Guided guided;
    uint interval = scaled(bits.x, guide.region_count);
    uint next = interval + 1u < guide.region_count ? interval + 1u : 0u;
    uint low = interval > 0u ? (guide_word(first + interval) >> 16u) & 0x3ffu : 0u;
    uint high = (guide_word(first + next) >> 16u) & 0x3ffu;
    // Find the last region whose preceding probability does not exceed the number.
    while (low < high) {
        uint middle = (low + high + 1u) >> 1u;
        if ((guide_word(first + middle) & 0xffffu) <= bits.x >> 16u) {
            low = middle;
        } else {
            high = middle - 1u;
        }
    }
    guided.region = low;
    uvec4 region = texelFetch(guide_regions, int(guided.region));
    guided.entry = guide_entry(first + guided.region, region);
    guided.sampled =
        evaluate_light(vertex, region_sample(guide_aliases, region, bits.y, more_bits));
    return guided;
}

Guided locate_guided(uint first, DirectionSample sampled) {
    Guided guided;
    guided.sampled = sampled;
    guided.region =
        texelFetch(guide_region_of_cell, environment_cell_index(sampled.direction)).x;
    guided.entry =
        guide_entry(first + guided.region, texelFetch(guide_regions, int(guided.region)));
    return guided;
}

Guided draw_brdf_guided(Vertex vertex, uint first, vec3 u) {
    return locate_guided(first, draw_from_brdf(vertex, u));
}

float guided_pdf(Guided guided) {
    return guided.entry.ratio * guided.sampled.environment_pdf;
}
