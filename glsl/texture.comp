// Reads the textures and vertex colours at every hit: hits -> hit_surfaces, and shading normals by
// normal maps. Later passes evaluate the BRDF with these values.
#version 460

#include "ggx.glsl"
#include "hit_instance.glsl"
#include "load.glsl"
#include "path_list.glsl"
#include "texture.glsl"
#include "wave.glsl"

WRITES(hits)
WRITES(hit_surfaces)

// As SMALLEST_ALPHA of src/brdf/ggx.rs.
const float SMALLEST_ALPHA = 1.0e-3;

void read_textures(uint path) {
    Hit hit = load_hit(path);
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
    vec3 anisotropy = vec3(1.0);
    float roughness = 1.0;
    float metallic = 1.0;
    bool has_direction = IS_ANISOTROPIC && surface.anisotropy_direction != NO_TEXTURE;
    uint count = has_direction ? 5u : (surface.normal != NO_TEXTURE ? 4u : 3u);
    for (uint property = 0u; property < count; property++) {
        uint use_index = property == 0u ? surface.color
            : property == 1u            ? surface.roughness
            : property == 2u            ? surface.metallic
            : property == 3u            ? surface.normal
                                        : surface.anisotropy_direction;
        vec3 value = texture_value(use_index, attributes.uv0, attributes.uv1).rgb;
        float number = dot(value, LUMINANCE_WEIGHTS);
        color = property == 0u ? value : color;
        roughness = property == 1u ? number : roughness;
        metallic = property == 2u ? number : metallic;
        normal = property == 4u ? normal : value;
        anisotropy = value;
    }
    if ((surface.flags & SURFACE_VERTEX_COLOR) != 0u) {
        color *= attributes.color.rgb;
    }
    // The smaller of the two widths.
    float alpha = IS_ANISOTROPIC ? material.alpha * (1.0 - length(material.anisotropy))
                                 : material.alpha;
    GgxWidth width = round_width(
        clamp(alpha * roughness * roughness, min(alpha, SMALLEST_ALPHA), 1.0));
    bool is_stretched = IS_ANISOTROPIC && surface.anisotropy != vec2(0.0);
    if (surface.normal != NO_TEXTURE || is_stretched) {
        float side = is_back(hit.triangle, instance, ray.direction) ? -1.0 : 1.0;
        // trace.comp may have turned the normals to the other side of a sheet.
        float turn = dot(hit.geometric_normal, ray.direction) > 0.0 ? -1.0 : 1.0;
        vec3 shading_normal = hit.shading_normal;
        if (surface.normal != NO_TEXTURE) {
            vec3 mapped = mapped_normal(
                surface.normal, normal, surface.normal_scale, hit.triangle, instance, attributes,
                turn * hit.shading_normal, side);
            shading_normal =
                turn * visible_normal(mapped, turn * hit.geometric_normal, ray.direction);
            hits[path].shading_normal = shading_normal;
        }
        if (is_stretched) {
            vec3 front = turn * side * hit.shading_normal;
            vec4 tangent = surface_tangent(
                surface.anisotropy_direction, hit.triangle, instance, attributes, front);
            vec2 axis = surface.anisotropy;
            if (has_direction) {
                axis = anisotropy.z * turned_by(axis, 2.0 * anisotropy.xy - 1.0);
            }
            vec2 direction = along_surface(axis, tangent, front, shading_normal);
            if (material.kind == MATERIAL_MEASURED) {
                // Turns of a table are those of its front: an axis of length 2 tells of the back.
                width.anisotropy = side < 0.0 ? 2.0 * direction : direction;
            } else {
                width = stretched_width(width.alpha, length(axis), direction);
            }
        }
    }
    hit_surfaces[path] = Surface(
        clamp((is_glass(material) ? material.eta : material.reflectance) * color, 0.0, 1.0), width.alpha,
        clamp(material.ior * metallic, 0.0, 1.0), width.anisotropy, 0.0);
}

WALK_PATHS(read_textures)
