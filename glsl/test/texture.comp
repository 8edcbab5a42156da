// Probe of texture.glsl: a use and coordinates, and a point of a triangle, in; values out.
#version 460

#include "test/answers.glsl"
#include "texture.glsl"

struct TextureQuery {
    uint use_index;
    uint material;
    uint triangle;
    float side;
    vec2 uv0;
    vec2 uv1;
    vec3 weights;
    vec3 shading_normal;
};

struct TextureAnswer {
    vec4 value;
    float number;
    TextureUse used;
    MaterialSurface surface;
    vec2 uv0;
    vec2 uv1;
    vec4 tangent;
    vec4 color;
    float opacity;
    vec3 surface_color;
    vec3 mapped;
};

TextureAnswer answer(TextureQuery query) {
    MaterialSurface surface = load_material_surface(query.material);
    TextureUse used = load_texture_use(query.use_index);
    Attributes attributes = triangle_attributes(query.triangle, query.weights);
    vec3 value = texture_value(query.use_index, attributes.uv0, attributes.uv1).rgb;
    vec3 mapped = mapped_normal(
        query.use_index, value, surface.normal_scale, query.triangle, NO_INSTANCE, attributes,
        query.shading_normal, query.side);
    return TextureAnswer(
        texture_value(query.use_index, query.uv0, query.uv1),
        texture_number(query.use_index, query.uv0, query.uv1), used, surface, attributes.uv0,
        attributes.uv1, attributes.tangent, attributes.color, surface_opacity(surface, attributes),
        surface_color(surface, attributes), mapped);
}

ANSWER_QUERIES(TextureQuery, TextureAnswer, answer)
