// First vertices of paths, kept while their hits are overwritten.

#include "brdf.glsl"
#include "frame.glsl"
#include "load.glsl"
#include "surfaces.glsl"

LOADS(FirstVertex, load_first_vertex, first_vertex_texels)

// Material of a first vertex, as textures vary it, seen from where the path came.
Reflector first_reflector(FirstVertex vertex, Frame frame) {
    Material material = load_material(vertex.material);
    if (IS_TEXTURED) {
        material = varied(
            material,
            Surface(vertex.reflectance, vertex.alpha, vertex.metallic, vertex.anisotropy, 0.0));
    }
    return reflector_from(material, to_local(frame, vertex.outgoing));
}

// BRDF of a first vertex in a direction, with the cosine and the path's throughput, and the density
// of the BRDF's sampling; both 0 where no path goes.
void evaluate_first(
    FirstVertex vertex, Reflector reflector, Frame frame, vec3 direction, out vec3 throughput,
    out float pdf) {
    vec3 incident_local = to_local(frame, direction);
    vec3 value;
    brdf_evaluate_and_pdf(reflector, incident_local, value, pdf);
    throughput = vertex.throughput * value * incident_local.z;
    bool goes = pdf > 0.0 && dot(direction, vertex.geometric_normal) > 0.0
        && largest_of(throughput) > 0.0;
    throughput = goes ? throughput : vec3(0.0);
    pdf = goes ? pdf : 0.0;
}
