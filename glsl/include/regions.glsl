// Cells of rectangles of the environment, drawn in proportion to their light. Twin of
// tests/twin/regions.rs.

#include "divide.glsl"
#include "environment.glsl"
#include "random.glsl"

// Column and row of a cell of the environment, from the alias table of a region: `place` chooses an entry,
// `keep` its own cell or its alias. The region is as in Partition::tables.
uvec2 region_cell(usamplerBuffer aliases, uvec4 region, uint place, uint keep) {
    uint columns = region.y & 0xffffu;
    uint chosen = scaled(place, columns * (region.y >> 16u));
    uvec2 alias = texelFetch(aliases, int(region.x + chosen)).xy;
    chosen = keep < alias.x ? chosen : alias.y;
    uvec2 place_in_region = divide(chosen, columns);
    return uvec2(region.w & 0xffffu, region.w >> 16u) + place_in_region.yx;
}

// Draws a cell of a region by `place`, and a direction from its bilinear patch by other bits.
EnvironmentSample region_sample(usamplerBuffer aliases, uvec4 region, uint place, uvec4 bits) {
    uvec2 cell = region_cell(aliases, region, place, bits.z);
    EnvironmentSample light =
        environment_sample_cell(cell.x, cell.y, vec2(unit_float(bits.x), unit_float(bits.y)));
    // The density of a black map is 0 / 0.
    light.pdf = parameters.environment_total > 0.0 ? light.pdf : 0.0;
    return light;
}
