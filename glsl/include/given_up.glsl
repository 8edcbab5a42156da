// Rays given up after TRAVERSAL_STEP_LIMIT steps, and the pixels they belong to.

#include "wave.glsl"

// Counts a ray of a path. The host clears counters to zero, so lower bounds are kept as complements.
#define COUNT_GIVEN_UP(path) { \
    uvec2 at = wave_path(path).crop_pixel; \
    atomicAdd(counters.traversal_overruns, 1u); \
    atomicMax(counters.overrun_left, ~at.x); \
    atomicMax(counters.overrun_top, ~at.y); \
    atomicMax(counters.overrun_right, at.x + 1u); \
    atomicMax(counters.overrun_bottom, at.y + 1u); \
}
