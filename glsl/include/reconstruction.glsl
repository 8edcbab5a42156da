// Reconstruction filter of the film: where samples lie in their pixels, and their weights in those around.
// Lengths are in pixels. Twin: src/film/reconstruction.rs.

// The Gaussian is cut off at one and a half: a sample reaches the eight pixels around its own.
const float FILTER_SIGMA = 0.5;

// Returns the offset of a sample from the centre of its pixel. All pixels share those of the Gaussian, so
// that its weights can add up to one in every pixel and sample: weights that vary would add noise, and
// dividing by their sum would add bias.
vec2 sample_offset(uint pixel, uint sample_index, uint seed) {
    uint key = parameters.film_filter == FILTER_GAUSSIAN ? EVERY_PIXEL : pixel;
    return random_2d(key, sample_index, DIMENSION_FILTER, seed) - 0.5;
}

// Returns the weights of the samples at `offset` in the pixel before, in the pixel and in the one after,
// along one axis. `exists` is 0 for a pixel outside the window.
vec3 filter_weights(float offset, vec3 exists) {
    vec3 distance = (vec3(-1.0, 0.0, 1.0) + offset) / FILTER_SIGMA;
    vec3 weights = exists * exp(-0.5 * distance * distance);
    return weights / (weights.x + weights.y + weights.z);
}
