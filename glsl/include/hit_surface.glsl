// Material at a hit, as textures vary it.

#include "load.glsl"
#include "surfaces.glsl"

LOADS(Surface, load_hit_surface, hit_surface_texels)

// Loads the material at the hit of a path; `index` is that of the material.
Material load_surface(uint path, uint index) {
    Material material = load_material(index);
    if (IS_TEXTURED) {
        material = varied(material, load_hit_surface(path));
    }
    return material;
}
