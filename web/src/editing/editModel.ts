import type { EditLayer, StaticPart } from '../capture';
import { fitted, weightAt, type CageEdit, type FrameRange } from './cageEdit';
import { CageGraph, type FalloffMeasure } from './falloff';
import { gripOf, weightsOf, type Grip } from './grip';
import { combined, type Motion, type MotionKind } from './motion';
import { AXES, mirrorOf, type Axis, type Mirror } from './symmetry';

/** Frames that a new edit is kept over: the one that is shown, some around it with easing, or all. */
export type Reach = 'frame' | 'around' | 'all';

/** How the next vertices that are moved take others with them. */
export interface EditSettings {
  /** Radius of the falloff as a fraction of the rest pose's diagonal. */
  readonly radius: number;
  readonly measure: FalloffMeasure;
  readonly symmetry: Axis | null;
  readonly reach: Reach;
}

/** Frames that an edit with the reach `around` eases over, on either side. */
const EASE_FRAMES = 12;
/** Least share of vertices with a partner at which a cage counts as symmetric. */
const SYMMETRIC = 0.5;

/** Edits of this session, and those that the capture's file has. */
interface Edits {
  readonly edits: readonly CageEdit[];
  readonly layers: readonly EditLayer[];
}

/** Edits of one capture's cages: chosen vertices, settings, the edits and their history. Knows nothing of pictures and pointers. */
export class EditModel {
  onChange: () => void = () => undefined;
  readonly graph: CageGraph;
  /** Planes across which the cage is symmetric, by their axes. */
  readonly mirrors: ReadonlyMap<Axis, Mirror>;
  private readonly history: History<Edits>;
  private chosen: readonly number[] = [];
  private choices: EditSettings = { radius: 0.12, measure: 'surface', symmetry: null, reach: 'around' };
  private shownId: number | null = null;
  /** With which settings an edit was made: moving the same vertices again adds to it only with the same ones. */
  private readonly madeWith = new Map<number, string>();
  private lastId = 0;
  private steps = 0;
  private lastGrip: { readonly key: string; readonly grip: Grip } | null = null;

  /** @param diagonal length of the rest pose's diagonal, in the capture's unit */
  constructor(
    part: Pick<StaticPart, 'cage'>,
    readonly diagonal: number,
    layers: readonly EditLayer[] = [],
  ) {
    this.history = new History<Edits>({ edits: [], layers });
    this.graph = new CageGraph(part.cage);
    const mirrors = AXES.map((axis) => [axis, mirrorOf(this.graph, axis)] as const);
    this.mirrors = new Map(mirrors.filter(([, { share }]) => share >= SYMMETRIC));
  }

  get edits(): readonly CageEdit[] {
    return this.history.present.edits;
  }

  /** Edits of the file that are still there. */
  get layers(): readonly EditLayer[] {
    return this.history.present.layers;
  }

  switchLayer(layer: EditLayer): void {
    this.replaceAll({ layers: this.layers.map((each) => (each === layer ? { ...each, isOn: !each.isOn } : each)) });
  }

  removeLayer(layer: EditLayer): void {
    this.replaceAll({ layers: this.layers.filter((each) => each !== layer) });
  }

  get canUndo(): boolean {
    return this.history.canUndo;
  }

  get canRedo(): boolean {
    return this.history.canRedo;
  }

  get selection(): readonly number[] {
    return this.chosen;
  }

  set selection(vertices: readonly number[]) {
    this.chosen = [...new Set(vertices)].sort((a, b) => a - b);
    this.history.endStep();
    this.onChange();
  }

  get settings(): EditSettings {
    return this.choices;
  }

  set settings(settings: EditSettings) {
    this.choices = settings;
    this.onChange();
  }

  get active(): CageEdit | null {
    return this.edits.find(({ id }) => id === this.shownId) ?? null;
  }

  activate(id: number | null): void {
    this.shownId = id;
    const edit = this.active;
    if (edit) this.selection = edit.grip.chosen;
    else this.onChange();
  }

  /** How much each vertex takes part when the chosen ones move. */
  get weights(): Float64Array {
    return weightsOf(this.grip());
  }

