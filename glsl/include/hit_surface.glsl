// Material at a hit, as textures vary it.

#include "load.glsl"
#include "surfaces.glsl"

READS(hit_surfaces)

// Loads the material at the hit of a path; `index` is that of the material.
Material load_surface(uint path, uint index) {
    Material material = load_material(index);
    if (IS_TEXTURED) {
        material = varied(material, hit_surfaces[path]);
    }
    return material;
}
