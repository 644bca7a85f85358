#version 450
// No shadows: what a pixel shows does not depend on them.

#include "../shadow.glsl"
