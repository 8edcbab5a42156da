// Rebuilds the cumulative weights of the lobes at every hit whose visibility cache has grown: lobes,
// visibility_cache -> cumulative. [Wu & Shih 2009], section 4.2: Num(l) counts the cached directions
// close to lobe l, V(l) lowers its weight.
//
// Deviation: V = (1 / (1 + Num))^k instead of (1 / Num)^k, which is infinite for lobes nothing is known
// of. Where visible directions are recorded too, V = ((1 + visible) / (1 + visible + Num))^k.
#version 460

#define NEEDS_PARAMETERS
#define NEEDS_WAVE
#define NEEDS_LOBE_TEXELS
#define NEEDS_LOBE_COUNTS
#define NEEDS_CUMULATIVE
#define WRITES_CUMULATIVE
#define NEEDS_CACHE
#define WRITES_CACHE
#define NEEDS_COUNTERS
#include "product.glsl"
#include "wave.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(constant_id = CONSTANT_CACHE_CAPACITY) const uint CACHE_CAPACITY = 8u;
layout(constant_id = CONSTANT_CACHE_OF_PIXEL) const uint CACHE_OF_PIXEL = 0u;
layout(constant_id = CONSTANT_COUNT_VISIBLE) const uint COUNT_VISIBLE = 0u;
layout(constant_id = CONSTANT_VISIBILITY_EXPONENT) const float VISIBILITY_EXPONENT = 2.0;

void main() {
    uint path = gl_GlobalInvocationID.x;
    uint path_count = wave_path_count();
    if (path >= path_count) {
        return;
    }
    uint lobe_count = lobe_counts[path];
    PathIndex index = wave_path(path);
    if (lobe_count == 0u || !index.inside) {
        return;
    }
    uint first = (CACHE_OF_PIXEL != 0u ? index.film_index : path) * (CACHE_CAPACITY + 1u);
    uint head = visibility_cache[first];
    uint entries = min(head & ~CACHE_GROWN, CACHE_CAPACITY);
    // The lobes of a sample's first ray are new to the cache of its pixel.
    bool is_new = CACHE_OF_PIXEL != 0u && wave.first_shadow_ray == 0u;
    if (entries == 0u || ((head & CACHE_GROWN) == 0u && !is_new)) {
        return;
    }
    // Places that hold nothing yet are close to no lobe. Loops of a constant length, so that all of this
    // stays in registers.
    vec3 directions[CACHE_CAPACITY];
    float visible[CACHE_CAPACITY];
    for (uint i = 0u; i < CACHE_CAPACITY; ++i) {
        uint outcome = visibility_cache[first + 1u + i];
        directions[i] = i < entries ? unpack_normal(outcome) : vec3(1e3);
        visible[i] = float(outcome & 1u);
    }
    float sum = 0.0;
    for (uint l = 0u; l < lobe_count; ++l) {
        ProductLobe lobe = unpack_lobe(texelFetch(lobe_texels, int(l * path_count + path)));
        float close_count = 0.0;
        float visible_count = 0.0;
        for (uint i = 0u; i < CACHE_CAPACITY; ++i) {
            float close = is_close(lobe, directions[i]) ? 1.0 : 0.0;
            close_count += close;
            visible_count += COUNT_VISIBLE != 0u ? close * visible[i] : 0.0;
        }
        float ratio = (1.0 + visible_count) / (1.0 + close_count);
        sum += lobe.weight
            * (VISIBILITY_EXPONENT == 2.0 ? ratio * ratio : pow(ratio, VISIBILITY_EXPONENT));
        cumulative[l * path_count + path] = sum;
    }
    visibility_cache[first] = head & ~CACHE_GROWN;
    atomicAdd(counters.cdf_rebuilds, 1u);
}
