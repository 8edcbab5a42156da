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
