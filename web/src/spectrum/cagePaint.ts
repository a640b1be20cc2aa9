import { BufferAttribute, BufferGeometry, DynamicDrawUsage, FrontSide, Mesh } from 'three';
import { shaderMaterial } from '../render/materials';
import { signedShader } from '../render/colorMap';

const vertexShader = `precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
in float value;
out vec3 viewPosition;
out float shown;
void main() {
  vec4 place = modelViewMatrix * vec4(position, 1.0);
  viewPosition = place.xyz;
  shown = value;
  gl_Position = projectionMatrix * place;
}`;

/** Flat faces in a soft light from the eye, with lines where the value is zero. */
const fragmentShader = `precision highp float;
uniform float opacity;
in vec3 viewPosition;
in float shown;
out vec4 shade;
${signedShader}
void main() {
  vec3 normal = normalize(cross(dFdx(viewPosition), dFdy(viewPosition)));
  float facing = abs(dot(normal, normalize(viewPosition)));
  float zero = 1.0 - smoothstep(0.6, 1.4, abs(shown) / max(1e-6, fwidth(shown)));
  shade = vec4(signedColor(shown) * (0.72 + 0.28 * facing) * (1.0 - 0.3 * zero), opacity);
}`;

/** Faces of a cage in colours of a value at each corner, between −1 and 1. */
export class CagePaint {
  readonly mesh: Mesh;
  private readonly places: BufferAttribute;
  private readonly values: BufferAttribute;
  private readonly opacity = { value: 0.86 };

  constructor(private readonly triangles: Uint32Array) {
    const corners = triangles.length;
    this.places = new BufferAttribute(new Float32Array(3 * corners), 3).setUsage(DynamicDrawUsage);
    this.values = new BufferAttribute(new Float32Array(corners), 1);
    const geometry = new BufferGeometry().setAttribute('position', this.places).setAttribute('value', this.values);
    const material = shaderMaterial(
      vertexShader,
      fragmentShader,
      { opacity: this.opacity },
      // The model is seen through the faces in front of it.
      { transparent: true, side: FrontSide },
    );
    this.mesh = new Mesh(geometry, material);
    this.mesh.frustumCulled = false;
  }

  /** Vertices of the cage, x y z each. */
  setVertices(vertices: Float32Array) {
    const { triangles } = this;
    const places = this.places.array as Float32Array;
    for (let corner = 0; corner < triangles.length; corner++) {
      const from = 3 * triangles[corner];
      for (let axis = 0; axis < 3; axis++) places[3 * corner + axis] = vertices[from + axis];
    }
    this.places.needsUpdate = true;
  }

  /** Colours vertices by their values, or faces where there are as many values as faces. */
  setValues(values: Float64Array, of: 'vertices' | 'faces') {
    let largest = 0;
    for (const value of values) largest = Math.max(largest, Math.abs(value));
    const shown = this.values.array as Float32Array;
    for (let corner = 0; corner < shown.length; corner++) {
      shown[corner] = values[of === 'faces' ? Math.floor(corner / 3) : this.triangles[corner]] / (largest || 1);
    }
    this.values.needsUpdate = true;
  }

  dispose() {
    this.mesh.geometry.dispose();
    (this.mesh.material as { dispose(): void }).dispose();
  }
}
