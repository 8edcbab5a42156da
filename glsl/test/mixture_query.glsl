// Query of probes that draw from a mixture.

#include "product/techniques.glsl"

struct MixtureQuery {
    uint path;
    // 1 draws a direction from the numbers, 0 takes the given one.
    uint draws;
    vec3 direction;
    float technique;
    vec2 direction_numbers;
    float lobe;
};

MixtureNumbers numbers_of(MixtureQuery query) {
    return MixtureNumbers(query.technique, query.direction_numbers, query.lobe);
}
