// Reflection models: evaluate, pdf, sample and directional albedo of every material. Twin of
// src/brdf/twin.rs, same names, same order.
//
// Directions are unit vectors in the shading frame (z is the normal) and point away from the
// surface. Values are per steradian without the cosine; pdfs are per steradian of incident
// directions. Both are 0 unless both directions are above the surface.
//

#ifndef BRDF_GLSL
#define BRDF_GLSL

#include "frame.glsl"
#include "layout.glsl"
#include "surfaces.glsl"

// One buffer, seen as floats and as cells of four halves.
TEXELS(brdf_table)
TEXELS(brdf_cells)

// Tests the kind of a material. Folds to a constant in the pipeline if the scene has no material of
// the kind, or only such.
bool is_kind(Material material, uint kind) {
    uint bit = 1u << kind;
    return MATERIAL_KINDS == bit || ((MATERIAL_KINDS & bit) != 0u && material.kind == kind);
}

// Word of the BRDF table as a float.
float table_value(uint index) {
    return texelFetch(brdf_table, int(index)).x;
}

// Interpolates linearly between equally spaced nodes over the cosine 0…1, `stride` words apart.
float cosine_table(uint offset, uint stride, float cosine) {
    float position = clamp(cosine, 0.0, 1.0) * float(BRDF_COSINE_INTERVALS);
    uint node = min(uint(position), BRDF_COSINE_INTERVALS - 1u);
    uint index = offset + node * stride;
    return mix(table_value(index), table_value(index + stride), position - float(node));
}

// Samples a direction with density cosθ/π.
vec3 sample_cosine_hemisphere(vec2 u) {
    float radius = sqrt(u.x);
    float azimuth = 2.0 * PI * u.y;
    return vec3(radius * cos(azimuth), radius * sin(azimuth), sqrt(max(0.0, 1.0 - u.x)));
}

// Reflectance of a dielectric of refractive index `ior` seen from outside; exact Fresnel.
float fresnel_dielectric(float cosine, float ior) {
    float g = sqrt(max(0.0, ior * ior - 1.0 + cosine * cosine));
    float difference = (ior * ior - 1.0) / (g + cosine);
    float perpendicular = difference / (g + cosine);
    float ratio = (cosine * (g + cosine) - 1.0) / (cosine * difference + 1.0);
    return min(1.0, 0.5 * perpendicular * perpendicular * (1.0 + ratio * ratio));
}

// Reflectance of a conductor of refractive index eta + i·k; exact Fresnel.
vec3 fresnel_conductor(float cosine, vec3 eta, vec3 k) {
    float cosine_squared = cosine * cosine;
    float sine_squared = max(0.0, 1.0 - cosine_squared);
    vec3 real = eta * eta - k * k - vec3(sine_squared);
    vec3 modulus = sqrt(real * real + 4.0 * eta * eta * k * k);
    vec3 a = sqrt(max(vec3(0.0), 0.5 * (modulus + real)));
    vec3 sum = modulus + vec3(cosine_squared);
    vec3 cross_term = 2.0 * cosine * a;
    vec3 perpendicular = (sum - cross_term) / (sum + cross_term);
    vec3 parallel_sum = cosine_squared * modulus + vec3(sine_squared * sine_squared);
    vec3 parallel_cross = cross_term * sine_squared;
    vec3 parallel = perpendicular * (parallel_sum - parallel_cross)
        / (parallel_sum + parallel_cross);
    // Rounding may leave `perpendicular` below 0 where nothing is reflected, as at eta = 1, k = 0.
    return max(vec3(0.0), 0.5 * (perpendicular + parallel));
}

// Reflectance of a conductor from that at normal incidence. [Schlick 1994].
vec3 fresnel_schlick(float cosine, vec3 reflectance) {
    float complement = 1.0 - cosine;
    float square = complement * complement;
    return reflectance + (vec3(1.0) - reflectance) * (square * square * complement);
}

