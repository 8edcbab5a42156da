// Part of a BRDF whose light the pixels of a cohort share: all but the peaks of narrow lobes, in which light
// that one path finds says little about the next pixel.

#include "brdf.glsl"
#include "reservoir.glsl"

// Value above which a BRDF is not shared, 1/sr: half the peak of a lobe of GGX with α = 0.1 and a reflectance
// of 1, seen along the normal.
const float LARGEST_SHARED_VALUE = 4.0;
// Added to that value where light is chosen for other pixels, which may see more of it, 1/sr.
const float BROAD_VALUE = 0.1;

// Share of `value` below the largest that is shared.
float shared_share(vec3 value) {
    return LARGEST_SHARED_VALUE / max(LARGEST_SHARED_VALUE, largest_of(value));
}

// Counts light that a second vertex reflects from a direction by a BRDF of `value`, which is positive in
// every channel that reflects at all, and may choose it for the other pixels.
void take_light(inout SecondLight light, vec3 direction, vec3 reflected, vec3 value) {
    vec3 shared_light = shared_share(value) * reflected;
    vec3 arriving = mix(vec3(0.0), reflected / value, greaterThan(value, vec3(0.0)));
    light.shared_light += shared_light;
    float weight = largest_of(shared_light) + BROAD_VALUE * largest_of(arriving);
    Reservoir reservoir = Reservoir(light.weight_sum, light.weight, light.random_number);
    if (reservoir_takes(reservoir, weight, weight)) {
        light.incident = direction;
        light.arriving = arriving;
    }
    light.weight_sum = reservoir.sum;
    light.weight = reservoir.target;
    light.random_number = reservoir.u;
}
