// Pixel and sample of a path of the wave, and the dimensions of its random numbers.

#ifndef WAVE_GLSL
#define WAVE_GLSL

#include "divide.glsl"
#include "layout.glsl"
#include "parameters.glsl"
#include "random.glsl"

layout(scalar, push_constant) uniform WaveConstants {
    Wave wave;
};

// Dimensions of random_2d and random_1d along a path: two for the camera, then per vertex.
const uint DIMENSION_FILTER = 0u;
const uint DIMENSION_LENS = 1u;
const uint DIMENSION_VERTEX = 2u;
// Offsets from the first dimension of a vertex. The directions of resampling's candidates take one
// dimension per candidate.
const uint DIMENSION_TECHNIQUE = 0u;
const uint DIMENSION_RESAMPLING = 1u;
const uint DIMENSION_BOUNCE = 2u;
const uint DIMENSION_BOUNCE_LOBE = 3u;
const uint DIMENSION_ROULETTE = 4u;
const uint DIMENSION_BRDF_LOBE = 8u;
const uint DIMENSION_BRDF_DIRECTION = 16u;
const uint DIMENSION_ENVIRONMENT_DIRECTION = 24u;
const uint DIMENSIONS_PER_VERTEX = 32u;
// First dimension of the rays of adaptive samplers, which each have their own: technique, direction
// and lobe. At most 4096 rays a vertex.
const uint DIMENSION_ADAPTIVE = 0x10000u;
const uint DIMENSIONS_PER_ADAPTIVE_RAY = 3u;
// First dimension of random walks.
const uint DIMENSION_WALK = 0x8000000u;

// Film order walks through blocks of 8x8 pixels, so that neighbouring invocations trace
// neighbouring rays.
const uint FILM_BLOCK = 8u;

struct PathIndex {
    // Pixel in the crop window.
    uvec2 crop_pixel;
    // Index of the pixel in the buffers of the film.
    uint film_index;
    // Index of the pixel in the whole film: random numbers do not depend on the crop window.
    uint pixel;
    uint sample_index;
    // Whether the pixel lies in the crop window; blocks at its edges reach beyond it.
    bool inside;
};

uint wave_path_count() {
    return wave.pixel_count * wave.sample_count;
}

// Position in film order of pixel `index` of the wave.
uint wave_film_position(uint index) {
    return wave.first_pixel + index * max(wave.pixel_stride, 1u);
}

// The pixel at a position in film order.
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

// The pixel and sample of a path of the wave.
PathIndex wave_path(uint path) {
    uvec2 sample_and_pixel = divide(path, wave.pixel_count);
    PathIndex index = wave_pixel(wave_film_position(sample_and_pixel.y));
    index.sample_index = wave.first_sample + sample_and_pixel.x;
    return index;
}

// First dimension of the vertex this dispatch works at.
uint vertex_dimension() {
    return DIMENSION_VERTEX + wave.vertex * DIMENSIONS_PER_VERTEX;
}

// Random bits that the paths of a block of 8x8 pixels share, for choices that neighbouring
// invocations had better make alike. `dimension` counts from the first one of the vertex.
uvec4 block_random_bits(PathIndex index, uint dimension) {
    uvec2 block = divide(index.pixel, parameters.film_width).yx / FILM_BLOCK;
    return hash_4d(uvec4(block, vertex_dimension() + dimension, wave.seed));
}

#endif
