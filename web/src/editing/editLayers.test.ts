import { execFileSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { allBlocks, goldenBytes, openBytes, positionsOf, takeApart } from '../../tests/support/containers';
import { withLayers } from '../container/layers';
import { parseFields } from '../container/section';
import { diagonalOf } from '../coordinates/topology';
import type { CageEdit } from './cageEdit';
import { EditModel } from './editModel';
import { decodedFrames, npyHeader, withNewEdits } from './exporter';

const NAMES = ['definition3-mvc', 'definition3-green', 'definition3-green-free', 'definition3-mvc-origin', 'coded-mvc'];
const program = process.env.CAGER_BINARY;

/** Moves a vertex in frame 1 of 3. */
function editOf(vertices: number, x = 0.25): CageEdit {
  const own = new Float64Array(vertices);
  own[5] = 1;
  const grip = { chosen: [5], own, mirror: null };
  const range = { first: 1, last: 1, easeIn: 0, easeOut: 0 };
  return { id: 1, grip, motion: { kind: 'move', by: [x, -0.5, 0.125] }, range, enabled: true };
}

async function written(bytes: Uint8Array<ArrayBuffer>, edits: readonly CageEdit[]): Promise<Uint8Array<ArrayBuffer>> {
  return new Uint8Array(await (await withNewEdits(await openBytes(bytes), edits, {})).arrayBuffer());
}

const tags = (bytes: Uint8Array) => takeApart(bytes).map(({ header }) => parseFields(header, 0).tag);

describe.each(NAMES)('%s, edited', (name) => {
  it('has all its bytes as they were, and one layer behind them', async () => {
    const before = goldenBytes(name);
    const bytes = await written(before, [editOf(26)]);
    const parts = takeApart(bytes);
    expect(parts.slice(0, -1)).toEqual(takeApart(before));
    expect(parseFields(parts.at(-1)!.header, 0)).toMatchObject({ tag: 'EDIT', first: 1, count: 1, rawBytes: 32 });
    expect(bytes.length - before.length).toBe(40 + 32 + 40);
  });

  it('shows the edited cage of that frame with all else, and no error that nobody measured', async () => {
    const before = await openBytes(goldenBytes(name));
    const after = await openBytes(await written(goldenBytes(name), [editOf(26)]));
    expect(after.problem).toBeNull();
    expect(after.layers).toMatchObject([{ name: 'Vertex 5', isOn: true, first: 1, count: 1 }]);
    const [[a], [b]] = [await allBlocks(before), await allBlocks(after)];
    const at = 3 * before.static.rowsPerFrame + 3 * 5;
    const moved = [...b.cages].flatMap((x, k) => (x === a.cages[k] ? [] : [k]));
    expect(moved).toEqual([at, at + 1, at + 2]);
    expect(b.cages[at]).toBeCloseTo(a.cages[at] + 0.25, 5);
    expect(b.residual).toEqual(a.residual);
    expect([...after.errors.linf].map(Number.isNaN)).toEqual([false, true, false]);
  });

  it('is what it was with its layer switched off or taken away, in the page and in a file written again', async () => {
    const edited = await openBytes(await written(goldenBytes(name), [editOf(26)]));
    const model = new EditModel(edited.static, 1, edited.layers);
    model.switchLayer(model.layers[0]);
    edited.setLayers!(model.layers);
    const before = await openBytes(goldenBytes(name));
    expect(await allBlocks(edited)).toEqual(await allBlocks(before));
    expect(edited.errors).toEqual(before.errors);
    const off = await openBytes(new Uint8Array(await (await withNewEdits(edited, [], {})).arrayBuffer()));
    expect(off.layers).toMatchObject([{ name: 'Vertex 5', isOn: false }]);
    expect(await allBlocks(off)).toEqual(await allBlocks(before));
    model.removeLayer(model.layers[0]);
    edited.setLayers!(model.layers);
    const plain = new Uint8Array(await (await withNewEdits(edited, [], {})).arrayBuffer());
    expect(plain).toEqual(goldenBytes(name));
    model.undo();
    expect(model.layers).toMatchObject([{ isOn: false }]);
  });

  it.runIf(program)('is read by the program, which decodes what the page does', async () => {
    const folder = mkdtempSync(join(tmpdir(), 'cager-edited-'));
    try {
      const [path, to] = [join(folder, 'edited.cager'), join(folder, 'decoded.npy')];
      const bytes = await written(await written(goldenBytes(name), [editOf(26)]), [editOf(26, -1)]);
      writeFileSync(path, bytes);
      expect(execFileSync(program!, ['inspect', path]).toString()).toMatch(/Vertex 5/);
      execFileSync(program!, ['decode', path, '-o', to, '--overwrite', '-q']);
      const after = await openBytes(bytes);
      const shown = positionsOf(after.static, await allBlocks(after));
      const { origin = [0, 0, 0] } = after.static;
      const decoded = numbersOf(readFileSync(to), name.endsWith('-origin'));
      const farthest = shown.reduce((far, x, k) => Math.max(far, Math.abs(x - (decoded[k] - origin[k % 3]))), 0);
      expect(farthest / diagonalOf(after.static.rest)).toBeLessThan(1e-6);
    } finally {
      rmSync(folder, { recursive: true });
    }
  });
});

it('a second edit lies over the first, which keeps its bytes', async () => {
  const once = await written(goldenBytes('coded-mvc'), [editOf(26)]);
  const twice = await written(once, [editOf(26, -1)]);
  expect(tags(twice).filter((tag) => tag === 'EDIT').length).toBe(2);
  expect(takeApart(twice).slice(0, -1)).toEqual(takeApart(once));
  const both = await openBytes(await written(goldenBytes('coded-mvc'), [editOf(26), { ...editOf(26, -1), id: 2 }]));
  expect((await allBlocks(both))[0].cages).toEqual((await allBlocks(await openBytes(twice)))[0].cages);
});

it('refuses a vertex beyond single precision, and edits that a file cannot hold', async () => {
  await expect(written(goldenBytes('definition3-mvc'), [editOf(26, 1e39)])).rejects.toThrow(/move it closer/);
  const many = Array.from({ length: 257 }, (_, id) => ({ ...editOf(26), id }));
  await expect(written(goldenBytes('definition3-mvc'), many)).rejects.toThrow(/at most 256 edits/);
});

it('a copy without edits is the same file', async () => {
  const before = goldenBytes('coded-green');
  expect(await written(before, [{ ...editOf(26), enabled: false }])).toEqual(before);
});

it('layers add up in double precision and are rounded once, in blocks that begin before them and after', () => {
  const cages = new Float32Array(3 * 2 * 4).fill(1);
  const layer = (first: number, count: number, x: number) => {
    const offsets = new Float32Array(3 * count).fill(x);
    return { name: '', isOn: true, first, count, vertices: Uint32Array.of(1), offsets };
  };
  const block = { first: 4, count: 4, cages, residual: null };
  const small = 2 ** -24;
  const { cages: edited } = withLayers(block, [layer(2, 3, small), layer(2, 3, small), layer(7, 9, 3)], 2);
  expect([...edited].map((x) => x - 1).filter((x) => x !== 0)).toEqual(
    [2, 2, 2].map(() => 2 * small).concat([3, 3, 3]),
  );
  expect(cages.every((x) => x === 1)).toBe(true);
});

it('positions that a service decodes have what is coded beside the cages', async () => {
  const capture = await openBytes(goldenBytes('coded-mvc'));
  const { static: part } = capture;
  // As a service does, which is sent cages alone.
  capture.decode = async (blob) => {
    const cages = new Float32Array(await blob.arrayBuffer());
    const block = { first: 0, count: cages.length / (3 * part.rowsPerFrame), cages, residual: null };
    return new Response(positionsOf(part, [block]) as Float32Array<ArrayBuffer>);
  };
  const saved = new Uint8Array(await (await decodedFrames(capture, [editOf(26)])).arrayBuffer());
  const edited = await openBytes(await written(goldenBytes('coded-mvc'), [editOf(26)]));
  expect(numbersOf(Buffer.from(saved), false)).toEqual(positionsOf(part, await allBlocks(edited)));
});

it('the header of a NumPy file is padded to a multiple of 64 bytes and names the shape', () => {
  const header = npyHeader([120, 20_000, 3]);
  expect(header.length % 64).toBe(0);
  expect(new TextDecoder('latin1').decode(header)).toContain("'shape': (120, 20000, 3), }");
  expect(header[8] + 256 * header[9]).toBe(header.length - 10);
});

if (program && !existsSync(program)) throw new Error(`CAGER_BINARY names ${program}, which does not exist.`);

function numbersOf(npy: Buffer, isDouble: boolean): Float32Array | Float64Array {
  const { buffer } = Uint8Array.from(npy.subarray(10 + npy.readUInt16LE(8)));
  return isDouble ? new Float64Array(buffer) : new Float32Array(buffer);
}
