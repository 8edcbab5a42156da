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
    uvec2 pixel = inside * film_size / uvec2(frame.shown_width, frame.shown_height);
    uint place = pixel.y * film_size.x + pixel.x;
    vec3 value;
    if (is_right) {
        value = shown_right[place];
    } else {
        value = shown[place];
    }
    return tone_map(value, frame.exposure, frame.curve);
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
