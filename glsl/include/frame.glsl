// Orthonormal frames, the octahedral map of normals and the lat-long mapping: twin of
// crates/scene/src/math/frame.rs and src/math/octahedron.rs.
//
// Local frames have the normal as z axis; names of vectors in them end in _local. The lat-long
// mapping takes unit directions to the unit square; its Jacobian is 2 pi^2 sin(theta), with theta
// measured from +Y.

#include "divide.glsl"

const float PI = 3.14159265358979;

struct Frame {
    vec3 tangent;
    vec3 bitangent;
    vec3 normal;
};

// Right-handed orthonormal basis around a unit normal, without branches or a singularity. [Duff et
// al. 2017] listing 3.
Frame frame_from_normal(vec3 normal) {
    float handedness = normal.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (handedness + normal.z);
    float b = normal.x * normal.y * a;
    return Frame(
        vec3(1.0 + handedness * normal.x * normal.x * a, handedness * b, -handedness * normal.x),
        vec3(b, handedness + normal.y * normal.y * a, -normal.y),
        normal);
}

vec3 to_local(Frame frame, vec3 direction) {
    return vec3(
        dot(frame.tangent, direction), dot(frame.bitangent, direction), dot(frame.normal, direction));
}

vec3 to_world(Frame frame, vec3 direction_local) {
    return frame.tangent * direction_local.x + frame.bitangent * direction_local.y
        + frame.normal * direction_local.z;
}

float largest_of(vec3 numbers) {
    return max(numbers.x, max(numbers.y, numbers.z));
}

// Folds the lower half of the octahedron over the upper, and back.
vec2 octahedron_fold(vec2 p) {
    return (1.0 - abs(p.yx)) * vec2(p.x < 0.0 ? -1.0 : 1.0, p.y < 0.0 ? -1.0 : 1.0);
}

// Packs a unit vector by the octahedral map, 16 bits a coordinate; twin of octahedron::pack.
uint pack_normal(vec3 normal) {
    vec2 p = normal.xy / (abs(normal.x) + abs(normal.y) + abs(normal.z));
    p = normal.z < 0.0 ? octahedron_fold(p) : p;
    ivec2 quantised = ivec2(round(clamp(p, -1.0, 1.0) * 32767.0));
    return (uint(quantised.x) & 0xffffu) | (uint(quantised.y) << 16u);
}

// Unpacks a unit vector from the octahedral map; twin of octahedron::unpack.
vec3 unpack_normal(uint packed_normal) {
    ivec2 quantised = ivec2(int(packed_normal << 16) >> 16, int(packed_normal) >> 16);
    vec2 p = vec2(quantised) / 32767.0;
    float z = 1.0 - abs(p.x) - abs(p.y);
    p = z < 0.0 ? octahedron_fold(p) : p;
    return normalize(vec3(p, z));
}

// (sin(pi x), cos(pi x)) for 0 <= x <= 2 with small *relative* error near the zeros, which built-in
// functions do not promise: densities over the sphere divide by the sine near the poles.
// Polynomials of sinf and cosf in [Moshier 1992], |argument| <= pi/4.
vec2 sin_cos_pi(float x) {
    float quarter_turns = floor(2.0 * x + 0.5);
    float angle = PI * (x - 0.5 * quarter_turns);
    float z = angle * angle;
    float s = ((-1.9515295891e-4 * z + 8.3321608736e-3) * z - 1.6666654611e-1) * z * angle + angle;
    float c = ((2.443315711809948e-5 * z - 1.388731625493765e-3) * z + 4.166664568298827e-2) * z * z
        - 0.5 * z + 1.0;
    int quadrant = whole(quarter_turns);
    vec2 turned = (quadrant & 1) == 0 ? vec2(s, c) : vec2(c, -s);
    return (quadrant & 2) == 0 ? turned : -turned;
}

// Lat-long coordinates of a direction: u = 0.5 + atan2(x, -z) / 2 pi, 0.5 at the poles; v = theta /
// pi. The direction need not be exactly unit.
vec2 lat_long_from_direction(vec3 direction) {
    float sin_theta = sqrt(direction.x * direction.x + direction.z * direction.z);
    bool pole = sin_theta == 0.0;
    float azimuth = pole ? 0.0 : atan(direction.x, -direction.z);
    return vec2(0.5 + azimuth / (2.0 * PI), atan(sin_theta, direction.y) / PI);
}

// Returns the cube face that a normal points at most: +x, -x, +y, -y, +z, -z.
uint cube_face(vec3 normal) {
    vec3 size = abs(normal);
    uint axis = size.x >= size.y && size.x >= size.z ? 0u : (size.y >= size.z ? 1u : 2u);
    float along = axis == 0u ? normal.x : (axis == 1u ? normal.y : normal.z);
    return 2u * axis + (along < 0.0 ? 1u : 0u);
}
