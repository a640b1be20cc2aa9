import { FIELD_OF_VIEW } from './camera';
import { WIDTH, WIDTH_BITS } from './packing';

export const header = `precision highp float;
precision highp int;
precision highp sampler2D;
`;

export const lookUp = `
ivec2 texelOf(int point) { return ivec2(point & ${WIDTH - 1}, point >> ${WIDTH_BITS}); }
`;

/** How far away a point looks; without perspective all are as far as the camera's target. */
const away = `
float awayOf(float z) {
  return projectionMatrix[3][3] == 1.0 ? ${(1 / Math.tan(FIELD_OF_VIEW / 2)).toFixed(6)} / projectionMatrix[1][1] : max(0.05, -z);
}
`;

/** Light to sRGB, with a shoulder that keeps highlights from clipping. */
export const tone = `
vec3 toned(vec3 light) {
  vec3 mapped = light * (1.0 + light * 0.12) / (1.0 + light * 0.34);
  return pow(clamp(mapped, 0.0, 1.0), vec3(1.0 / 2.2));
}
`;

/** Soft light fixed to the camera, by a normal and how far that points up. */
export const studio = `
vec3 studio(vec3 normal, float up) {
  float key = max(0.0, dot(normal, vec3(0.42, 0.66, 0.62)) * 0.82 + 0.18);
  float fill = max(0.0, dot(normal, vec3(-0.83, 0.12, 0.54)) * 0.7 + 0.3);
  vec3 light = vec3(1.04, 0.98, 0.90) * key * key * 0.86 + vec3(0.60, 0.74, 0.98) * fill * fill * 0.24;
  return light + mix(vec3(0.13, 0.115, 0.105), vec3(0.33, 0.37, 0.43), up * 0.5 + 0.5) * 0.62;
}
`;

/** Places a point of the model by its number, which the index buffer holds. */
export const modelVertexShader = `${header}
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform sampler2D positions;
uniform sampler2D normals;
uniform sampler2D heat;
uniform float heatScale;
uniform float heatShare;
uniform vec3 color;
uniform sampler2D colors;
uniform bool hasColors;
uniform float pointSize;
uniform float towards;
out vec3 viewPosition;
out vec3 viewNormal;
out float heatValue;
out vec3 ownColor;
${lookUp}${away}
void main() {
  ivec2 at = texelOf(gl_VertexID);
  vec4 place = modelViewMatrix * vec4(texelFetch(positions, at, 0).xyz, 1.0);
  viewPosition = place.xyz;
  viewNormal = mat3(modelViewMatrix) * texelFetch(normals, at, 0).xyz;
  heatValue = heatShare > 0.0 ? length(texelFetch(heat, at, 0).xyz) * heatScale : 0.0;
  ownColor = hasColors ? texelFetch(colors, at, 0).rgb : color;
  place.xyz *= 1.0 - towards;
  gl_Position = projectionMatrix * place;
  gl_PointSize = pointSize / awayOf(place.z);
}`;

