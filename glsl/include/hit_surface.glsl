// Material at a hit, as textures vary it.

#include "load.glsl"
#include "surfaces.glsl"

READS(hit_surfaces)

// Loads the material at the hit of a path; `index` is that of the material.
Material load_surface(uint path, uint index) {
    Material material = load_material(index);
    if (IS_TEXTURED) {
        Surface surface = hit_surfaces[path];
        material.reflectance = surface.reflectance;
        material.alpha = surface.alpha;
        material.ior = material.kind == MATERIAL_PRINCIPLED ? surface.metallic : material.ior;
    }
    return material;
}
