// Adds the albedo, shading normal and position of camera-ray hits to the film, where requested.
#version 460

#include "brdf.glsl"
#include "frame.glsl"
#include "hit_instance.glsl"
#include "hit_surface.glsl"
#include "load.glsl"
#include "wave.glsl"

READS(rays)
READS(hits)
UPDATES(film_albedo)
UPDATES(film_normal)
UPDATES(film_position)

void add_features(uint pixel, PathIndex index) {
    uint place = film_place(index);
    // Add sample by sample: the sums must not depend on how samples are grouped into waves.
    bool wants_albedo = (wave.aovs & AOV_ALBEDO) != 0u;
    bool wants_normal = (wave.aovs & AOV_NORMAL) != 0u;
    bool wants_position = (wave.aovs & AOV_POSITION) != 0u;
    vec3 albedo = wants_albedo ? film_albedo[place] : vec3(0.0);
    vec3 normal = wants_normal ? film_normal[place] : vec3(0.0);
    vec3 position = wants_position ? film_position[place] : vec3(0.0);
    for (uint i = 0u; i < wave.sample_count; ++i) {
        uint path = i * wave.pixel_count + pixel;
        Hit hit = hits[path];
        if (hit.triangle == NO_TRIANGLE) {
            continue;
        }
        Frame frame = frame_from_normal(hit.shading_normal);
        Material material =
            load_surface(path, triangle_material(hit.triangle, load_hit_instance(path)));
        albedo += brdf_albedo(material, to_local(frame, -rays[path].direction));
        normal += hit.shading_normal;
        position += hit.position;
    }
    if (wants_albedo) {
        film_albedo[place] = albedo;
    }
    if (wants_normal) {
        film_normal[place] = normal;
    }
    if (wants_position) {
        film_position[place] = position;
    }
}

RUN_PIXELS(add_features)
