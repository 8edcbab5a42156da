// Structs and buffers shared with the host: build.rs writes interface.glsl from src/shader. It also gives an
// include only where a shader first names it, so that files need no guards.

#extension GL_EXT_scalar_block_layout : require

#include "interface.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

// Declare a buffer with the access of the pass; synchronization validation relies on it.
#define READS(name) BUFFER_##name(readonly)
#define WRITES(name) BUFFER_##name(writeonly)
#define UPDATES(name) BUFFER_##name(READ_WRITE)
#define READ_WRITE
#define TEXELS(name) TEXELS_##name
// Declares texels that hold a struct each, and `load`, which returns that of an index.
#define LOADS(Struct, load, texels) TEXELS(texels) LOADS_##Struct(load, texels)
// Declares texels in up to four pages of 1 << PAGE_SHIFT elements, and `fetch`, which returns texel `part` of
// an element of `size` texels; with one page the choice folds away.
#define PAGED_TEXELS(fetch, texels, size, PAGES, PAGE_SHIFT) \
    TEXELS(texels##_0) TEXELS(texels##_1) TEXELS(texels##_2) TEXELS(texels##_3) \
    uvec4 fetch(uint element, uint part) { \
        if (PAGES == 1u) { \
            return texelFetch(texels##_0, int(size * element + part)); \
        } \
        uint page = element >> PAGE_SHIFT; \
        int texel = int(size * (element - (page << PAGE_SHIFT)) + part); \
        if (page == 0u) { \
            return texelFetch(texels##_0, texel); \
        } \
        if (page == 1u) { \
            return texelFetch(texels##_1, texel); \
        } \
        if (page == 2u) { \
            return texelFetch(texels##_2, texel); \
        } \
        return texelFetch(texels##_3, texel); \
    }
