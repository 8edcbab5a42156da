// Equal-area octahedral map between the sphere and the unit square: a part of the square stands for
// 4 pi times its area in steradians. [Clarberg 2008]. Twin of crates/scene/src/math/equal_area.rs.

#include "frame.glsl"

// Unit direction at a point of the square.
vec3 direction_from_square(vec2 at) {
    vec2 p = 2.0 * at - 1.0;
    // Inside the diamond of the upper hemisphere this is positive.
    float inside = 1.0 - (abs(p.x) + abs(p.y));
    float radius = 1.0 - abs(inside);
    float quarter = radius > 0.0 ? 0.5 * ((abs(p.y) - abs(p.x)) / radius + 1.0) : 0.0;
    vec2 azimuth = sin_cos_pi(0.5 * clamp(quarter, 0.0, 1.0));
    float sine = radius * sqrt(2.0 - radius * radius);
    float z = 1.0 - radius * radius;
    return vec3(
        p.x < 0.0 ? -sine * azimuth.y : sine * azimuth.y,
        p.y < 0.0 ? -sine * azimuth.x : sine * azimuth.x, inside < 0.0 ? -z : z);
}

// Point of the square, in [0, 1], for a unit direction.
vec2 square_from_direction(vec3 direction) {
    vec3 a = abs(direction);
    // The root of 1 - |z|, without cancellation near the poles.
    float radius = sqrt(dot(a.xy, a.xy) / (1.0 + a.z));
    float quarter = a.x + a.y > 0.0 ? atan(a.y, a.x) * (2.0 / PI) : 0.0;
    vec2 p = vec2(radius - radius * quarter, radius * quarter);
    p = direction.z < 0.0 ? 1.0 - p.yx : p;
    p = vec2(direction.x < 0.0 ? -p.x : p.x, direction.y < 0.0 ? -p.y : p.y);
    return clamp(0.5 * p + 0.5, 0.0, 1.0);
}
