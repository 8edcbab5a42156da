// Path vertex as the sampling passes see it: surface, integrand in a direction, and the densities
// of sampling BRDF and environment. Densities in solid angle measure.

#include "frame.glsl"
#include "hit_surface.glsl"
#include "load.glsl"
#include "random.glsl"
#include "wave.glsl"
#include "brdf.glsl"
#include "environment.glsl"

WRITES(shadow_rays)

// Data common to all rays at one hit.
struct Vertex {
    Hit hit;
    Frame frame;
    Reflector reflector;
    PathIndex index;
    uint dimension;
};

struct DirectionSample {
    vec3 direction;
    // BRDF * radiance * cosine, without occlusion.
    vec3 integrand;
    float brdf_pdf;
    float environment_pdf;
};

// Loads the vertex of a path whose hit is on a surface.
Vertex load_vertex(uint path, Hit hit) {
    Vertex vertex;
    vertex.hit = hit;
    vertex.index = wave_path(path);
    vertex.frame = frame_from_normal(hit.shading_normal);
    vertex.reflector = reflector_from(
        load_surface(path, hit.material), to_local(vertex.frame, -load_ray(path).direction));
    vertex.dimension = vertex_dimension();
    return vertex;
}

DirectionSample evaluate_direction(
    Vertex vertex, vec3 direction, vec3 incident_local, vec3 radiance, float environment_density) {
    DirectionSample sampled = DirectionSample(direction, vec3(0.0), 0.0, environment_density);
    vec3 value;
    brdf_evaluate_and_pdf(vertex.reflector, incident_local, value, sampled.brdf_pdf);
    // Nothing contributes below the shading or the geometric horizon.
    if (incident_local.z > 0.0 && dot(direction, vertex.hit.geometric_normal) > 0.0) {
        sampled.integrand = value * radiance * incident_local.z;
    }
    return sampled;
}

// Evaluates a direction in world space.
DirectionSample evaluate_world(Vertex vertex, vec3 direction) {
    vec4 light = environment_light(direction);
    return evaluate_direction(
        vertex, direction, to_local(vertex.frame, direction), light.xyz,
        environment_pdf(direction, light));
}

// Evaluates a direction in the frame of the vertex.
DirectionSample evaluate_local(Vertex vertex, vec3 incident_local) {
    vec3 direction = to_world(vertex.frame, incident_local);
    vec4 light = environment_light(direction);
    return evaluate_direction(
        vertex, direction, incident_local, light.xyz, environment_pdf(direction, light));
}

// Evaluates a direction drawn from the environment.
DirectionSample evaluate_light(Vertex vertex, EnvironmentSample light) {
    return evaluate_direction(
        vertex, light.direction, to_local(vertex.frame, light.direction), light.radiance,
        light.pdf);
}

// Samples a direction in proportion to the environment's luminance; u in [0, 1)^2.
DirectionSample draw_from_environment(Vertex vertex, vec2 u) {
    return evaluate_light(vertex, environment_sample(u));
}

// Samples a direction from the BRDF; u in [0, 1)^3.
DirectionSample draw_from_brdf(Vertex vertex, vec3 u) {
    return evaluate_local(vertex, brdf_sample(vertex.reflector, u));
}

// Number of the first ray of the group through all samples: they share one sequence.
uint first_ray_number(Vertex vertex) {
    return vertex.index.sample_index * wave.total_shadow_rays + wave.first_shadow_ray;
}

vec2 vertex_numbers(Vertex vertex, uint number, uint dimension) {
    return random_2d(vertex.index.pixel, number, vertex.dimension + dimension, wave.seed);
}

float vertex_number(Vertex vertex, uint number, uint dimension) {
    return random_1d(vertex.index.pixel, number, vertex.dimension + dimension, wave.seed);
}

// Draws direction `number` of the sequence of a vertex's candidate from the environment.
DirectionSample draw_environment_ray(Vertex vertex, uint number, uint candidate) {
    return draw_from_environment(
        vertex, vertex_numbers(vertex, number, DIMENSION_ENVIRONMENT_DIRECTION + candidate));
}

// Draws direction `number` of the sequence of a vertex's candidate from the BRDF.
DirectionSample draw_brdf_ray(Vertex vertex, uint number, uint candidate) {
    vec2 u = vertex_numbers(vertex, number, DIMENSION_BRDF_DIRECTION + candidate);
    float lobe = vertex_number(vertex, number, DIMENSION_BRDF_LOBE + candidate);
    return draw_from_brdf(vertex, vec3(u, lobe));
}

void write_ray(uint index, vec3 direction, vec3 contribution) {
    shadow_rays[index] = ShadowRay(direction, contribution);
}

// Writes a direction drawn with density `pdf`; 0 if none was drawn.
void write_sample(uint index, DirectionSample sampled, float pdf) {
    write_ray(index, sampled.direction, pdf > 0.0 ? sampled.integrand / pdf : vec3(0.0));
}

// Runs `run` for a path and its vertex, if light is sampled there.
#define AT_VERTEX(run) \
    void at_vertex(uint path) { \
        Hit hit = load_hit(path); \
        if (hit.material != NO_MATERIAL) { \
            run(path, load_vertex(path, hit)); \
        } \
    }

// Define main: run `run` for the vertices of the paths to walk, or of all paths in the wave.
#define WALK_VERTICES(run) AT_VERTEX(run) WALK_PATHS(at_vertex)
#define RUN_VERTICES(run) AT_VERTEX(run) RUN_PATHS(at_vertex)
