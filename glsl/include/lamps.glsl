// Lamps: emitting triangles, and lights without a surface. Clusters of them are drawn from the list of the
// place, those of a cluster in proportion to their power, triangles uniformly over their area. Twin of
// src/pass/lamps.rs and lamp_cells for the densities.

#include "bvh.glsl"
#include "divide.glsl"
#include "emission.glsl"
#include "frame.glsl"
#include "parameters.glsl"
#include "random.glsl"

TEXELS(lamp_cells)
TEXELS(lamp_clusters)
LOADS(LampChoice, load_lamp_choice, lamp_choice_texels)
LOADS(LampEntry, load_lamp_entry, lamp_entry_texels)
LOADS(Lamp, load_lamp, lamp_texels)

struct LampSample {
    // From the surface to a point on the lamp, metres.
    vec3 to_lamp;
    // Unit direction.
    vec3 direction;
    // Radiance / density per steradian; irradiance at normal incidence of a lamp without a surface.
    vec3 radiance_over_pdf;
    // Density per steradian; 0 if no other technique finds the lamp.
    float pdf;
    // Factor on the weight of a candidate.
    float visibility;
    // As in LampChoice.
    uint source;
};

// Density per steradian of sampling a point at `distance` on a triangle of area `area`, which
// `direction` meets at the cosine `cosine`, if points have `area_density` per square metre.
float lamp_pdf(float area_density, float distance, float cosine) {
    return area_density * distance * distance / max(cosine, 1.0e-7);
}

// Light of a spot at an angle to its axis, relative to that along the axis.
float spot_falloff(Lamp lamp, float cosine) {
    if (lamp.kind == LAMP_SPOT_LINEAR_ANGLE) {
        float angle = acos(clamp(cosine, -1.0, 1.0));
        return clamp((lamp.outer - angle) / max(lamp.outer - lamp.inner, 1.0e-6), 0.0, 1.0);
    }
    float t = clamp((cosine - lamp.outer) / max(lamp.inner - lamp.outer, 1.0e-6), 0.0, 1.0);
    return lamp.kind == LAMP_SPOT_SMOOTH_COSINE ? t * t * (3.0 - 2.0 * t) : t * t;
}

LampSample sample_point_lamp(Lamp lamp, vec3 position) {
    if (lamp.kind == LAMP_DIRECTIONAL) {
        // Beyond any scene, and short enough to have a square.
        return LampSample(-1.0e18 * lamp.direction, -lamp.direction, lamp.intensity, 0.0, 1.0, 0u);
    }
    vec3 to_lamp = lamp.position - position;
    float distance = length(to_lamp);
    vec3 direction = to_lamp / max(distance, 1.0e-20);
    float falloff = 1.0;
    if (lamp.kind != LAMP_POINT) {
        falloff = spot_falloff(lamp, -dot(direction, lamp.direction));
    }
    vec3 irradiance = lamp.intensity * (falloff / max(distance * distance, 1.0e-20));
    return LampSample(to_lamp, direction, irradiance, 0.0, 1.0, 0u);
}

LampSample sample_triangle_lamp(uint triangle, float probability, vec3 position, vec2 u) {
    vec3 a = uintBitsToFloat(triangle_texel(triangle, 0u).xyz);
    vec3 b = uintBitsToFloat(triangle_texel(triangle, 1u).xyz);
    vec3 c = uintBitsToFloat(triangle_texel(triangle, 2u).xyz);
    // Uniform over the triangle: pbrt-v4, section A.5.1 in the form of a folded square.
    vec2 folded = u.x + u.y > 1.0 ? 1.0 - u.yx : u;
    vec3 weights = vec3(1.0 - folded.x - folded.y, folded);
    vec3 point = weights.x * a + weights.y * b + weights.z * c;
    vec3 to_lamp = point - position;
    float distance = length(to_lamp);
    vec3 direction = to_lamp / max(distance, 1.0e-20);
    vec3 normal = cross(b - a, c - a);
    float twice_area = length(normal);
    float cosine = -dot(direction, normal) / max(twice_area, 1.0e-37);
    LampSample sampled = LampSample(to_lamp, direction, vec3(0.0), 0.0, 1.0, 0u);
    if (cosine != 0.0 && distance > 0.0) {
        sampled.pdf = lamp_pdf(2.0 * probability / twice_area, distance, abs(cosine));
        sampled.radiance_over_pdf =
            emitted_radiance(triangle, weights, cosine < 0.0) / sampled.pdf;
        if (HAS_PASSAGES) {
            // As often as bounce rays meet the lamp here and do not pass through it.
            sampled.radiance_over_pdf *= meeting_share(triangle, weights);
        }
    }
    // End the ray before the lamp, which would else block it.
    sampled.to_lamp = point + (cosine < 0.0 ? -ray_offset() : ray_offset()) * (normal / twice_area)
        - position;
    return sampled;
}

