// BRDF * cosine of a node of the product, sampled on the fly [Clarberg & Akenine-Möller 2008].
//
// Deviation: every hit has the same nodes, each sampled once, at its centre. The paper splits nodes where
// the BRDF needs it; a loop without branches costs less on devices that run many hits in step. A lobe
// narrower than a node is widened to it instead, and the BRDF's own samples find its peak.
//
// Deviation: a node across the horizon has the mean of its cosine, not that of its centre.

#include "brdf.glsl"
#include "haar/tree.glsl"

// Angle from the centre of a node to its corners, about: half the diagonal of its solid angle.
float node_radius() {
    return 2.506628 / float(1u << LEVEL);
}

// Nodes hold halves of this unit, which leaves room for surfaces that are nearly black.
const float REFLECTANCE_UNIT = 1.0 / 256.0;
const float LARGEST_REFLECTANCE = 6e4 * REFLECTANCE_UNIT;

// Material with lobes as wide as a node: half vectors move half as far as directions.
Material widened(Material material) {
    float width = 0.5 * node_radius();
    material.alpha = min(sqrt(material.alpha * material.alpha + width * width), 1.0);
    return material;
}

// Mean of the cosine over a node, 0 below the horizon.
float mean_cosine(float cosine) {
    float radius = node_radius();
    float above = cosine + radius;
    return cosine > radius ? cosine : above * above / (4.0 * radius);
}

// Luminance of BRDF * cosine, in REFLECTANCE_UNIT, for a node that is not wholly below the horizon;
// the material is widened.
float node_reflectance(Reflector reflector, vec3 centre_local) {
    float cosine = mean_cosine(centre_local.z);
    vec3 incident_local = normalize(vec3(centre_local.xy, cosine));
    vec3 value = brdf_evaluate(reflector, incident_local);
    return min(dot(value, LUMINANCE_WEIGHTS) * cosine, LARGEST_REFLECTANCE) / REFLECTANCE_UNIT;
}
