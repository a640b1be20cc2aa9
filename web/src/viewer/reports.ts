import type { Tracking } from '../capture';
import { counted } from '../text';

interface FrameReport {
  readonly file: string;
  readonly outcome: string;
  readonly score: number | null;
}

/** The JSON in a report of the program. Throws one sentence for a person where the file has none. */
export async function readReport(file: File): Promise<unknown> {
  try {
    return JSON.parse(await file.text());
  } catch {
    throw new Error(`${file.name} is not a report: it is not JSON.`);
  }
}

/** How the frames of a capture of so many were found, from the report of `cager recover`. Throws one sentence for a person where it is none of this capture. */
export function trackingOf(report: unknown, frames: number): Tracking {
  const found = (report as { frames?: unknown } | null)?.frames;
  if (!Array.isArray(found) || !found.every(isFrame)) {
    throw new Error(
      'Nothing in this report can be shown here. Use one of `cager recover`, or of `cager transfer` by the fitted cage.',
    );
  }
  if (found.length !== frames) {
    throw new Error(
      `The report has ${counted(found.length, 'frame')} and the capture ${counted(frames, 'frame')}: they do not belong together.`,
    );
  }
  return {
    scores: Float32Array.from(found, ({ score }) => score ?? NaN),
    outcomes: found.map(({ outcome }) => outcome),
    files: found.map(({ file }) => file.split(/[\\/]/).at(-1)!),
  };
}

/** The point of a source that corresponds to each point of a target, from the report of `cager transfer`; null of other reports. */
export function correspondenceOf(report: unknown): readonly number[] | null {
  const found = (report as { correspondence?: unknown } | null)?.correspondence;
  const isPoint = (point: unknown) => Number.isSafeInteger(point) && (point as number) >= 0;
  return Array.isArray(found) && found.every(isPoint) ? (found as number[]) : null;
}

function isFrame(frame: unknown): frame is FrameReport {
  const { file, outcome, score } = (frame ?? {}) as Partial<Record<keyof FrameReport, unknown>>;
  return typeof file === 'string' && typeof outcome === 'string' && (score === null || typeof score === 'number');
}

/** Whether part of the template may be somewhere else in a frame. */
export function isLost({ outcomes }: Tracking, frame: number): boolean {
  return outcomes[frame] === 'lost' || outcomes[frame] === 'no_surface';
}

/** Runs of lost frames, first and last each. */
export function lostRuns(tracking: Tracking): [number, number][] {
  const runs: [number, number][] = [];
  for (let frame = 0; frame < tracking.outcomes.length; frame++) {
    if (!isLost(tracking, frame)) continue;
    const run = runs.at(-1);
    if (run?.[1] === frame - 1) run[1] = frame;
    else runs.push([frame, frame]);
  }
  return runs;
}
