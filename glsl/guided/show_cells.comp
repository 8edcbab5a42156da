// Adds to the film the colour and kind (face, coarse, fine) of the guide cells at first hits.
#version 460

#include "guided/guide.glsl"

UPDATES(film_guide_cell)
UPDATES(film_guide_level)

// Stands for the missing key of a face's cell: the face bits of other cells are lower.
const uint FACE_KEY = 0xf0000000u;

// Returns three bytes of the key's hash in 256ths, whose sums are exact.
vec3 colour_of(uint key) {
    uint hash = guide_hash(key);
    return vec3(uvec3(hash, hash >> 8u, hash >> 16u) & 255u) * (1.0 / 256.0);
}

void show_pixel(uint pixel, PathIndex index) {
    uint place = film_place(index);
    vec3 colour = film_guide_cell[place];
    vec3 level = film_guide_level[place];
    for (uint i = 0u; i < wave.sample_count; ++i) {
        Hit hit = load_hit(i * wave.pixel_count + pixel);
        if (hit.material == NO_MATERIAL) {
            continue;
        }
        index.sample_index = wave.first_sample + i;
        uint face = cube_face(hit.geometric_normal);
        uint key =
            guide_cell(hit.position, face, guide_cell_bits(index, vertex_dimension())).key;
        bool is_face = key == GUIDE_NO_KEY;
        bool is_coarse = !is_face && (key & GUIDE_COARSE) != 0u;
        colour += colour_of(is_face ? FACE_KEY | face : key);
        level += vec3(is_face, is_coarse, !is_face && !is_coarse);
    }
    film_guide_cell[place] = colour;
    film_guide_level[place] = level;
}

RUN_PIXELS(show_pixel)
