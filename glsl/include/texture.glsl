// Textures, attributes of triangles and normal maps. Twins: src/surface/lookup.rs, tests/twin/texture.rs
// and crates/scene/src/texture/lookup.rs.
//
// Lookups read the full resolution. A mip level would average texels over an area that the pixel
// filter averages anyway once samples add up, and so blur the picture: a bias that no number of
// samples removes.

#include "divide.glsl"
#include "bvh.glsl"
#include "ggx.glsl"
#include "layout.glsl"

layout(constant_id = CONSTANT_TEXTURE_PAGES) const uint TEXTURE_PAGES = 1u;
layout(constant_id = CONSTANT_TEXTURE_PAGE_SHIFT) const uint TEXTURE_PAGE_SHIFT = 27u;
layout(constant_id = CONSTANT_ATTRIBUTE_PAGES) const uint ATTRIBUTE_PAGES = 1u;
layout(constant_id = CONSTANT_ATTRIBUTE_PAGE_SHIFT) const uint ATTRIBUTE_PAGE_SHIFT = 27u;
layout(constant_id = CONSTANT_ATTRIBUTES) const uint ATTRIBUTES = 0u;

LOADS(TextureUse, load_texture_use, texture_use_texels)
LOADS(MaterialSurface, load_material_surface, material_surface_texels)

PAGED_TEXELS(texture_word, texture_words, 1u, TEXTURE_PAGES, TEXTURE_PAGE_SHIFT)
PAGED_TEXELS(attribute_word, triangle_attributes, 1u, ATTRIBUTE_PAGES, ATTRIBUTE_PAGE_SHIFT)

// Linear value of a number 0 to 1 in the encoding of [IEC 61966-2-1:1999].
float srgb_to_linear(float encoded) {
    return encoded <= 0.04045 ? encoded / 12.92 : pow((encoded + 0.055) / 1.055, 2.4);
}

// Linear colour and opacity of a texel.
vec4 texture_texel(TextureUse used, ivec2 place) {
    uint index = uint(place.y) * used.width + uint(place.x);
    uint format = used.flags & TEXTURE_FORMAT_MASK;
    vec4 texel;
    if (format == TEXTURE_BYTES) {
        texel = unpackUnorm4x8(texture_word(used.first_word + index, 0u).x);
    } else {
        uint low = texture_word(used.first_word + 2u * index, 0u).x;
        uint high = texture_word(used.first_word + 2u * index + 1u, 0u).x;
        texel = format == TEXTURE_SHORTS ? vec4(unpackUnorm2x16(low), unpackUnorm2x16(high))
                                         : vec4(unpackHalf2x16(low), unpackHalf2x16(high));
    }
    if ((used.flags & TEXTURE_SRGB) != 0u) {
        texel.rgb = vec3(srgb_to_linear(texel.r), srgb_to_linear(texel.g), srgb_to_linear(texel.b));
    }
    return texel;
}

// Place along an axis of `size` texels, in texels, brought near the image so that texels next to it
// are in reach of wrapped_texel. Coordinates too large to have a fraction, and NaN, count as 0.
float texture_place(float coordinate, uint wrap, uint size) {
    coordinate = abs(coordinate) < 1.0e9 ? coordinate : 0.0;
    if (wrap == TEXTURE_REPEAT) {
        coordinate -= floor(coordinate);
    } else if (wrap == TEXTURE_MIRROR) {
        coordinate -= 2.0 * floor(0.5 * coordinate);
    } else {
        coordinate = clamp(coordinate, -1.0, 2.0);
    }
    return coordinate * float(size);
}

// Texel of the image that stands for the one at `place`.
int wrapped_texel(int place, uint wrap, uint size) {
    int last = int(size) - 1;
    if (wrap == TEXTURE_REPEAT) {
        return place < 0 ? place + int(size) : (place > last ? place - int(size) : place);
    }
    if (wrap == TEXTURE_MIRROR) {
        place = place < 0 ? -1 - place : place;
        place = place > last ? 2 * last + 1 - place : place;
        return place < 0 ? -1 - place : place;
    }
    return clamp(place, 0, last);
}

