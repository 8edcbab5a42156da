// Pixel and sample of each path of the wave, and the dimensions of its random numbers.

#include "divide.glsl"
#include "layout.glsl"
#include "parameters.glsl"
#include "random.glsl"

layout(scalar, push_constant) uniform WaveConstants {
    Wave wave;
};

// Number of groups of lights whose light is kept apart.
layout(constant_id = CONSTANT_LIGHT_GROUPS) const uint LIGHT_GROUPS = 0u;

// Bits AOV_... of the extra film buffers that are written.
layout(constant_id = CONSTANT_AOVS) const uint AOVS = 0u;

// Dimensions of random_2d and random_1d along a path: DIMENSION_FILTER and DIMENSION_LENS for the camera,
// then DIMENSIONS_PER_VERTEX each from DIMENSION_VERTEX on.
const uint DIMENSION_LENS = 1u;
// Offsets from a vertex's first dimension. Directions of resampling candidates take one each.
const uint DIMENSION_TECHNIQUE = 0u;
const uint DIMENSION_RESAMPLING = 1u;
const uint DIMENSION_BOUNCE = 2u;
const uint DIMENSION_BOUNCE_LOBE = 3u;
const uint DIMENSION_ROULETTE = 4u;
const uint DIMENSION_BRDF_LOBE = 8u;
const uint DIMENSION_BRDF_DIRECTION = 16u;
const uint DIMENSION_ENVIRONMENT_DIRECTION = 24u;
// First dimension of the rays of adaptive samplers, which each have three; at most 4096 rays a vertex.
const uint DIMENSION_ADAPTIVE = 0x10000u;
const uint DIMENSIONS_PER_ADAPTIVE_RAY = 3u;
// First dimension of random walks.
const uint DIMENSION_WALK = 0x8000000u;

struct PathIndex {
    uvec2 crop_pixel;
    // Index in the crop window.
    uint film_index;
    // Index in the whole film: random numbers do not depend on the crop window.
    uint pixel;
    uint sample_index;
    // False where a block reaches beyond the crop window.
    bool inside;
};

// Tests whether a path has shadow rays. Those to lamps may start at specular surfaces too, and carry nothing
// where these are not rough.
bool has_shadow_rays(Hit hit) {
    return hit.material != NO_MATERIAL || (wave.to_lamps != 0u && hit.triangle != NO_TRIANGLE);
}

uint wave_path_count() {
    return wave.pixel_count * wave.sample_count;
}

uint wave_film_position(uint index) {
    uint skipped = index / (FILM_BLOCK * FILM_BLOCK) * (max(wave.block_stride, 1u) - 1u);
    return wave.first_pixel
        + (index + skipped * FILM_BLOCK * FILM_BLOCK) * max(wave.pixel_stride, 1u);
}

PathIndex wave_pixel(uint film_position) {
    PathIndex index;
    uint blocks_per_row = (parameters.crop_width + FILM_BLOCK - 1u) / FILM_BLOCK;
    uint block = film_position / (FILM_BLOCK * FILM_BLOCK);
    uint within = film_position % (FILM_BLOCK * FILM_BLOCK);
    uvec2 block_position = divide(block, blocks_per_row).yx;
    index.crop_pixel =
        block_position * FILM_BLOCK + uvec2(within % FILM_BLOCK, within / FILM_BLOCK);
    index.inside = index.crop_pixel.x < parameters.crop_width
        && index.crop_pixel.y < parameters.crop_height;
    index.film_index = index.crop_pixel.y * parameters.crop_width + index.crop_pixel.x;
    index.pixel = (index.crop_pixel.y + parameters.crop_y) * parameters.film_width
        + index.crop_pixel.x + parameters.crop_x;
    index.sample_index = wave.first_sample;
    return index;
}

PathIndex wave_path(uint path) {
    uvec2 sample_and_pixel = divide(path, wave.pixel_count);
    PathIndex index = wave_pixel(wave_film_position(sample_and_pixel.y));
    index.sample_index = wave.first_sample + sample_and_pixel.x;
    return index;
}

// Returns the index into the buffers of the film, which hold a page of the crop window.
uint film_place(PathIndex index) {
    return index.film_index - wave.film_start;
}

// Returns where the film keeps the radiance of sample `i` of the wave at a place of the page; that of light
// groups follows. A row of the page before comes first, and one of the page after last: places above the
// first row wrap to it.
uint radiance_place(uint place, uint i) {
    return ((place + parameters.crop_width) * wave.sample_count + i) * (1u + LIGHT_GROUPS);
}

uint vertex_dimension() {
    return DIMENSION_VERTEX + wave.vertex * DIMENSIONS_PER_VERTEX;
}

// Row and column of the 8x8 pixels of a path in the whole film.
uvec2 film_block_place(PathIndex index) {
    return divide(index.pixel, parameters.film_width) / FILM_BLOCK;
}

// Number of these pixels, in place of the pixel's own where all of them draw the same random number.
uint film_block(PathIndex index) {
    uvec2 place = film_block_place(index);
    return place.x << 16u | place.y;
}

// Returns bits shared by 8x8 pixels, for choices that neighbouring invocations should make alike.
// `dimension` counts from the first of the vertex.
uvec4 block_random_bits(PathIndex index, uint dimension) {
    uvec2 block = film_block_place(index).yx;
    return hash_4d(uvec4(block, vertex_dimension() + dimension, wave.seed));
}

// Defines main: runs `run` for the path of the invocation, of all paths in the wave.
#define RUN_PATHS(run) \
    void main() { \
        uint path = gl_GlobalInvocationID.x; \
        if (path < wave_path_count()) { \
            run(path); \
        } \
    }

// Defines main: runs `run` for the pixel of the invocation and its place, of the wave inside the crop window.
#define RUN_PIXELS(run) \
    void main() { \
        uint pixel = gl_GlobalInvocationID.x; \
        PathIndex index = wave_pixel(wave_film_position(pixel)); \
        if (pixel < wave.pixel_count && index.inside) { \
            run(pixel, index); \
        } \
    }
