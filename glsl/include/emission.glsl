// Light that triangles emit.

#include "bvh.glsl"
#include "texture.glsl"

// Radiance that a triangle emits at barycentric coordinates, to its front or its back.
vec3 emitted_radiance(uint triangle, vec3 weights, bool is_back) {
    MaterialSurface surface = load_material_surface(mesh_material(triangle));
    vec3 radiance = surface.emission_radiance;
    if (is_back && (surface.flags & SURFACE_EMISSION_TWO_SIDED) == 0u) {
        return vec3(0.0);
    }
    if (surface.emission != NO_TEXTURE && radiance != vec3(0.0)) {
        Attributes attributes = triangle_attributes(triangle, weights);
        radiance *= texture_value(surface.emission, attributes.uv0, attributes.uv1).rgb;
    }
    return radiance;
}

// Probability with which a ray meets a triangle at a point rather than pass through it.
float meeting_share(uint triangle, vec3 weights) {
    return surface_opacity(
        load_material_surface(mesh_material(triangle)), triangle_attributes(triangle, weights));
}
