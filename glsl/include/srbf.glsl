// Gaussian spherical radial basis functions: twins src/srbf.rs and tests/twin/srbf.rs.
// Densities and integrals cover the whole sphere, in solid angle. The forms hold in 32-bit floats
// for bandwidths from 1e-3 to 1e5; the twins give the reason for each.

const float SRBF_PI = 3.14159265358979;

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

// Error function: Maclaurin series for |x| <= 1, beyond it 7.1.26 of [Abramowitz & Stegun 1964].
float erf(float x) {
    float x2 = x * x;
    if (x2 <= 1.0) {
        float tail = 1.0 - x2 * (19.0 / 210.0);
        tail = 1.0 - x2 * (17.0 / 171.0) * tail;
        tail = 1.0 - x2 * (15.0 / 136.0) * tail;
        tail = 1.0 - x2 * (13.0 / 105.0) * tail;
        tail = 1.0 - x2 * (11.0 / 78.0) * tail;
        tail = 1.0 - x2 * (9.0 / 55.0) * tail;
        tail = 1.0 - x2 * (7.0 / 36.0) * tail;
        tail = 1.0 - x2 * (5.0 / 21.0) * tail;
        tail = 1.0 - x2 * (3.0 / 10.0) * tail;
        tail = 1.0 - x2 * (1.0 / 3.0) * tail;
        return 1.1283791671 * x * tail;
    }
    float t = 1.0 / (1.0 + 0.3275911 * abs(x));
    float tail = -1.453152027 + t * 1.061405429;
    tail = 1.421413741 + t * tail;
    tail = -0.284496736 + t * tail;
    tail = 0.254829592 + t * tail;
    float magnitude = 1.0 - t * tail * exp(-x2);
    return x < 0.0 ? -magnitude : magnitude;
}

// amplitude * exp(bandwidth * (dot(direction, axis) - 1)); 20 bytes in scalar layout.
struct Lobe {
    vec3 axis;
    float bandwidth;
    float amplitude;
};

// Kernel, computed as exp(-bandwidth |direction - axis|^2 / 2).
float kernel_value(vec3 axis, float bandwidth, vec3 direction) {
    vec3 d = direction - axis;
    return exp(-0.5 * bandwidth * dot(d, d));
}

// Integral of the kernel over the sphere.
float kernel_integral(float bandwidth) {
    if (bandwidth < 1e-3) {
        return 4.0 * SRBF_PI * (1.0 - bandwidth);
    }
    return -2.0 * SRBF_PI * expm1(-2.0 * bandwidth) / bandwidth;
}

// Root mean square of x = 1 - dot(direction, axis): sigma of Eq. 9 and 10 of [Wu & Shih 2009].
float kernel_deviation(float bandwidth) {
    if (bandwidth < 0.5) {
        float y = -2.0 * bandwidth;
        float second_moment = 1.0 / 12.0 + y / 10.0 * (1.0 / 13.0);
        second_moment = 1.0 / 11.0 + y / 9.0 * second_moment;
        second_moment = 1.0 / 10.0 + y / 8.0 * second_moment;
        second_moment = 1.0 / 9.0 + y / 7.0 * second_moment;
        second_moment = 1.0 / 8.0 + y / 6.0 * second_moment;
        second_moment = 1.0 / 7.0 + y / 5.0 * second_moment;
        second_moment = 1.0 / 6.0 + y / 4.0 * second_moment;
        second_moment = 1.0 / 5.0 + y / 3.0 * second_moment;
        second_moment = 1.0 / 4.0 + y / 2.0 * second_moment;
        second_moment = 1.0 / 3.0 + y * second_moment;
        return sqrt(16.0 * SRBF_PI * second_moment / kernel_integral(bandwidth));
    }
    float b = 1.0 / bandwidth;
    float e = exp(-2.0 * bandwidth);
    float second_moment = 2.0 * b * b - e * (4.0 + 4.0 * b + 2.0 * b * b);
    return sqrt(second_moment / (1.0 - e));
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

// Share of the kernel's integral where dot(direction, n) > 0; cosine is dot(axis, n). [Tokuyoshi 2022].
float kernel_hemisphere_part(float bandwidth, float cosine) {
    float steepness = kernel_steepness(bandwidth);
    float ratio = steepness < 1e-4 ? cosine : erf(steepness * cosine) / erf(steepness);
    return kernel_part_of_ratio(bandwidth, ratio);
}

// Value of a lobe.
float lobe_value(Lobe lobe, vec3 direction) {
    return lobe.amplitude * kernel_value(lobe.axis, lobe.bandwidth, direction);
}

// Integral of a lobe over the sphere.
float lobe_integral(Lobe lobe) {
    return lobe.amplitude * kernel_integral(lobe.bandwidth);
}

// Product of two lobes, again a lobe. [Tsai & Shih 2006].
Lobe lobe_product(Lobe a, Lobe b) {
    vec3 d = a.axis - b.axis;
    vec3 u = a.bandwidth * a.axis + b.bandwidth * b.axis;
    float bandwidth = length(u);
    vec3 axis = bandwidth > 1e-20 ? u / bandwidth : a.axis;
    float sum = max(a.bandwidth + b.bandwidth + bandwidth, 1e-20);
    float exponent = -a.bandwidth * (b.bandwidth / sum) * dot(d, d);
    return Lobe(axis, bandwidth, a.amplitude * b.amplitude * exp(exponent));
}

// Integral over the sphere of the product of two lobes. [Wu & Shih 2009] Eq. 7.
float lobe_convolution(Lobe a, Lobe b) {
    Lobe product = lobe_product(a, b);
    return product.amplitude * kernel_integral(product.bandwidth);
}

// Two unit vectors that complete the axis to a right-handed frame. [Duff et al. 2017].
void lobe_frame(vec3 axis, out vec3 tangent, out vec3 bitangent) {
    float s = axis.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (s + axis.z);
    float b = axis.x * axis.y * a;
    tangent = vec3(1.0 + s * axis.x * axis.x * a, s * b, -s * axis.x);
    bitangent = vec3(b, s + axis.y * axis.y * a, -axis.y);
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
    float azimuth = 2.0 * SRBF_PI * u.y;
    vec3 tangent;
    vec3 bitangent;
    lobe_frame(axis, tangent, bitangent);
    return (1.0 - x) * axis + sine * cos(azimuth) * tangent + sine * sin(azimuth) * bitangent;
}

// Density of kernel_sample per steradian.
float kernel_pdf(vec3 axis, float bandwidth, vec3 direction) {
    return kernel_value(axis, bandwidth, direction) / kernel_integral(bandwidth);
}

// Point of the unit square that kernel_sample maps to the direction.
vec2 kernel_inverse(vec3 axis, float bandwidth, vec3 direction) {
    vec3 d = direction - axis;
    float x = 0.5 * dot(d, d);
    float u = bandwidth < 1e-4 ? 0.5 * x : expm1(-bandwidth * x) / expm1(-2.0 * bandwidth);
    vec3 tangent;
    vec3 bitangent;
    lobe_frame(axis, tangent, bitangent);
    float azimuth = atan(dot(direction, bitangent), dot(direction, tangent)) / (2.0 * SRBF_PI);
    return vec2(clamp(u, 0.0, 1.0), azimuth < 0.0 ? azimuth + 1.0 : azimuth);
}
