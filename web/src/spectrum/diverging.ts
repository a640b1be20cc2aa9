/** Colours from blue over a light grey to red, as sRGB at equal distances: what is zero is light, what is below or above is dark on either side. */
const ANCHORS = ['1f4e96', '7fabd6', 'f1efec', 'ee9a78', 'a3231f'].map((hex) =>
  [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)),
);

/** The map as a CSS gradient, from left to right. */
export function divergingGradient(): string {
  return `linear-gradient(90deg, ${ANCHORS.map((color) => `rgb(${color.join(' ')})`).join(', ')})`;
}

/** A function `vec3 diverging(float)` for shaders: the sRGB colour of a value between −1 and 1. */
export const divergingShader = `
vec3 diverging(float value) {
  vec3 anchors[${ANCHORS.length}] = vec3[](${ANCHORS.map((color) => `vec3(${color.map((x) => (x / 255).toFixed(4)).join(', ')})`).join(', ')});
  float place = (clamp(value, -1.0, 1.0) * 0.5 + 0.5) * ${(ANCHORS.length - 1).toFixed(1)};
  int low = min(int(place), ${ANCHORS.length - 2});
  return mix(anchors[low], anchors[low + 1], place - float(low));
}`;
