// Cells of rectangles of the environment, drawn in proportion to their light. Twin of
// src/sampler/guided/partition.rs.

#include "random.glsl"

// Column and row of a cell of the environment, from the alias table of a region: `place` chooses an entry,
// `keep` its own cell or its alias. The region is first alias entry, columns, rows, first row * 65,536 +
// first column.
uvec2 region_cell(usamplerBuffer aliases, uvec4 region, uint place, uint keep) {
    uint count = region.y * region.z;
    uint chosen = scaled(place, count);
    uvec2 alias = texelFetch(aliases, int(region.x + chosen)).xy;
    chosen = keep < alias.x ? chosen : alias.y;
    // Divide chosen by columns without an integer division.
    uint row = uint(float(chosen) / float(region.y));
    int column = int(chosen) - int(row * region.y);
    row = column < 0 ? row - 1u : (column >= int(region.y) ? row + 1u : row);
    column += column < 0 ? int(region.y) : (column >= int(region.y) ? -int(region.y) : 0);
    return uvec2((region.w & 0xffffu) + uint(column), (region.w >> 16u) + row);
}