// Linear colour and opacity of an image at image coordinates. Centres of texels lie at +0.5.
vec4 texture_lookup(TextureUse used, vec2 image) {
    uint wrap_u = (used.flags >> TEXTURE_WRAP_U_SHIFT) & 3u;
    uint wrap_v = (used.flags >> TEXTURE_WRAP_V_SHIFT) & 3u;
    vec2 place = vec2(
        texture_place(image.x, wrap_u, used.width), texture_place(image.y, wrap_v, used.height));
    bool is_nearest = (used.flags & TEXTURE_NEAREST) != 0u;
    place -= is_nearest ? 0.0 : 0.5;
    ivec2 low = ivec2(whole(place.x), whole(place.y));
    vec2 share = place - floor(place);
    // A loop, since compilers copy the decoding of a texel into each place that calls it. Differences from
    // the first texel are exactly 0 where all are alike: opaque stays opaque.
    uint corners = is_nearest ? 1u : 4u;
    vec4 first = vec4(0.0);
    vec4 sum = vec4(0.0);
    for (uint corner = 0u; corner < corners; corner++) {
        ivec2 beside = ivec2(corner & 1u, corner >> 1u);
        vec2 weight = mix(1.0 - share, share, vec2(beside));
        int column = wrapped_texel(low.x + beside.x, wrap_u, used.width);
        int row = wrapped_texel(low.y + beside.y, wrap_v, used.height);
        vec4 texel = texture_texel(used, ivec2(column, row));
        first = corner == 0u ? texel : first;
        sum = corner == 0u ? texel : sum + weight.x * weight.y * (texel - first);
    }
    return sum;
}

// Image coordinates of a point of the surface.
vec2 image_coordinates(TextureUse used, vec2 uv0, vec2 uv1) {
    vec3 uv = vec3((used.flags & TEXTURE_SECOND_UVS) != 0u ? uv1 : uv0, 1.0);
    return vec2(dot(used.image_u, uv), dot(used.image_v, uv));
}

// Factor that a texture gives a property: scaled colour, and opacity as it is in the image. One
// without a texture.
vec4 texture_value(uint use_index, vec2 uv0, vec2 uv1) {
    if (use_index == NO_TEXTURE) {
        return vec4(1.0);
    }
    TextureUse used = load_texture_use(use_index);
    vec4 texel = texture_lookup(used, image_coordinates(used, uv0, uv1));
    uint channel = used.flags >> TEXTURE_CHANNEL_SHIFT;
    vec3 color = channel == 0u ? texel.rgb : vec3(texel[channel - 1u]);
    return vec4(color * used.scale + used.bias, texel.a);
}

// The same for a property that is one number: the luminance.
float texture_number(uint use_index, vec2 uv0, vec2 uv1) {
    return dot(texture_value(use_index, uv0, uv1).rgb, LUMINANCE_WEIGHTS);
}

// Attributes of a point of a triangle.
struct Attributes {
    // Texture coordinates, 0 where there are none.
    vec2 uv0;
    vec2 uv1;
    // Tangent of any length along u of the first set, and sign of the bitangent; 0 for none.
    vec4 tangent;
    // Linear colour and opacity, 1 where there is none.
    vec4 color;
};

// Two words of attribute `bit` at a corner (0 to 2) of a triangle that has it.
uvec2 corner_attribute(uint triangle, uint corner, uint bit) {
    uint place = 2u * uint(bitCount(ATTRIBUTES & (bit - 1u)));
    uint stride = 2u * uint(bitCount(ATTRIBUTES));
    uint word = (3u * triangle + corner) * stride + place;
    return uvec2(attribute_word(word, 0u).x, attribute_word(word + 1u, 0u).x);
}

// Texture coordinates at a corner; 0 where there are none.
vec2 corner_uv(uint triangle, uint corner, uint bit) {
    bool is_there = (ATTRIBUTES & bit) != 0u;
    return is_there ? uintBitsToFloat(corner_attribute(triangle, corner, bit)) : vec2(0.0);
}

vec2 interpolated_uv(uint triangle, vec3 weights, uint bit) {
    return weights.x * corner_uv(triangle, 0u, bit) + weights.y * corner_uv(triangle, 1u, bit)
        + weights.z * corner_uv(triangle, 2u, bit);
}

