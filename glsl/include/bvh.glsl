// Traversal of the compressed wide BVH, one step at a time, so that a pass may keep several rays in
// flight per invocation. Twins: src/accel/traverse.rs, tests/twin/surface.rs.
//
// [Ylitie et al. 2017]. Node layout as in obvhs (planes of x, y, z; low bytes first):
//   texel 0: corner.xyz, exponents x, y, z and the mask of inner children (one byte each)
//   texel 1: first child node, first triangle, meta bytes of children 0-3 and 4-7
//   texel 2: lower x planes of children 0-3 and 4-7, upper x planes of both; 3: y; 4: z
//
// Deviation: two groups of triangles may wait while nodes are traversed ("speculative traversal",
// [Aila & Laine 2009]). A step tests one node and one triangle, so that lanes of a subgroup in
// different places do both kinds of work together.
//
// With instances the tree has two levels: what the upper one calls triangles are instances, each with
// the root of a tree in the space of its mesh. There the ray is followed by its transformed origin and
// direction, so that its parameter stays the distance in the world; triangles are tested in the world,
// where they meet those of other instances without cracks.

#include "frame.glsl"
#include "instance.glsl"
#include "layout.glsl"
#include "surfaces.glsl"

TEXELS(bvh_nodes)

layout(constant_id = CONSTANT_TRIANGLE_PAGES) const uint TRIANGLE_PAGES = 1u;
layout(constant_id = CONSTANT_TRIANGLE_PAGE_SHIFT) const uint TRIANGLE_PAGE_SHIFT = 30u;
// Texel `part` (0 to 2) of a triangle: position and packed normal of a vertex.
PAGED_TEXELS(triangle_texel, triangles, 3u, TRIANGLE_PAGES, TRIANGLE_PAGE_SHIFT)

const float FAR_AWAY = 3.0e38;

// State of the ray in flight.
vec3 bvh_origin;
vec3 bvh_direction;
// Frame around the direction: z in it is the distance along the ray.
Frame bvh_frame;
vec3 bvh_inverse_direction;
// Octant in each byte. Children are visited in descending order of slot ^ octant.
uint bvh_octant4;
// Nearest hit so far: distance and triangle.
float bvh_distance;
uint bvh_triangle;
// Hits up to this distance do not count: the ray has passed those surfaces.
float bvh_passed_distance;
// Share of light that passed the surfaces met by a shadow ray.
vec3 bvh_transmittance;
// Group of nodes: first child; bits 24-31 hits in visiting order, bits 0-7 mask of inner children.
uvec2 bvh_nodes_waiting;
// Groups of triangles: first triangle; one bit per triangle to test.
uvec2 bvh_triangles_waiting;
uvec2 bvh_triangles_next;
// Deferred groups of nodes, one per level of the tree; the host checks the depth.
uvec2 bvh_stack[BVH_STACK_ENTRIES];
uint bvh_stack_size;

// State that only scenes with instances have: the ray as nodes see it, the margin by which their boxes
// grow, the instance that it is in, that of the nearest hit, the rows of world from object, and the
// size of the stack at the entry.
vec3 bvh_node_origin;
vec3 bvh_node_direction;
vec3 bvh_node_margin;
uint bvh_instance;
uint bvh_hit_instance;
vec4 bvh_world_x;
vec4 bvh_world_y;
vec4 bvh_world_z;
uint bvh_stack_base;

// 1 / x, finite even for x = 0: its product with a distance in a scene stays finite.
float bvh_inverse(float x) {
    return abs(x) > 1.0e-18 ? 1.0 / x : (x < 0.0 ? -1.0e18 : 1.0e18);
}

// Sets the ray that nodes see. The closest hit visits the nearest children first, any hit the
// farthest: the walls of a room are large and behind most other things, and hitting one ends the ray
// (13 to 28% faster in rooms, docs/traversal.md).
void bvh_see(vec3 direction, bool any_hit) {
    bvh_inverse_direction =
        vec3(bvh_inverse(direction.x), bvh_inverse(direction.y), bvh_inverse(direction.z));
    bvh_octant4 = (direction.x < 0.0 ? 0u : 0x04040404u) | (direction.y < 0.0 ? 0u : 0x02020202u)
        | (direction.z < 0.0 ? 0u : 0x01010101u);
    if (any_hit) {
        bvh_octant4 ^= 0x07070707u;
    }
}

