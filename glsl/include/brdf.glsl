// Reflection models: evaluate, pdf, sample and directional albedo of every material. Twins:
// src/brdf/value.rs and tests/twin/brdf.rs, same names, same order.
//
// Directions are unit vectors in the shading frame (z is the normal) and point away from the
// surface. Values are per steradian without the cosine; pdfs are per steradian of incident
// directions. Both are 0 unless both directions are above the surface, and for mirrors, dielectrics and
// thin panes: see specular.glsl.

#include "divide.glsl"
#include "frame.glsl"
#include "fresnel.glsl"
#include "ggx.glsl"
#include "layout.glsl"
#include "sheen.glsl"
#include "surfaces.glsl"

// Reflectance of a coat at normal incidence, of refractive index 1.5. Twin: src/brdf/value.rs.
const float COAT_REFLECTANCE = 0.04;

// One buffer, seen as floats and as cells of four halves.
TEXELS(brdf_table)
TEXELS(brdf_cells)

// Tests the kind of a material. Folds to a constant in the pipeline if the scene has no material of
// the kind, or only such.
bool is_kind(Material material, uint kind) {
    uint bit = 1u << kind;
    return MATERIAL_KINDS == bit || ((MATERIAL_KINDS & bit) != 0u && material.kind == kind);
}

// Tests for a material that scatters alike to all directions of a side.
bool is_diffuse(Material material) {
    return is_kind(material, MATERIAL_DIFFUSE) || is_kind(material, MATERIAL_DIFFUSE_TRANSMISSION);
}

// Tests for a metallic-roughness material below a coat or a sheen.
bool is_covered(Material material) {
    return is_kind(material, MATERIAL_COATED) || is_kind(material, MATERIAL_SHEEN);
}

// Tests for a metallic-roughness material, covered or not.
bool is_principled(Material material) {
    return is_kind(material, MATERIAL_PRINCIPLED) || is_covered(material);
}

// Word of the BRDF table as a float.
float table_value(uint index) {
    return texelFetch(brdf_table, int(index)).x;
}

// Interpolates linearly between equally spaced nodes over the cosine 0…1, `stride` words apart.
float cosine_table(uint offset, uint stride, float cosine) {
    float position = clamp(cosine, 0.0, 1.0) * float(BRDF_COSINE_INTERVALS);
    uint node = min(uint(whole(position)), BRDF_COSINE_INTERVALS - 1u);
    uint index = offset + node * stride;
    return mix(table_value(index), table_value(index + stride), position - float(node));
}

// Samples a direction with density cosθ/π.
vec3 sample_cosine_hemisphere(vec2 u) {
    float radius = sqrt(u.x);
    float azimuth = 2.0 * PI * u.y;
    return vec3(radius * cos(azimuth), radius * sin(azimuth), sqrt(max(0.0, 1.0 - u.x)));
}

// Samples a direction with density 1/2π: the product of a sheen and the cosine is bounded.
vec3 sample_uniform_hemisphere(vec2 u) {
    vec2 azimuth = sin_cos_pi(2.0 * u.y);
    return vec3(sqrt(u.x * (2.0 - u.x)) * azimuth.yx, 1.0 - u.x);
}

// Directional albedo of a GGX surface with Schlick's reflectance: factors of the reflectance at normal
// and at grazing incidence. Linear in roughness and cosine between the nodes of the table that all such
// materials share.
vec2 ggx_schlick_albedo(uint table_offset, float alpha, float cosine) {
    float position = clamp(sqrt(alpha), 0.0, 1.0) * float(GGX_ROUGHNESS_INTERVALS);
    uint row = min(uint(whole(position)), GGX_ROUGHNESS_INTERVALS - 1u);
    float fraction = position - float(row);
    uint lower = table_offset + row * GGX_ROUGHNESS_WORDS;
    uint upper = lower + GGX_ROUGHNESS_WORDS;
    return vec2(
        mix(cosine_table(lower, 2u, cosine), cosine_table(upper, 2u, cosine), fraction),
        mix(cosine_table(lower + 1u, 2u, cosine), cosine_table(upper + 1u, 2u, cosine), fraction));
}

