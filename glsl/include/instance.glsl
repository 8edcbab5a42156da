// Instances: meshes that are in memory once and in the scene many times. Twin: src/accel/instances.rs.
//
// A record is INSTANCE_TEXELS texels: the rows of object from world (0 to 2) and world from object (3
// to 5); root node, first material, mask of materials and flags (6); margin of node boxes per metre of
// reach, and reach (7). Triangles in world space belong to a record that changes nothing.

#include "frame.glsl"
#include "layout.glsl"
#include "surfaces.glsl"

TEXELS(instances)
TEXELS(triangle_materials)

vec4 instance_row(uint instance, uint row) {
    return uintBitsToFloat(texelFetch(instances, int(INSTANCE_TEXELS * instance + row)));
}

// Root node, first material, mask of materials, flags.
uvec4 instance_places(uint instance) {
    return texelFetch(instances, int(INSTANCE_TEXELS * instance + 6u));
}

// Affine map of a point by its three rows; `precise` as `projected` is.
vec3 map_point(vec4 x, vec4 y, vec4 z, vec3 point) {
    precise vec3 mapped = vec3(x.x, y.x, z.x) * point.x + vec3(x.y, y.y, z.y) * point.y
        + vec3(x.z, y.z, z.z) * point.z + vec3(x.w, y.w, z.w);
    return mapped;
}

vec3 map_vector(vec4 x, vec4 y, vec4 z, vec3 vector) {
    return vec3(dot(x.xyz, vector), dot(y.xyz, vector), dot(z.xyz, vector));
}

// Takes a vector along the surface from the space of the mesh to the world.
vec3 instance_vector(uint instance, vec3 vector) {
    return map_vector(
        instance_row(instance, 3u), instance_row(instance, 4u), instance_row(instance, 5u), vector);
}

// Takes a normal of the mesh to the world: a unit vector by the inverse transpose, unless it has no
// direction.
vec3 instance_normal(uint instance, vec3 normal) {
    vec4 x = instance_row(instance, 0u);
    vec4 y = instance_row(instance, 1u);
    vec4 z = instance_row(instance, 2u);
    vec3 world = normal.x * x.xyz + normal.y * y.xyz + normal.z * z.xyz;
    // Scale first: squares of an instance of extreme scale would overflow.
    float largest = largest_of(abs(world));
    return largest > 0.0 ? normalize(world / largest) : vec3(0.0);
}

// -1 where an instance turns the winding of its triangles round, else 1.
float instance_winding(uint instance) {
    if (!HAS_INSTANCES) {
        return 1.0;
    }
    return (instance_places(instance).w & INSTANCE_MIRRORS) != 0u ? -1.0 : 1.0;
}

// Material of a triangle as its mesh has it.
uint mesh_material(uint triangle) {
    return texelFetch(triangle_materials, int(triangle)).x;
}

// Material of a triangle: an instance may move the materials of its mesh, or replace all by one.
uint triangle_material(uint triangle, uint instance) {
    uint material = mesh_material(triangle);
    if (HAS_INSTANCES) {
        uvec4 places = instance_places(instance);
        return places.y + (material & places.z);
    }
    return material;
}
