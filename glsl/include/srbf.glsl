// Gaussian spherical radial basis functions: twins src/srbf.rs and tests/twin/srbf.rs.
// Densities and integrals cover the whole sphere, in solid angle. The forms hold in 32-bit floats
// for bandwidths from 1e-3 to 1e5; the twins give the reason for each.

#include "frame.glsl"

// exp(x) - 1 with a small relative error: Taylor series below 1/2.
float expm1(float x) {
    if (abs(x) > 0.5) {
        return exp(x) - 1.0;
    }
    float tail = 1.0 + x / 9.0;
    tail = 1.0 + x / 8.0 * tail;
    tail = 1.0 + x / 7.0 * tail;
    tail = 1.0 + x / 6.0 * tail;
    tail = 1.0 + x / 5.0 * tail;
    tail = 1.0 + x / 4.0 * tail;
    tail = 1.0 + x / 3.0 * tail;
    tail = 1.0 + x / 2.0 * tail;
    return x * tail;
}

// ln(1 + x) for x > -1 with a small relative error: series of 2 atanh(x / (2 + x)) below 1/2.
float log1p(float x) {
    if (abs(x) > 0.5) {
        return log(1.0 + x);
    }
    float s = x / (2.0 + x);
    float s2 = s * s;
    float tail = 1.0 / 15.0;
    tail = 1.0 / 13.0 + s2 * tail;
    tail = 1.0 / 11.0 + s2 * tail;
    tail = 1.0 / 9.0 + s2 * tail;
    tail = 1.0 / 7.0 + s2 * tail;
    tail = 1.0 / 5.0 + s2 * tail;
    tail = 1.0 / 3.0 + s2 * tail;
    return 2.0 * s * (1.0 + s2 * tail);
}

// Kernel, computed as exp(-bandwidth |direction - axis|^2 / 2).
float kernel_value(vec3 axis, float bandwidth, vec3 direction) {
    vec3 d = direction - axis;
    return exp(-0.5 * bandwidth * dot(d, d));
}

// Integral of the kernel over the sphere.
float kernel_integral(float bandwidth) {
    if (bandwidth < 1e-3) {
        return 4.0 * PI * (1.0 - bandwidth);
    }
    return -2.0 * PI * expm1(-2.0 * bandwidth) / bandwidth;
}

// Steepness of the error function that gives a kernel's share above a plane. [Tokuyoshi 2022].
float kernel_steepness(float bandwidth) {
    return bandwidth
        * sqrt((0.5 * bandwidth + 0.651733) / ((bandwidth + 1.341828) * bandwidth + 7.221669));
}

// That share, where ratio is erf(steepness * cosine) / erf(steepness).
float kernel_part_of_ratio(float bandwidth, float ratio) {
    float blend = clamp(0.5 + 0.5 * ratio, 0.0, 1.0);
    float e = exp(-bandwidth);
    return (e + (1.0 - e) * blend) / (1.0 + e);
}

// Maps a uniform number u in 0...1 to a distance x = 1 - dot(direction, axis) in 0...2.
float kernel_sample_distance(float bandwidth, float u) {
    float x;
    if (bandwidth < 1e-4) {
        x = 2.0 * u;
    } else if (bandwidth > 10.0) {
        x = -log1p(-min(u, 0.99999994)) / bandwidth;
    } else {
        x = -log1p(u * expm1(-2.0 * bandwidth)) / bandwidth;
    }
    return clamp(x, 0.0, 2.0);
}

// Samples a direction with the density of the kernel; u is uniform in the unit square.
vec3 kernel_sample(vec3 axis, float bandwidth, vec2 u) {
    float x = kernel_sample_distance(bandwidth, u.x);
    float sine = sqrt(x * (2.0 - x));
    float azimuth = 2.0 * PI * u.y;
    Frame frame = frame_from_normal(axis);
    return (1.0 - x) * axis + sine * cos(azimuth) * frame.tangent
        + sine * sin(azimuth) * frame.bitangent;
}
