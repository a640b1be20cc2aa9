import { save } from '../save';

/** Saves canvases of one size beside each other as one picture, on a ground of this colour. */
export function saveSideBySide(canvases: readonly HTMLCanvasElement[], ground: string) {
  const [width, height] = [canvases[0].width, canvases[0].height];
  const columns = Math.ceil(Math.sqrt(canvases.length));
  const sheet = document.createElement('canvas');
  [sheet.width, sheet.height] = [columns * width, Math.ceil(canvases.length / columns) * height];
  const context = sheet.getContext('2d')!;
  context.fillStyle = ground;
  context.fillRect(0, 0, sheet.width, sheet.height);
  canvases.forEach((canvas, k) => context.drawImage(canvas, (k % columns) * width, Math.floor(k / columns) * height));
  sheet.toBlob((blob) => blob && save(blob, 'cager.png'));
}
