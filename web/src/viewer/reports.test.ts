import { expect, test } from 'vitest';
import { placeColors } from './besideMode';
import { correspondenceOf, isLost, lostRuns, readReport, trackingOf } from './reports';

const frame = (outcome: string, score: number | null = 0.01) => ({ file: `/scans/${outcome}.ply`, outcome, score });

test('a_report_tells_how_each_frame_was_found', () => {
  const outcomes = ['followed', 'lost', 'lost', 'wider_search', 'no_surface', 'lost'];
  const frames = outcomes.map((outcome) => frame(outcome, outcome === 'no_surface' ? null : 0.01));
  const tracking = trackingOf({ frames, lost: [1, 2, 5] }, 6);
  expect(tracking.outcomes.map((_, k) => isLost(tracking, k))).toEqual([false, true, true, false, true, true]);
  expect(lostRuns(tracking)).toEqual([
    [1, 2],
    [4, 5],
  ]);
  expect(tracking.scores[3]).toBeCloseTo(0.01, 6);
  expect(tracking.scores[4]).toBeNaN();
  expect(tracking.files[1]).toBe('lost.ply');
});

test('reports_of_something_else_are_refused_in_words', async () => {
  expect(() => trackingOf({ frames: [frame('followed')] }, 2)).toThrow('has 1 frame and the capture 2 frames');
  for (const report of [null, {}, { frames: 3 }, { frames: [{ outcome: 'lost' }] }])
    expect(() => trackingOf(report, 1)).toThrow('Nothing in this report can be shown here');
  await expect(readReport(new File(['v 0 0 0'], 'a.json'))).rejects.toThrow('a.json is not a report');
});

test('a_correspondence_is_points_of_the_source', () => {
  expect(correspondenceOf({ correspondence: [2, 0, 1] })).toEqual([2, 0, 1]);
  for (const other of [null, {}, { correspondence: null }, { correspondence: [-1] }, { correspondence: [0.5] }])
    expect(correspondenceOf(other)).toBeNull();
});

test('places_between_the_ends_of_a_model_have_colours_between_those_of_its_ends', () => {
  const rest = Float64Array.of(-1, 5, 0, 1, 5, 4, 0, 5, 1);
  expect([...placeColors({ rest })]).toEqual([40, 40, 40, 245, 40, 245, 143, 40, 91]);
});
