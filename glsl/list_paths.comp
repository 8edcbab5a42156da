// Lists the paths of the wave whose ray has met a surface, for the passes at that vertex: the others have
// ended. Reads the list of the vertex before, and empties the one after.
#version 460
#extension GL_KHR_shader_subgroup_ballot : require

#include "load.glsl"
#include "path_list.glsl"

UPDATES(path_lists)

void main() {
    uint place = gl_GlobalInvocationID.x;
    uint list = wave.vertex & (PATH_LISTS - 1u);
    if (place == 0u) {
        path_lists[(list + 1u) & (PATH_LISTS - 1u)] = 0u;
    }
    uint path = 0u;
    bool lives = place < listed_path_count();
    if (lives) {
        path = listed_path(place);
        lives = load_ray(path).is_active != 0u && load_hit(path).triangle != NO_TRIANGLE;
    }
    uvec4 ballot = subgroupBallot(lives);
    uint first = 0u;
    if (subgroupElect()) {
        first = atomicAdd(path_lists[list], subgroupBallotBitCount(ballot));
    }
    first = subgroupBroadcastFirst(first);
    if (lives) {
        path_lists[path_list_start(list) + first + subgroupBallotExclusiveBitCount(ballot)] = path;
    }
}
