// Directional bins of arriving light: a grid over the octahedral map [Cigolle et al. 2014, A Survey
// of Efficient Representations for Independent Unit Vectors]. Twin of tests/twin/guided.rs.

#include "divide.glsl"
#include "frame.glsl"

uint arrival_direction(vec3 direction) {
    vec2 place = direction.xy / (abs(direction.x) + abs(direction.y) + abs(direction.z));
    place = direction.z < 0.0 ? octahedron_fold(place) : place;
    const float side = float(GUIDE_ARRIVAL_SIDE);
    vec2 cell = clamp((0.5 * place + 0.5) * side, vec2(0.0), vec2(side - 1.0));
    return uint(whole(cell.y)) * GUIDE_ARRIVAL_SIDE + uint(whole(cell.x));
}
