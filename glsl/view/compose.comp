// Draws the window: one film or two side by side, scaled and tone-mapped, with an inset, below the controls.
#version 460

#include "layout.glsl"
#include "tone.glsl"

READS(shown)
READS(shown_right)
READS(inset)
READS(overlay)
WRITES(window_pixels)

layout(scalar, push_constant) uniform WindowFrameConstants {
    WindowFrame frame;
};

// Grey around the film.
const vec3 AROUND = vec3(0.13);

// Display values of a pixel of a film.
vec3 film_value(bool is_right, uint place) {
    vec3 value;
    if (is_right) {
        value = shown_right[place];
    } else {
        value = shown[place];
    }
    return tone_map(value, frame.exposure, frame.curve);
}

// Returns display values of a pixel of the window.
vec3 pixel_at(uvec2 at) {
    if (at.x < frame.left || at.y < frame.top || at.x >= frame.left + frame.shown_width
        || at.y >= frame.top + frame.shown_height) {
        return AROUND;
    }
    uvec2 inside = at - uvec2(frame.left, frame.top);
    uvec2 from_end = uvec2(frame.shown_width, frame.shown_height) - inside;
    if (from_end.x <= frame.inset_width && from_end.y <= frame.inset_height) {
        uvec2 place = uvec2(frame.inset_width, frame.inset_height) - from_end;
        return unpackUnorm4x8(inset[place.y * frame.inset_width + place.x]).rgb;
    }
    if (at.x == frame.split) {
        return vec3(1.0);
    }
    bool is_right = at.x > frame.split;
    uvec2 film_size = is_right ? uvec2(frame.right_width, frame.right_height)
                               : uvec2(frame.film_width, frame.film_height);
    uvec2 low = inside * film_size / uvec2(frame.shown_width, frame.shown_height);
    vec2 share = vec2(0.0);
    uint corners = 1u;
    // A smaller film than the scene's stands in for it: pixels as large as blocks would hide what it shows.
    if (frame.is_reduced != 0u) {
        vec2 scale = vec2(film_size) / vec2(frame.shown_width, frame.shown_height);
        vec2 place = max((vec2(inside) + 0.5) * scale - 0.5, 0.0);
        low = min(uvec2(place), film_size - 1u);
        share = place - vec2(low);
        corners = 4u;
    }
    vec3 value = vec3(0.0);
    for (uint corner = 0u; corner < corners; corner++) {
        uvec2 by = uvec2(corner & 1u, corner >> 1u);
        uvec2 pixel = min(low + by, film_size - 1u);
        float weight = (by.x == 0u ? 1.0 - share.x : share.x) * (by.y == 0u ? 1.0 - share.y : share.y);
        value += weight * film_value(is_right, pixel.y * film_size.x + pixel.x);
    }
    return value;
}

void main() {
    uint index = frame.first_index + gl_GlobalInvocationID.x;
    if (index >= frame.width * frame.height) {
        return;
    }
    uvec2 at = uvec2(index % frame.width, index / frame.width);
    vec3 value = pixel_at(at);
    if (at.x < frame.overlay_width && at.y < frame.overlay_height) {
        vec4 over = unpackUnorm4x8(overlay[at.y * frame.overlay_width + at.x]);
        value = over.rgb + (1.0 - over.a) * value;
    }
    vec4 ordered = vec4(frame.is_bgra != 0u ? value.bgr : value, 1.0);
    window_pixels[index] = packUnorm4x8(ordered);
}