// Light of a uniform white hemisphere that each part of a principled material reflects.
struct PrincipledAlbedo {
    vec3 specular;
    vec3 diffuse;
};

PrincipledAlbedo principled_albedo(Material material, float cosine) {
    float metallic = material.ior;
    vec2 specular = ggx_schlick_albedo(material.table_offset, material.alpha, cosine);
    float rise = cosine_table(material.table_offset + DIFFUSE_RISE_OFFSET, 1u, cosine);
    vec3 dielectric = mix(material.eta, material.k, rise);
    float strongest = largest_of(dielectric);
    return PrincipledAlbedo(
        mix(material.eta, material.reflectance, metallic) * specular.x
            + mix(material.k, vec3(1.0), metallic) * specular.y,
        (1.0 - metallic) * (1.0 - strongest) * material.reflectance);
}

// Probability of sampling the specular part of a principled material.
float principled_specular_share(Material material, float cosine) {
    PrincipledAlbedo albedo = principled_albedo(material, cosine);
    float specular = dot(albedo.specular, LUMINANCE_WEIGHTS);
    float sum = specular + dot(albedo.diffuse, LUMINANCE_WEIGHTS);
    return sum > 0.0 ? specular / sum : 0.5;
}

// Light of a uniform white hemisphere that what covers a principled material reflects.
vec3 cover_albedo(Material material, float cosine) {
    return cosine_table(material.cover_table, 1u, cosine) / largest_of(material.cover)
        * material.cover;
}

// Probability of sampling what covers a principled material.
float cover_share(Material material, float cosine) {
    PrincipledAlbedo albedo = principled_albedo(material, cosine);
    vec3 covering = cover_albedo(material, cosine);
    float base = (1.0 - largest_of(covering))
        * dot(albedo.specular + albedo.diffuse, LUMINANCE_WEIGHTS);
    float above = dot(covering, LUMINANCE_WEIGHTS);
    return above / (above + base);
}

