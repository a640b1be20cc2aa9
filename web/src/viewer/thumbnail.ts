const [WIDTH, HEIGHT] = [112, 84];

/** The middle of a picture, as the address of a small one; null where the browser cannot draw it. */
export function thumbnail(picture: HTMLCanvasElement): string | null {
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [WIDTH, HEIGHT];
  const context = canvas.getContext('2d');
  const height = Math.min(picture.height, (picture.width * HEIGHT) / WIDTH);
  const width = (height * WIDTH) / HEIGHT;
  if (!context || height === 0) return null;
  const [left, top] = [(picture.width - width) / 2, (picture.height - height) / 2];
  context.drawImage(picture, left, top, width, height, 0, 0, WIDTH, HEIGHT);
  return canvas.toDataURL('image/webp', 0.75);
}
