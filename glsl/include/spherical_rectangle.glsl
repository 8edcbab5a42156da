// Rectangle seen from a point: its solid angle, and directions into it. Twin of
// tests/twin/spherical_rectangle.rs, which says where the numbers are good.

// Below this solid angle, directions are uniform over the area instead of over the solid angle.
const float LEAST_UNIFORM_SOLID_ANGLE = 1e-2;

// Distance from the plane of the rectangle, in lengths of its longer edge, below which it is not seen.
const float LEAST_RECTANGLE_DISTANCE = 1e-3;

struct SphericalRectangle {
    vec3 x_axis;
    vec3 y_axis;
    // From the point to the plane of the rectangle.
    vec3 z_axis;
    // Corners of least and greatest coordinates along the axes, from the point.
    vec2 low;
    vec2 high;
    float distance;
    // Steradians; 0 if the rectangle is not sampled.
    float solid_angle;
};

// Solid angle of a triangle of corners a, b, c with |det(a, b, c)| = volume, at most 2 pi.
// [van Oosterom & Strackee 1983].
float triangle_solid_angle(vec3 a, vec3 b, vec3 c, float volume) {
    float la = length(a);
    float lb = length(b);
    float lc = length(c);
    return 2.0 * atan(volume, la * lb * lc + dot(a, b) * lc + dot(a, c) * lb + dot(b, c) * la);
}

// Rectangle from `corner`, relative to the point, along two unit vectors at a right angle.
SphericalRectangle spherical_rectangle(vec3 corner, vec3 x_axis, vec3 y_axis, vec2 size) {
    SphericalRectangle seen;
    seen.x_axis = x_axis;
    seen.y_axis = y_axis;
    vec3 normal = cross(x_axis, y_axis);
    float height = dot(corner, normal);
    seen.z_axis = height < 0.0 ? -normal : normal;
    seen.distance = abs(height);
    seen.low = vec2(dot(corner, x_axis), dot(corner, y_axis));
    seen.high = seen.low + size;
    seen.solid_angle = 0.0;
    if (seen.distance > LEAST_RECTANGLE_DISTANCE * max(size.x, size.y)) {
        vec3 a = vec3(seen.low, seen.distance);
        vec3 b = vec3(seen.high.x, seen.low.y, seen.distance);
        vec3 c = vec3(seen.high, seen.distance);
        vec3 d = vec3(seen.low.x, seen.high.y, seen.distance);
        float volume = seen.distance * size.x * size.y;
        seen.solid_angle =
            triangle_solid_angle(a, b, c, volume) + triangle_solid_angle(a, c, d, volume);
    }
    return seen;
}

// Solid angle between the axis and a corner at (x, y), signed.
float corner_solid_angle(float x, float y, float h) {
    return atan(x * y, h * sqrt(x * x + y * y + h * h));
}

// Direction into a rectangle with a solid angle above 0; u in [0, 1)^2.
// [Ureña, Fajardo & King 2013], without inverse cosines.
vec3 spherical_rectangle_sample(SphericalRectangle seen, vec2 u) {
    float h = seen.distance;
    vec2 at = mix(seen.low, seen.high, u);
    if (seen.solid_angle >= LEAST_UNIFORM_SOLID_ANGLE) {
        float y0 = seen.low.y;
        float y1 = seen.high.y;
        float r0 = sqrt(y0 * y0 + h * h);
        float r1 = sqrt(y1 * y1 + h * h);
        // Solid angle from x = 0 to the sampled x.
        float angle = u.x * seen.solid_angle + corner_solid_angle(seen.low.x, y1, h)
            - corner_solid_angle(seen.low.x, y0, h);
        float half_sine = sin(0.5 * angle);
        float s0 = y0 / r0;
        // Difference of the sines, without cancellation where both have one sign.
        float difference = y0 * y1 > 0.0
            ? h * h * (y1 - y0) * (y1 + y0) / (r0 * r1 * (y1 * r0 + y0 * r1))
            : y1 / r1 - s0;
        float a = difference + 2.0 * s0 * half_sine * half_sine;
        float b = h / r0 * sin(angle);
        at.x = clamp(
            h * sin(angle) / sqrt(max((a - b) * (a + b), 1e-30)), seen.low.x, seen.high.x);
        float squared = at.x * at.x + h * h;
        float elevation =
            mix(y0 / sqrt(squared + y0 * y0), y1 / sqrt(squared + y1 * y1), u.y);
        float y = elevation * sqrt(squared / max(1.0 - elevation * elevation, 1e-30));
        at.y = clamp(y, y0, y1);
    }
    return normalize(at.x * seen.x_axis + at.y * seen.y_axis + h * seen.z_axis);
}

// Density per steradian of spherical_rectangle_sample at a direction that it can return.
float spherical_rectangle_density(SphericalRectangle seen, vec3 direction) {
    if (seen.solid_angle >= LEAST_UNIFORM_SOLID_ANGLE) {
        return 1.0 / seen.solid_angle;
    }
    vec2 size = seen.high - seen.low;
    float cosine = max(dot(direction, seen.z_axis), 1e-6);
    float along = seen.distance / cosine;
    return along * along / (cosine * size.x * size.y);
}

// True if a direction from the point meets the rectangle.
bool meets_rectangle(SphericalRectangle seen, vec3 direction) {
    float cosine = dot(direction, seen.z_axis);
    vec2 across = vec2(dot(direction, seen.x_axis), dot(direction, seen.y_axis)) * seen.distance;
    return cosine > 0.0 && all(greaterThanEqual(across, seen.low * cosine))
        && all(lessThanEqual(across, seen.high * cosine));
}

// Density per steradian of spherical_rectangle_sample.
float spherical_rectangle_pdf(SphericalRectangle seen, vec3 direction) {
    return seen.solid_angle > 0.0 && meets_rectangle(seen, direction)
        ? spherical_rectangle_density(seen, direction)
        : 0.0;
}

// True if all corners are below the plane of `normal` through the point.
bool is_below(SphericalRectangle seen, vec3 normal) {
    vec3 across = vec3(
        dot(seen.x_axis, normal), dot(seen.y_axis, normal), dot(seen.z_axis, normal));
    vec2 highest = max(seen.low * across.xy, seen.high * across.xy);
    return highest.x + highest.y + seen.distance * across.z <= 0.0;
}
