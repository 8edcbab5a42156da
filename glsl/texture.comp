// Reads the textures and vertex colours at every hit: hits -> hit_surfaces, and shading normals by
// normal maps. Later passes evaluate the BRDF with these values.
#version 460

#include "hit_instance.glsl"
#include "load.glsl"
#include "path_list.glsl"
#include "texture.glsl"
#include "wave.glsl"

UPDATES(hits)
WRITES(hit_surfaces)

// As SMALLEST_ALPHA of src/brdf/ggx.rs.
const float SMALLEST_ALPHA = 1.0e-3;

void read_textures(uint path) {
    Hit hit = hits[path];
    if (hit.triangle == NO_TRIANGLE) {
        return;
    }
    uint instance = load_hit_instance(path);
    uint index = triangle_material(hit.triangle, instance);
    Material material = load_material(index);
    MaterialSurface surface = load_material_surface(index);
    Ray ray = load_ray(path);
    Attributes attributes = triangle_attributes(
        hit.triangle, barycentric(hit.triangle, instance, ray.origin, ray.direction));

    // A loop, since drivers copy a lookup into each place that calls it.
    vec3 color = vec3(1.0);
    vec3 normal = vec3(0.0);
    float roughness = 1.0;
    float metallic = 1.0;
    uint count = surface.normal != NO_TEXTURE ? 4u : 3u;
    for (uint property = 0u; property < count; property++) {
        uint use_index = property == 0u ? surface.color
            : property == 1u            ? surface.roughness
            : property == 2u            ? surface.metallic
                                        : surface.normal;
        vec3 value = texture_value(use_index, attributes.uv0, attributes.uv1).rgb;
        float number = dot(value, LUMINANCE_WEIGHTS);
        color = property == 0u ? value : color;
        roughness = property == 1u ? number : roughness;
        metallic = property == 2u ? number : metallic;
        normal = value;
    }
    if ((surface.flags & SURFACE_VERTEX_COLOR) != 0u) {
        color *= attributes.color.rgb;
    }
    hit_surfaces[path] = Surface(
        clamp(material.reflectance * color, 0.0, 1.0),
        clamp(material.alpha * roughness * roughness, min(material.alpha, SMALLEST_ALPHA), 1.0),
        clamp(material.ior * metallic, 0.0, 1.0));

    if (surface.normal != NO_TEXTURE) {
        float side = is_back(hit.triangle, instance, ray.direction) ? -1.0 : 1.0;
        // trace.comp may have turned the normals to the other side of a sheet.
        float turn = dot(hit.geometric_normal, ray.direction) > 0.0 ? -1.0 : 1.0;
        vec3 mapped = mapped_normal(
            surface.normal, normal, surface.normal_scale, hit.triangle, instance, attributes,
            turn * hit.shading_normal, side);
        hits[path].shading_normal =
            turn * visible_normal(mapped, turn * hit.geometric_normal, ray.direction);
    }
}

WALK_PATHS(read_textures)
