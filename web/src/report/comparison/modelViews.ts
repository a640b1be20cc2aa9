import type { Quantised } from '../geometry/numbers';
import { joined, lengths, scaleTop, type RestPose } from '../geometry/modelInCage';
import { mostOf } from '../geometry/most';
import { methodColor } from '../methods';
import { percents } from '../text';
import type { View } from '../views';
import type { ComparisonReport, SystemReport } from './system';

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