// Returns to the upper level of the tree.
void bvh_leave_instance(bool any_hit) {
    bvh_instance = NO_INSTANCE;
    bvh_node_origin = bvh_origin;
    bvh_node_direction = bvh_direction;
    bvh_node_margin = vec3(0.0);
    bvh_see(bvh_direction, any_hit);
}

// Goes on at the root of the tree of an instance. Its node boxes grow by the rounding of the ray's
// transform and of the triangle test, in the space of the mesh: docs/traversal.md has the bound.
void bvh_enter_instance(uint instance, bool any_hit) {
    vec4 x = instance_row(instance, 0u);
    vec4 y = instance_row(instance, 1u);
    vec4 z = instance_row(instance, 2u);
    vec4 margin = instance_row(instance, 7u);
    bvh_instance = instance;
    bvh_node_origin = map_point(x, y, z, bvh_origin);
    bvh_node_direction = map_vector(x, y, z, bvh_direction);
    bvh_node_margin = margin.xyz * (margin.w + largest_of(abs(bvh_origin)));
    bvh_world_x = instance_row(instance, 3u);
    bvh_world_y = instance_row(instance, 4u);
    bvh_world_z = instance_row(instance, 5u);
    bvh_see(bvh_node_direction, any_hit);
    bvh_stack_base = bvh_stack_size;
    bvh_nodes_waiting = uvec2(instance_places(instance).x, 0x80000000u);
}

// Goes back to the root, to find a hit up to `farthest`; any hit if `any_hit`.
void bvh_restart(float farthest, bool any_hit) {
    if (HAS_INSTANCES) {
        bvh_hit_instance = NO_INSTANCE;
        bvh_leave_instance(any_hit);
    }
    bvh_distance = farthest;
    bvh_triangle = NO_TRIANGLE;
    bvh_nodes_waiting = uvec2(0u, 0x80000000u);
    bvh_triangles_waiting = uvec2(0u);
    bvh_triangles_next = uvec2(0u);
    bvh_stack_size = 0u;
}

#ifdef MEETS_PASSAGES
// Share of light that goes straight through a triangle. `normal` is its normal of any length with the
// ray along z. Defined in passage.glsl.
vec3 passage(uint triangle, uint instance, vec3 weights, vec3 normal);
#endif

// Starts the traversal of a ray; `direction` is a unit vector.
void bvh_start(vec3 origin, vec3 direction, float farthest, bool any_hit) {
    bvh_origin = origin;
    bvh_direction = direction;
    bvh_frame = frame_from_normal(direction);
    bvh_see(direction, any_hit);
    bvh_passed_distance = 0.0;
    bvh_transmittance = vec3(1.0);
    bvh_restart(farthest, any_hit);
}

// Corner (0 to 2) of a triangle in the world.
vec3 triangle_corner(uint triangle, uint corner, uint instance) {
    vec3 position = uintBitsToFloat(triangle_texel(triangle, corner).xyz);
    if (HAS_INSTANCES) {
        return map_point(
            instance_row(instance, 3u), instance_row(instance, 4u), instance_row(instance, 5u),
            position);
    }
    return position;
}

// The same for the instance that the ray is in.
vec3 bvh_corner(uint triangle, uint corner) {
    vec3 position = uintBitsToFloat(triangle_texel(triangle, corner).xyz);
    return HAS_INSTANCES ? map_point(bvh_world_x, bvh_world_y, bvh_world_z, position) : position;
}

// Normal of a triangle in the world, of any length, on the side from where it is counter-clockwise.
vec3 front_normal(uint triangle, uint instance) {
    vec3 a = triangle_corner(triangle, 0u, instance);
    vec3 b = triangle_corner(triangle, 1u, instance);
    vec3 c = triangle_corner(triangle, 2u, instance);
    return instance_winding(instance) * cross(b - a, c - a);
}

