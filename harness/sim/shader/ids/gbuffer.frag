#version 450
// What is drawn at a pixel: the number that its body was given, lower byte first, and whether its
// surface looks up. Alpha is 1, so that 0 is where nothing was drawn.

#include "../lights.glsl"
#include "../material.glsl"

layout(location = 0) in vec3 outwards;
layout(location = 1) flat in uint number;

layout(location = 0) out vec4 outColor;

void main() {
  outColor = vec4(vec2(number & 255u, number >> 8) / 255, outwards.z > 0.9 ? 1 : 0, 1);
}