// First entry of the list of a place, by the normal on the side of its ray.
uint lamp_list(vec3 position, vec3 normal) {
    vec3 place = (position - parameters.lamp_grid_origin) * parameters.lamp_cells_per_metre;
    uvec3 size = parameters.lamp_grid_size;
    place = clamp(place, vec3(0.0), vec3(size - 1u));
    uvec3 cell = uvec3(whole(place.x), whole(place.y), whole(place.z));
    uint place_of_cell = (cell.z * size.y + cell.y) * size.x + cell.x;
    return texelFetch(lamp_cells, int(place_of_cell * 6u + cube_face(normal))).x;
}

// Last entry of a list whose cluster begins no later than at column `cluster`.
LampEntry lamp_entry_of(uint list, uint cluster) {
    for (uint step = parameters.lamp_list_length >> 1u; step > 0u; step >>= 1u) {
        list += load_lamp_entry(list + step).first <= cluster ? step : 0u;
    }
    return load_lamp_entry(list);
}

// Cluster of a placed triangle that emits.
uint lamp_cluster(uint triangle) {
    return texelFetch(lamp_clusters, int(triangle)).x;
}

// Probability of a lamp of a cluster over that by power alone, at the place of a list.
float lamp_ratio(uint list, uint cluster) {
    LampEntry entry = lamp_entry_of(list, cluster);
    return entry.first == cluster ? entry.ratio : load_lamp_entry(list).ratio;
}

// Draws an entry of a list.
LampEntry draw_lamp_entry(uint list, uint bits) {
    // The last number belongs to entries that fill the list up.
    bits = min(bits, 0xfffffffeu);
    for (uint step = parameters.lamp_list_length >> 1u; step > 0u; step >>= 1u) {
        list += load_lamp_entry(list + step).before <= bits ? step : 0u;
    }
    return load_lamp_entry(list);
}

// A lamp without a point on it.
struct DrawnLamp {
    uint source;
    float probability;
    float visibility;
};

// Draws a lamp from a list.
DrawnLamp draw_lamp(uint list, uvec2 bits) {
    // Rounding of the products favours no column by more than lamp_count / 2^32.
    uint column = scaled(bits.x, parameters.lamp_count);
    LampEntry entry = LampEntry(0u, 1.0, 0u, 0u, 1.0, vec3(0.0));
    if (HAS_LAMP_CELLS) {
        entry = draw_lamp_entry(list, bits.x);
        column = entry.first + scaled(bits.y, entry.count);
        bits.y *= entry.count;
    }
    LampChoice choice = load_lamp_choice(column);
    if (bits.y >= choice.threshold) {
        choice = load_lamp_choice(entry.first + choice.alias);
    }
    if (HAS_LAMP_CELLS && entry.first == 0u) {
        // Drawn among all lamps: its cluster may have an entry too.
        LampEntry own = lamp_entry_of(list, choice.cluster);
        if (own.first == choice.cluster) {
            entry = own;
        }
    }
    return DrawnLamp(choice.source, choice.probability * entry.ratio, entry.visibility);
}

// Draws a lamp from the list of the place, and a point on it with u.
LampSample sample_lamp(uint list, vec3 position, uvec2 bits, vec2 u) {
    DrawnLamp drawn = draw_lamp(list, bits);
    LampSample sampled;
    if ((drawn.source & LAMP_BIT) != 0u) {
        sampled = sample_point_lamp(load_lamp(drawn.source & ~LAMP_BIT), position);
        sampled.radiance_over_pdf /= drawn.probability;
    } else {
        sampled = sample_triangle_lamp(drawn.source, drawn.probability, position, u);
    }
    sampled.visibility = drawn.visibility;
    sampled.source = drawn.source;
    return sampled;
}

// Group of the light of a lamp or emitting triangle.
uint light_group(uint source) {
    return (source & LAMP_BIT) != 0u
        ? load_lamp(source & ~LAMP_BIT).light_group
        : load_material_surface(mesh_material(source)).light_group;
}
