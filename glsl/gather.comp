// Adds visible shadow rays to every path, and the environment where rays escape: all of it where no
// light was sampled, which is seen directly, in a mirror or through glass; else the share of the
// bounce ray among the samples of `mis`, or beside that of sample_lamps.comp at rough glass, or nothing.
#version 460

#include "environment.glsl"
#include "light_groups.glsl"
#include "load.glsl"
#include "mis.glsl"
#include "path_list.glsl"
#include "wave.glsl"

TEXELS(lamp_group_texels)
WRITES(paths)

void gather_path(uint path) {
    uint path_count = wave_path_count();
    Hit hit = load_hit(path);
    vec3 light = vec3(0.0);
    float weight = 1.0;
    uint group = ENVIRONMENT_GROUP;
    uint traced = 0u;
    uint visible = 0u;
    if (has_shadow_rays(hit)) {
        for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
            uint ray = i * path_count + path;
            vec3 contribution = load_shadow_ray(ray).contribution;
            // Same test as in shadow.comp: rays without a contribution are not traced.
            bool is_traced = any(notEqual(contribution, vec3(0.0)));
            traced += is_traced ? 1u : 0u;
            if (is_traced && reaches_light(ray)) {
                visible += 1u;
                light += contribution;
            }
        }
        light /= float(max(wave.total_shadow_rays, 1u));
        if (LIGHT_GROUPS > 0u && wave.to_lamps != 0u) {
            group = texelFetch(lamp_group_texels, int(path)).x;
        }
    } else {
        Ray ray = load_ray(path);
        bool is_first = wave.first_shadow_ray == 0u && wave.to_lamps == 0u;
        uint rays = wave.arriving_shadow_rays;
        if (!is_first || ray.is_active == 0u || (ray.brdf_pdf > 0.0 && rays == 0u)
            || hit.triangle != NO_TRIANGLE) {
            return;
        }
        vec4 arriving = environment_light(ray.direction);
        light = arriving.xyz;
        if (ray.brdf_pdf != 0.0) {
            float environment_density = environment_pdf(ray.direction, arriving);
            float all = ray.brdf_pdf < 0.0
                ? ray.brdf_pdf - environment_density
                : float(rays) * mis_pdf(ray.brdf_pdf, environment_density, rays, 1u);
            weight = ray.brdf_pdf / all;
        }
    }
    PathState state = load_path_state(path);
    precise vec3 found = state.throughput * light * weight;
    paths[path].radiance = state.radiance + found;
    paths[path].shadow_rays_traced = state.shadow_rays_traced + traced;
    paths[path].shadow_rays_visible = state.shadow_rays_visible + visible;
    add_to_group(path, group, found);
}

WALK_PATHS(gather_path)