/** Soft studio light fixed to the camera, and a slight darkening of hollows. */
export const modelFragmentShader = `${header}
uniform vec3 skyDirection;
uniform sampler2D heatColors;
uniform float heatShare;
uniform bool hasColors;
uniform bool asPoints;
uniform float transparency;
in vec3 viewPosition;
in vec3 viewNormal;
in float heatValue;
in vec3 ownColor;
out vec4 shade;
${tone}${studio}
void main() {
  vec3 normal = viewNormal;
  vec3 eye = normalize(-viewPosition);
  if (asPoints) {
    vec2 across = gl_PointCoord * vec2(2.0, -2.0) - vec2(1.0, -1.0);
    float inside = 1.0 - dot(across, across);
    if (inside < 0.0) discard;
    normal = vec3(across, sqrt(inside));
  } else if (dot(normal, normal) < 1e-6) {
    normal = cross(dFdx(viewPosition), dFdy(viewPosition));
  } else if (!gl_FrontFacing) {
    normal = -normal;
  }
  normal = normalize(normal);
  vec3 base = ownColor;
  if (heatShare > 0.0) {
    vec3 mapped = isnan(heatValue) ? vec3(0.5) : texture(heatColors, vec2(clamp(heatValue, 0.0, 1.0) * 0.996 + 0.002, 0.5)).rgb;
    base = mix(base, pow(mapped, vec3(2.2)), heatShare);
  }
  // Screen-space curvature: positive on ridges, negative in hollows.
  vec3 bendX = dFdx(normal), bendY = dFdy(normal), stepX = dFdx(viewPosition), stepY = dFdy(viewPosition);
  float bend = (dot(bendX, stepX) + dot(bendY, stepY)) / max(1e-12, dot(stepX, stepX) + dot(stepY, stepY));
  float cavity = asPoints ? 1.0 : 1.0 + clamp(bend * 0.006, -0.22, 0.14);
  float facing = max(0.0, dot(normal, eye));
  float up = dot(normal, skyDirection);
  vec3 light = studio(normal, up);
  vec3 halfway = normalize(eye + vec3(0.42, 0.66, 0.62));
  // To the powers of 26 and of 3.5: a processor that draws multiplies in a fraction of the time of pow().
  float towards = max(0.0, dot(normal, halfway));
  float towards2 = towards * towards;
  float towards8 = towards2 * towards2 * towards2 * towards2;
  float gloss = towards2 * towards8 * towards8 * towards8 * 0.10;
  float away = 1.0 - facing;
  float rim = away * away * away * sqrt(max(0.0, away)) * (0.24 + 0.28 * max(0.0, up)) * (heatShare > 0.0 || hasColors ? 0.35 : 1.0);
  vec3 lit = base * light * cavity + gloss + rim * vec3(0.80, 0.90, 1.0);
  shade = vec4(toned(lit), 1.0 - transparency);
}`;

/** Lines and dots in one colour, at points of the model. */
export const inkFragmentShader = `${header}
uniform vec4 ink;
uniform bool asPoints;
out vec4 shade;
void main() {
  float cover = 1.0;
  if (asPoints) {
    float away = length(gl_PointCoord * 2.0 - 1.0);
    cover = 1.0 - smoothstep(0.72, 1.0, away);
    if (cover <= 0.0) discard;
  }
  shade = vec4(ink.rgb, ink.a * cover);
}`;

/** Lines and dots at positions of an attribute: the cage. */
export const cageVertexShader = `${header}
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform float pointSize;
uniform float towards;
in vec3 position;
void main() {
  vec4 place = modelViewMatrix * vec4(position, 1.0);
  place.xyz *= 1.0 - towards;
  gl_Position = projectionMatrix * place;
  gl_PointSize = pointSize;
}`;

/** Places a point of a surface that is given by attributes; without normals its faces are flat, and without heat it has one colour. */
export const shapeVertexShader = `${header}
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform float pointSize;
uniform vec3 color;
in vec3 position;
in vec3 normal;
in float heat;
out vec3 viewPosition;
out vec3 viewNormal;
out float heatValue;
out vec3 ownColor;
${away}
void main() {
  vec4 place = modelViewMatrix * vec4(position, 1.0);
  viewPosition = place.xyz;
  viewNormal = mat3(modelViewMatrix) * normal;
  heatValue = heat;
  ownColor = color;
  gl_Position = projectionMatrix * place;
  gl_PointSize = pointSize / awayOf(place.z);
}`;

/** Squares along a side of the backdrop, whose colours are computed at their corners: at every pixel they would cost more than the model. */
export const BACKDROP_SQUARES = 24;

/** The backdrop: a gradient from top to bottom that is lighter behind the model. */
export const backdropVertexShader = `${header}
uniform vec3 top;
uniform vec3 bottom;
out vec3 blended;
void main() {
  ivec2 corner = ivec2(gl_VertexID % ${BACKDROP_SQUARES + 1}, gl_VertexID / ${BACKDROP_SQUARES + 1});
  vec2 at = vec2(corner) / ${BACKDROP_SQUARES}.0;
  float share = smoothstep(0.0, 1.0, at.y);
  float centre = 1.0 - 0.55 * length((at - vec2(0.5, 0.62)) * vec2(1.0, 1.1));
  blended = mix(bottom, top, clamp(share * 0.45 + centre * 0.62, 0.0, 1.0));
  gl_Position = vec4(at * 2.0 - 1.0, 0.0, 1.0);
}`;

