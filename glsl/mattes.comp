// Counts the samples of each pixel by the object and by the material that their camera rays meet first, as
// Cryptomatte identifies them. What finds no slot left is not counted.
#version 460

#include "hit_instance.glsl"
#include "load.glsl"
#include "wave.glsl"

READS(triangle_objects)
READS(instance_objects)
READS(material_identifiers)
UPDATES(film_objects)
UPDATES(film_materials)

// Object of a triangle: the instance's, or that of a placed one.
uint object_of(uint triangle, uint instance) {
    uint own = HAS_INSTANCES ? instance_places(instance).w >> 1u : 0u;
    return own > 0u ? instance_objects[own - 1u] : triangle_objects[triangle];
}

#define COUNT(slots, first, identifier) \
    for (uint slot = first; slot < first + MATTE_SLOTS; ++slot) { \
        uvec2 found = slots[slot]; \
        if (found.y == 0u || found.x == identifier) { \
            slots[slot] = uvec2(identifier, found.y + 1u); \
            break; \
        } \
    }

void count_mattes(uint pixel, PathIndex index) {
    uint first = MATTE_SLOTS * film_place(index);
    for (uint i = 0u; i < wave.sample_count; ++i) {
        uint path = i * wave.pixel_count + pixel;
        uint triangle = load_hit(path).triangle;
        if (triangle == NO_TRIANGLE) {
            continue;
        }
        uint instance = load_hit_instance(path);
        if ((AOVS & AOV_OBJECTS) != 0u) {
            uint object = object_of(triangle, instance);
            COUNT(film_objects, first, object)
        }
        if ((AOVS & AOV_MATERIALS) != 0u) {
            uint material = material_identifiers[triangle_material(triangle, instance)];
            COUNT(film_materials, first, material)
        }
    }
}

RUN_PIXELS(count_mattes)
