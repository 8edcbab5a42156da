// Instance that a path has hit.

#include "instance.glsl"

TEXELS(hit_instance_texels)

uint load_hit_instance(uint path) {
    return HAS_INSTANCES ? texelFetch(hit_instance_texels, int(path)).x : NO_INSTANCE;
}
