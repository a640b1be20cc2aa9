import {
  type BufferGeometry,
  Camera,
  Color,
  LinearFilter,
  Matrix3,
  Mesh,
  RGBAFormat,
  UnsignedByteType,
  Vector2,
  Vector3,
  WebGLRenderTarget,
  type Texture,
  type WebGLRenderer,
} from 'three';
import { numberedGeometry, shaderMaterial } from './materials';
import { materialsOf } from './modelView';
import { Pass } from './pass';
import {
  blurShader,
  groundFragmentShader,
  groundVertexShader,
  shadowFragmentShader,
  shadowVertexShader,
  BACKDROP_SQUARES,
  backdropFragmentShader,
  backdropVertexShader,
} from './sceneShaders';

/** Texels along a side of the shadow. */
const SHADOW_SIZE = 160;
/** Half the side of the square that the shadow covers, and the height up to which something casts one, in diagonals. */
const [SHADOW_REACH, SHADOW_HEIGHT] = [0.8, 0.9];

export class Ground {
  readonly mesh: Mesh;
  readonly middle = new Vector3(0, -0.5, 0);
  private readonly ink = { value: new Color() };
  private readonly strength = { value: 0.5 };
  private readonly sharp = shadowTarget();
  private readonly soft = shadowTarget();
  readonly caster: Mesh;
  private readonly blurred = { source: { value: null as Texture | null }, way: { value: new Vector2() } };
  private readonly blur = new Pass(blurShader, this.blurred);
  private readonly turn = { value: new Matrix3() };
  private readonly eye = new Camera();

  /** @param geometry the triangles that cast the shadow, of points of the model */
  constructor(positions: Texture, geometry: BufferGeometry) {
    this.mesh = new Mesh(
      numberedGeometry(Uint32Array.of(0, 1, 2, 2, 1, 3)),
      shaderMaterial(
        groundVertexShader,
        groundFragmentShader,
        {
          middle: { value: this.middle },
          reach: { value: 4 },
          cell: { value: 0.1 },
          ink: this.ink,
          shadow: { value: this.sharp.texture },
          shadowReach: { value: SHADOW_REACH },
          shadowStrength: this.strength,
        },
        { transparent: true, depthWrite: false },
      ),
    );
    const casting = {
      positions: { value: positions },
      turn: this.turn,
      middle: { value: this.middle },
      reach: { value: SHADOW_REACH },
      height: { value: SHADOW_HEIGHT },
    };
    this.caster = new Mesh(geometry, shaderMaterial(shadowVertexShader, shadowFragmentShader, casting));
    for (const mesh of [this.mesh, this.caster]) mesh.frustumCulled = false;
  }

  setColors(ink: Color, shadowStrength: number) {
    this.ink.value.copy(ink).convertLinearToSRGB();
    this.strength.value = shadowStrength;
  }

  /** Draws the shadow of the model as it is now; `turn` takes the model's axes to the scene's. */
  castShadow(renderer: WebGLRenderer, turn: Matrix3) {
    this.turn.value.copy(turn);
    const clear = renderer.getClearColor(new Color());
    renderer.setClearColor(0x000000, 1);
    renderer.setRenderTarget(this.sharp);
    renderer.clear();
    renderer.render(this.caster, this.eye);
    for (const spread of [0.55, 1.3]) {
      this.pass(renderer, this.sharp, this.soft, spread, 0);
      this.pass(renderer, this.soft, this.sharp, 0, spread);
    }
    renderer.setRenderTarget(null);
    renderer.setClearColor(clear);
  }

  dispose() {
    this.sharp.dispose();
    this.soft.dispose();
    this.blur.dispose();
    this.mesh.geometry.dispose();
    for (const material of [this.mesh, this.caster].flatMap(materialsOf)) material.dispose();
  }

  private pass(renderer: WebGLRenderer, from: WebGLRenderTarget, to: WebGLRenderTarget, x: number, y: number) {
    this.blurred.source.value = from.texture;
    this.blurred.way.value.set(x, y);
    this.blur.render(renderer, to);
  }
}

function shadowTarget(): WebGLRenderTarget {
  return new WebGLRenderTarget(SHADOW_SIZE, SHADOW_SIZE, {
    format: RGBAFormat,
    type: UnsignedByteType,
    minFilter: LinearFilter,
    magFilter: LinearFilter,
    depthBuffer: true,
  });
}

/** What is behind everything: one colour that passes into another from top to bottom. */
export class Backdrop {
  readonly mesh: Mesh;
  private readonly colors = { top: { value: new Color() }, bottom: { value: new Color() } };

  constructor() {
    this.mesh = new Mesh(
      numberedGeometry(gridTriangles(BACKDROP_SQUARES)),
      shaderMaterial(backdropVertexShader, backdropFragmentShader, this.colors, {
        depthTest: false,
        depthWrite: false,
      }),
    );
    this.mesh.frustumCulled = false;
  }

  /** Takes CSS colours in sRGB. */
  setColors(top: string, bottom: string) {
    this.colors.top.value.set(top).convertLinearToSRGB();
    this.colors.bottom.value.set(bottom).convertLinearToSRGB();
  }
}

/** Triangles of a square of so many squares along a side; vertices are numbered row by row. */
function gridTriangles(squares: number): Uint32Array {
  const corners = [0, 1, squares + 1, squares + 1, 1, squares + 2];
  return Uint32Array.from({ length: 6 * squares * squares }, (_, k) => {
    const square = Math.floor(k / 6);
    return square + Math.floor(square / squares) + corners[k % 6];
  });
}