// Density of GGX normals, per steradian, for a half vector of any length. [Walter et al. 2007] Eq.
// 33, without the cancellation in 1 − cos²θ, which matters for α below 0.01.
float ggx_normal_density(vec3 half_vector, float alpha) {
    float tangential = dot(half_vector.xy, half_vector.xy);
    float normal = half_vector.z * half_vector.z;
    float ratio = (tangential + normal) / (tangential + alpha * alpha * normal);
    return alpha * alpha * ratio * ratio / PI;
}

// Length of the direction after stretching the surface to α = 1: √(cos²θ + α² sin²θ).
float ggx_stretched_length(vec3 direction, float alpha) {
    return length(vec3(alpha * direction.xy, direction.z));
}

// Lower end of the spherical cap of bounded sampling, as a factor. [Eto & Tokuyoshi 2023] Eq. 5.
float ggx_cap_factor(vec3 outgoing_local, float alpha) {
    float bounded_alpha = min(alpha, 1.0);
    float alpha_squared = bounded_alpha * bounded_alpha;
    float s = 1.0 + length(outgoing_local.xy);
    float s_squared = s * s;
    return (1.0 - alpha_squared) * s_squared
        / (s_squared + alpha_squared * outgoing_local.z * outgoing_local.z);
}

// Microfacet reflection at unit reflectance, per steradian: D·G₂/(4 cosθ_o cosθ_i) with the
// height-correlated masking of [Heitz 2014] Eq. 99.
float ggx_reflection(vec3 half_vector, vec3 outgoing_local, vec3 incident_local, float alpha) {
    float masking = incident_local.z * ggx_stretched_length(outgoing_local, alpha)
        + outgoing_local.z * ggx_stretched_length(incident_local, alpha);
    return 0.5 * ggx_normal_density(half_vector, alpha) / masking;
}

// Density of ggx_sample. [Eto & Tokuyoshi 2023] Eq. 8 with the Jacobian of the reflection.
float ggx_pdf(vec3 half_vector, vec3 outgoing_local, float alpha) {
    float cap = ggx_cap_factor(outgoing_local, alpha) * outgoing_local.z
        + ggx_stretched_length(outgoing_local, alpha);
    return 0.5 * ggx_normal_density(half_vector, alpha) / cap;
}

// Samples an incident direction by the visible normals of GGX, on the spherical cap that omits most
// reflections below the surface. Those that remain have z ≤ 0: no sample. [Dupuy & Benyoub 2023],
// [Eto & Tokuyoshi 2023].
vec3 ggx_sample(vec3 outgoing_local, float alpha, vec2 u) {
    vec3 stretched = normalize(vec3(alpha * outgoing_local.xy, outgoing_local.z));
    float cap = ggx_cap_factor(outgoing_local, alpha) * stretched.z;
    // 1 − z rather than z keeps the root below accurate near the pole.
    float below_pole = u.x * (1.0 + cap);
    float sine = sqrt(max(0.0, below_pole * (2.0 - below_pole)));
    float azimuth = 2.0 * PI * u.y;
    vec3 normal = stretched + vec3(sine * cos(azimuth), sine * sin(azimuth), 1.0 - below_pole);
    normal = normalize(vec3(alpha * normal.xy, max(1e-7, normal.z)));
    return 2.0 * dot(outgoing_local, normal) * normal - outgoing_local;
}

// (θ_h, θ_d, φ_d) of two directions, φ_d in 0…π: the half/difference angles of [Rusinkiewicz 1998],
// symmetric in the two directions to the last bit.
vec3 half_difference_angles(vec3 outgoing_local, vec3 incident_local) {
    vec3 half_vector = outgoing_local + incident_local;
    vec3 difference = incident_local - outgoing_local;
    float tangential = dot(half_vector.xy, half_vector.xy);
    float y = length(half_vector)
        * (difference.y * half_vector.x - difference.x * half_vector.y);
    float x = half_vector.z * dot(difference.xy, half_vector.xy) - difference.z * tangential;
    if (y < 0.0 || (y == 0.0 && x < 0.0)) {
        y = -y;
        x = -x;
    }
    // The angle is undefined at the poles, and the grid is constant over it.
    float phi_difference = (x == 0.0 && y == 0.0) ? 0.0 : atan(y, x);
    return vec3(
        atan(sqrt(tangential), half_vector.z),
        atan(length(difference), length(half_vector)),
        phi_difference);
}

