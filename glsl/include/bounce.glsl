// Next direction of a path, for bounce.comp and bounce_guided.comp. Densities in solid angle measure.

#include "frame.glsl"
#include "hit_instance.glsl"
#include "hit_surface.glsl"
#include "load.glsl"
#include "random.glsl"
#include "wave.glsl"
#include "brdf.glsl"
#include "bvh.glsl"
#include "specular.glsl"

WRITES(rays)
WRITES(paths)

// First vertex at which russian roulette may end a path.
layout(constant_id = CONSTANT_ROULETTE_VERTEX) const uint ROULETTE_VERTEX = 2u;
// Throughput below which it does: the light that such a path still brings is worth less than its time.
layout(constant_id = CONSTANT_ROULETTE_THROUGHPUT) const float ROULETTE_THROUGHPUT = 0.1;

// Random numbers for a direction of the BRDF: those of sample `number`.
vec3 bounce_numbers(PathIndex index, uint number, uint seed) {
    uint dimension = vertex_dimension();
    return vec3(
        random_2d(index.pixel, number, dimension + DIMENSION_BOUNCE, seed),
        random_1d(index.pixel, number, dimension + DIMENSION_BOUNCE_LOBE, seed));
}

// Returns BRDF * cosine / density of a direction drawn from the BRDF, and that density; 0 below
// either horizon.
vec3 bounce_factor(
    Hit hit, Reflector reflector, vec3 incident_local, vec3 direction, out float pdf) {
    vec3 factor = vec3(0.0);
    pdf = 0.0;
    if (incident_local.z > 0.0 && dot(direction, hit.geometric_normal) > 0.0) {
        vec3 value;
        brdf_evaluate_and_pdf(reflector, incident_local, value, pdf);
        factor = pdf > 0.0 ? value * (incident_local.z / pdf) : vec3(0.0);
    }
    return factor;
}

// Sends a path on unless it carries nothing or loses at roulette, which draws with `number` and `seed`.
// The pixels of a block draw the same number, so that invocations which run together end together.
// `brdf_pdf` is the ray's. Returns true if it goes on.
bool follow_bounce(
    uint path, PathIndex index, Hit hit, vec3 direction, float brdf_pdf, vec3 factor, uint number,
    uint seed) {
    PathState state = load_path_state(path);
    vec3 throughput = state.throughput * factor;
    float strongest = largest_of(throughput);
    if (wave.vertex + 1u >= ROULETTE_VERTEX && strongest > 0.0) {
        float survival = min(1.0, strongest / ROULETTE_THROUGHPUT);
        float u_roulette = random_1d(
            film_block(index), number, vertex_dimension() + DIMENSION_ROULETTE, seed);
        throughput = u_roulette < survival ? throughput / survival : vec3(0.0);
        strongest = u_roulette < survival ? strongest : 0.0;
    }
    bool alive = strongest > 0.0;
    paths[path].throughput = throughput;
    paths[path].rays_traced = state.rays_traced + (alive ? 1u : 0u);
    rays[path] = Ray(
        offset_ray_origin(hit.position, hit.geometric_normal, direction), alive ? 1u : 0u,
        direction, brdf_pdf);
    return alive;
}

// Loads the material from which a path goes on: that of light sampling, or else a specular one. Returns
// false where the path ends.
bool goes_on_from(uint path, Hit hit, out Material material) {
    bool samples_light = hit.material != NO_MATERIAL;
    if (!samples_light && (!HAS_SPECULAR || hit.triangle == NO_TRIANGLE)) {
        return false;
    }
    material = load_surface(
        path, samples_light ? hit.material
                            : triangle_material(hit.triangle, load_hit_instance(path)));
    return samples_light || is_specular(material.kind);
}

// Returns what bounce_factor returns for a direction drawn at a specular surface, and that direction. The
// density is negative, as in Ray.
vec3 specular_factor(
    uint path, Hit hit, Material material, Frame frame, vec3 outgoing_local, vec3 u,
    out vec3 direction, out float pdf) {
    Scatter scattered;
    if (is_kind(material, MATERIAL_THIN_DIELECTRIC)) {
        // trace.comp has let the rest through, by the geometric normal.
        float cosine = abs(dot(hit.geometric_normal, load_ray(path).direction));
        scattered = Scatter(
            vec3(-outgoing_local.xy, outgoing_local.z), pane_reflectance(material, cosine), false,
            0.0);
    } else {
        bool is_behind = is_back(hit.triangle, load_hit_instance(path), load_ray(path).direction);
        scattered = scatter(material, outgoing_local, is_behind, u);
        scattered.weight *= inside_transmittance(material, is_behind, hit.distance);
    }
    direction = to_world(frame, scattered.direction_local);
    pdf = HAS_ROUGH_GLASS ? -scattered.pdf : 0.0;
    bool is_behind = dot(direction, hit.geometric_normal) < 0.0;
    // A shading normal may send light through an opaque surface, or reflect it from a clear one.
    return is_behind == scattered.is_transmitted ? scattered.weight : vec3(0.0);
}
