// Camera, film, crop window and environment of the scene.

#ifndef PARAMETERS_GLSL
#define PARAMETERS_GLSL

#include "layout.glsl"

READS(parameters)

#endif
