import { execFileSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { LocalCodec } from '../../tests/support/localCodec';
import { bytesSource } from '../container/source';
import {
  allBlocks,
  goldenBytes,
  openBytes,
  positionsOf,
  rawPart,
  streamedPart,
  takeApart,
  withPart,
} from '../../tests/support/containers';
import { parseFields } from '../container/section';
import { diagonalOf } from '../coordinates/topology';
import { editedBlock, type CageEdit } from './cageEdit';
import { npyHeader } from './exporter';
import { writeEdited } from './editedContainer';

const NAMES = ['definition3-mvc', 'definition3-green', 'definition3-green-free', 'coded-mvc'];
const isCoded = (name: string) => name.startsWith('coded');
const program = process.env.CAGER_BINARY;

/** Moves a vertex in frame 1 of 3. */
function editOf(vertices: number, x = 0.25): CageEdit {
  const own = new Float64Array(vertices);
  own[5] = 1;
  const grip = { chosen: [5], own, mirror: null };
  const range = { first: 1, last: 1, easeIn: 0, easeOut: 0 };
  return { id: 1, grip, motion: { kind: 'move', by: [x, -0.5, 0.125] }, range, enabled: true };
}

async function written(name: string, edits: readonly CageEdit[]): Promise<Uint8Array<ArrayBuffer>> {
  const capture = await openBytes(goldenBytes(name));
  const { container } = await writeEdited(bytesSource(goldenBytes(name)), capture, edits, {
    codec: new LocalCodec(),
  });
  return new Uint8Array(await container.arrayBuffer());
}

describe.each(NAMES)('%s, edited', (name) => {
  it('has the edited cages, all else as it was, and no errors that nobody measured', async () => {
    const before = await openBytes(goldenBytes(name));
    const edit = editOf(26);
    const bytes = await written(name, [edit]);
    const after = await openBytes(bytes);
    expect(after.problem).toBeNull();
    expect(after.head).toEqual(before.head);
    expect({ ...after.static, report: null }).toEqual({ ...before.static, report: null });
    const expected = (await allBlocks(before)).map((block) => editedBlock(block, [edit], before.static));
    expect(await allBlocks(after)).toEqual(expected);
    const losesAll = isCoded(name);
    expect([...after.errors.linf].map(Number.isNaN)).toEqual([losesAll, true, losesAll]);
    if (!losesAll) expect(after.errors.l2[2]).toBe(before.errors.l2[2]);
    const report = after.static.report as { error: Record<string, unknown>; coding?: unknown; warnings: string[] };
    expect(report.error.linf_max).toBeNull();
    expect(report.coding).toBeUndefined();
    expect(report.warnings.at(-1)).toMatch(/edited/);
  });

  it('keeps sections of model and cage as they were coded', async () => {
    const kept = (bytes: Uint8Array) =>
      takeApart(bytes).filter(({ header }) => /HEAD|RPTS|RFAC|CVTX|CTRI|ELEM/.test(parseFields(header, 0).tag));
    expect(kept(await written(name, [editOf(26)]))).toEqual(kept(goldenBytes(name)));
  });

  it.runIf(program)('is read by the program, which decodes what the page does', async () => {
    const folder = mkdtempSync(join(tmpdir(), 'cager-edited-'));
    try {
      const path = join(folder, 'edited.cager');
      const bytes = await written(name, [editOf(26)]);
      writeFileSync(path, bytes);
      expect(execFileSync(program!, ['inspect', path]).toString()).toMatch(/edited/);
      const decode = (from: string, ...options: string[]) => {
        const to = join(folder, 'decoded.npy');
        execFileSync(program!, ['decode', from, '-o', to, '--overwrite', '-q', ...options]);
        return floatsOf(readFileSync(to));
      };
      const decoded = decode(path);
      const after = await openBytes(bytes);
      const shown = positionsOf(after.static, await allBlocks(after));
      const diagonal = diagonalOf(after.static.rest);
      const farthest = shown.reduce((far, x, k) => Math.max(far, Math.abs(x - decoded[k])), 0);
      expect(farthest / diagonal).toBeLessThan(1e-6);
      const source = join(folder, 'source.cager');
      writeFileSync(source, goldenBytes(name));
      const original = decode(source, ...(isCoded(name) ? ['--layer', 'cages'] : []));
      const points = after.head.points * 3;
      for (const frame of [0, 2]) {
        const [a, b] = [decoded, original].map((all) => all.slice(frame * points, (frame + 1) * points));
        // Coded cages are decoded to numbers that differ by rounding between programs.
        if (isCoded(name)) {
          expect(a.reduce((far, x, k) => Math.max(far, Math.abs(x - b[k])), 0) / diagonal).toBeLessThan(1e-6);
        } else {
          expect(a).toEqual(b);
        }
      }
      expect(decoded.slice(points, 2 * points)).not.toEqual(original.slice(points, 2 * points));
    } finally {
      rmSync(folder, { recursive: true });
    }
  });
});

it('refuses a vertex beyond single precision', async () => {
  await expect(written('definition3-mvc', [editOf(26, 1e39)])).rejects.toThrow(/move it closer/);
});

it('a copy without edits keeps errors and figures', async () => {
  const before = await openBytes(goldenBytes('definition3-mvc'));
  const after = await openBytes(await written('definition3-mvc', []));
  expect(after.errors).toEqual(before.errors);
  expect(after.static.report).toEqual(before.static.report);
});

it('keeps the colours of the model', async () => {
  const name = 'coded-mvc';
  const colors = Uint8Array.from({ length: 3 * 120 }, (_, k) => (7 * k) % 256);
  const bytes = withPart(goldenBytes(name), rawPart('rcol', colors), 'RFAC');
  const { container } = await writeEdited(bytesSource(bytes), await openBytes(bytes), [editOf(26)], {
    codec: new LocalCodec(),
  });
  const after = await openBytes(new Uint8Array(await container.arrayBuffer()));
  expect(after.problem).toBeNull();
  expect(after.static.colors).toEqual(colors);
});

it('keeps the units, which the page passes over', async () => {
  const units = Uint8Array.from([...new Uint8Array(Float64Array.of(0.01).buffer), 2]);
  const bytes = withPart(goldenBytes('coded-mvc'), rawPart('unit', units), 'HEAD');
  const before = await openBytes(bytes);
  expect(before.problem).toBeNull();
  // What is streamed has no report yet.
  expect(await streamedPart(bytes, 1000)).toEqual({ ...before.static, report: null });
  const { container } = await writeEdited(bytesSource(bytes), before, [editOf(26)], { codec: new LocalCodec() });
  const kept = takeApart(new Uint8Array(await container.arrayBuffer()))[1];
  expect(parseFields(kept.header, 0).tag).toBe('unit');
  expect(kept.payload).toEqual(units);
});

it('the header of a NumPy file is padded to a multiple of 64 bytes and names the shape', () => {
  const header = npyHeader([120, 20_000, 3]);
  expect(header.length % 64).toBe(0);
  expect(new TextDecoder('latin1').decode(header)).toContain("'shape': (120, 20000, 3), }");
  expect(header[8] + 256 * header[9]).toBe(header.length - 10);
});

if (program && !existsSync(program)) throw new Error(`CAGER_BINARY names ${program}, which does not exist.`);

function floatsOf(npy: Buffer): Float32Array {
  return new Float32Array(Uint8Array.from(npy.subarray(10 + npy.readUInt16LE(8))).buffer);
}
