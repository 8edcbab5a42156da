// Specialization of passes by the kinds and properties of the surfaces in the scene.

#include "layout.glsl"

// One bit per kind of material in the scene.
layout(constant_id = CONSTANT_MATERIAL_KINDS) const uint MATERIAL_KINDS = 0xffffffffu;
// Bits SURFACES_….
layout(constant_id = CONSTANT_SURFACES) const uint SURFACES = 0u;

const bool HAS_SPECULAR = (SURFACES & SURFACES_SPECULAR) != 0u;
const bool HAS_PASSAGES = (SURFACES & SURFACES_PASSING) != 0u;
const bool HAS_BACKS = (SURFACES & SURFACES_ONE_SIDED) != 0u;
const bool HAS_INSTANCES = (SURFACES & SURFACES_INSTANCED) != 0u;
const bool HAS_LAMP_CELLS = (SURFACES & SURFACES_LAMP_CELLS) != 0u;
const bool IS_TEXTURED = (SURFACES & SURFACES_TEXTURED) != 0u;
const bool HAS_TINTED_PANES = (SURFACES & SURFACES_TINTED_PANES) != 0u;
const bool HAS_BECKMANN = (SURFACES & SURFACES_BECKMANN) != 0u;
const bool HAS_ROUGH_GLASS = (SURFACES & SURFACES_ROUGH_GLASS) != 0u;
const bool IS_ANISOTROPIC = (SURFACES & SURFACES_ANISOTROPIC) != 0u;

// Tests whether a kind of material is specular: no sampler draws light at it.
bool is_specular(uint kind) {
    return HAS_SPECULAR && ((1u << kind) & SPECULAR_KINDS) != 0u;
}

// Tests whether a material is glass, whose colour is that of the light that it lets through.
bool is_glass(Material material) {
    return material.kind == MATERIAL_DIELECTRIC || material.kind == MATERIAL_THIN_DIELECTRIC
        || material.kind == MATERIAL_ROUGH_PANE;
}

// Material as the textures at a place vary it.
Material varied(Material material, Surface surface) {
    bool is_principled = material.kind == MATERIAL_PRINCIPLED || material.kind == MATERIAL_COATED
        || material.kind == MATERIAL_SHEEN;
    if (is_glass(material)) {
        material.eta = surface.reflectance;
    } else {
        material.reflectance = surface.reflectance;
    }
    material.alpha = surface.alpha;
    material.anisotropy = surface.anisotropy;
    material.ior = is_principled ? surface.metallic : material.ior;
    return material;
}
