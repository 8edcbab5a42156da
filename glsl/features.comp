// Keeps what the layers of surfaces show of every path: position of its first hit, albedo and shading
// normal of the first surface that is no perfect mirror, smooth glass or pane. Denoisers want these of
// what is seen in mirrors and through glass: https://www.openimagedenoise.org/documentation.html
#version 460

#include "brdf.glsl"
#include "frame.glsl"
#include "hit_instance.glsl"
#include "hit_surface.glsl"
#include "load.glsl"
#include "path_list.glsl"
#include "wave.glsl"

UPDATES(features)

// Tests whether paths go on in a single direction of reflection, or of refraction.
bool is_perfectly_specular(Material material) {
    return is_specular(material.kind) && material.alpha == 0.0;
}

void keep_features(uint path) {
    Hit hit = load_hit(path);
    Ray ray = load_ray(path);
    Feature feature = Feature(vec3(0.0), 0u, vec3(0.0), hit.position);
    if (wave.vertex > 0u) {
        feature.position = features[path].position;
        // A path that has ended shows the surface where it did.
        if (features[path].is_open == 0u || ray.is_active == 0u) {
            return;
        }
    }
    if (hit.triangle != NO_TRIANGLE) {
        Frame frame = frame_from_normal(hit.shading_normal);
        Material material =
            load_surface(path, triangle_material(hit.triangle, load_hit_instance(path)));
        feature.albedo = load_path_state(path).throughput
            * brdf_albedo(material, to_local(frame, -ray.direction));
        feature.normal = faceforward(hit.shading_normal, ray.direction, hit.geometric_normal);
        feature.is_open = is_perfectly_specular(material) ? 1u : 0u;
    }
    features[path] = feature;
}

WALK_PATHS(keep_features)
