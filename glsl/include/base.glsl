// Base of the BRDF at a second vertex: the part whose light looks the same from all directions but for a
// factor. value = base_view(outgoing) * base_part(incident) + rest, and the rest is not negative.

#include "brdf.glsl"

bool has_base(Material material) {
    return ((1u << material.kind) & KINDS_WITH_BASE) != 0u;
}

// Separable part of a measured BRDF, sqrt(1/sr): crates/scene/src/measured/base.rs.
vec3 measured_base(uint table_offset, float cosine) {
    uint offset = table_offset + MEASURED_BASE_OFFSET;
    return vec3(
        cosine_table(offset, 3u, cosine), cosine_table(offset + 1u, 3u, cosine),
        cosine_table(offset + 2u, 3u, cosine));
}

// Factor of the base by the cosine of the outgoing direction.
vec3 base_view(Material material, float cosine) {
    if (is_kind(material, MATERIAL_PLASTIC)) {
        return vec3(
            cosine_table(material.table_offset + PLASTIC_TRANSMISSION_OFFSET, 1u, cosine));
    }
    if (is_kind(material, MATERIAL_MEASURED)) {
        return measured_base(material.table_offset, cosine);
    }
    return vec3(1.0);
}

// Rest of the base by the cosine of the incident direction; 1/sr together.
vec3 base_part(Material material, float cosine) {
    if (is_kind(material, MATERIAL_MEASURED)) {
        return measured_base(material.table_offset, cosine);
    }
    float factor = 1.0;
    if (is_kind(material, MATERIAL_PLASTIC)) {
        factor = cosine_table(material.table_offset + PLASTIC_TRANSMISSION_OFFSET, 1u, cosine);
    } else if (is_kind(material, MATERIAL_PRINCIPLED)) {
        // Least of 1 - F over the outgoing directions: they are at most 90 degrees + theta away, and so
        // at most half of that from the half vector.
        float sine = sqrt(max(0.0, 1.0 - cosine * cosine));
        vec3 fresnel =
            mix(material.eta, material.k, schlick_rise(sqrt(max(0.0, 0.5 * (1.0 - sine)))));
        float strongest = max(fresnel.r, max(fresnel.g, fresnel.b));
        factor = (1.0 - material.ior) * max(0.0, 1.0 - strongest);
    }
    return factor / PI * material.reflectance;
}

// Share of the base in what the BRDF reflects from one direction into another.
vec3 base_share(Reflector reflector, vec3 incident_local) {
    Material material = reflector.material;
    if (is_kind(material, MATERIAL_DIFFUSE)) {
        return vec3(1.0);
    }
    vec3 value = brdf_evaluate(reflector, incident_local);
    vec3 base = base_view(material, reflector.outgoing_local.z) * base_part(material, incident_local.z);
    return mix(vec3(0.0), base / value, greaterThan(value, vec3(0.0)));
}
