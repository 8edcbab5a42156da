// Camera, film, crop window and environment of the scene.

#include "layout.glsl"

READS(parameters)