  /**
   * Begins to move, rotate or scale the chosen vertices, seen in a frame where they follow wholly. What it returns does so, counted from how they are now,
   * as often as it is called; all of it is one step.
   *
   * @param step continues the step of this name, if the last change was one of it
   */
  begin(kind: MotionKind, frame: number, frames: number, step = `drag ${++this.steps}`): (motion: Motion) => void {
    const key = this.key();
    const grip = this.grip();
    const before = this.edits;
    const { active } = this;
    const isContinued =
      active?.enabled &&
      active.motion.kind === kind &&
      this.madeWith.get(active.id) === key &&
      weightAt(active.range, frame) === 1;
    const continued = isContinued ? active : null;
    const id = continued?.id ?? ++this.lastId;
    const range = continued?.range ?? rangeAround(frame, frames, this.settings.reach);
    this.madeWith.set(id, key);
    return (motion) => {
      const whole = continued ? combined(continued.motion, motion) : motion;
      const edit: CageEdit = { id, grip, motion: whole, range, enabled: true };
      const next = continued ? before.map((other) => (other.id === id ? edit : other)) : [...before, edit];
      this.shownId = id;
      this.change(next, step);
    };
  }

  /** Sets the range of an edit; settings of the same range that follow each other are one step, until it is ended. */
  setRange(id: number, range: FrameRange, frames: number): void {
    this.replace(id, { range: fitted(range, frames) }, `range ${id}`);
  }

  /** Ends a step: the next change is one of its own. */
  endStep(): void {
    this.history.endStep();
  }

  /** Takes up edits that were made before, below those there are; that can be undone. */
  takeUp(edits: readonly CageEdit[]): void {
    const earlier = edits.map((edit) => ({ ...edit, id: ++this.lastId }));
    this.change([...earlier, ...this.edits], null);
  }

  setEnabled(id: number, enabled: boolean): void {
    this.replace(id, { enabled }, null);
  }

  remove(id: number): void {
    this.change(
      this.edits.filter((edit) => edit.id !== id),
      null,
    );
  }

  /** Takes all edits away; that can be undone as well. */
  reset(): void {
    if (this.edits.length + this.layers.length > 0) this.replaceAll({ edits: [], layers: [] });
  }

  undo(): boolean {
    return this.told(this.history.undo());
  }

  redo(): boolean {
    return this.told(this.history.redo());
  }

  private replace(id: number, part: Partial<CageEdit>, step: string | null): void {
    this.change(
      this.edits.map((edit) => (edit.id === id ? { ...edit, ...part } : edit)),
      step,
    );
  }

  private change(edits: readonly CageEdit[], step: string | null): void {
    this.replaceAll({ edits }, step);
  }

  private replaceAll(part: Partial<Edits>, step: string | null = null): void {
    this.history.change({ ...this.history.present, ...part }, step);
    this.onChange();
  }

  private told(isMoved: boolean): boolean {
    // What was shown may be gone; the newest is what the next movement adds to.
    if (isMoved && !this.active) this.shownId = this.edits.at(-1)?.id ?? null;
    if (isMoved) this.onChange();
    return isMoved;
  }

  private key(): string {
    const { radius, measure, symmetry } = this.choices;
    return [radius, measure, symmetry, ...this.chosen].join(' ');
  }

  private grip(): Grip {
    const key = this.key();
    if (this.lastGrip?.key !== key) {
      const { radius, measure, symmetry } = this.choices;
      const mirror = (symmetry && this.mirrors.get(symmetry)) ?? null;
      this.lastGrip = {
        key,
        grip: gripOf(this.graph, this.chosen, { radius: radius * this.diagonal, measure, mirror }),
      };
    }
    return this.lastGrip.grip;
  }
}

/** The range of a new edit, which is whole at a frame. */
export function rangeAround(frame: number, frames: number, reach: Reach): FrameRange {
  if (reach === 'all') return fitted({ first: 0, last: frames - 1, easeIn: 0, easeOut: 0 }, frames);
  const ease = reach === 'around' ? EASE_FRAMES : 0;
  const [first, last] = [Math.max(0, frame - ease), Math.min(frames - 1, frame + ease)];
  return fitted({ first, last, easeIn: frame - first, easeOut: last - frame }, frames);
}

export class History<T> {
  private past: T[] = [];
  private future: T[] = [];
  private step: string | null = null;

  constructor(private state: T) {}

  get present(): T {
    return this.state;
  }

  get canUndo(): boolean {
    return this.past.length > 0;
  }

  get canRedo(): boolean {
    return this.future.length > 0;
  }

  /** Goes on to a state. Changes that follow each other with the same name are one step: a drag is undone at once. */
  change(state: T, step: string | null = null): void {
    if (step === null || step !== this.step) this.past.push(this.state);
    this.step = step;
    this.state = state;
    this.future = [];
  }

  /** Ends a step: the next change is one of its own, whatever its name. */
  endStep(): void {
    this.step = null;
  }

  undo(): boolean {
    return this.move(this.past, this.future);
  }

  redo(): boolean {
    return this.move(this.future, this.past);
  }

  private move(from: T[], to: T[]): boolean {
    const state = from.pop();
    if (state === undefined) return false;
    to.push(this.state);
    this.state = state;
    this.step = null;
    return true;
  }
}
