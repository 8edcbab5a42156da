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

    vec3 color = texture_value(surface.color, attributes.uv0, attributes.uv1).rgb;
    if ((surface.flags & SURFACE_VERTEX_COLOR) != 0u) {
        color *= attributes.color.rgb;
    }
    float roughness = texture_number(surface.roughness, attributes.uv0, attributes.uv1);
    float metallic = texture_number(surface.metallic, attributes.uv0, attributes.uv1);
    hit_surfaces[path] = Surface(
        clamp(material.reflectance * color, 0.0, 1.0),
        clamp(material.alpha * roughness * roughness, min(material.alpha, SMALLEST_ALPHA), 1.0),
        clamp(material.ior * metallic, 0.0, 1.0));

    if (surface.normal != NO_TEXTURE) {
        float side = is_back(hit.triangle, instance, ray.direction) ? -1.0 : 1.0;
        vec3 mapped = mapped_normal(
            surface.normal, surface.normal_scale, hit.triangle, instance, attributes,
            hit.shading_normal, side);
        hits[path].shading_normal =
            visible_normal(mapped, hit.geometric_normal, ray.direction);
    }
}

WALK_PATHS(read_textures)
