// Densities that readings of [Wu & Shih 2009], Eq. 2, divide directions from lobes by. All but the
// mixture's are biased and for studies alone. Solid angle measure.

#include "visibility/weights.glsl"

layout(constant_id = CONSTANT_READING) const uint READING = READING_MIXTURE;

// Lobe that the last direction was drawn from.
uint chosen_lobe = 0u;

// Returns the weight of a lobe with the cache as it is.
float weight_in_force(Lobes lobes, uint l) {
    return weight_of_words(lobe_words(lobes, l))
        * visibility_weight(counts_of(lobes, l / 4u), l % 4u);
}

// Returns the density of all lobes with their weights before the cache lowered them.
float density_before(Lobes lobes, vec3 direction) {
    float sum = 0.0;
    float density = 0.0;
    for (uint l = 0u; l < lobes.count; ++l) {
        ProductLobe lobe = unpack_lobe(lobe_words(lobes, l));
        sum += lobe.weight;
        density += lobe.weight * kernel_pdf(lobe.axis, lobe.bandwidth, direction);
    }
    return sum > 0.0 ? density / sum : 0.0;
}

// Returns the density of the lobes by the reading; by the weights in force, which add up to `total`, it
// is `lobe_density`.
float read_density(Lobes lobes, float total, vec3 direction, float lobe_density) {
    if (READING == READING_MIXTURE || total <= 0.0) {
        return lobe_density;
    }
    if (READING == READING_WEIGHTS_BEFORE) {
        return density_before(lobes, direction);
    }
    ProductLobe lobe = unpack_lobe(lobe_words(lobes, chosen_lobe));
    float density = kernel_pdf(lobe.axis, lobe.bandwidth, direction);
    return READING == READING_CHOSEN_PAIR
        ? density * weight_in_force(lobes, chosen_lobe) / total
        : density;
}
