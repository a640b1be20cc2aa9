import { readFileSync } from 'node:fs';
import { expect, test } from 'vitest';
import { BrokenRecord, CageRecordReader } from './frameRecords';

/** The example of proto/README.md: frame 258, a cage of two rows. */
const example = Uint8Array.from(
  readFileSync(new URL('../../../proto/README.md', import.meta.url), 'utf8')
    .split('<!-- example -->')[1]
    .split('\n')
    .flatMap((line) => /^[0-9a-f]{4} {2}([^|]*)/.exec(line)?.[1].trim().split(/\s+/) ?? [])
    .map((byte) => Number.parseInt(byte, 16)),
);

test('the_documented_example_is_read_wherever_it_is_cut', () => {
  expect(example.length).toBe(52);
  for (let cut = 0; cut <= example.length; cut += 1) {
    const reader = new CageRecordReader(2);
    const records = [...reader.push(example.subarray(0, cut)), ...reader.push(example.subarray(cut))];
    expect(records.length).toBe(1);
    const [{ frame, l2, linf, rows }] = records;
    expect([frame, l2, Number.isNaN(linf)]).toEqual([258, 0.25, true]);
    expect([...rows]).toEqual([1, -2, 0.5, 0, Math.fround(0.001), 3.25]);
  }
});

test('records_that_follow_each_other_keep_their_own_rows', () => {
  const other = example.slice();
  other[8] = 7;
  const records = [...new CageRecordReader(2).push(Uint8Array.from([...example, ...other]))];
  expect(records.map(({ frame }) => frame)).toEqual([258, 263]);
  expect(records[0].rows.buffer).not.toBe(records[1].rows.buffer);
});

test('every_wrong_bit_that_a_record_can_notice_is_an_error', () => {
  // The frame's number and errors have no checksum.
  const unchecked = new Set([8, 9, 10, 11, 16, 17, 18, 19, 20, 21, 22, 23]);
  for (let at = 0; at < example.length; at += 1) {
    if (unchecked.has(at)) continue;
    const damaged = example.slice();
    damaged[at] ^= 0x10;
    expect(() => [...new CageRecordReader(2).push(damaged)], `byte ${at}`).toThrow(BrokenRecord);
  }
});
