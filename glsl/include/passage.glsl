// Light that goes straight through surfaces: where they are not opaque, and through thin panes.

#define MEETS_PASSAGES
#include "bvh.glsl"
#include "load.glsl"
#include "specular.glsl"
#include "texture.glsl"

// Light at a point of a surface, by what becomes of it.
struct Passing {
    // Share that goes straight through.
    vec3 passed;
    // Share that meets the surface.
    float met;
    // As much of it as counts for the chance to go on: of a pane that emits nothing, what it reflects.
    float kept;
};

Passing passing(uint triangle, uint instance, vec3 weights, vec3 normal) {
    uint index = triangle_material(triangle, instance);
    MaterialSurface surface = load_material_surface(index);
    Attributes attributes = triangle_attributes(triangle, weights);
    float opacity = surface_opacity(surface, attributes);
    Material material = load_material(index);
    Passing shares = Passing(vec3(1.0 - opacity), opacity, opacity);
    if (is_kind(material, MATERIAL_THIN_DIELECTRIC)) {
        if (HAS_TINTED_PANES) {
            material.eta = clamp(material.eta * surface_color(surface, attributes), 0.0, 1.0);
        }
        float cosine = abs(normal.z) / max(length(normal), 1.0e-37);
        shares.passed += opacity * pane_transmittance(material, cosine);
        if (surface.emission_radiance == vec3(0.0)) {
            shares.kept = opacity * dot(pane_reflectance(material, cosine), LUMINANCE_WEIGHTS);
        }
    }
    return shares;
}

vec3 passage(uint triangle, uint instance, vec3 weights, vec3 normal) {
    return passing(triangle, instance, weights, normal).passed;
}