// Cell of the measured grid: RGB per steradian from three halves.
vec3 measured_cell(uint grid, uint row, uint phi_index) {
    uint index = grid / 2u + row * MEASURED_PHI_DIFFERENCE_BINS + phi_index;
    return texelFetch(brdf_cells, int(index)).xyz;
}

// Measured BRDF, trilinear between the centres of the grid's bins; periodic in φ_d.
vec3 measured_value(uint table_offset, vec3 angles) {
    float theta_half = clamp(
        float(MEASURED_THETA_HALF_BINS) * sqrt(angles.x * (2.0 / PI)) - 0.5,
        0.0, float(MEASURED_THETA_HALF_BINS - 1u));
    float theta_difference = clamp(
        float(MEASURED_THETA_DIFFERENCE_BINS) * angles.y * (2.0 / PI) - 0.5,
        0.0, float(MEASURED_THETA_DIFFERENCE_BINS - 1u));
    float phi = float(MEASURED_PHI_DIFFERENCE_BINS) * angles.z / PI - 0.5;
    if (phi < 0.0) {
        phi += float(MEASURED_PHI_DIFFERENCE_BINS);
    }
    uint half_0 = uint(theta_half);
    uint half_1 = min(half_0 + 1u, MEASURED_THETA_HALF_BINS - 1u);
    uint difference_0 = uint(theta_difference);
    uint difference_1 = min(difference_0 + 1u, MEASURED_THETA_DIFFERENCE_BINS - 1u);
    uint phi_0 = min(uint(phi), MEASURED_PHI_DIFFERENCE_BINS - 1u);
    uint phi_1 = phi_0 + 1u == MEASURED_PHI_DIFFERENCE_BINS ? 0u : phi_0 + 1u;
    float phi_fraction = phi - float(phi_0);

    uint grid = table_offset + MEASURED_GRID_OFFSET;
    vec3 value = vec3(0.0);
    for (uint corner = 0u; corner < 4u; ++corner) {
        bool upper_half = (corner & 1u) != 0u;
        bool upper_difference = (corner & 2u) != 0u;
        uint row = (upper_half ? half_1 : half_0) * MEASURED_THETA_DIFFERENCE_BINS
            + (upper_difference ? difference_1 : difference_0);
        float half_fraction = theta_half - float(half_0);
        float difference_fraction = theta_difference - float(difference_0);
        float weight = (upper_half ? half_fraction : 1.0 - half_fraction)
            * (upper_difference ? difference_fraction : 1.0 - difference_fraction);
        vec3 cells = mix(
            measured_cell(grid, row, phi_0), measured_cell(grid, row, phi_1), phi_fraction);
        value += weight * cells;
    }
    return value;
}

// Bin of the outgoing polar angle in the sampling table.
uint measured_elevation_bin(vec3 outgoing_local) {
    float theta = atan(length(outgoing_local.xy), outgoing_local.z);
    return min(uint(theta * (2.0 / PI) * float(MEASURED_ELEVATION_BINS)),
        MEASURED_ELEVATION_BINS - 1u);
}

// Unit azimuthal direction that is φ_h = 0 in the sampling table.
vec2 measured_azimuth_axis(vec3 outgoing_local) {
    float sine = length(outgoing_local.xy);
    return sine > 0.0 ? outgoing_local.xy / sine : vec2(1.0, 0.0);
}

