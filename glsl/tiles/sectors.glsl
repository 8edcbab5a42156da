// Sectors of the directions from the camera, in which visibility is learned, and tiles of the environment.
// Twin of tests/twin/tiles.rs.

#include "environment.glsl"
#include "equal_area.glsl"

TEXELS(tile_of_cell)
TEXELS(tile_entries)

layout(constant_id = CONSTANT_TILES) const uint TILES = 128u;

// Sectors along each side of the square of directions. No constant: a window in motion changes it with the
// size of its film, and each constant has pipelines of its own.
uint sector_side() {
    return uint(sqrt(float(uint(textureSize(tile_entries)) / TILES)) + 0.5);
}

// Sector of a place as seen from the camera. All sectors have the same solid angle;
// the square of directions has its middle at the view axis, and its seam behind the camera.
uint sector_of(vec3 position) {
    vec3 away = position - parameters.camera_position;
    float far = length(away);
    vec3 direction = far > 0.0 ? away / far : parameters.camera_forward;
    vec2 at = square_from_direction(vec3(
        dot(direction, parameters.camera_right), dot(direction, parameters.camera_up),
        dot(direction, parameters.camera_forward)));
    uint side = sector_side();
    vec2 place = clamp(at * float(side), 0.0, float(side - 1u));
    return uint(place.y) * side + uint(place.x);
}

// Tile that holds a direction.
uint tile_of(vec3 direction) {
    return texelFetch(tile_of_cell, environment_cell_index(direction)).x;
}
