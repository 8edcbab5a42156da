// Adds the light that surfaces emit where rays meet them: all of it where no light was sampled at the
// ray's origin, else the share of the BRDF's sampling in the balance heuristic with sample_lamps.comp.
#version 460

#include "hit_instance.glsl"
#include "lamps.glsl"
#include "light_groups.glsl"
#include "load.glsl"
#include "path_list.glsl"
#include "wave.glsl"

TEXELS(lamp_list_texels)
WRITES(paths)

void add_emission(uint path) {
    Hit hit = load_hit(path);
    if (hit.triangle == NO_TRIANGLE) {
        return;
    }
    uint instance = load_hit_instance(path);
    MaterialSurface surface =
        load_material_surface(triangle_material(hit.triangle, instance));
    if (surface.emission_radiance == vec3(0.0)) {
        return;
    }
    Ray ray = load_ray(path);
    bool is_behind = is_back(hit.triangle, instance, ray.direction);
    vec3 radiance = emitted_radiance(
        hit.triangle, barycentric(hit.triangle, instance, ray.origin, ray.direction), is_behind);
    float weight = 1.0;
    float pdf = abs(ray.brdf_pdf);
    if (pdf > 0.0) {
        float cosine = abs(dot(ray.direction, hit.geometric_normal));
        float density = surface.emission_density;
        if (HAS_LAMP_CELLS) {
            uint list = texelFetch(lamp_list_texels, int(path)).x;
            density *= lamp_ratio(list, lamp_cluster(hit.triangle));
        }
        weight = pdf / (pdf + lamp_pdf(density, hit.distance, cosine));
    }
    PathState state = load_path_state(path);
    precise vec3 light = state.throughput * radiance * weight;
    paths[path].radiance = state.radiance + light;
    add_to_group(path, surface.light_group, light);
}

WALK_PATHS(add_emission)
