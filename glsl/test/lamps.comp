// Probe of lamps.glsl: the list of a place, a draw from it, and its ratio. For tests/lamps.rs.
#version 460

#include "lamps.glsl"
#include "test/answers.glsl"

struct LampQuery {
    vec3 position;
    vec3 normal;
    uvec2 bits;
};

struct LampAnswer {
    uint source;
    float probability;
    // By the way of emit.comp, over the area.
    float found_probability;
};

LampAnswer answer(LampQuery query) {
    uint list = lamp_list(query.position, query.normal);
    DrawnLamp drawn = draw_lamp(list, query.bits);
    vec3 corners[3];
    for (uint corner = 0u; corner < 3u; ++corner) {
        corners[corner] = uintBitsToFloat(triangle_texel(drawn.source, corner).xyz);
    }
    float area = 0.5 * length(cross(corners[1] - corners[0], corners[2] - corners[0]));
    MaterialSurface surface = load_material_surface(mesh_material(drawn.source));
    float ratio = lamp_ratio(list, lamp_cluster(drawn.source));
    return LampAnswer(drawn.source, drawn.probability, surface.emission_density * ratio * area);
}

ANSWER_QUERIES(LampQuery, LampAnswer, answer)
