/** Shaders of the model in its materials. */

import { header, lookUp, studio, tone } from './sceneShaders';

/** Places a vertex, which has the numbers of its point and of its normal: there may be several vertices at a point. */
export const materialVertexShader = `${header}
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform sampler2D positions;
uniform sampler2D normals;
uniform sampler2D splitNormals;
uniform bool hasSplitNormals;
in uint point;
in uint normalAt;
in vec2 uv;
out vec3 viewPosition;
out vec3 viewNormal;
out vec2 texel;
${lookUp}
void main() {
  ivec2 at = texelOf(int(point));
  vec4 place = modelViewMatrix * vec4(texelFetch(positions, at, 0).xyz, 1.0);
  vec3 normal = hasSplitNormals ? texelFetch(splitNormals, texelOf(int(normalAt)), 0).xyz : texelFetch(normals, at, 0).xyz;
  viewPosition = place.xyz;
  viewNormal = mat3(modelViewMatrix) * normal;
  // Pictures begin at their top, and v at the bottom.
  texel = vec2(uv.x, 1.0 - uv.y);
  gl_Position = projectionMatrix * place;
}`;

/** The light of the model without materials; roughness and metalness say how it is mirrored, about as UsdPreviewSurface and glTF have it. */
export const materialFragmentShader = `${header}
uniform vec3 skyDirection;
uniform vec3 baseColor;
uniform float opacity;
uniform float roughness;
uniform float metalness;
uniform sampler2D baseMap;
uniform sampler2D opacityMap;
uniform sampler2D roughnessMap;
uniform sampler2D metalnessMap;
uniform bvec4 hasMaps;
uniform bool opacityIsAlpha;
in vec3 viewPosition;
in vec3 viewNormal;
in vec2 texel;
out vec4 shade;
${tone}${studio}
void main() {
  float alpha = opacity;
  if (hasMaps.y) {
    vec4 found = texture(opacityMap, texel);
    alpha = opacityIsAlpha ? found.a : found.r;
    if (alpha < 0.5) discard;
    alpha = 1.0;
  }
  vec3 base = hasMaps.x ? texture(baseMap, texel).rgb : baseColor;
  float rough = hasMaps.z ? texture(roughnessMap, texel).g : roughness;
  float metal = hasMaps.w ? texture(metalnessMap, texel).b : metalness;
  vec3 normal = viewNormal;
  if (dot(normal, normal) < 1e-6) normal = cross(dFdx(viewPosition), dFdy(viewPosition));
  else if (!gl_FrontFacing) normal = -normal;
  normal = normalize(normal);
  vec3 eye = normalize(-viewPosition);
  float up = dot(normal, skyDirection);
  float spread = clamp(rough * rough, 0.04, 1.0);
  // A highlight of Blinn and Phong that is as wide as one of this roughness.
  float power = 2.0 / (spread * spread) - 2.0;
  vec3 key = vec3(0.42, 0.66, 0.62);
  // Its lobe as a Gaussian, which a processor that draws computes faster than a power.
  float lobe = exp2(1.442695 * power * (dot(normal, normalize(eye + key)) - 1.0));
  float highlight = (power + 8.0) * 0.04 * lobe * max(0.0, dot(normal, key));
  // What is around is bright above and dark below, and a rough surface mixes both.
  float seen = dot(reflect(-eye, normal), skyDirection);
  float sky = smoothstep(-0.15 - spread, 0.35 + spread, seen);
  vec3 around = mix(vec3(0.10, 0.09, 0.08), vec3(0.74, 0.80, 0.88), sky);
  float edge = 1.0 - max(0.0, dot(normal, eye));
  float edge2 = edge * edge;
  vec3 straight = mix(vec3(0.04), base, metal);
  vec3 mirrored = straight + (max(vec3(1.0 - rough), straight) - straight) * edge2 * edge2 * edge;
  vec3 lit = base * (1.0 - metal) * studio(normal, up) + mirrored * (around + highlight);
  shade = vec4(toned(lit), alpha);
}`;
