/** The browser's WebGL 2: a renderer on a canvas, and whether the processor does its work. */

import { WebGLRenderer } from 'three';

/** Throws one sentence for a person where the browser or the device cannot draw captures. */
export function createRenderer(canvas: HTMLCanvasElement): WebGLRenderer {
  const antialias = !isSoftwareRendered();
  const context = canvas.getContext('webgl2', { antialias, alpha: false, powerPreference: 'high-performance' });
  if (!context) {
    throw new Error(
      'This browser does not support WebGL 2: turn on hardware acceleration in its settings, or use a newer browser.',
    );
  }
  const renderer = new WebGLRenderer({ canvas, context });
  renderer.autoClear = false;
  renderer.sortObjects = false;
  if (!renderer.extensions.has('EXT_color_buffer_float')) {
    renderer.dispose();
    throw new Error('This GPU does not support floating-point textures; open the capture on another device.');
  }
  return renderer;
}

/** Whether the processor does the work of a graphics processor: smoothing edges then costs more than a picture at twice the size when all rests. */
export function isSoftwareRendered(): boolean {
  softwareRendered ??= probeRenderer();
  return softwareRendered;
}

let softwareRendered: boolean | null = null;

function probeRenderer(): boolean {
  const context = new OffscreenCanvas(1, 1).getContext('webgl2');
  if (!context) return false;
  const details = context.getExtension('WEBGL_debug_renderer_info');
  const name = String(context.getParameter(details ? details.UNMASKED_RENDERER_WEBGL : context.RENDERER));
  context.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}