vec4 corner_color(uint triangle, uint corner) {
    uvec2 words = corner_attribute(triangle, corner, ATTRIBUTE_COLOR);
    return vec4(unpackUnorm2x16(words.x), unpackUnorm2x16(words.y));
}

// Attributes at the point of a triangle in BVH order with these barycentric coordinates.
Attributes triangle_attributes(uint triangle, vec3 weights) {
    Attributes attributes = Attributes(
        interpolated_uv(triangle, weights, ATTRIBUTE_FIRST_UVS),
        interpolated_uv(triangle, weights, ATTRIBUTE_SECOND_UVS), vec4(0.0), vec4(1.0));
    if ((ATTRIBUTES & ATTRIBUTE_TANGENT) != 0u) {
        uvec2 a = corner_attribute(triangle, 0u, ATTRIBUTE_TANGENT);
        uvec2 b = corner_attribute(triangle, 1u, ATTRIBUTE_TANGENT);
        uvec2 c = corner_attribute(triangle, 2u, ATTRIBUTE_TANGENT);
        if (a.x != FLAT_NORMAL && b.x != FLAT_NORMAL && c.x != FLAT_NORMAL) {
            vec3 tangent = weights.x * unpack_normal(a.x) + weights.y * unpack_normal(b.x)
                + weights.z * unpack_normal(c.x);
            attributes.tangent = vec4(tangent, uintBitsToFloat(a.y));
        }
    }
    if ((ATTRIBUTES & ATTRIBUTE_COLOR) != 0u) {
        attributes.color = weights.x * corner_color(triangle, 0u)
            + weights.y * corner_color(triangle, 1u) + weights.z * corner_color(triangle, 2u);
    }
    return attributes;
}

// Factor of the main colour at a point.
vec3 surface_color(MaterialSurface surface, Attributes attributes) {
    vec3 color = texture_value(surface.color, attributes.uv0, attributes.uv1).rgb;
    return (surface.flags & SURFACE_VERTEX_COLOR) != 0u ? color * attributes.color.rgb : color;
}

// Share of light that the surface stops at a point, 0 to 1.
float surface_opacity(MaterialSurface surface, Attributes attributes) {
    float opacity =
        surface.opacity_factor * texture_number(surface.opacity, attributes.uv0, attributes.uv1);
    if ((surface.flags & SURFACE_VERTEX_COLOR) != 0u) {
        opacity *= attributes.color.a;
    }
    if (surface.opacity_cutoff >= 0.0) {
        return opacity >= surface.opacity_cutoff ? 1.0 : 0.0;
    }
    return clamp(opacity, 0.0, 1.0);
}

// Direction of increasing u of the image along a triangle, at right angles to a unit normal, and the
// sign of the bitangent, which points up in the image; 0 if the coordinates do not span the triangle.
// The edges are those from the first corner, in the world and in the image.
vec4 gradient_tangent(vec3 edge_1, vec3 edge_2, vec2 image_1, vec2 image_2, vec3 normal) {
    float area = image_1.x * image_2.y - image_2.x * image_1.y;
    // The sign alone matters: tangents are scaled to unit length below.
    float turn = area < 0.0 ? -1.0 : 1.0;
    vec3 along_u = turn * (image_2.y * edge_1 - image_1.y * edge_2);
    vec3 along_v = turn * (image_1.x * edge_2 - image_2.x * edge_1);
    vec3 tangent = along_u - dot(along_u, normal) * normal;
    float largest = largest_of(abs(tangent));
    if (area == 0.0 || !(largest > 0.0)) {
        return vec4(0.0);
    }
    tangent = normalize(tangent / largest);
    return vec4(tangent, dot(cross(normal, tangent), along_v) > 0.0 ? -1.0 : 1.0);
}