// A vertex in the frame of a ray, as `to_local`. `precise`: devices that fuse multiplications and additions
// otherwise round a vertex in one way for one triangle, and in another for the next.
vec3 projected(Frame frame, vec3 vertex) {
    precise vec3 local = vec3(frame.tangent.x, frame.bitangent.x, frame.normal.x) * vertex.x
        + vec3(frame.tangent.y, frame.bitangent.y, frame.normal.y) * vertex.y
        + vec3(frame.tangent.z, frame.bitangent.z, frame.normal.z) * vertex.z;
    return local;
}

// Twice the signed areas of the three sub-triangles around the ray, given the vertices in its
// frame: barycentric coordinates before division by their sum. All have one sign if the ray passes
// inside.
//
// [Woop et al. 2013]: every vertex is projected alike for all its triangles, and reversing an edge
// only changes the sign, so that no ray slips between triangles that share vertices. Deviation:
// projects along the ray by an orthonormal frame, without choosing axes for a shear.
vec3 edge_functions(vec3 a, vec3 b, vec3 c) {
    precise vec3 areas = vec3(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
    return areas;
}

uint bvh_byte(uint word, int index) {
    return index == 3 ? word >> 24 : (word >> (8 * index)) & 0xffu;
}

// Hit bits of four children: triangles in bits 0 to 23, nodes in bits 24 to 31. `near` and `far`
// are the planes where the ray enters and leaves, one byte per child; t = plane · scale + bias, with a
// bias for either that differ by the margin of an instance.
//
// Compares distances as signed integers. Their order is that of floats if at least one is not
// negative; all are finite, so NaN needs no special case.
uint bvh_children(
    uint meta4, uint near_x, uint far_x, uint near_y, uint far_y, uint near_z, uint far_z, vec3 scale,
    vec3 near_bias, vec3 far_bias
) {
    uint is_inner4 = (meta4 & (meta4 << 1)) & 0x10101010u;
    uint inner_mask4 = (is_inner4 >> 4) * 0xffu;
    uint bit_index4 = (meta4 ^ (bvh_octant4 & inner_mask4)) & 0x1f1f1f1fu;
    uint child_bits4 = (meta4 >> 5) & 0x07070707u;
    uint hits = 0u;
    for (int child = 0; child < 4; child++) {
        vec3 near = vec3(
            float(int(bvh_byte(near_x, child))), float(int(bvh_byte(near_y, child))),
            float(int(bvh_byte(near_z, child))));
        vec3 far = vec3(
            float(int(bvh_byte(far_x, child))), float(int(bvh_byte(far_y, child))),
            float(int(bvh_byte(far_z, child))));
        ivec3 enter = floatBitsToInt(near * scale + near_bias);
        ivec3 leave = floatBitsToInt(far * scale + far_bias);
        int first = max(max(enter.x, enter.y), max(enter.z, 0));
        int last = min(min(leave.x, leave.y), min(leave.z, floatBitsToInt(bvh_distance)));
        hits |= first <= last ? bvh_byte(child_bits4, child) << bvh_byte(bit_index4, child) : 0u;
    }
    return hits;
}

// Takes the next node of the group and replaces the group by the children that the ray meets.
void bvh_visit_node() {
    uint hits = bvh_nodes_waiting.y;
    uint bit = uint(findMSB(hits));
    bvh_nodes_waiting.y &= ~(1u << bit);
    if (bvh_nodes_waiting.y > 0x00ffffffu) {
        bvh_stack[bvh_stack_size] = bvh_nodes_waiting;
        bvh_stack_size++;
    }
    uint slot = (bit - 24u) ^ (bvh_octant4 & 0xffu);
    uint node = bvh_nodes_waiting.x + uint(bitCount(hits & ~(0xffffffffu << slot)));
    int texel = int(5u * node);
    uvec4 frame = texelFetch(bvh_nodes, texel);
    uvec4 children = texelFetch(bvh_nodes, texel + 1);
    uvec4 x = texelFetch(bvh_nodes, texel + 2);
    uvec4 y = texelFetch(bvh_nodes, texel + 3);
    uvec4 z = texelFetch(bvh_nodes, texel + 4);

    // Plane q lies at corner + q·2^exponent; the ray meets it at q·scale + bias.
    vec3 spacing = vec3(
        uintBitsToFloat((frame.w & 0xffu) << 23), uintBitsToFloat((frame.w & 0xff00u) << 15),
        uintBitsToFloat((frame.w & 0xff0000u) << 7));
    vec3 scale = spacing * bvh_inverse_direction;
    vec3 origin = HAS_INSTANCES ? bvh_node_origin : bvh_origin;
    vec3 direction = HAS_INSTANCES ? bvh_node_direction : bvh_direction;
    vec3 bias = (uintBitsToFloat(frame.xyz) - origin) * bvh_inverse_direction;
    vec3 near_bias = bias;
    vec3 far_bias = bias;
    if (HAS_INSTANCES) {
        vec3 margin = bvh_node_margin * abs(bvh_inverse_direction);
        near_bias -= margin;
        far_bias += margin;
    }
    x = direction.x < 0.0 ? x.zwxy : x;
    y = direction.y < 0.0 ? y.zwxy : y;
    z = direction.z < 0.0 ? z.zwxy : z;
    uint found =
        bvh_children(children.z, x.x, x.z, y.x, y.z, z.x, z.z, scale, near_bias, far_bias)
        | bvh_children(children.w, x.y, x.w, y.y, y.w, z.y, z.w, scale, near_bias, far_bias);

    bvh_nodes_waiting = uvec2(children.x, (found & 0xff000000u) | (frame.w >> 24));
    uvec2 triangles = uvec2(children.y, found & 0x00ffffffu);
    if (bvh_triangles_waiting.y == 0u) {
        bvh_triangles_waiting = triangles;
    } else {
        bvh_triangles_next = triangles;
    }
}

// Tests the next triangle of the group. A triangle seen edge on has no area and is not hit.
void bvh_test_triangle(bool any_hit) {
    uint bit = uint(findMSB(bvh_triangles_waiting.y));
    bvh_triangles_waiting.y &= ~(1u << bit);
    uint triangle = bvh_triangles_waiting.x + bit;
    vec3 a = projected(bvh_frame, bvh_corner(triangle, 0u) - bvh_origin);
    vec3 b = projected(bvh_frame, bvh_corner(triangle, 1u) - bvh_origin);
    vec3 c = projected(bvh_frame, bvh_corner(triangle, 2u) - bvh_origin);
    vec3 areas = edge_functions(a, b, c);
    float area = areas.x + areas.y + areas.z;
    // A weighted mean of the vertices' distances lies within the triangle, however badly conditioned.
    precise float distance = (areas.x * a.z + areas.y * b.z + areas.z * c.z) / area;
    bool inside = min(areas.x, min(areas.y, areas.z)) >= 0.0
        || max(areas.x, max(areas.y, areas.z)) <= 0.0;
    float least = HAS_PASSAGES ? bvh_passed_distance : 0.0;
    if (inside && area != 0.0 && distance > least && distance < bvh_distance) {
#ifdef MEETS_PASSAGES
        if (HAS_PASSAGES && any_hit) {
            bvh_transmittance *=
                passage(triangle, bvh_instance, areas / area, cross(b - a, c - a));
            if (bvh_transmittance != vec3(0.0)) {
                return;
            }
        }
#endif
        bvh_distance = distance;
        bvh_triangle = triangle;
        bvh_hit_instance = bvh_instance;
        if (any_hit) {
            bvh_nodes_waiting.y = 0u;
            bvh_triangles_waiting.y = 0u;
            bvh_triangles_next.y = 0u;
            bvh_stack_size = 0u;
        }
    }
}

// Moves between the levels of the tree as far as a step needs: takes the next group off the stack,
// enters the next instance, or leaves one that has nothing left. The upper level stacks groups of
// instances as well as of nodes, which have bits above 23.
void bvh_change_level(bool any_hit) {
    bool is_idle = bvh_nodes_waiting.y <= 0x00ffffffu && bvh_triangles_waiting.y == 0u;
    if (bvh_instance != NO_INSTANCE) {
        if (!is_idle || bvh_stack_size > bvh_stack_base) {
            return;
        }
        bvh_leave_instance(any_hit);
    }
    if (is_idle && bvh_stack_size > 0u) {
        bvh_stack_size--;
        uvec2 group = bvh_stack[bvh_stack_size];
        if (group.y > 0x00ffffffu) {
            bvh_nodes_waiting = group;
        } else {
            bvh_triangles_waiting = group;
        }
    }
    if (bvh_triangles_waiting.y != 0u) {
        uint bit = uint(findMSB(bvh_triangles_waiting.y));
        uint instance = bvh_triangles_waiting.x + bit;
        bvh_triangles_waiting.y &= ~(1u << bit);
        if (bvh_nodes_waiting.y > 0x00ffffffu) {
            bvh_stack[bvh_stack_size] = bvh_nodes_waiting;
            bvh_stack_size++;
        }
        if (bvh_triangles_waiting.y != 0u) {
            bvh_stack[bvh_stack_size] = bvh_triangles_waiting;
            bvh_stack_size++;
        }
        bvh_triangles_waiting.y = 0u;
        bvh_enter_instance(instance, any_hit);
    }
}

// Visits at most one node and one triangle. Returns false when the ray is finished; with `any_hit`,
// the first hit ends it.
bool bvh_step(bool any_hit) {
    if (HAS_INSTANCES) {
        bvh_change_level(any_hit);
    }
    uint base = HAS_INSTANCES && bvh_instance != NO_INSTANCE ? bvh_stack_base : 0u;
    if (bvh_nodes_waiting.y <= 0x00ffffffu && bvh_stack_size > base) {
        bvh_stack_size--;
        bvh_nodes_waiting = bvh_stack[bvh_stack_size];
    }
    if (bvh_nodes_waiting.y > 0x00ffffffu && bvh_triangles_next.y == 0u) {
        bvh_visit_node();
    }
    if (bvh_triangles_waiting.y != 0u && (!HAS_INSTANCES || bvh_instance != NO_INSTANCE)) {
        bvh_test_triangle(any_hit);
    }
    if (bvh_triangles_waiting.y == 0u) {
        bvh_triangles_waiting = bvh_triangles_next;
        bvh_triangles_next.y = 0u;
    }
    return (bvh_triangles_waiting.y | (bvh_nodes_waiting.y & 0xff000000u) | bvh_stack_size) != 0u;
}

// Turns a shading normal toward `outgoing_direction`, in the plane of the two, until their cosine is
// at least `least`. A visible surface is thus lit as if seen at grazing angle, and the change is
// continuous where the cosine falls below `least`.
vec3 consistent_normal(vec3 shading_normal, vec3 outgoing_direction, float least) {
    float cosine = dot(shading_normal, outgoing_direction);
    vec3 tangential = shading_normal - cosine * outgoing_direction;
    float size = length(tangential);
    if (cosine >= least || size == 0.0) {
        return shading_normal;
    }
    return tangential * (sqrt(1.0 - least * least) / size) + least * outgoing_direction;
}

// Cosine with the outgoing direction below which shading normals are turned.
const float LEAST_SHADING_COSINE = 0.01;

// Turns the shading normal of a surface that a ray along `direction` meets until it can be seen.
vec3 visible_normal(vec3 shading_normal, vec3 geometric_normal, vec3 direction) {
    float cosine = -dot(geometric_normal, direction);
    return consistent_normal(
        shading_normal, -direction, max(min(LEAST_SHADING_COSINE, cosine), 1.0e-6));
}

// Barycentric coordinates of the point where a ray meets the plane of `triangle`.
vec3 barycentric(uint triangle, uint instance, vec3 origin, vec3 direction) {
    Frame frame = frame_from_normal(direction);
    vec3 a = projected(frame, triangle_corner(triangle, 0u, instance) - origin);
    vec3 b = projected(frame, triangle_corner(triangle, 1u, instance) - origin);
    vec3 c = projected(frame, triangle_corner(triangle, 2u, instance) - origin);
    vec3 areas = edge_functions(a, b, c);
    return areas / (areas.x + areas.y + areas.z);
}

// Unit shading normal of a vertex in the world.
vec3 vertex_normal(uint packed_normal, uint instance) {
    vec3 normal = unpack_normal(packed_normal);
    return HAS_INSTANCES ? instance_normal(instance, normal) : normal;
}

// Computes the surface that a ray meets on `triangle`.
Hit surface_at(uint triangle, uint instance, vec3 origin, vec3 direction) {
    uvec4 texel_a = triangle_texel(triangle, 0u);
    uvec4 texel_b = triangle_texel(triangle, 1u);
    uvec4 texel_c = triangle_texel(triangle, 2u);
    vec3 a = uintBitsToFloat(texel_a.xyz);
    vec3 b = uintBitsToFloat(texel_b.xyz);
    vec3 c = uintBitsToFloat(texel_c.xyz);
    if (HAS_INSTANCES) {
        vec4 x = instance_row(instance, 3u);
        vec4 y = instance_row(instance, 4u);
        vec4 z = instance_row(instance, 5u);
        a = map_point(x, y, z, a);
        b = map_point(x, y, z, b);
        c = map_point(x, y, z, c);
    }
    Frame frame = frame_from_normal(direction);
    vec3 a_local = projected(frame, a - origin);
    vec3 b_local = projected(frame, b - origin);
    vec3 c_local = projected(frame, c - origin);
    vec3 areas = edge_functions(a_local, b_local, c_local);
    float area = areas.x + areas.y + areas.z;
    vec3 weights = areas / area;

    Hit hit;
    hit.position = weights.x * a + weights.y * b + weights.z * c;
    hit.distance = (areas.x * a_local.z + areas.y * b_local.z + areas.z * c_local.z) / area;
    hit.triangle = triangle;
    hit.material = triangle_material(triangle, instance);
    vec3 normal = cross(b - a, c - a);
    // Scale first: the squares of a small triangle's components would underflow.
    normal = normalize(normal / largest_of(abs(normal)));
    hit.geometric_normal = dot(normal, direction) > 0.0 ? -normal : normal;
    vec3 shading_normal = hit.geometric_normal;
    if (texel_a.w != FLAT_NORMAL) {
        vec3 interpolated = weights.x * vertex_normal(texel_a.w, instance)
            + weights.y * vertex_normal(texel_b.w, instance)
            + weights.z * vertex_normal(texel_c.w, instance);
        float squared = dot(interpolated, interpolated);
        if (squared > 1.0e-12) {
            interpolated *= inversesqrt(squared);
            shading_normal =
                dot(interpolated, hit.geometric_normal) < 0.0 ? -interpolated : interpolated;
        }
    }
    hit.shading_normal = visible_normal(shading_normal, hit.geometric_normal, direction);
    return hit;
}

// Tests whether a ray meets the back of a triangle, from which its corners go clockwise.
bool is_back(uint triangle, uint instance, vec3 direction) {
    return dot(front_normal(triangle, instance), direction) > 0.0;
}

// Result of a ray that met nothing or was not traced.
Hit no_surface() {
    return Hit(vec3(0.0), NO_MATERIAL, vec3(0.0), -1.0, vec3(0.0), NO_TRIANGLE);
}

// Offset of ray origins from their surface, as a share of the scene's size: 64 units of roundoff.
// docs/traversal.md has the error bound and the measured margin.
const float RAY_OFFSET_SHARE = 3.814697265625e-6;

// Offset of ray origins from their surface, metres: a fixed share of the scene's size, read from the
// root node. Scaling a scene by a power of two therefore changes no bit of the result.
float ray_offset() {
    uvec4 root = texelFetch(bvh_nodes, 0);
    vec3 corner = uintBitsToFloat(root.xyz);
    vec3 extent = 255.0 * vec3(
        uintBitsToFloat((root.w & 0xffu) << 23), uintBitsToFloat((root.w & 0xff00u) << 15),
        uintBitsToFloat((root.w & 0xff0000u) << 7));
    return RAY_OFFSET_SHARE * largest_of(max(abs(corner), abs(corner + extent)));
}

// Moves `position` by `offset` to the side of the surface that `direction` leads to.
vec3 moved_off_surface(vec3 position, vec3 geometric_normal, vec3 direction, float offset) {
    return position + (dot(geometric_normal, direction) < 0.0 ? -offset : offset) * geometric_normal;
}

// Origin of a ray that leaves a surface, offset by more than the error of positions and of the
// triangle test, so that the ray does not meet that surface again.
//
// Deviation: [Wächter & Binder 2019] move by a number of floats, and by a fixed distance near the
// coordinate origin, which is too much for a scene in millimetres.
vec3 offset_ray_origin(vec3 position, vec3 geometric_normal, vec3 direction) {
    return moved_off_surface(position, geometric_normal, direction, ray_offset());
}
