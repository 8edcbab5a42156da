// Sheen of cloth by KHR_materials_sheen: fibres by Charlie's distribution, with its masking [Estevez & Kulla
// 2017]. Twin: src/brdf/sheen.rs.

#include "frame.glsl"

// Logarithm of masking as they fit it, for cosines of 0 to 1/2.
float sheen_fit(float cosine, float alpha) {
    float gloss = (1.0 - alpha) * (1.0 - alpha);
    float a = mix(21.5473, 25.3245, gloss);
    float b = mix(3.82987, 3.32435, gloss);
    float c = mix(0.19823, 0.16801, gloss);
    float d = mix(-1.97760, -1.27393, gloss);
    float e = mix(-4.32054, -4.85967, gloss);
    return a / (1.0 + b * pow(cosine, c)) + d * cosine + e;
}

float sheen_lambda(float cosine, float alpha) {
    return exp(
        cosine < 0.5 ? sheen_fit(cosine, alpha)
                     : 2.0 * sheen_fit(0.5, alpha) - sheen_fit(1.0 - cosine, alpha));
}

// Value of a white sheen, 1/sr, for a half vector of any length.
float sheen_value(vec3 half_vector, float outgoing_cosine, float incident_cosine, float alpha) {
    float squared_sine = dot(half_vector.xy, half_vector.xy) / dot(half_vector, half_vector);
    float inverse = 1.0 / alpha;
    float density = (2.0 + inverse) * pow(squared_sine, 0.5 * inverse) / (2.0 * PI);
    float masking =
        1.0 + sheen_lambda(outgoing_cosine, alpha) + sheen_lambda(incident_cosine, alpha);
    return density * min(1.0 / (4.0 * masking * outgoing_cosine * incident_cosine), 1.0);
}
