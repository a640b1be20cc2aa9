import { expect, it } from 'vitest';
import { goldenBytes, openBytes, putTogether, rawPart, takeApart } from '../../tests/support/containers';
import { parseFields } from './section';
import { heldToBound } from './tail';

const found = (report: Readonly<Record<string, unknown>> | null) => {
  const error = (...of: readonly number[]) => Float32Array.from(of);
  const { l2, linf } = heldToBound(
    { l2: error(0.0002, 0.0010004, NaN), linf: error(0.0009, 0.0010004, 0.0011) },
    report,
  );
  return [...l2, ...linf].map((x) => Number(x.toPrecision(6)));
};

it('shows no error above the guaranteed one that is there by its rounding alone', () => {
  expect(found({ coding: { max_error: 0.001 } })).toEqual([0.0002, 0.001, NaN, 0.0009, 0.001, 0.0011]);
});

it.each([null, {}, { coding: null }, { coding: { max_error: 'small' } }])(
  'leaves errors of files without a guaranteed one as they are: %j',
  (report) => {
    expect(found(report)).toEqual([0.0002, 0.0010004, NaN, 0.0009, 0.0010004, 0.0011]);
  },
);

it('holds errors of a file that is opened to its bound', async () => {
  const golden = goldenBytes('coded-mvc');
  const { max_error: bound } = (await openBytes(golden)).static.report!.coding as { max_error: number };
  const errors = Float32Array.from([0.5, 1.0004, 0.5, 0.9, 0.5, 1.0004], (part) => part * bound);
  const parts = takeApart(golden).map((part) =>
    parseFields(part.header, 0).tag === 'ERRS' ? rawPart('ERRS', new Uint8Array(errors.buffer), 4) : part,
  );
  const capture = await openBytes(putTogether(parts));
  expect([...capture.errors.linf]).toEqual([bound, 0.9 * bound, bound].map(Math.fround));
});
