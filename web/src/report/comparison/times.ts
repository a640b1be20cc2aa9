import { html } from 'lit';
import { count } from '../../text';
import { folded, methodName, table, type Column } from '../table';
import { percents, seconds } from '../text';
import { methodOf, ofAll, type ComparisonReport } from './system';

/** The paper's Table 1: points, cage, frames, preparation, one frame and total in milliseconds, and where the text gives it the mean L2 in percent. */
const PAPER = [
  ['Fig. 14, 1st row (capoeira)', 19_998, '330 / 656', 499, 5_616, 568, 289_048, '0.12'],
  ['Fig. 14, 2nd row', 19_998, '330 / 656', 179, 5_616, 568, 107_288, '–'],
  ['Fig. 14, 3rd row (skirt)', 19_990, '368 / 732', 437, 7_291, 890, 396_221, '–'],
  ['Fig. 14, 4th row', 15_002, '339 / 674', 169, 5_617, 624, 111_073, '–'],
  ['Fig. 14, 5th row (horse)', 8_431, '348 / 692', 48, 5_029, 748, 40_933, '0.19'],
] as const;

const TITLES =
  'input|points|cage #V / #T|frames|coordinates|maxvol + SVD|one frame|inverting all|mean L2 %|mean L∞ %'.split('|');

export function times({ figures: { capture }, systems }: ComparisonReport) {
  const ours = systems.map(({ name, figures }) => {
    const usual = methodOf(figures, 'maxvol', 'laplacian')?.totals;
    const { coordinates, maxvol, svd, per_frame } = figures.seconds;
    return [
      `${capture.source}, ${name}`,
      count(capture.points),
      `${capture.cage_vertices} / ${capture.cage_faces}`,
      count(capture.frames),
      seconds(coordinates),
      seconds(maxvol !== null && svd !== null ? maxvol + svd : null),
      seconds(per_frame),
      seconds(per_frame === null ? null : per_frame * capture.frames),
      percents(usual?.l2_mean, 3),
      percents(usual?.linf_mean, 3),
    ];
  });
  const theirs = PAPER.map(([input, points, cage, frames, prepare, frame, total, l2]) => [
    ...[`the paper: ${input}`, count(points), cage, String(frames), '–'],
    ...[prepare, frame, total].map((milliseconds) => seconds(milliseconds / 1e3)),
    ...[l2, '–'],
  ]);
  return html`
    ${table(
      ours,
      TITLES.map((title, k): Column<string[]> => [title, (row) => row[k]]),
      1,
      theirs,
    )}
    <p class="caption">
      Times of this machine and run, for maxvol handles with sub-spectral regularisation at the usual threshold; they
      differ from run to run. “Maxvol + SVD” here includes the decomposition over all points, which other methods need.
      One frame is one inversion on one thread within a batch of sixteen, without reading and measuring it; methods that
      read the same rows take the same matrix product, which is timed once, and green coordinates are timed while other
      methods run. Grey rows: Table 1 and §6.3 of the paper (Core 2 Duo 2.53 GHz and GeForce GTX 260 M, 2012), whose
      total includes the preparation; captures and cages are others than here, so they are for orientation. Form of the
      table: the paper's Table 1.
    </p>
    ${folded(
      'One inversion by every method',
      table(
        ofAll(systems, ({ methods }) => methods),
        [
          ['system', (row) => row.system],
          ['method', methodName],
          ['one frame', (row) => seconds(row.frame_seconds)],
        ],
        2,
      ),
    )}
  `;
}
