// Visibility records: shares of visible rays by place in the scene and direction, counted in a pilot.
// [Clarberg & Akenine-Möller 2008b]. Twin of tests/twin/control_variates.rs.
//
// A record belongs to all places that share a cube of a grid and the face of the cube that their normals
// point at; its bins are equal parts of the sphere. The edge of the cubes grows with the distance to the
// camera in powers of two.
//
// Deviation: a record holds shares, which become bits where they are used (`control-bits`). The paper's hold
// bits.
//
// Deviation: a place reads the one record of its cube, in a table without keys: two cubes may share a
// record, which costs precision and nothing else. The paper looks for records nearby.

#include "equal_area.glsl"
#include "frame.glsl"
#include "parameters.glsl"
#include "random.glsl"

layout(constant_id = CONSTANT_RECORD_SIDE) const uint RECORD_SIDE = 16u;
layout(constant_id = CONSTANT_RECORD_EDGE) const float RECORD_EDGE = 0.05;
layout(constant_id = CONSTANT_RECORD_LARGEST_EDGE) const float RECORD_LARGEST_EDGE = 1.0;

// Edge of the cubes around a place: a power of two, at most the wanted edge.
float record_edge(vec3 position) {
    float wanted =
        min(RECORD_LARGEST_EDGE, RECORD_EDGE * distance(position, parameters.camera_position));
    return uintBitsToFloat(floatBitsToUint(max(wanted, 1.0e-9)) & 0x7f800000u);
}

// Index of the record for a place on a surface.
uint record_of(vec3 position, vec3 normal) {
    float edge = record_edge(position);
    ivec3 cube = ivec3(clamp(floor(position / edge), vec3(-1.0e9), vec3(1.0e9)));
    uint kind = cube_face(normal) << 8u | floatBitsToUint(edge) >> 23u;
    return hash_4d(uvec4(uvec3(cube), kind)).x & (VISIBILITY_RECORDS - 1u);
}

// Index of a direction's entry in a record, among those of all records.
uint record_entry(uint record, vec3 direction) {
    vec2 at = square_from_direction(direction) * float(RECORD_SIDE);
    uvec2 bin = min(uvec2(at), uvec2(RECORD_SIDE - 1u));
    return (record * RECORD_SIDE + bin.y) * RECORD_SIDE + bin.x;
}
