import { WIDTH, WIDTH_BITS } from './packing';

const FAN_BITS = 11;
/** Texels per row of the list of fans. */
export const FAN_WIDTH = 1 << FAN_BITS;
/** Triangles around one point that count for its normal: more would take a frame's time for a single point. */
const MAX_TRIANGLES = 256;

const header = `precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
precision highp isampler2DArray;
precision highp usampler2D;
`;

/** One triangle that covers the target, from vertex numbers alone. */
export const coverVertexShader = `void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

/** Where the products of Φ come from: integers or full floats that the shader multiplies, or products that the page has computed. */
export type PositionSource = 'integers' | 'floats' | 'products';

const products = {
  integers: multiplied('isampler2DArray', 'weights *= abs(weights);'),
  floats: multiplied('sampler2DArray', ''),
  products: `
uniform sampler2D products;
vec3 product(ivec2 at) {
  return texelFetch(products, at, 0).xyz;
}`,
} satisfies Record<PositionSource, string>;

/**
 * Φ·C for a texel. The texture `cage` has the x of columns 4k … 4k+3 in texel (k, 0), y in (k, 1) and z in (k, 2), relative to the mean of the
 * vertices.
 */
function multiplied(sampler: string, expand: string): string {
  return `
uniform ${sampler} phi;
uniform float scale;
uniform sampler2D cage;
uniform int blocks;
uniform int bandsPerLayer;
vec3 product(ivec2 at) {
  int layer = at.y / bandsPerLayer;
  int first = (at.y - layer * bandsPerLayer) * blocks;
  vec3 sum = vec3(0.0);
  for (int k = 0; k < blocks; k++) {
    vec4 weights = vec4(texelFetch(phi, ivec3(at.x, first + k, layer), 0));
    ${expand}
    sum.x += dot(weights, texelFetch(cage, ivec2(k, 0), 0));
    sum.y += dot(weights, texelFetch(cage, ivec2(k, 1), 0));
    sum.z += dot(weights, texelFetch(cage, ivec2(k, 2), 0));
  }
  return sum * scale;
}`;
}

/** P = Φ·C for the point of each texel: `origin` is what the cage is relative to, offsets are what a residual layer adds, of two frames. */
export function positionShader(source: PositionSource): string {
  return `${header}
uniform sampler2D offsetsBefore;
uniform sampler2D offsetsAfter;
uniform vec2 offsetWeights;
uniform vec3 origin;
out vec4 position;
${products[source]}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec3 sum = product(at) + origin;
  if (offsetWeights.x != 0.0) sum += offsetWeights.x * texelFetch(offsetsBefore, at, 0).xyz;
  if (offsetWeights.y != 0.0) sum += offsetWeights.y * texelFetch(offsetsAfter, at, 0).xyz;
  position = vec4(sum, 1.0);
}`;
}

/** @param found the normal that is written, by the mean of those around, `mean`, and what `leaning` has */
const normalsAround = (own: string, found: string, leaning = ''): string => `${header}
uniform sampler2D positions;
uniform usampler2D owners;
uniform usampler2D fanStarts;
uniform usampler2D fans;
out vec4 normal;
vec3 place(uint point) {
  return texelFetch(positions, ivec2(point & ${WIDTH - 1}u, point >> ${WIDTH_BITS}), 0).xyz;
}
${leaning}void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec3 own = ${own};
  uvec2 range = texelFetch(fanStarts, at, 0).xy;
  uint end = range.x + min(range.y, ${MAX_TRIANGLES}u);
  vec3 sum = vec3(0.0);
  for (uint k = range.x; k < end; k++) {
    uvec2 others = texelFetch(fans, ivec2(k & ${FAN_WIDTH - 1}u, k >> ${FAN_BITS}), 0).xy;
    sum += cross(place(others.x) - own, place(others.y) - own);
  }
  float size = length(sum);
  vec3 mean = size > 0.0 ? sum / size : vec3(0.0);
  normal = vec4(${found}, 1.0);
}`;

/** The normal of each point: the normals of the triangles around it, weighted by their areas. */
export const normalShader = normalsAround('texelFetch(positions, at, 0).xyz', 'mean');

/** The same for normals of which a point may have several, and which may be tilted; `owners` are the points and those that follow them around faces. */
export const splitNormalShader = normalsAround(
  'place(texelFetch(owners, at, 0).x)',
  'tilted(mean, at, own)',
  `
uniform sampler2D tilts;
uniform bool areTilted;
vec3 tilted(vec3 mean, ivec2 at, vec3 own) {
  vec2 angles = areTilted ? texelFetch(tilts, at, 0).xy : vec2(0.0);
  float angle = length(angles);
  vec3 edge = place(texelFetch(owners, at, 0).y) - own;
  vec3 along = edge - dot(edge, mean) * mean;
  float size = length(along);
  if (angle == 0.0 || size == 0.0) return mean;
  vec2 parts = sin(angle) / (angle * size) * angles;
  return cos(angle) * mean + parts.x * along + parts.y * cross(mean, along);
}
`,
);