// Metal and dielectric in one: `reflection` is that of GGX at unit reflectance. glTF 2.0, appendix B.
vec3 principled_value(Material material, float reflection, float cosine_difference) {
    float metallic = material.ior;
    vec3 metal = fresnel_schlick(cosine_difference, material.reflectance);
    vec3 dielectric = mix(material.eta, material.k, schlick_rise(cosine_difference));
    float strongest = largest_of(dielectric);
    vec3 base = (1.0 - strongest) / PI * material.reflectance;
    return mix(base + reflection * dielectric, reflection * metal, metallic);
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

// The two bins of an axis between whose centres a position lies, and its share of the way.
struct Between {
    uvec2 bins;
    float fraction;
};

// Bins around a position, in bins; the ends are held.
Between held_bins(float position, uint count) {
    position = clamp(position - 0.5, 0.0, float(count - 1u));
    uint lower = uint(whole(position));
    return Between(uvec2(lower, min(lower + 1u, count - 1u)), position - float(lower));
}

// Bins around a position, in bins, of an axis that closes.
Between closed_bins(float position, uint count) {
    position -= 0.5;
    if (position < 0.0) {
        position += float(count);
    }
    uint lower = min(uint(whole(position)), count - 1u);
    return Between(
        uvec2(lower, lower + 1u == count ? 0u : lower + 1u), position - float(lower));
}

// One of the two bins, with its weight in `weight`.
uint side(Between between, bool upper, inout float weight) {
    weight *= upper ? between.fraction : 1.0 - between.fraction;
    return upper ? between.bins.y : between.bins.x;
}

// Bins of θ_h in the grid and in its turns.
Between theta_half_bins(float theta_half) {
    return held_bins(
        float(MEASURED_THETA_HALF_BINS) * sqrt(theta_half * (2.0 / PI)), MEASURED_THETA_HALF_BINS);
}

// Bins of θ_d and φ_d, as many as a grid has.
void difference_bins(
    vec3 angles, uint theta_count, uint phi_count, out Between theta, out Between phi) {
    theta = held_bins(float(theta_count) * angles.y * (2.0 / PI), theta_count);
    phi = closed_bins(float(phi_count) * angles.z / PI, phi_count);
}

// Mixes two cells of a row that starts at a word: RGB from three halves.
vec3 measured_cells(uint row, Between phi) {
    uvec2 cells = row / 2u + phi.bins;
    return mix(
        texelFetch(brdf_cells, int(cells.x)).xyz, texelFetch(brdf_cells, int(cells.y)).xyz,
        phi.fraction);
}

// Measured BRDF, trilinear between the centres of the grid's bins; periodic in φ_d.
vec3 measured_value(uint table_offset, vec3 angles) {
    Between theta_half = theta_half_bins(angles.x);
    Between theta_difference;
    Between phi;
    difference_bins(
        angles, MEASURED_THETA_DIFFERENCE_BINS, MEASURED_PHI_DIFFERENCE_BINS, theta_difference,
        phi);
    vec3 value = vec3(0.0);
    for (uint corner = 0u; corner < 4u; ++corner) {
        float weight = 1.0;
        uint row = side(theta_half, (corner & 1u) != 0u, weight) * MEASURED_THETA_DIFFERENCE_BINS;
        row += side(theta_difference, (corner & 2u) != 0u, weight);
        row = table_offset + MEASURED_GRID_OFFSET + 2u * row * MEASURED_PHI_DIFFERENCE_BINS;
        value += weight * measured_cells(row, phi);
    }
    return value;
}

// Factor of the measured BRDF, which is a mean over all turns about the normal, at the turn of a surface
// whose unit tangent is `axis`.
vec3 measured_turn(uint table_offset, vec3 angles, vec3 half_vector, vec2 axis) {
    float y = axis.x * half_vector.y - axis.y * half_vector.x;
    float x = dot(axis, half_vector.xy);
    float azimuth = (x == 0.0 && y == 0.0) ? 0.0 : atan(y, x);
    Between theta_half = theta_half_bins(angles.x);
    Between theta_difference;
    Between phi;
    difference_bins(
        angles, MEASURED_TURN_THETA_DIFFERENCE_BINS, MEASURED_TURN_PHI_DIFFERENCE_BINS,
        theta_difference, phi);
    Between turn = closed_bins(
        float(MEASURED_TURN_BINS) * (azimuth * (0.5 / PI) + 0.5), MEASURED_TURN_BINS);
    vec3 factor = vec3(0.0);
    for (uint corner = 0u; corner < 8u; ++corner) {
        float weight = 1.0;
        uint row = side(theta_half, (corner & 1u) != 0u, weight);
        row = row * MEASURED_TURN_THETA_DIFFERENCE_BINS
            + side(theta_difference, (corner & 2u) != 0u, weight);
        row = row * MEASURED_TURN_BINS + side(turn, (corner & 4u) != 0u, weight);
        row = table_offset + MEASURED_TURN_OFFSET + 2u * row * MEASURED_TURN_PHI_DIFFERENCE_BINS;
        factor += weight * measured_cells(row, phi);
    }
    return factor;
}

// Bin of the outgoing polar angle in the sampling table.
uint measured_elevation_bin(vec3 outgoing_local) {
    float theta = atan(length(outgoing_local.xy), outgoing_local.z);
    return min(uint(whole(theta * (2.0 / PI) * float(MEASURED_ELEVATION_BINS))),
        MEASURED_ELEVATION_BINS - 1u);
}

// Unit azimuthal direction that is φ_h = 0 in the sampling table.
vec2 measured_azimuth_axis(vec3 outgoing_local) {
    float sine = length(outgoing_local.xy);
    return sine > 0.0 ? outgoing_local.xy / sine : vec2(1.0, 0.0);
}

// Material seen from one direction, with what no other direction changes: tables are read once for all
// incident directions. The twins work it out at each.
struct Reflector {
    Material material;
    vec3 outgoing_local;
    // Probability of sampling the specular part; of a measured material, the cosine lobe.
    float share;
    // Probability of sampling what covers a principled material; `share` is that of the rest.
    float cover_share;
    // Light that enters the base of a plastic, or what a coat covers, from the outgoing direction.
    float transmission;
    // ggx_stretched_length and ggx_cap_factor of the outgoing direction.
    float stretched;
    float cap_factor;
    // Bin of the outgoing polar angle of a measured material.
    uint elevation;
};

Reflector reflector_from(Material material, vec3 outgoing_local) {
    // From the other side of a sheet, to which trace.comp has turned the normals, it shows what it transmits;
    // each side over the probability of that.
    if (is_kind(material, MATERIAL_DIFFUSE_TRANSMISSION)) {
        material.reflectance *= outgoing_local.z < 0.0 ? material.eta : material.k;
        outgoing_local.z = abs(outgoing_local.z);
    }
    GgxWidth width = material_width(material);
    Reflector reflector = Reflector(
        material, outgoing_local, 0.0, 0.0, 0.0, ggx_stretched_length(outgoing_local, width),
        ggx_cap_factor(outgoing_local, width), 0u);
    if (is_kind(material, MATERIAL_CONDUCTOR)) {
        reflector.share = 1.0;
    }
    if (is_kind(material, MATERIAL_PLASTIC)) {
        uint offset = material.table_offset;
        reflector.share =
            cosine_table(offset + PLASTIC_SPECULAR_SHARE_OFFSET, 1u, outgoing_local.z);
        reflector.transmission =
            cosine_table(offset + COAT_TRANSMISSION_OFFSET, 1u, outgoing_local.z);
    }
    if (is_principled(material)) {
        reflector.share = principled_specular_share(material, outgoing_local.z);
    }
    if (is_covered(material)) {
        reflector.transmission = cosine_table(
            material.cover_table + COAT_TRANSMISSION_OFFSET, 1u, outgoing_local.z);
        reflector.cover_share = cover_share(material, outgoing_local.z);
    }
    if (is_kind(material, MATERIAL_MEASURED)) {
        reflector.elevation = measured_elevation_bin(outgoing_local);
        reflector.share = table_value(
            material.table_offset + MEASURED_COSINE_SHARE_OFFSET + reflector.elevation);
    }
    return reflector;
}

// Density of measured_sample: cosine lobe and tabulated half vectors.
float measured_pdf(Reflector reflector, vec3 incident_local, float theta_half) {
    uint table_offset = reflector.material.table_offset;
    vec3 half_vector = reflector.outgoing_local + incident_local;
    uint elevation = reflector.elevation;
    float cosine_share = reflector.share;
    uint polar = min(
        uint(whole(float(MEASURED_POLAR_BINS) * sqrt(theta_half * (2.0 / PI)))),
        MEASURED_POLAR_BINS - 1u);
    vec2 axis = measured_azimuth_axis(reflector.outgoing_local);
    float y = abs(axis.x * half_vector.y - axis.y * half_vector.x);
    float x = dot(axis, half_vector.xy);
    float phi = (x == 0.0 && y == 0.0) ? 0.0 : atan(y, x);
    uint azimuth = min(
        uint(whole(float(MEASURED_AZIMUTH_BINS) * phi / PI)), MEASURED_AZIMUTH_BINS - 1u);
    float density = table_value(table_offset + MEASURED_DENSITY_OFFSET
        + elevation * MEASURED_SAMPLING_CELLS + polar * MEASURED_AZIMUTH_BINS + azimuth);
    // dω_h/dω_i = 1/(4 ω_o·h), and ω_o·h is half the length of the half vector.
    return cosine_share * incident_local.z / PI
        + (1.0 - cosine_share) * density / (2.0 * length(half_vector));
}

// Samples an incident direction from the cosine lobe or the tabulated half vectors; z ≤ 0 means no
// sample.
vec3 measured_sample(Reflector reflector, vec3 u) {
    uint table_offset = reflector.material.table_offset;
    vec3 outgoing_local = reflector.outgoing_local;
    uint elevation = reflector.elevation;
    float cosine_share = reflector.share;
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

// Adds a coat or a sheen to value and density of a principled material. Light between both is as that of
// a plastic's coat and diffuse base [Kelemen & Szirmay-Kalos 2001].
void cover(
    Reflector reflector, vec3 incident_local, vec3 half_vector, float cosine_difference,
    inout vec3 value, inout float pdf) {
    Material material = reflector.material;
    vec3 outgoing_local = reflector.outgoing_local;
    float covering;
    float cover_pdf;
    if (is_kind(material, MATERIAL_SHEEN)) {
        covering = sheen_value(
            half_vector, outgoing_local.z, incident_local.z, material.cover_alpha);
        cover_pdf = 0.5 / PI;
    } else {
        GgxWidth width = round_width(material.cover_alpha);
        float stretched = ggx_stretched_length(outgoing_local, width);
        covering = mix(COAT_REFLECTANCE, 1.0, schlick_rise(cosine_difference))
            * ggx_reflection(half_vector, outgoing_local, stretched, incident_local, width);
        cover_pdf = ggx_pdf(
            half_vector, outgoing_local, stretched, ggx_cap_factor(outgoing_local, width), width);
    }
    float base = reflector.transmission
        * cosine_table(material.cover_table + COAT_TRANSMISSION_OFFSET, 1u, incident_local.z);
    value = base * value + covering * material.cover;
    pdf = mix(pdf, cover_pdf, reflector.cover_share);
}

// Value (1/sr, without the cosine) and density of brdf_sample at one pair of directions. The density
// integrates over the hemisphere to 1 less the share of samples below the surface.
void brdf_evaluate_and_pdf(
    Reflector reflector, vec3 incident_local, out vec3 value, out float pdf) {
    Material material = reflector.material;
    vec3 outgoing_local = reflector.outgoing_local;
    value = vec3(0.0);
    pdf = 0.0;
    if (outgoing_local.z <= 0.0 || incident_local.z <= 0.0) {
        return;
    }
    float cosine_pdf = incident_local.z / PI;
    if (is_diffuse(material)) {
        value = material.reflectance / PI;
        pdf = cosine_pdf;
        return;
    }
    if (is_kind(material, MATERIAL_MEASURED)) {
        // Mirror a table that is seen from behind, which an axis of length 2 tells. The twins see fronts.
        bool is_back = IS_ANISOTROPIC && dot(material.anisotropy, material.anisotropy) > 2.0;
        vec3 image = vec3(1.0, is_back ? -1.0 : 1.0, 1.0);
        vec3 angles = half_difference_angles(image * outgoing_local, image * incident_local);
        value = measured_value(material.table_offset, angles);
        if (IS_ANISOTROPIC && material.anisotropy != vec2(0.0)) {
            value *= measured_turn(
                material.table_offset, angles, image * (outgoing_local + incident_local),
                image.xy * material.anisotropy);
        }
        pdf = measured_pdf(reflector, incident_local, angles.x);
        return;
    }
    vec3 half_vector = outgoing_local + incident_local;
    float cosine_difference = min(1.0, 0.5 * length(half_vector));
    GgxWidth width = material_width(material);
    float reflection = ggx_reflection(
        half_vector, outgoing_local, reflector.stretched, incident_local, width);
    pdf = ggx_pdf(half_vector, outgoing_local, reflector.stretched, reflector.cap_factor, width);
    if (is_kind(material, MATERIAL_PLASTIC)) {
        float base = reflector.transmission
            * cosine_table(
                material.table_offset + COAT_TRANSMISSION_OFFSET, 1u, incident_local.z) / PI;
        value = vec3(reflection * fresnel_dielectric(cosine_difference, material.ior))
            + base * material.reflectance;
        pdf = mix(cosine_pdf, pdf, reflector.share);
    } else if (is_principled(material)) {
        value = principled_value(material, reflection, cosine_difference);
        pdf = mix(cosine_pdf, pdf, reflector.share);
        if (is_covered(material)) {
            cover(reflector, incident_local, half_vector, cosine_difference, value, pdf);
        }
    } else if (is_kind(material, MATERIAL_CONDUCTOR) && material.ior > 0.0) {
        value = reflection * material.reflectance
            * fresnel_conductor(cosine_difference, material.eta, material.k);
    } else if (is_kind(material, MATERIAL_CONDUCTOR)) {
        value = reflection * fresnel_schlick(cosine_difference, material.reflectance);
    } else {
        pdf = 0.0;
    }
}

// Value, 1/sr, without the cosine.
vec3 brdf_evaluate(Reflector reflector, vec3 incident_local) {
    vec3 value;
    float pdf;
    brdf_evaluate_and_pdf(reflector, incident_local, value, pdf);
    return value;
}

// Samples an incident direction with three numbers in [0, 1); z ≤ 0 means no sample, which counts
// as one with contribution 0.
vec3 brdf_sample(Reflector reflector, vec3 u) {
    Material material = reflector.material;
    bool is_sampled = is_diffuse(material) || is_kind(material, MATERIAL_PLASTIC)
        || is_kind(material, MATERIAL_CONDUCTOR) || is_kind(material, MATERIAL_MEASURED)
        || is_principled(material);
    if (reflector.outgoing_local.z <= 0.0 || !is_sampled) {
        return vec3(0.0, 0.0, -1.0);
    }
    if (is_kind(material, MATERIAL_MEASURED)) {
        return measured_sample(reflector, u);
    }
    float share = reflector.share;
    if (is_covered(material)) {
        if (u.x < reflector.cover_share) {
            if (is_kind(material, MATERIAL_SHEEN)) {
                return sample_uniform_hemisphere(u.yz);
            }
            GgxWidth width = round_width(material.cover_alpha);
            float cap_factor = ggx_cap_factor(reflector.outgoing_local, width);
            return ggx_sample(reflector.outgoing_local, width, cap_factor, u.yz);
        }
        share = mix(share, 1.0, reflector.cover_share);
    }
    if (u.x < share) {
        return ggx_sample(
            reflector.outgoing_local, material_width(material), reflector.cap_factor, u.yz);
    }
    return sample_cosine_hemisphere(u.yz);
}

// Share of light from a uniform white hemisphere reflected toward the outgoing direction, 0…1, for
// the albedo image. Dielectrics, panes and sheets count transmitted light too, the first seen from outside
// and as if smooth.
vec3 brdf_albedo(Material material, vec3 outgoing_local) {
    if (is_kind(material, MATERIAL_DIFFUSE) || is_kind(material, MATERIAL_MIRROR)) {
        return material.reflectance;
    }
    if (is_kind(material, MATERIAL_DIFFUSE_TRANSMISSION)) {
        return material.reflectance * mix(material.eta, material.k, material.ior);
    }
    uint offset = material.table_offset;
    if (is_kind(material, MATERIAL_PLASTIC)) {
        float coat = cosine_table(offset, 1u, outgoing_local.z);
        return vec3(coat) + (1.0 - coat) * material.reflectance;
    }
    if (is_principled(material)) {
        PrincipledAlbedo albedo = principled_albedo(material, outgoing_local.z);
        if (is_covered(material)) {
            vec3 covering = cover_albedo(material, outgoing_local.z);
            float rest = 1.0 - largest_of(covering);
            float transmission = cosine_table(
                material.cover_table + COAT_TRANSMISSION_OFFSET, 1u, outgoing_local.z);
            // Smooth surfaces send on light of the same elevation, rough ones of all.
            float spread = material.alpha / (material.alpha + 0.05);
            albedo.specular *= mix(transmission * transmission, rest, spread);
            albedo.specular += covering;
            albedo.diffuse *= rest;
        }
        return min(albedo.specular + albedo.diffuse, vec3(1.0));
    }
    if (is_kind(material, MATERIAL_CONDUCTOR) && material.ior == 0.0) {
        vec2 shares = ggx_schlick_albedo(offset, material.alpha, outgoing_local.z);
        return material.reflectance * shares.x + vec3(shares.y);
    }
    if (is_kind(material, MATERIAL_DIELECTRIC)) {
        float fresnel = fresnel_interface(abs(outgoing_local.z), material.ior);
        return mix(material.eta, material.reflectance, fresnel);
    }
    if (is_kind(material, MATERIAL_THIN_DIELECTRIC) || is_kind(material, MATERIAL_ROUGH_PANE)) {
        return pane_reflectance(material, outgoing_local.z)
            + pane_transmittance(material, outgoing_local.z);
    }
    if (!is_kind(material, MATERIAL_CONDUCTOR) && !is_kind(material, MATERIAL_MEASURED)) {
        return vec3(0.0);
    }
    vec3 albedo = vec3(
        cosine_table(offset, 3u, outgoing_local.z),
        cosine_table(offset + 1u, 3u, outgoing_local.z),
        cosine_table(offset + 2u, 3u, outgoing_local.z));
    return is_kind(material, MATERIAL_CONDUCTOR) ? material.reflectance * albedo : albedo;
}
