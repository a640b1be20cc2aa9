/** Pictures with at most 256 colours, a third of the size: median cut (Heckbert, SIGGRAPH 1982), written as PNG with a palette. */

import { crc32, deflateSync } from 'node:zlib';

/** Colours are told apart by their upper five bits. */
const [BITS, COLORS] = [5, 256];
const SIGNATURE = Buffer.from('\x89PNG\r\n\x1a\n', 'latin1');

/** Pixels that share their upper bits. */
interface Cell {
  readonly key: number;
  count: number;
  readonly sums: [number, number, number];
}

/** @param pixels red, green, blue and opacity of each pixel, row by row; opacity is left out */
export function indexedPng(pixels: Uint8Array, width: number, height: number): Buffer {
  const cells = new Map<number, Cell>();
  for (let at = 0; at < pixels.length; at += 4) {
    const key = keyAt(pixels, at);
    let cell = cells.get(key);
    if (!cell) cells.set(key, (cell = { key, count: 0, sums: [0, 0, 0] }));
    cell.count += 1;
    for (let channel = 0; channel < 3; channel += 1) cell.sums[channel] += pixels[at + channel];
  }
  const boxes = cut([...cells.values()]);
  const palette = Buffer.alloc(3 * boxes.length);
  const colorOf = new Map<number, number>();
  boxes.forEach((box, color) => {
    const count = box.reduce((sum, cell) => sum + cell.count, 0);
    for (let channel = 0; channel < 3; channel += 1) {
      palette[3 * color + channel] = Math.round(box.reduce((sum, cell) => sum + cell.sums[channel], 0) / count);
    }
    box.forEach((cell) => colorOf.set(cell.key, color));
  });
  // Each row begins with its filter: none, the best for palettes.
  const rows = Buffer.alloc(height * (width + 1));
  for (let k = 0; k < width * height; k += 1) {
    rows[k + Math.floor(k / width) + 1] = colorOf.get(keyAt(pixels, 4 * k))!;
  }
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header.set([8, 3, 0, 0, 0], 8);
  const body = deflateSync(rows, { level: 9 });
  return Buffer.concat([
    SIGNATURE,
    chunk('IHDR', header),
    chunk('PLTE', palette),
    chunk('IDAT', body),
    chunk('IEND', Buffer.alloc(0)),
  ]);
}

function keyAt(pixels: Uint8Array, at: number): number {
  const drop = 8 - BITS;
  return ((pixels[at] >> drop) << (2 * BITS)) | ((pixels[at + 1] >> drop) << BITS) | (pixels[at + 2] >> drop);
}

/** Parts cells into boxes of similar colour, the widest of the most pixels first. */
function cut(cells: Cell[]): Cell[][] {
  const boxes = [cells];
  while (boxes.length < COLORS) {
    const spans = boxes.map((box) => ({ box, ...widest(box) }));
    const next = spans.reduce((a, b) => (b.weight > a.weight ? b : a));
    if (next.weight === 0) break;
    const sorted = next.box.sort((a, b) => mean(a, next.channel) - mean(b, next.channel));
    const half = sorted.reduce((sum, cell) => sum + cell.count, 0) / 2;
    let [at, passed] = [0, 0];
    while (at < sorted.length - 1 && (at === 0 || passed < half)) passed += sorted[at++].count;
    boxes.splice(boxes.indexOf(next.box), 1, sorted.slice(0, at), sorted.slice(at));
  }
  return boxes;
}

/** The channel in which a box is widest, and how much it asks to be cut; 0 where it cannot be. */
function widest(box: readonly Cell[]): { channel: number; weight: number } {
  const pixels = box.reduce((sum, cell) => sum + cell.count, 0);
  const spans = [0, 1, 2].map((channel) => {
    const values = box.map((cell) => mean(cell, channel));
    return Math.max(...values) - Math.min(...values);
  });
  const channel = spans.indexOf(Math.max(...spans));
  return { channel, weight: box.length < 2 ? 0 : spans[channel] * Math.sqrt(pixels) };
}

function mean(cell: Cell, channel: number): number {
  return cell.sums[channel] / cell.count;
}

function chunk(type: string, body: Buffer): Buffer {
  const named = Buffer.concat([Buffer.from(type, 'latin1'), body]);
  const [length, check] = [Buffer.alloc(4), Buffer.alloc(4)];
  length.writeUInt32BE(body.length);
  check.writeUInt32BE(crc32(named));
  return Buffer.concat([length, named, check]);
}
