// Starts the paths of a wave with one camera ray each, sampling pixel and thin lens.
#version 460

#include "frame.glsl"
#include "light_groups.glsl"
#include "random.glsl"
#include "wave.glsl"
#include "reconstruction.glsl"

WRITES(rays)
WRITES(paths)
WRITES(path_lists)

void main() {
    uint path = gl_GlobalInvocationID.x;
    if (path < PATH_LISTS) {
        path_lists[path] = 0u;
    }
    if (path >= wave_path_count()) {
        return;
    }
    PathIndex index = wave_path(path);
    vec2 position = vec2(index.crop_pixel + uvec2(parameters.crop_x, parameters.crop_y)) + 0.5
        + sample_offset(index.pixel, index.sample_index, wave.seed);

    vec2 film_size = vec2(parameters.film_width, parameters.film_height);
    vec2 plane = ((2.0 * position - film_size) / film_size.y + parameters.camera_shift)
        * parameters.camera_tan_half_fov;
    vec3 direction = parameters.camera_forward + plane.x * parameters.camera_right
        - plane.y * parameters.camera_up;
    vec3 origin = parameters.camera_position;
    if (parameters.camera_aperture_radius > 0.0) {
        vec2 u = random_2d(index.pixel, index.sample_index, DIMENSION_LENS, wave.seed);
        vec2 azimuth = sin_cos_pi(2.0 * u.y);
        vec2 lens = parameters.camera_aperture_radius * sqrt(u.x) * azimuth.yx;
        vec3 shift = lens.x * parameters.camera_right + lens.y * parameters.camera_up;
        // Aim every lens point at the same point in the plane of focus.
        direction = parameters.camera_focus_distance * direction - shift;
        origin += shift;
    }

    rays[path] = Ray(origin, index.inside ? 1u : 0u, normalize(direction), 0.0);
    paths[path] = PathState(
        vec3(1.0), 0u, vec3(0.0), 0u, index.inside ? 1u : 0u, vec3(0.0));
    for (uint group = 0u; group < LIGHT_GROUPS; ++group) {
        group_radiance[group_place(path, group)] = vec3(0.0);
    }
}
