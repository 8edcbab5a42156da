// Instance that a path has hit.

#include "instance.glsl"

READS(hit_instances)

uint load_hit_instance(uint path) {
    return HAS_INSTANCES ? hit_instances[path] : NO_INSTANCE;
}
