#version 450
// Where things are in the picture of one camera.

#include "../camera.glsl"
#include "../body.glsl"

layout(location = 0) out vec3 outwards;  // normal, in the world
layout(location = 1) flat out uint number;

const vec4 NOWHERE = vec4(0, 0, 2, 1);

void main() {
  vec4 at = body.modelMatrix * vec4(position, 1);
  outwards = mat3(body.modelMatrix) * normal;
  number = bodyData.segmentation.w;
  bool first = int(bodyData.transparency * 4 + 0.5) == 0;
  gl_Position = first ? camera.projectionMatrix * (camera.viewMatrix * at) : NOWHERE;
}
