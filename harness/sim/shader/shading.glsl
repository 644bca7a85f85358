// Colour of a pixel: ambient light, two lamps and a sun, with shadows, on a rough or shiny, coloured
// or metallic surface (Cook and Torrance's model with the GGX distribution, Schlick's fresnel term),
// gamma 2.2. Alpha is 1, so that 0 is where nothing was drawn.

#include "lights.glsl"
#include "material.glsl"

const int COLOR = 1, ROUGHNESS = 2, METALLIC = 8;  // bits of textureMask

layout(location = 0) in vec3 place;
layout(location = 1) in vec3 outwards;
layout(location = 2) in vec2 texel;
layout(location = 3) in vec3 bySun;
layout(location = 4) in vec4 byLeft;
layout(location = 5) in vec4 byRight;
layout(location = 6) flat in vec3 eye;

layout(location = 0) out vec4 outColor;

const float PI = 3.14159265;
const float TINY = 1e-6;
// Ambient light on upright faces, and how much more there is on those that look up, for what table
// and wall throw back or hide: fitted to ray-traced pictures of the same scenes.
const float UPRIGHT = 0.9, SLOPE = 0.25;

// Of ambient light up to MOST is hidden by what is nearer than 12 cm in the way to a light, TOUCHING for
// each of them; a mm of distance is ignored, within which a surface would hide itself. Both are in
// parts of the depth of the maps of sun and lamps.
const float TOUCHING = 0.35, MOST = 0.6, BY_SUN = 50, BY_LAMP = 36, RISE = 2500;

struct Surface {
  vec3 normal;
  vec3 toCamera;
  float facing;     // cosine between the two
  vec3 diffuse;     // reflected in all directions, over pi
  vec3 fresnel;     // reflected like a mirror at right angles
  float alpha2;     // fourth power of the roughness
  float remap;      // of the geometric term
  float geometric;  // its part towards the camera, times the cosine and 4 pi
};

float grazing(float cosine) {
  float x = 1 - cosine;
  return x * x * (x * x) * x;
}

// Light from direction `way` (unit) that goes to the camera, of a colour and strength. The vector half
// way between the two is needed nowhere, only its squared length and the cosines of its angles; both
// parts of a fraction are multiplied by that length, because a division is dear on a CPU.
vec3 reflected(Surface s, vec3 way, vec3 color, float strength) {
  float towards = dot(s.normal, way);
  float nl = clamp(towards, 0, 1);
  float length2 = max(2 + 2 * dot(way, s.toCamera), TINY);
  float nh = max(towards + s.facing, 0);  // times the length
  float vh = min(0.5 * sqrt(length2), 1);
  float lobe = min(nh * nh, length2) * (s.alpha2 - 1) + length2;
  float spread = lobe * lobe * s.geometric * (nl * (1 - s.remap) + s.remap);
  float length4 = length2 * length2;
  float share = s.alpha2 * length4 / max(spread, TINY * length4);
  return (s.diffuse + (s.fresnel + (1 - s.fresnel) * grazing(vh)) * share) * (color * (strength * nl));
}

// Of a light at `at` (column, row, depth in its shadow map): the share that reaches it, and how near
// what hides it is, 1 where it touches and 0 beyond a depth of 1 / `nearness`. A mean over the four
// texels around it, weighted by how near they are.
vec2 reaching(sampler2D map, vec3 at, float nearness) {
  vec4 gap = at.z - textureGather(map, at.xy);
  vec2 share = fract(at.xy * textureSize(map, 0).x + 0.5), rest = 1 - share;
  vec4 weight = vec4(rest.x, share.x, share.x, rest.x) * vec4(share.yy, rest.yy);
  vec4 near = max(min(RISE * gap - 0.6, 1 - nearness * gap), 0);
  return vec2(dot(step(gap, vec4(0)), weight), dot(near, weight));
}

vec2 lamplit(sampler2D map, vec4 seen) {
  float scale = 1 / seen.w;
  vec3 at = vec3(seen.xy * (0.5 * scale) + 0.5, seen.z * scale);
  return seen.w > 0 ? reaching(map, at, BY_LAMP) : vec2(1, 0);
}

vec3 lamp(Surface s, int i, float strength) {
  vec3 way = lights.spotLights[i].position.xyz - place;
  float nearness = inversesqrt(dot(way, way));
  vec3 color = lights.spotLights[i].emission.rgb;
  return reflected(s, way * nearness, color, strength * nearness * nearness);
}

// To the power of 1 / 2.2, within 0.11 of the 255 steps: roots cost a CPU a third of a power.
vec3 shown(vec3 color) {
  vec3 root = sqrt(min(color, 1)), fourth = sqrt(root);
  return fourth * (0.033443 + fourth * (1.241114 + fourth * (-0.415369 + fourth * 0.141237)));
}

void main() {
  vec3 albedo = material.baseColor.rgb;
  float roughness = material.roughness;
  float metallic = material.metallic;
  if ((material.textureMask & COLOR) != 0) {
    albedo = textureLod(colorTexture, texel, 0).rgb;
  }
  if ((material.textureMask & ROUGHNESS) != 0) {
    roughness = textureLod(roughnessTexture, texel, 0).r;
  }
  if ((material.textureMask & METALLIC) != 0) {
    metallic = textureLod(metallicTexture, texel, 0).r;
  }

  Surface s;
  s.toCamera = normalize(eye - place);
  vec3 normal = normalize(outwards);
  float facing = dot(normal, s.toCamera);
  s.normal = facing < 0 ? -normal : normal;
  s.facing = abs(facing);
  s.diffuse = albedo * ((1 - metallic) * (1 / PI));
  s.fresnel = mix(vec3(0.08 * material.fresnel), albedo, metallic);
  float alpha = roughness * roughness;
  s.alpha2 = alpha * alpha;
  s.remap = (alpha + 2 * roughness + 1) / 8;
  float nv = clamp(s.facing, TINY, 1);
  s.geometric = 4 * PI * (nv * (1 - s.remap) + s.remap);

  vec3 scattered = albedo * (1 - metallic) * (UPRIGHT + SLOPE * s.normal.z);
  vec3 mirrored = s.fresnel * (1 - 0.75 * roughness * (1 - metallic)) +
                  (1 - s.fresnel) * grazing(nv) * (1 - roughness);
  vec2 sun = reaching(samplerDirectionalLightDepths[0], bySun, BY_SUN);
  vec2 left = lamplit(samplerSpotLightDepths[0], byLeft);
  vec2 right = lamplit(samplerSpotLightDepths[1], byRight);
  float hidden = max(s.normal.z, 0) * (sun.y + left.y + right.y) * TOUCHING;
  vec3 color = lights.ambientLight.rgb * (scattered + mirrored) * (1 - min(hidden, MOST));
  color += lamp(s, 0, left.x);
  color += lamp(s, 1, right.x);
  color += reflected(s, -lights.directionalLights[0].direction.xyz,
                     lights.directionalLights[0].emission.rgb, sun.x);
  outColor = vec4(shown(color), 1);
}
