import { html } from 'lit';
import { PALE } from '../../render/colorMap';
import type { MethodFigures } from '../data';
import { caption, charts, colorScale, folded, methodName, table, viewsOf, type Column } from '../table';
import { percents } from '../text';
import { curves, type ComparisonReport, type SystemReport } from './system';
import type { Quantised } from '../geometry/numbers';
import { joined, lengths, scaleTop, type RestPose } from '../geometry/modelInCage';
import { methodColor } from '../methods';
import type { View } from '../views';

export function errors(report: ComparisonReport, system: SystemReport) {
  const { figures } = report;
  const { shown, measured } = figures.capture;
  const { methods } = system.figures;
  const chart = (measure: 'l2' | 'linf', label: string) => ({
    title: `${label} of every measured frame`,
    x: { label: 'frame' },
    y: { label: `${label}, %`, cover: 'zero' as const },
    series: curves(figures, methods, measure),
  });
  const models = modelViews(report, system);
  return html`
    ${charts(chart('l2', 'L2'), chart('linf', 'L∞'))}
    ${caption(
      'Error of every measured frame, by method.',
      'L2 is the root mean square over the model’s points, L∞ the largest distance of a point, both in percent of the rest diagonal. Lower is better; a method whose curve lies close to “all points, data alone” loses little to what any cage of this system could reach, if the system is linear: with green, whose cages are iterated for, other methods may come lower than it. Dashed lines are regularised over the whole spectrum or damped.',
      'Paper: Figs. 14 and 18.',
    )}
    ${methodTable(methods)} ${viewsOf(`Frame ${shown} as the methods reconstruct it`, models)}
    ${colorScale('0', `${percents(models.top, 2)} % and more`, PALE.gradient)}
    ${caption(
      `Frame ${shown} reconstructed, coloured by the distance of every point from the capture.`,
      'It is the frame in which the cage of plain least squares spikes most. One scale for all views but for the first, whose points were drawn at random and whose errors may be off the scale.',
      'Paper: Figs. 3, 10 and 18.',
    )}
    ${viewsOf('The capture as the paper’s method encodes it', rowViews(report, system))}
    ${caption(
      'The capture as the paper’s method encodes it.',
      'Maxvol handles with sub-spectral regularisation at the usual threshold: the reconstructed model, and its cage around it.',
      'Paper: Fig. 14.',
    )}
    ${folded(
      'Every frame in numbers',
      frameTable(
        methods.filter(({ curve }) => curve),
        measured,
      ),
    )}
  `;
}

function methodTable(methods: readonly MethodFigures[]) {
  const least = Math.min(...methods.map(({ totals }) => totals.l2_mean ?? Infinity));
  const ratio = (l2: number | null) => (l2 === null || least === 0 ? '–' : `${(l2 / least).toFixed(2)} ×`);
  return table(methods, [
    ['method', methodName],
    ['mean L2 %', ({ totals }) => percents(totals.l2_mean, 4)],
    ['largest L2 %', ({ totals }) => percents(totals.l2_max, 4)],
    ['mean L∞ %', ({ totals }) => percents(totals.linf_mean, 3)],
    ['largest L∞ %', ({ totals }) => percents(totals.linf_max, 3)],
    ['mean L2 over the least', ({ totals }) => ratio(totals.l2_mean)],
  ]);
}

function frameTable(methods: readonly MethodFigures[], measured: readonly number[]) {
  const column = ({ name, per_frame: { l2, linf } }: MethodFigures): Column<number> => [
    html`${name}<br />L2 %, L∞ %`,
    (k) => `${percents(l2[k], 3)}, ${percents(linf[k], 2)}`,
  ];
  return table([...measured.keys()], [['frame', (k) => String(measured[k])], ...methods.map(column)], 0);
}

/** Errors beyond this fraction of the diagonal leave no surface to be seen: points alone are drawn, with a view of their own. */
const LOST = 0.5;

/** The shown frame as the methods reconstruct it, coloured by the distance of every point from the capture. */
export function modelViews(
  report: ComparisonReport,
  system: SystemReport,
): { views: View[]; framed: Float32Array; top: number } {
  const { rest, figures } = report;
  const { shown, measured } = figures.capture;
  const at = measured.indexOf(shown);
  const captured = frameOf(report, shown);
  const found = system.geometry.methods.map(({ method, offsets }) => {
    const of = system.figures.methods[method];
    return { of, ...reconstructed(rest, captured, offsets) };
  });
  const curves = found.filter(({ of }) => of.curve);
  const top = scaleTop(curves.map(({ errors }) => errors));
  const scaled = (errors: Float32Array) => errors.map((error) => error / top);
  const views: View[] = curves.map(({ of, positions, errors }) => {
    const surface = { positions, triangles: rest.triangles, values: scaled(errors) };
    const note = `L2 ${percents(of.per_frame.l2[at], 3)} %, L∞ ${percents(of.per_frame.linf[at], 2)} %`;
    return { title: of.name, note, color: methodColor(of), drawing: () => ({ surface }) };
  });
  const { draw } = system.geometry;
  if (draw) {
    const { positions, errors } = reconstructed(rest, captured, draw.offsets);
    const isLost = (draw.linf ?? Infinity) > LOST;
    const surface = { positions, triangles: isLost ? new Uint32Array(0) : rest.triangles, values: scaled(errors) };
    views.unshift({
      title: `${draw.name}, sub-spectral`,
      note: `L2 ${percents(draw.l2, 3)} %, L∞ ${percents(draw.linf, 2)} %`,
      drawing: () => ({ surface }),
      ...(isLost ? { framed: mostOf(positions) } : {}),
    });
  }
  return { views, framed: captured, top };
}

/** Some frames as the paper's method encodes them, in their cages. */
export function rowViews(report: ComparisonReport, system: SystemReport): { views: View[]; framed: Float32Array } {
  const { rest } = report;
  const cages = system.geometry.row.map(({ cage }) => rest.placedFrom(cage));
  const views = system.geometry.row.map(({ frame, offsets }, k) => {
    const { positions } = reconstructed(rest, frameOf(report, frame), offsets);
    const drawing = {
      surface: { positions, triangles: rest.triangles },
      cage: { mesh: rest.cage, vertices: cages[k] },
    };
    return { title: `frame ${frame}`, note: '', drawing: () => drawing };
  });
  return { views, framed: joined(cages) };
}

function frameOf({ rest, geometry }: ComparisonReport, frame: number): Float32Array {
  const found = geometry.frames.find((captured) => captured.frame === frame);
  return found ? rest.placedFrom(found.points) : rest.points;
}

function reconstructed(rest: RestPose, captured: Float32Array, offsets: Quantised) {
  const moved = rest.vectorsFrom(offsets);
  return { positions: captured.map((x, k) => x + moved[k]), errors: lengths(moved) };
}

/** Of positions, x y z each, those between the 2nd and 98th percentile along every axis. */
export function mostOf(positions: Float32Array): Float32Array {
  const ends = [0, 1, 2].map((axis) => {
    const sorted = positions.filter((_, k) => k % 3 === axis).sort();
    const skipped = Math.floor(sorted.length / 50);
    return [sorted.at(skipped) ?? 0, sorted.at(-1 - skipped) ?? 0];
  });
  const isWithin = (value: number, axis: number) => value >= ends[axis][0] && value <= ends[axis][1];
  const isKept = (first: number) => [0, 1, 2].every((axis) => isWithin(positions[first + axis], axis));
  return positions.filter((_, k) => isKept(k - (k % 3)));
}
