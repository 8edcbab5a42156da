// Light that paths have gathered, by groups of lights.

#include "wave.glsl"

UPDATES(group_radiance)

// Group of the environment.
const uint ENVIRONMENT_GROUP = 0u;

uint group_place(uint path, uint group) {
    return group * wave_path_count() + path;
}

// Adds light of a group to that of a path, where groups are kept. It is `precise`, so that the picture's bits
// do not depend on whether they are.
void add_to_group(uint path, uint group, vec3 radiance) {
    if (LIGHT_GROUPS > 0u) {
        group_radiance[group_place(path, group)] += radiance;
    }
}
