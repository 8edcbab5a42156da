// Paths that a dispatch walks: all of the wave, or a list of those that are still alive, without gaps, so
// that no lane works for a path that has ended.

#include "divide.glsl"
#include "wave.glsl"

TEXELS(path_list_texels)

// Place of the first path of a list in its buffer.
uint path_list_start(uint list) {
    return PATH_LISTS + (list & 1u) * wave_path_count();
}

// Returns the number of paths to walk.
uint listed_path_count() {
    return wave.path_list == 0u ? wave_path_count()
                                : texelFetch(path_list_texels, int(wave.path_list - 1u)).x;
}

// Returns the path at a place below that number.
uint listed_path(uint place) {
    return wave.path_list == 0u
        ? place
        : texelFetch(path_list_texels, int(path_list_start(wave.path_list - 1u) + place)).x;
}

// Path of a shadow ray, and the ray's index in its buffers.
struct ListedRay {
    uint path;
    uint ray;
};

// Returns the shadow ray at a place below listed_path_count() * wave.shadow_ray_count.
ListedRay listed_ray(uint place, uint path_count) {
    uvec2 direction_and_path = divide(place, path_count);
    uint path = listed_path(direction_and_path.y);
    return ListedRay(path, direction_and_path.x * wave_path_count() + path);
}

// Defines main: runs `walk` for the path of the invocation. A loop, since software devices run the body of
// every branch, and the last invocations have no path.
#define WALK_PATHS(walk) \
    void main() { \
        uint count = listed_path_count(); \
        for (uint place = gl_GlobalInvocationID.x; place < count; place += count) { \
            walk(listed_path(place)); \
        } \
    }

// The same for the shadow ray of the invocation.
#define WALK_RAYS(walk) \
    void main() { \
        uint path_count = listed_path_count(); \
        uint count = path_count * wave.shadow_ray_count; \
        for (uint place = gl_GlobalInvocationID.x; place < count; place += count) { \
            walk(listed_ray(place, path_count)); \
        } \
    }
