// Loads rays, hits, shadow rays and materials through texel buffers: on lavapipe a texel of four
// words costs a fraction of four loads from a storage buffer (docs/traversal.md).

#include "layout.glsl"

TEXELS(ray_texels)
TEXELS(hit_texels)
TEXELS(shadow_ray_texels)
TEXELS(material_texels)

Ray load_ray(uint index) {
    uvec4 first = texelFetch(ray_texels, int(2u * index));
    uvec4 second = texelFetch(ray_texels, int(2u * index + 1u));
    return Ray(
        uintBitsToFloat(first.xyz), first.w, uintBitsToFloat(second.xyz),
        uintBitsToFloat(second.w));
}

Hit load_hit(uint index) {
    uvec4 first = texelFetch(hit_texels, int(3u * index));
    uvec4 second = texelFetch(hit_texels, int(3u * index + 1u));
    uvec4 third = texelFetch(hit_texels, int(3u * index + 2u));
    return Hit(
        uintBitsToFloat(first.xyz), first.w, uintBitsToFloat(second.xyz), uintBitsToFloat(second.w),
        uintBitsToFloat(third.xyz), third.w);
}

ShadowRay load_shadow_ray(uint index) {
    uvec2 first = texelFetch(shadow_ray_texels, int(3u * index)).xy;
    uvec2 second = texelFetch(shadow_ray_texels, int(3u * index + 1u)).xy;
    uvec2 third = texelFetch(shadow_ray_texels, int(3u * index + 2u)).xy;
    return ShadowRay(uintBitsToFloat(uvec3(first, second.x)), uintBitsToFloat(uvec3(second.y, third)));
}

Material load_material(uint index) {
    uvec4 first = texelFetch(material_texels, int(4u * index));
    uvec4 second = texelFetch(material_texels, int(4u * index + 1u));
    uvec4 third = texelFetch(material_texels, int(4u * index + 2u));
    uint last = texelFetch(material_texels, int(4u * index + 3u)).x;
    return Material(
        first.x, first.y, uintBitsToFloat(first.z), uintBitsToFloat(first.w),
        uintBitsToFloat(second.xyz), uintBitsToFloat(uvec3(second.w, third.xy)),
        uintBitsToFloat(uvec3(third.zw, last)), vec3(0.0));
}