// Unit tangent of a texture at a point, at right angles to `normal`, and the sign of the bitangent: the
// stored one, else from the coordinates of the triangle; for `NO_TEXTURE` from its first set, whose v points
// up. `normal` is the unit shading normal on the front, from where the triangle is counter-clockwise. 0 if
// there is no tangent.
vec4 surface_tangent(
    uint use_index, uint triangle, uint instance, Attributes attributes, vec3 normal
) {
    vec3 along = attributes.tangent.xyz;
    float turn = 1.0;
    if (HAS_INSTANCES) {
        along = instance_vector(instance, along);
        along *= inversesqrt(max(dot(along, along), 1.0e-30));
        turn = instance_winding(instance);
    }
    vec3 stored = along - dot(along, normal) * normal;
    float squared = dot(stored, stored);
    if (squared > 1.0e-8) {
        return vec4(
            stored * inversesqrt(squared), turn * attributes.tangent.w < 0.0 ? -1.0 : 1.0);
    }
    vec2 image[3];
    for (uint corner = 0u; corner < 3u; corner++) {
        vec2 uv0 = corner_uv(triangle, corner, ATTRIBUTE_FIRST_UVS);
        image[corner] = vec2(uv0.x, -uv0.y);
        if (use_index != NO_TEXTURE) {
            image[corner] = image_coordinates(
                load_texture_use(use_index), uv0,
                corner_uv(triangle, corner, ATTRIBUTE_SECOND_UVS));
        }
    }
    vec3 a = triangle_corner(triangle, 0u, instance);
    vec3 b = triangle_corner(triangle, 1u, instance);
    vec3 c = triangle_corner(triangle, 2u, instance);
    return gradient_tangent(b - a, c - a, image[1] - image[0], image[2] - image[0], normal);
}

// Unit shading normal after a normal map of this value. `shading_normal` and the result are on the same
// side of the surface: the front for a `side` of 1, the back for -1, where the map's normals are turned
// round. The caller still has to turn the result toward the viewer with consistent_normal.
vec3 mapped_normal(
    uint use_index, vec3 value, float normal_scale, uint triangle, uint instance,
    Attributes attributes, vec3 shading_normal, float side
) {
    vec3 normal = side * shading_normal;
    vec4 tangent = surface_tangent(use_index, triangle, instance, attributes, normal);
    if (tangent.w == 0.0) {
        return shading_normal;
    }
    vec3 local = 2.0 * value - 1.0;
    vec3 bitangent = tangent.w * cross(normal, tangent.xyz);
    vec3 mapped = normal_scale * local.x * tangent.xyz + normal_scale * local.y * bitangent
        + local.z * normal;
    float squared = dot(mapped, mapped);
    return squared > 1.0e-12 ? side * mapped * inversesqrt(squared) : shading_normal;
}

// Turns a vector by the angle of another from the x axis; by none for a vector of length 0.
vec2 turned_by(vec2 vector, vec2 direction) {
    float squared = dot(direction, direction);
    vec2 turn = squared > 0.0 ? direction * inversesqrt(squared) : vec2(1.0, 0.0);
    return vec2(vector.x * turn.x - vector.y * turn.y, vector.x * turn.y + vector.y * turn.x);
}

// Unit direction in the frame of the shading normal of `axis`, which counts in tangent and bitangent; without
// a tangent, in the axes of that frame.
vec2 along_surface(vec2 axis, vec4 tangent, vec3 tangent_normal, vec3 shading_normal) {
    vec2 direction = axis;
    if (tangent.w != 0.0) {
        vec3 bitangent = tangent.w * cross(tangent_normal, tangent.xyz);
        direction = to_local(
            frame_from_normal(shading_normal), axis.x * tangent.xyz + axis.y * bitangent).xy;
    }
    return direction * inversesqrt(max(dot(direction, direction), 1.0e-30));
}

// Widths of a surface of width `alpha` that KHR_materials_anisotropy stretches by a strength along a unit
// direction.
GgxWidth stretched_width(float alpha, float strength, vec2 direction) {
    strength = min(strength, 1.0);
    float along = mix(alpha, 1.0, strength * strength);
    if (along <= alpha) {
        return round_width(alpha);
    }
    // Twice the angle of the direction, since both of its ends are alike.
    vec2 stretch = (along - alpha) / (along + alpha) * turned_by(direction, direction);
    return GgxWidth(0.5 * (along + alpha), stretch, false);
}
