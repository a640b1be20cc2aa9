/** Sizes and errors of sessions, which the list itself does not have: fetched for those that are seen. */

import { readContents, readSections } from '../container/sectionReader';
import { EndsCache } from '../container/source';
import { decodeReport } from '../container/tail';
import type { Session } from '../service/messages';
import { type Service, sessionPath } from '../service/service';

/** Errors are fractions of the diagonal; null: not measured. */
export interface Figures {
  readonly meanL2: number | null;
  readonly worst: number | null;
  /** Of the container; null before there is one. */
  readonly bytes: number | null;
  /** How many times smaller it is than the capture in single precision. */
  readonly ratio: number | null;
}

/** More than the table of contents and the report of most containers. */
const TAIL_BYTES = 64 << 10;
const AT_ONCE = 2;
/** Least time between looks at the errors of a running session; longer for many frames, since all of them come each time. */
const MIN_MS = 5000;
const MS_PER_FRAME = 2;
const RETRY_MS = 30_000;

export class FigureLoader extends EventTarget {
  private readonly figures = new Map<string, Figures>();
  /** Of how many frames the figures of a session are, whether these are the last, and when to look again at the earliest. */
  private readonly fetched = new Map<string, { solved: number; isFinal: boolean; next: number }>();
  private readonly wanted = new Map<string, Session>();
  private atWork = 0;

  constructor(private readonly service: Service) {
    super();
  }

  of(id: string): Figures | null {
    return this.figures.get(id) ?? null;
  }

  /** Fetches what is not known of these sessions, or not known anew. */
  want(sessions: readonly Session[]) {
    this.wanted.clear();
    for (const session of sessions) {
      if (this.isDue(session)) this.wanted.set(session.id, session);
    }
    while (this.atWork < AT_ONCE && this.wanted.size > 0) void this.work();
  }

  reset() {
    this.figures.clear();
    this.fetched.clear();
    this.wanted.clear();
  }

  private isDue(session: Session): boolean {
    if (session.state === 'preparing' || session.frames.solved === 0) return false;
    const fetched = this.fetched.get(session.id);
    if (!fetched) return true;
    if (fetched.isFinal || performance.now() < fetched.next) return false;
    return fetched.solved !== session.frames.solved || isOver(session);
  }

  private async work() {
    this.atWork += 1;
    for (const [id, session] of this.wanted) {
      this.wanted.delete(id);
      const { solved } = session.frames;
      const note = (wait: number, known: number, isFinal: boolean) =>
        this.fetched.set(id, { solved: known, isFinal, next: performance.now() + wait });
      note(Math.max(MIN_MS, MS_PER_FRAME * solved), solved, isOver(session));
      try {
        const fetch = session.state === 'completed' ? containerFigures : frameFigures;
        this.figures.set(id, await fetch(this.service, session));
      } catch {
        // Figures are an addition: what is wrong with the service, the list itself says.
        note(RETRY_MS, -1, false);
      }
      this.dispatchEvent(new Event('change'));
    }
    this.atWork -= 1;
  }
}

function isOver(session: Session): boolean {
  return session.state === 'completed' || session.state === 'failed';
}

async function frameFigures(service: Service, session: Session): Promise<Figures> {
  // Of frames that are to be compressed nobody knows the errors that they end with.
  const final = session.coding?.frames ?? Infinity;
  const frames = (await service.errors(session.id)).filter(({ frame }) => frame < final);
  let [sum, measured, worst] = [0, 0, 0];
  for (const { l2, linf } of frames) {
    if (l2 === null || linf === null) continue;
    sum += l2;
    measured += 1;
    worst = Math.max(worst, linf);
  }
  const meanL2 = measured > 0 ? sum / measured : null;
  return { meanL2, worst: measured > 0 ? worst : null, bytes: null, ratio: null };
}

/** What the report at the end of a completed session's container says (docs/FORMAT.md, `summ`). */
export async function containerFigures(service: Service, session: Session): Promise<Figures> {
  const source = await service.source(sessionPath(session.id, 'capture.cager'), undefined, 1);
  const tail = await EndsCache.of(source, 0, TAIL_BYTES);
  const contents = await readContents(tail);
  const summary = contents.get('summ');
  const report = summary ? decodeReport((await readSections(tail, [summary]))[0]) : {};
  const error = (report.error ?? {}) as Record<string, unknown>;
  // Faces and corners of the model from the size of both, and from the triangles, of which each face has its corners less two.
  const facesAndCorners = (contents.get('RFAC')?.fields.rawBytes ?? 0) / 4;
  const corners = (2 * facesAndCorners + (numberOf(report.triangles) ?? 0)) / 3;
  const capture = 12 * (session.points ?? 0) * session.frames.solved + 4 * corners;
  return {
    meanL2: numberOf(error.l2_mean),
    worst: numberOf(error.linf_max),
    bytes: source.size,
    ratio: capture > 0 ? capture / source.size : null,
  };
}

function numberOf(value: unknown): number | null {
  return typeof value === 'number' ? value : null;
}
