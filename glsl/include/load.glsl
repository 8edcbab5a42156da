// Loads rays, hits, shadow rays, materials and paths through texel buffers: on lavapipe a texel of four
// words costs a fraction of four loads from a storage buffer (docs/traversal.md). Compilers take texels for
// constant: a pass may write an element that it has loaded only if what it writes depends on that.

#include "layout.glsl"

LOADS(Ray, load_ray, ray_texels)
LOADS(Hit, load_hit, hit_texels)
LOADS(ShadowRay, load_shadow_ray, shadow_ray_texels)
LOADS(Material, load_material, material_texels)
LOADS(PathState, load_path_state, path_texels)
TEXELS(visibility_texels)

// Tests whether a shadow ray reaches the light.
bool reaches_light(uint ray) {
    return texelFetch(visibility_texels, int(ray)).x != 0u;
}
