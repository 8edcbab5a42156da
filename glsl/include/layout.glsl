// Structs and buffers shared with the host: build.rs writes interface.glsl from src/shader.

#ifndef LAYOUT_GLSL
#define LAYOUT_GLSL

#extension GL_EXT_scalar_block_layout : require

#include "interface.glsl"

// Declare a buffer with the access of the pass; synchronization validation relies on it.
#define READS(name) BUFFER_##name(readonly)
#define WRITES(name) BUFFER_##name(writeonly)
#define UPDATES(name) BUFFER_##name(READ_WRITE)
#define READ_WRITE
#define TEXELS(name) TEXELS_##name

#endif