/** Dithers the backdrop against banding, by interleaved gradient noise (Jimenez 2014). */
export const backdropFragmentShader = `${header}
in vec3 blended;
out vec4 shade;
void main() {
  float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))) - 0.5;
  shade = vec4(blended + noise / 255.0, 1.0);
}`;

export const groundVertexShader = `${header}
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 middle;
uniform float reach;
out vec2 place;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
  vec3 world = middle + vec3(corner.x, 0.0, corner.y) * reach;
  place = world.xz;
  gl_Position = projectionMatrix * viewMatrix * vec4(world, 1.0);
}`;

/** Lines of a grid that fade with the distance, and the model's soft shadow. */
export const groundFragmentShader = `${header}
uniform vec3 middle;
uniform float reach;
uniform float cell;
uniform vec3 ink;
uniform sampler2D shadow;
uniform float shadowReach;
uniform float shadowStrength;
in vec2 place;
out vec4 shade;
float lines(vec2 at, vec2 pixel, float width) {
  vec2 near = abs(fract(at - 0.5) - 0.5) / pixel;
  vec2 cover = clamp(width + 0.5 - near, 0.0, 1.0) * clamp((0.6 - pixel) / 0.35, 0.0, 1.0);
  return max(cover.x, cover.y);
}
void main() {
  vec2 fromMiddle = place - middle.xz;
  float fade = 1.0 - smoothstep(0.12, 0.95, length(fromMiddle) / reach);
  vec2 at = place / cell;
  vec2 pixel = fwidth(at);
  float line = max(lines(at, pixel, 0.5) * 0.20, lines(at * 0.2, pixel * 0.2, 0.75) * 0.42) * fade;
  at = fromMiddle / shadowReach;
  float dark = 0.0;
  if (max(abs(at.x), abs(at.y)) < 1.0) dark = texture(shadow, at * 0.5 + 0.5).r * shadowStrength;
  float cover = dark + line * (1.0 - dark);
  if (cover <= 0.002) discard;
  shade = vec4(ink * line * (1.0 - dark) / cover, cover);
}`;

/** The model seen from above, onto the ground: darker where it is nearer. */
export const shadowVertexShader = `${header}
uniform sampler2D positions;
uniform mat3 turn;
uniform vec3 middle;
uniform float reach;
uniform float height;
out float above;
${lookUp}
void main() {
  vec3 place = turn * texelFetch(positions, texelOf(gl_VertexID), 0).xyz - middle;
  above = place.y / height;
  gl_Position = vec4(place.xz / reach, above * 2.0 - 1.0, 1.0);
  gl_PointSize = 2.0;
}`;

export const shadowFragmentShader = `${header}
in float above;
out vec4 shade;
void main() {
  shade = vec4(vec3(exp(-max(0.0, above) * 5.0)), 1.0);
}`;

/** Places of a Gaussian blur, in texels, and the weight of each. */
const taps = [-10, -8, -6, -4, -2, 0, 2, 4, 6, 8, 10].map((place) => ({ place, weight: Math.exp(-0.02 * place ** 2) }));
const total = taps.reduce((sum, { weight }) => sum + weight, 0);

/** One direction of a Gaussian blur. */
export const blurShader = `${header}
uniform sampler2D source;
uniform vec2 way;
out vec4 shade;
void main() {
  vec2 texel = 1.0 / vec2(textureSize(source, 0));
  vec2 at = gl_FragCoord.xy * texel;
  vec2 one = way * texel;
  float sum = 0.0;
${taps.map(({ place, weight }) => `  sum += ${(weight / total).toFixed(8)} * texture(source, at + one * ${place.toFixed(1)}).r;`).join('\n')}
  shade = vec4(vec3(sum), 1.0);
}`;
