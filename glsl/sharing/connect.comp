// Connects the first vertex of every path with second vertices of some pixels of its cohort, by a shadow
// ray each.
//
// [Bekaert, Sbert & Halton 2002]: all paths of a cohort are one sample of many techniques, the BRDFs
// of its first vertices, weighted by the balance heuristic.
#version 460

#include "bvh.glsl"
#include "first_vertex.glsl"
#include "frame.glsl"
#include "load.glsl"
#include "sharing/cohort.glsl"
#include "sharing/shared_part.glsl"
#include "wave.glsl"

LOADS(Offer, load_offer, offer_texels)
WRITES(hits)
WRITES(shadow_rays)
WRITES(connections)
WRITES(seen)

// Squared distance below which vertices are not connected, square metres: its inverse is finite.
const float LEAST_SQUARED_DISTANCE = 1.0e-18;

// Radiance that the shared part of an offered vertex sends into a direction.
vec3 offered_radiance(uint path, Offer offer, vec3 outgoing) {
    Material material = load_material(offer.material);
    if (is_diffuse(material)) {
        return offer.radiance;
    }
    // The rest of the offer is fetched only here.
    Offer rest = load_offer(path);
    if (IS_TEXTURED) {
        material = varied(
            material, Surface(rest.reflectance, offer.alpha, offer.metallic, rest.anisotropy, 0.0));
    }
    Frame frame = frame_from_normal(offer.shading_normal);
    Reflector reflector = reflector_from(material, to_local(frame, outgoing));
    vec3 value = brdf_evaluate(reflector, to_local(frame, rest.incident));
    return offer.radiance * shared_share(value) * value;
}

// Tests whether the shading normal of a second vertex looks the same from a direction: `trace.comp`
// turns those that could not be seen. A little stricter, so that turned ones fail from all sides.
bool keeps_normal(Offer offer, vec3 to_first, float cosine) {
    return dot(offer.shading_normal, to_first)
        > 1.01 * max(min(LEAST_SHADING_COSINE, cosine), 1.0e-6);
}

void connect_path(uint path) {
    uint path_count = wave_path_count();
    FirstVertex first = load_first_vertex(path);
    if (wave.first_shadow_ray == 0u) {
        hits[path].position = first.position;
        hits[path].material = first.material;
        hits[path].geometric_normal = first.geometric_normal;
        hits[path].triangle = NO_TRIANGLE;
        seen[path] = uvec2(0u);
    }
    if (first.material == NO_MATERIAL) {
        return;
    }
    Frame frame = frame_from_normal(first.shading_normal);
    Reflector reflector = first_reflector(first, frame);
    Cohort cohort = cohort_of(path);
    float offset = ray_offset();
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint member = wave.first_shadow_ray + i;
        uint other = cohort_path(cohort, member);
        Offer offer = load_offer(other);
        vec3 to_second = offer.position - first.position;
        float squared = dot(to_second, to_second);
        vec3 direction = to_second * inversesqrt(max(squared, LEAST_SQUARED_DISTANCE));
        float cosine = -dot(offer.geometric_normal, direction);
        bool is_joined = offer.material != NO_MATERIAL && squared > LEAST_SQUARED_DISTANCE
            && cosine > 0.0 && keeps_normal(offer, -direction, cosine);
        vec3 throughput = vec3(0.0);
        float pdf = 0.0;
        if (is_joined) {
            evaluate_first(first, reflector, frame, direction, throughput, pdf);
        }
        vec3 contribution = vec3(0.0);
        if (pdf > 0.0) {
            contribution = throughput * offered_radiance(other, offer, -direction);
        }
        // From solid angle at the first vertex to area at the second.
        float geometry = cosine / max(squared, LEAST_SQUARED_DISTANCE);
        connections[member * path_count + path] =
            Connection(contribution * geometry, pdf * geometry);
        vec3 end = moved_off_surface(offer.position, offer.geometric_normal, -direction, offset);
        shadow_rays[i * path_count + path] =
            ShadowRay(end - first.position, vec3(pdf > 0.0 ? 1.0 : 0.0));
    }
}

RUN_PATHS(connect_path)
