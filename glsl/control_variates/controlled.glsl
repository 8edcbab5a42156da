// One shadow ray chosen among candidates, with the expected visibility of all candidates as control
// variate. [Clarberg & Akenine-Möller 2008b], [Lavenberg & Welch 1981]. Twin of
// src/sampler/control_variates/controlled.rs.
//
// Candidate c has the weight w_c, its integrand without occlusion over its density, and the expected
// visibility v_c. With n candidates, one of them, i, chosen with probability q_i, and its visibility V,
//
//     1/n sum_c w_c a v_c  +  w_i (V - a v_i) / (n q_i)
//
// has the mean 1/n sum_c w_c V_c whatever v, a and q > 0 are, since the choice knows no V.
//
// Deviation: the first sum takes the candidates of the ray themselves, from which the ray is chosen, in
// place of a second set of directions: double sampling [Neyman 1938].
//
// Deviation: q goes by the light of a candidate times the root mean square of V - a v that its record
// expects, sqrt(v (1 - a)^2 + a^2 v (1 - v)) for a share v of visible rays. The paper follows the light alone
// (`control-choice=off`).

#ifndef CONTROLLED_GLSL
#define CONTROLLED_GLSL

#include "layout.glsl"

layout(constant_id = CONSTANT_CONTROL_SHARE) const float CONTROL_SHARE = 1.0;
layout(constant_id = CONSTANT_CONTROL_CHOICE) const bool CONTROL_CHOICE = true;

// Least mean square of V - a v: bounds the weight of a direction that its record takes for certain.
const float LEAST_DOUBT = 0.01;

struct Controlled {
    vec3 direction;
    // Weight and expected visibility of the chosen candidate, and what it was chosen in proportion to.
    vec3 weight;
    float visibility;
    float target;
    // Sums over all candidates.
    float target_sum;
    vec3 control_sum;
    // Random number, rescaled after each choice for the next.
    float u;
};

// Root mean square of V - a v where a share v of the rays is visible.
float doubt(float visibility) {
    float left = 1.0 - CONTROL_SHARE;
    float square = visibility * (left * left)
        + CONTROL_SHARE * CONTROL_SHARE * visibility * (1.0 - visibility);
    return sqrt(max(square, LEAST_DOUBT));
}

Controlled controlled_start(float u) {
    return Controlled(vec3(0.0), vec3(0.0), 0.0, 0.0, 0.0, vec3(0.0), u);
}

void controlled_add(inout Controlled chosen, vec3 direction, vec3 weight, float visibility) {
    chosen.control_sum += weight * (CONTROL_SHARE * visibility);
    float target = dot(weight, LUMINANCE_WEIGHTS) * (CONTROL_CHOICE ? doubt(visibility) : 1.0);
    chosen.target_sum += target;
    if (target > 0.0) {
        float probability = target / chosen.target_sum;
        if (chosen.u < probability) {
            chosen.u /= probability;
            chosen.direction = direction;
            chosen.weight = weight;
            chosen.visibility = visibility;
            chosen.target = target;
        } else {
            chosen.u = (chosen.u - probability) / (1.0 - probability);
        }
    }
}

// w_i / (n q_i), the contribution of the chosen candidate if it is visible.
vec3 controlled_contribution(Controlled chosen, uint candidates) {
    float factor = chosen.target > 0.0
        ? chosen.target_sum / (float(candidates) * chosen.target)
        : 0.0;
    return chosen.weight * factor;
}

// The rest, visible or not: expected light of all candidates less that of the chosen one. May be negative.
vec3 controlled_rest(Controlled chosen, uint candidates, vec3 contribution) {
    return chosen.control_sum / float(candidates)
        - contribution * (CONTROL_SHARE * chosen.visibility);
}

#endif
