// One shadow ray chosen among candidates, with the expected visibility of all candidates as control
// variate. [Clarberg & Akenine-Möller 2008b], [Lavenberg & Welch 1981]. Twin of
// tests/twin/control_variates.rs.
//
// Candidate c has the weight w_c, its integrand without occlusion over its density, and the control h_c:
// a times the expected visibility v_c, as a bit or as a share. With n candidates, one of them, i, chosen
// with probability q_i, and its visibility V,
//
//     1/n sum_c w_c h_c  +  w_i (V - h_i) / (n q_i)
//
// has the mean 1/n sum_c w_c V_c whatever h and q > 0 are, since the choice knows no V.
//
// Deviation: the first sum takes the candidates of the ray themselves, from which the ray is chosen, in
// place of a second set of directions: double sampling [Neyman 1938].
//
// Deviation: q goes by the light of a candidate times the root mean square of V - h that its record
// expects, sqrt(v (1 - h)^2 + (1 - v) h^2). The paper follows the light alone (`control-choice=off`).

#include "layout.glsl"
#include "reservoir.glsl"

layout(constant_id = CONSTANT_CONTROL_SHARE) const float CONTROL_SHARE = 1.0;
layout(constant_id = CONSTANT_CONTROL_BITS) const bool CONTROL_BITS = true;
layout(constant_id = CONSTANT_CONTROL_CHOICE) const bool CONTROL_CHOICE = true;

// Least mean square of V - h: bounds the weight of a direction that its record takes for certain.
const float LEAST_DOUBT = 0.01;

struct Controlled {
    vec3 direction;
    // Weight and control of the chosen candidate.
    vec3 weight;
    float control;
    // Sum over all candidates.
    vec3 control_sum;
    Reservoir reservoir;
};

// h where a share `visibility` of the rays is visible.
float control_of(float visibility) {
    float expected = CONTROL_BITS ? (visibility >= 0.5 ? 1.0 : 0.0) : visibility;
    return CONTROL_SHARE * expected;
}

// Root mean square of V - h.
float doubt(float visibility, float control) {
    float left = 1.0 - control;
    float square = visibility * (left * left) + (1.0 - visibility) * (control * control);
    return sqrt(max(square, LEAST_DOUBT));
}

Controlled controlled_start(float u) {
    return Controlled(vec3(0.0), vec3(0.0), 0.0, vec3(0.0), reservoir_start(u));
}

void controlled_add(inout Controlled chosen, vec3 direction, vec3 weight, float visibility) {
    float control = control_of(visibility);
    chosen.control_sum += weight * control;
    float target =
        dot(weight, LUMINANCE_WEIGHTS) * (CONTROL_CHOICE ? doubt(visibility, control) : 1.0);
    if (reservoir_takes(chosen.reservoir, target, target)) {
        chosen.direction = direction;
        chosen.weight = weight;
        chosen.control = control;
    }
}

// w_i / (n q_i), the contribution of the chosen candidate if it is visible.
vec3 controlled_contribution(Controlled chosen, uint candidates) {
    return chosen.weight * reservoir_factor(chosen.reservoir, candidates);
}

// The rest, visible or not: expected light of all candidates less that of the chosen one. May be negative.
vec3 controlled_rest(Controlled chosen, uint candidates, vec3 contribution) {
    return chosen.control_sum / float(candidates) - contribution * chosen.control;
}
