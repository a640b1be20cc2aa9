import { Color, PerspectiveCamera, Vector3, WebGLRenderer } from 'three';
import { aim, FIELD_OF_VIEW, type CameraState } from '../../render/camera';
import type { DrawingScene } from './drawing';

/**
 * Draws all views of a report with one graphics context, of which browsers give out few, and copies each picture onto the canvas of its view.
 *
 * Its canvas is in no document. Throws one sentence for a person where the browser cannot draw.
 */
export class Painter {
  private static shared: Painter | null = null;
  private readonly renderer: WebGLRenderer;
  private readonly camera = new PerspectiveCamera((FIELD_OF_VIEW * 180) / Math.PI, 1, 0.01, 100);
  private size = '';

  private constructor() {
    const canvas = document.createElement('canvas');
    const context = canvas.getContext('webgl2', { antialias: true, alpha: true });
    if (!context) {
      throw new Error(
        'This browser does not support WebGL 2, so 3D views are missing: turn on hardware acceleration in its settings, or use a newer browser.',
      );
    }
    this.renderer = new WebGLRenderer({ canvas, context });
    this.renderer.setClearColor(new Color(0), 0);
    this.renderer.sortObjects = false;
  }

  static get(): Painter {
    return (Painter.shared ??= new Painter());
  }

  /** Draws onto a canvas of this size in CSS pixels. */
  paint(
    canvas: HTMLCanvasElement,
    drawing: DrawingScene,
    state: CameraState,
    width: number,
    height: number,
    ratio: number,
  ) {
    const { renderer, camera } = this;
    const size = `${width} ${height} ${ratio}`;
    if (size !== this.size) {
      this.size = size;
      renderer.setPixelRatio(ratio);
      renderer.setSize(width, height, false);
    }
    camera.aspect = width / height;
    aim(camera, state);
    const pixelsPerUnit = (height * ratio) / (2 * Math.tan(FIELD_OF_VIEW / 2));
    drawing.setView(new Vector3(0, 1, 0).transformDirection(camera.matrixWorldInverse), pixelsPerUnit, ratio);
    renderer.render(drawing.scene, camera);
    const source = renderer.domElement;
    if (canvas.width !== source.width || canvas.height !== source.height)
      [canvas.width, canvas.height] = [source.width, source.height];
    const context = canvas.getContext('2d')!;
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(source, 0, 0);
  }
}
