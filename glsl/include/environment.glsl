// The environment map: bilinear lookup and its exact sampling density per steradian. Twins
// crates/scene/src/environment and tests/twin/environment.rs.
//
// environment_rows: cumulative probability over height + 1 rows of cells, the mean sine of each
// row's polar angle, then a guide to the probabilities. environment_cells: cumulative probability
// over the width cells of each row, then a guide. crates/scene/src/environment/table.rs describes both.

#include "divide.glsl"
#include "frame.glsl"
#include "layout.glsl"
#include "parameters.glsl"

TEXELS(environment_texels)
TEXELS(environment_rows)
TEXELS(environment_cells)
TEXELS(compensated_rows)
TEXELS(compensated_cells)

// Samples and evaluates the compensated density: the luminance above that which samples of the BRDF
// cover well. It is 0 in places, so it serves only beside a density that is not.
layout(constant_id = CONSTANT_COMPENSATION) const bool COMPENSATES = false;

// Smallest sine of the polar angle in densities, to keep them finite near a pole.
const float ENVIRONMENT_MIN_SIN_THETA = 1e-7;

struct EnvironmentSample {
    vec3 direction;
    vec3 radiance;
    // Per steradian; 0 if the map is black and cannot be sampled.
    float pdf;
};

// Cell with its four texels, radiance and compensated luminance: c_ij at column offset i, row offset j.
struct EnvironmentCell {
    vec4 c00;
    vec4 c10;
    vec4 c01;
    vec4 c11;
};

// Luminance of linear Rec.709.
float luminance(vec3 radiance) {
    return dot(radiance, LUMINANCE_WEIGHTS);
}

// Turns a direction from the world into the frame of the map.
vec3 environment_map_from_world(vec3 direction) {
    float c = parameters.environment_cos_rotation;
    float s = parameters.environment_sin_rotation;
    return vec3(c * direction.x - s * direction.z, direction.y, s * direction.x + c * direction.z);
}

vec3 environment_world_from_map(vec3 direction) {
    float c = parameters.environment_cos_rotation;
    float s = parameters.environment_sin_rotation;
    return vec3(c * direction.x + s * direction.z, direction.y, c * direction.z - s * direction.x);
}

float environment_row(uint index) {
    return COMPENSATES ? texelFetch(compensated_rows, int(index)).x
                       : texelFetch(environment_rows, int(index)).x;
}

float environment_cell_value(uint index) {
    return COMPENSATES ? texelFetch(compensated_cells, int(index)).x
                       : texelFetch(environment_cells, int(index)).x;
}

float environment_density_total() {
    return COMPENSATES ? parameters.compensated_total : parameters.environment_total;
}

// Returns the weight of light in the density, radiance with the compensated luminance behind it.
float environment_weight(vec4 light) {
    return COMPENSATES ? light.w : luminance(light.xyz);
}

// Intervals of the guide to a cumulative distribution: a power of two, at least half its entries.
uint guide_size(uint count) {
    return count > 2u ? 1u << uint(findMSB(count - 1u)) : 1u;
}

EnvironmentCell environment_cell(uint column, uint row) {
    uint width = parameters.environment_width;
    uint next_column = column + 1u == width ? 0u : column + 1u;
    uint upper = (row == 0u ? 0u : row - 1u) * width;
    uint lower = min(row, parameters.environment_height - 1u) * width;
    return EnvironmentCell(
        texelFetch(environment_texels, int(upper + column)),
        texelFetch(environment_texels, int(upper + next_column)),
        texelFetch(environment_texels, int(lower + column)),
        texelFetch(environment_texels, int(lower + next_column)));
}

vec4 environment_interpolate(EnvironmentCell cell, vec2 position) {
    return mix(
        mix(cell.c00, cell.c10, position.x), mix(cell.c01, cell.c11, position.x), position.y);
}

// Place of a direction in the map: the cell between four texel centres, and the position in it.
struct EnvironmentLocation {
    uint column;
    uint row;
    vec2 position;
};

EnvironmentLocation environment_locate(vec3 direction) {
    vec2 uv = lat_long_from_direction(environment_map_from_world(direction));
    int width = int(parameters.environment_width);
    int height = int(parameters.environment_height);
    float x = uv.x * float(width) - 0.5;
    float y = uv.y * float(height) + 0.5;
    int column = whole(x);
    column = column < 0 ? width - 1 : min(column, width - 1);
    int row = clamp(whole(y), 0, height);
    return EnvironmentLocation(uint(column), uint(row), vec2(x - floor(x), y - floor(y)));
}

// Index of the cell that holds a direction.
int environment_cell_index(vec3 direction) {
    EnvironmentLocation location = environment_locate(direction);
    return int(location.row * parameters.environment_width + location.column);
}

// Radiance from a direction, and compensated luminance: bilinear between texel centres, wrapping in
// u, clamped in v.
vec4 environment_light(vec3 direction) {
    EnvironmentLocation location = environment_locate(direction);
    return environment_interpolate(
        environment_cell(location.column, location.row), location.position);
}

