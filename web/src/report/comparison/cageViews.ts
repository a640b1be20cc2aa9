import { scaleTop } from '../geometry/modelInCage';
import { methodColor } from '../methods';
import { percents } from '../text';
import type { Moments, View } from '../views';
import type { ComparisonReport, SystemReport } from './system';

/** Frames per second of the clip: slow enough to see single frames. */
const RATE = 6;

/** Cages of the frames around the shown one, coloured by each vertex's second difference in time. */
export function cageViews(
  { rest, figures, geometry }: ComparisonReport,
  system: SystemReport,
): { views: View[]; framed: Float32Array; moments: Moments; top: number } {
  const { clip } = geometry;
  const { shown, measured } = figures.capture;
  const size = rest.cageVertices.length;
  const found = system.geometry.methods.map(({ method, cages }) => {
    const all = rest.placedFrom(cages);
    const frames = clip.map((_, k) => all.subarray(k * size, (k + 1) * size));
    const spikes = frames.map((_, k) => secondDifferences(frames[k - 1], frames[k], frames[k + 1]));
    return { of: system.figures.methods[method], frames, spikes };
  });
  const first = Math.max(0, clip.indexOf(shown));
  const top = scaleTop(found.map(({ spikes }) => spikes[first]));
  const views = found.map(({ of, frames, spikes }): View => {
    const values = spikes.map((spike) => spike.map((value) => value / top));
    const at = measured.indexOf(shown);
    const { spike_mean, spike_max } = of.per_frame;
    return {
      title: of.name,
      note:
        spike_max[at] === null
          ? ''
          : `frame ${shown}: mean ${percents(spike_mean[at], 3)} %, largest ${percents(spike_max[at], 2)} %`,
      color: methodColor(of),
      drawing: (place) => ({
        surface: { positions: frames[place], triangles: rest.cage.triangles, values: values[place], flat: true },
        cage: { mesh: rest.cage, vertices: frames[place] },
      }),
    };
  });
  // Spikes may leave the picture; the cages of the paper's own method, whose strongest one is the smoothest, do not.
  const smoothest =
    found.findLast(({ of }) => of.handles === 'maxvol' && of.regularizer === 'laplacian') ?? found.at(0);
  return {
    views,
    framed: smoothest ? smoothest.frames[first] : rest.cageVertices,
    moments: { count: clip.length, first, rate: RATE, smooth: false, name: (place) => `frame ${clip[place]}` },
    top,
  };
}

/** Length of C(t+1) − 2 C(t) + C(t−1) of each vertex; 0 where a neighbour is missing. */
function secondDifferences(
  before: Float32Array | undefined,
  at: Float32Array,
  after: Float32Array | undefined,
): Float32Array {
  const found = new Float32Array(at.length / 3);
  if (!before || !after) return found;
  for (let i = 0; i < found.length; i++) {
    const bend = (k: number) => before[3 * i + k] - 2 * at[3 * i + k] + after[3 * i + k];
    found[i] = Math.hypot(bend(0), bend(1), bend(2));
  }
  return found;
}
