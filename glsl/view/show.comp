// Takes what a film shows from its sums, pixel by pixel: its mean or another layer.
#version 460

#include "layout.glsl"

READS(film_sum)
READS(film_compensation)
READS(film_squares)
READS(film_albedo)
READS(film_normal)
READS(film_visible)
READS(film_guide_cell)
READS(film_guide_level)
WRITES(shown)

layout(scalar, push_constant) uniform ShownFilmConstants {
    ShownFilm film;
};

// Colours from blue to red by a fit of the map "turbo" (Mikhailov 2019), about linear.
vec3 false_colour(float value) {
    vec4 powers = vec4(1.0, value, value * value, value * value * value);
    vec2 more = powers.zw * powers.z;
    vec3 display = vec3(
        dot(powers, vec4(0.13572138, 4.61539260, -42.66032258, 132.13108234))
            + dot(more, vec2(-152.94239396, 59.28637943)),
        dot(powers, vec4(0.09140261, 2.19418839, 4.84296658, -14.18503333))
            + dot(more, vec2(4.27729857, 2.82956604)),
        dot(powers, vec4(0.10667330, 12.64194608, -60.58204836, 110.36276771))
            + dot(more, vec2(-89.90310912, 27.34824973)));
    return pow(clamp(display, vec3(0.0), vec3(1.0)), vec3(2.2));
}

// Relative standard error, as in Sums::relative_standard_error.
float relative_error(uint place, vec3 total) {
    float count = float(film.sample_count);
    if (film.sample_count < 2u) {
        return 1.0;
    }
    vec3 deviation = max(film_squares[place] - total * total / count, vec3(0.0));
    vec3 errors = sqrt(deviation / (count * (count - 1.0)));
    float mean = dot(total, vec3(1.0 / 3.0)) / count;
    float error = dot(errors, vec3(1.0 / 3.0));
    float reference = sqrt(mean * mean + 0.01 * film.mean_radiance * film.mean_radiance);
    return error > 0.0 ? error / max(reference, 1e-30) : 0.0;
}

void main() {
    uint place = film.first_place + gl_GlobalInvocationID.x;
    if (place >= film.end_place) {
        return;
    }
    float scale = 1.0 / float(max(film.sample_count, 1u));
    vec3 total = film_sum[place] + film_compensation[place];
    vec3 value = total * scale;
    if (film.layer == SHOW_ERROR) {
        // From 1% to 100%.
        float error = max(relative_error(place, total), 1e-6);
        value = false_colour(clamp(1.0 + 0.5 * log2(error) / log2(10.0), 0.0, 1.0));
    } else if (film.layer == SHOW_ALBEDO) {
        value = film_albedo[place] * scale;
    } else if (film.layer == SHOW_NORMAL) {
        value = 0.5 + 0.5 * film_normal[place] * scale;
    } else if (film.layer == SHOW_VISIBLE) {
        uvec2 rays = film_visible[place];
        value = vec3(float(rays.x) / float(max(rays.y, 1u)));
    } else if (film.layer == SHOW_CELLS) {
        value = film_guide_cell[place] * scale;
    } else if (film.layer == SHOW_LEVELS) {
        value = film_guide_level[place] * scale;
    }
    shown[film.first_pixel + place] = value;
}