// Density per steradian of environment_sample at a direction with light environment_light(direction).
float environment_pdf(vec3 direction, vec4 light) {
    float total = environment_density_total();
    if (total <= 0.0) {
        return 0.0;
    }
    float height = float(parameters.environment_height);
    float sin_theta = sqrt(direction.x * direction.x + direction.z * direction.z);
    float v = atan(sin_theta, direction.y) / PI;
    uint row = min(uint(whole(v * height + 0.5)), parameters.environment_height);
    float mean_sine = environment_row(parameters.environment_height + 1u + row);
    return environment_weight(light) * mean_sine
        / (total * 2.0 * PI * PI * max(sin_theta, ENVIRONMENT_MIN_SIN_THETA));
}

// Samples a position in [0, 1) with density proportional to mix(a, b, position).
float environment_sample_linear(float a, float b, float u) {
    float sum = a + b;
    float start = sum > 0.0 ? a / sum : 0.5;
    float end = 1.0 - start;
    float divisor = start + sqrt(mix(start * start, end * end, u));
    return divisor > 0.0 ? min(u / divisor, 0.99999994) : 0.0;
}

// Samples a direction within a cell with two numbers in [0, 1); the density in (u, v) is
// proportional to environment_weight. The pdf is that of environment_sample, over the whole map.
EnvironmentSample environment_sample_cell(uint column, uint row, vec2 u) {
    uint width = parameters.environment_width;
    uint height = parameters.environment_height;
    // Sample the bilinear patch: its marginal along v, then its row at that v.
    EnvironmentCell cell = environment_cell(column, row);
    float l00 = environment_weight(cell.c00);
    float l10 = environment_weight(cell.c10);
    float l01 = environment_weight(cell.c01);
    float l11 = environment_weight(cell.c11);
    vec2 position;
    position.y = environment_sample_linear(l00 + l10, l01 + l11, u.y);
    position.x = environment_sample_linear(
        mix(l00, l01, position.y), mix(l10, l11, position.y), u.x);
    vec4 light = environment_interpolate(cell, position);

    // Measure the polar angle from the nearer pole, in rows, for relative accuracy; the first and
    // the last row are half cells.
    bool northern = 2u * row <= height;
    float from_pole = northern ? float(row) - 0.5 + position.y
                               : float(height - row) + 0.5 - position.y;
    if (row == 0u) {
        from_pole = 0.5 * position.y;
    } else if (row == height) {
        from_pole = 0.5 * (1.0 - position.y);
    }
    vec2 theta = sin_cos_pi(from_pole / float(height));
    float x = float(column) + 0.5 + position.x;
    x = x >= float(width) ? x - float(width) : x;
    vec2 azimuth = sin_cos_pi(2.0 * x / float(width));
    vec3 direction = vec3(
        -theta.x * azimuth.x, northern ? theta.y : -theta.y, theta.x * azimuth.y);

    float mean_sine = environment_row(height + 1u + row);
    float pdf = environment_weight(light) * mean_sine
        / (environment_density_total() * 2.0 * PI * PI
            * max(theta.x, ENVIRONMENT_MIN_SIN_THETA));
    return EnvironmentSample(environment_world_from_map(direction), light.xyz, pdf);
}

// Moves `first` to the first number for which `exceeds` is true, an expression of `middle`; at most `last`.
#define FIND_FIRST(first, last, exceeds) \
    while (first < last) { \
        uint middle = (first + last) >> 1u; \
        if (exceeds) { \
            last = middle; \
        } else { \
            first = middle + 1u; \
        } \
    }

// Samples a direction with density environment_pdf, from two numbers in [0, 1).
EnvironmentSample environment_sample(vec2 u) {
    if (environment_density_total() <= 0.0) {
        return EnvironmentSample(vec3(0.0, 1.0, 0.0), vec3(0.0), 0.0);
    }
    uint width = parameters.environment_width;
    uint height = parameters.environment_height;

    // Find the first row, then the first cell, whose cumulative probability exceeds u: never an
    // empty one. The guides bound the search.
    uint row_guide = 2u * (height + 1u);
    uint interval = uint(whole(u.y * float(guide_size(height + 1u))));
    uint row = uint(whole(environment_row(row_guide + interval)));
    uint last = uint(whole(environment_row(row_guide + interval + 1u)));
    FIND_FIRST(row, last, environment_row(middle) > u.y)
    float before = row > 0u ? environment_row(row - 1u) : 0.0;
    float row_remainder =
        min((u.y - before) / (environment_row(row) - before), 0.99999994);

    uint guide = guide_size(width);
    uint first_cell = row * (width + guide + 1u);
    interval = first_cell + width + uint(whole(u.x * float(guide)));
    uint column = uint(whole(environment_cell_value(interval)));
    last = uint(whole(environment_cell_value(interval + 1u)));
    FIND_FIRST(column, last, environment_cell_value(first_cell + middle) > u.x)
    before = column > 0u ? environment_cell_value(first_cell + column - 1u) : 0.0;
    float column_remainder = min(
        (u.x - before) / (environment_cell_value(first_cell + column) - before), 0.99999994);
    return environment_sample_cell(column, row, vec2(column_remainder, row_remainder));
}
