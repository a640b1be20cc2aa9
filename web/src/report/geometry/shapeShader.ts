/** Places a point of a shape that is given by attributes, for the light and the heat map of the viewer's model (`modelFragmentShader`). */
export const shapeVertexShader = `precision highp float;
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
void main() {
  vec4 place = modelViewMatrix * vec4(position, 1.0);
  viewPosition = place.xyz;
  viewNormal = mat3(modelViewMatrix) * normal;
  heatValue = heat;
  ownColor = color;
  gl_Position = projectionMatrix * place;
  gl_PointSize = pointSize / max(0.05, -place.z);
}`;