// Density of measured_sample: cosine lobe and tabulated half vectors.
float measured_pdf(uint table_offset, vec3 outgoing_local, vec3 incident_local, float theta_half) {
    vec3 half_vector = outgoing_local + incident_local;
    uint elevation = measured_elevation_bin(outgoing_local);
    float cosine_share = table_value(table_offset + MEASURED_COSINE_SHARE_OFFSET + elevation);
    uint polar = min(
        uint(float(MEASURED_POLAR_BINS) * sqrt(theta_half * (2.0 / PI))),
        MEASURED_POLAR_BINS - 1u);
    vec2 axis = measured_azimuth_axis(outgoing_local);
    float y = abs(axis.x * half_vector.y - axis.y * half_vector.x);
    float x = dot(axis, half_vector.xy);
    float phi = (x == 0.0 && y == 0.0) ? 0.0 : atan(y, x);
    uint azimuth = min(
        uint(float(MEASURED_AZIMUTH_BINS) * phi / PI), MEASURED_AZIMUTH_BINS - 1u);
    float density = table_value(table_offset + MEASURED_DENSITY_OFFSET
        + elevation * MEASURED_SAMPLING_CELLS + polar * MEASURED_AZIMUTH_BINS + azimuth);
    // dω_h/dω_i = 1/(4 ω_o·h), and ω_o·h is half the length of the half vector.
    return cosine_share * incident_local.z / PI
        + (1.0 - cosine_share) * density / (2.0 * length(half_vector));
}

// Samples an incident direction from the cosine lobe or the tabulated half vectors; z ≤ 0 means no
// sample.
vec3 measured_sample(uint table_offset, vec3 outgoing_local, vec3 u) {
    uint elevation = measured_elevation_bin(outgoing_local);
    float cosine_share = table_value(table_offset + MEASURED_COSINE_SHARE_OFFSET + elevation);
    if (u.x < cosine_share) {
        return sample_cosine_hemisphere(u.yz);
    }
    // Find the first cell whose cumulative probability exceeds u.y.
    uint cumulative =
        table_offset + MEASURED_CUMULATIVE_OFFSET + elevation * MEASURED_SAMPLING_CELLS;
    uint cell = 0u;
    for (uint span = MEASURED_SAMPLING_CELLS / 2u; span > 0u; span /= 2u) {
        if (table_value(cumulative + cell + span - 1u) <= u.y) {
            cell += span;
        }
    }
    float lower = cell > 0u ? table_value(cumulative + cell - 1u) : 0.0;
    float fraction = (u.y - lower) / (table_value(cumulative + cell) - lower);
    uint polar = cell / MEASURED_AZIMUTH_BINS;
    // 1 − cosθ_h is uniform within the cell; compute its edges as 2 sin²(θ/2).
    float edge_0 = float(polar) / float(MEASURED_POLAR_BINS);
    float edge_1 = float(polar + 1u) / float(MEASURED_POLAR_BINS);
    float sine_0 = sin(0.25 * PI * edge_0 * edge_0);
    float sine_1 = sin(0.25 * PI * edge_1 * edge_1);
    float below_pole = 2.0 * mix(sine_0 * sine_0, sine_1 * sine_1, u.z);
    float sine = sqrt(max(0.0, below_pole * (2.0 - below_pole)));
    float phi = PI * (float(cell % MEASURED_AZIMUTH_BINS) + fraction)
        / float(MEASURED_AZIMUTH_BINS);
    // The table holds |φ_h|; both signs are equally likely.
    if (u.x - cosine_share < 0.5 * (1.0 - cosine_share)) {
        phi = -phi;
    }
    vec2 axis = measured_azimuth_axis(outgoing_local);
    vec2 tangential = cos(phi) * axis + sin(phi) * vec2(-axis.y, axis.x);
    vec3 half_vector = vec3(sine * tangential, 1.0 - below_pole);
    return 2.0 * dot(outgoing_local, half_vector) * half_vector - outgoing_local;
}

