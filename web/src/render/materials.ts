import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DataTexture,
  DoubleSide,
  GLSL3,
  LinearFilter,
  RawShaderMaterial,
  RGBAFormat,
  UnsignedByteType,
  Vector3,
  Vector4,
  type IUniform,
  type ShaderMaterialParameters,
} from 'three';
import { type ColorMap, HEAT } from './colorMap';

export function shaderMaterial(
  vertexShader: string,
  fragmentShader: string,
  uniforms: Record<string, IUniform>,
  parameters: ShaderMaterialParameters = {},
): RawShaderMaterial {
  return new RawShaderMaterial({
    glslVersion: GLSL3,
    vertexShader,
    fragmentShader,
    uniforms,
    side: DoubleSide,
    ...parameters,
  });
}

export function numberedGeometry(index: Uint32Array): BufferGeometry {
  return new BufferGeometry().setIndex(new BufferAttribute(index, 1));
}

/** Uniforms that everything drawn at points of the model shares. */
export function modelUniforms() {
  return {
    positions: { value: null },
    normals: { value: null },
    heat: { value: null },
    heatScale: { value: 1 },
    heatShare: { value: 0 },
    heatColors: { value: colorTexture(HEAT) },
    color: { value: new Color() },
    colors: { value: null },
    hasColors: { value: false },
    transparency: { value: 0 },
    skyDirection: { value: new Vector3(0, 1, 0) },
  } satisfies Record<string, IUniform>;
}

/** An sRGB colour with opacity, as our shaders for lines and dots want it. */
export function ink(color: Color, opacity: number): Vector4 {
  const { r, g, b } = color.clone().convertLinearToSRGB();
  return new Vector4(r, g, b, opacity);
}

export function colorTexture(map: ColorMap): DataTexture {
  const texture = new DataTexture(map.texels(256), 256, 1, RGBAFormat, UnsignedByteType);
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
