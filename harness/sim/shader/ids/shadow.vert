#version 450
// No shadows: they change no number.

layout(set = 0, binding = 0) uniform LightBuffer {
  mat4 viewMatrix;
  mat4 viewMatrixInverse;
  mat4 projectionMatrix;
  mat4 projectionMatrixInverse;
  int width;
  int height;
} light;

#include "../body.glsl"

void main() {
  gl_Position = vec4(0, 0, 2, 1);
}