// Value (1/sr, without the cosine) and density of brdf_sample at one pair of directions.
void brdf_evaluate_and_pdf(
    Material material, vec3 outgoing_local, vec3 incident_local, out vec3 value, out float pdf) {
    value = vec3(0.0);
    pdf = 0.0;
    if (outgoing_local.z <= 0.0 || incident_local.z <= 0.0) {
        return;
    }
    float cosine_pdf = incident_local.z / PI;
    if (is_kind(material, MATERIAL_DIFFUSE)) {
        value = material.reflectance / PI;
        pdf = cosine_pdf;
        return;
    }
    if (is_kind(material, MATERIAL_MEASURED)) {
        vec3 angles = half_difference_angles(outgoing_local, incident_local);
        value = measured_value(material.table_offset, angles);
        pdf = measured_pdf(material.table_offset, outgoing_local, incident_local, angles.x);
        return;
    }
    vec3 half_vector = outgoing_local + incident_local;
    float cosine_difference = min(1.0, 0.5 * length(half_vector));
    float reflection = ggx_reflection(half_vector, outgoing_local, incident_local, material.alpha);
    pdf = ggx_pdf(half_vector, outgoing_local, material.alpha);
    if (is_kind(material, MATERIAL_PLASTIC)) {
        uint transmission = material.table_offset + PLASTIC_TRANSMISSION_OFFSET;
        float specular_share = cosine_table(
            material.table_offset + PLASTIC_SPECULAR_SHARE_OFFSET, 1u, outgoing_local.z);
        float base = cosine_table(transmission, 1u, outgoing_local.z)
            * cosine_table(transmission, 1u, incident_local.z) / PI;
        value = vec3(reflection * fresnel_dielectric(cosine_difference, material.ior))
            + base * material.reflectance;
        pdf = mix(cosine_pdf, pdf, specular_share);
    } else if (is_kind(material, MATERIAL_CONDUCTOR) && material.ior > 0.0) {
        value = reflection * fresnel_conductor(cosine_difference, material.eta, material.k);
    } else if (is_kind(material, MATERIAL_CONDUCTOR)) {
        value = reflection * fresnel_schlick(cosine_difference, material.reflectance);
    }
}

// Value, 1/sr, without the cosine.
vec3 brdf_evaluate(Material material, vec3 outgoing_local, vec3 incident_local) {
    vec3 value;
    float pdf;
    brdf_evaluate_and_pdf(material, outgoing_local, incident_local, value, pdf);
    return value;
}

// Density of brdf_sample per steradian. Integrates over the hemisphere to 1 less the share of
// samples below the surface.
float brdf_pdf(Material material, vec3 outgoing_local, vec3 incident_local) {
    vec3 value;
    float pdf;
    brdf_evaluate_and_pdf(material, outgoing_local, incident_local, value, pdf);
    return pdf;
}

// Samples an incident direction with three numbers in [0, 1); z ≤ 0 means no sample, which counts
// as one with contribution 0.
vec3 brdf_sample(Material material, vec3 outgoing_local, vec3 u) {
    if (outgoing_local.z <= 0.0) {
        return vec3(0.0, 0.0, -1.0);
    }
    if (is_kind(material, MATERIAL_MEASURED)) {
        return measured_sample(material.table_offset, outgoing_local, u);
    }
    float specular_share = is_kind(material, MATERIAL_CONDUCTOR) ? 1.0 : 0.0;
    if (is_kind(material, MATERIAL_PLASTIC)) {
        specular_share = cosine_table(
            material.table_offset + PLASTIC_SPECULAR_SHARE_OFFSET, 1u, outgoing_local.z);
    }
    if (u.x < specular_share) {
        return ggx_sample(outgoing_local, material.alpha, u.yz);
    }
    return sample_cosine_hemisphere(u.yz);
}

// Share of light from a uniform white hemisphere reflected toward the outgoing direction, 0…1, for
// the albedo image.
vec3 brdf_albedo(Material material, vec3 outgoing_local) {
    if (is_kind(material, MATERIAL_DIFFUSE)) {
        return material.reflectance;
    }
    uint offset = material.table_offset;
    return vec3(
        cosine_table(offset, 3u, outgoing_local.z),
        cosine_table(offset + 1u, 3u, outgoing_local.z),
        cosine_table(offset + 2u, 3u, outgoing_local.z));
}

#endif
