import { describe, expect, it } from 'vitest';
import { PartChoice } from './partChoice';
import { unshown } from './playedSurface';

const part = (shown: [number, number][] | null = null) => ({ path: '/a', firstPoint: 0, points: 1, shown });

describe('the parts that are shown', () => {
  it('are all, until somebody hides some', () => {
    let changes = 0;
    const choice = new PartChoice([part(), part(), part()], () => changes++);
    expect(choice.news(0)).toEqual([true, true, true]);
    expect(choice.news(1)).toBeNull();
    choice.toggle(1);
    expect(choice.news(1)).toEqual([true, false, true]);
    choice.toggle(1);
    expect(choice.news(1)).toEqual([true, true, true]);
    expect([changes, choice.allOn]).toEqual([2, true]);
  });

  it('are one alone, and all again', () => {
    const choice = new PartChoice([part(), part(), part()], () => undefined);
    choice.showOnly(1);
    expect(choice.news(0)).toEqual([false, true, false]);
    choice.showOnly(2);
    expect(choice.news(0)).toEqual([false, false, true]);
    // A double click hides it first.
    choice.toggle(2);
    choice.showOnly(2);
    expect(choice.news(0)).toEqual([true, true, true]);
  });

  it('are those that the capture has in a frame', () => {
    const choice = new PartChoice(
      [
        part(),
        part([
          [2, 4],
          [6, 7],
        ]),
      ],
      () => undefined,
    );
    const shown = [0, 2, 3, 4, 6, 7].map((frame) => choice.news(frame)?.[1] ?? 'same');
    expect(shown).toEqual([false, true, 'same', false, true, false]);
    choice.toggle(1);
    expect(choice.news(3)).toBeNull();
  });
});

it('pictures that are not shown are said by name, or counted', () => {
  expect(unshown(['a/b.ktx2'])).toMatch(/^The texture b\.ktx2 is not shown/);
  expect(unshown(['a/b.ktx2', 'c.tif'])).toMatch(/^2 textures \(KTX2, TIF\) are not shown/);
});
