import type { CageEditor } from './editor';
import { constraintAt, draggedBy, type Constraint } from './gizmo';
import { vertexAt, verticesWithin, type Rectangle } from './picking';
import type { Vector } from './projection';

/** Pixels around a vertex that count as it, for a mouse and for a finger. */
const [MOUSE_REACH, TOUCH_REACH] = [14, 24];
/** Pixels around a vertex within which it comes before an arrow that lies above it. */
const NEAR = 7;
/** Pixels more that a finger may be beside the gizmo. */
const TOUCH_SLACK = 8;
/** Pixels that a pointer moves before a press on a vertex becomes a drag. */
const SLACK = 3;

interface Held {
  readonly pointer: number;
  readonly x: number;
  readonly y: number;
}

/** A press of the pointer and what becomes of it. */
type Gesture =
  | (Held & { readonly kind: 'move'; constraint: Constraint; move: ((by: Vector) => void) | null; at: Vector })
  | (Held & { readonly kind: 'band'; toX: number; toY: number })
  | (Held & { readonly kind: 'outside' });

/**
 * Mouse, pen and fingers in the picture while a cage is edited. What begins on a vertex or on the gizmo is taken before the camera's controls hear of it;
 * all else is left to them.
 */
export class EditPointer {
  /** The vertex that is pointed at, −1 for none. */
  hovered = -1;
  private gesture: Gesture | null = null;
  private pointed: Constraint | null = null;

  constructor(
    private readonly editor: CageEditor,
    host: HTMLElement,
    signal: AbortSignal,
  ) {
    const options = { signal, capture: true };
    host.addEventListener('pointerdown', (event) => this.press(event), options);
    host.addEventListener('pointermove', (event) => this.track(event), options);
    for (const end of ['pointerup', 'pointercancel'] as const) {
      host.addEventListener(end, (event) => this.release(event, end === 'pointercancel'), options);
    }
    // Two clicks on a vertex are no wish to see all of the model.
    host.addEventListener('dblclick', (event) => this.isOnVertex && event.stopPropagation(), options);
  }

  /** Whether something is dragged. */
  get isDown(): boolean {
    return this.gesture !== null;
  }

  /** What of the gizmo is pointed at or dragged. */
  get constraint(): Constraint | null {
    return this.gesture?.kind === 'move' ? this.gesture.constraint : this.pointed;
  }

  /** The box that is drawn to choose what is in it. */
  get band(): Rectangle | null {
    return this.gesture?.kind === 'band' ? rectangleOf(this.gesture) : null;
  }

  private press(event: PointerEvent) {
    if (!this.editor.isShown || event.composedPath()[0] !== this.picture) return;
    if (this.gesture && this.gesture.kind !== 'outside') {
      event.stopPropagation();
      return;
    }
    if (event.button !== 0) return;
    const { x, y } = this.placeOf(event);
    const held = { pointer: event.pointerId, x, y };
    const isTouch = event.pointerType === 'touch';
    const vertex = vertexAt(this.editor.places, x, y, isTouch ? TOUCH_REACH : MOUSE_REACH);
    const adds = event.shiftKey || event.ctrlKey || event.metaKey || this.editor.addsToSelection;
    const { selection } = this.editor.model;
    const isOn = (v: number) => v >= 0 && Math.hypot(this.editor.places[v]!.x - x, this.editor.places[v]!.y - y) < NEAR;
    const constraint =
      this.editor.gizmo && !adds && !(isOn(vertex) && !selection.includes(vertex))
        ? constraintAt(this.editor.gizmo, x, y, isTouch ? TOUCH_SLACK : 0)
        : null;
    if (adds && vertex >= 0) {
      this.editor.select(selection.includes(vertex) ? selection.filter((v) => v !== vertex) : [...selection, vertex]);
    } else if (constraint) {
      this.gesture = { ...held, kind: 'move', constraint, move: null, at: this.editor.middle() };
    } else if (vertex >= 0) {
      if (!selection.includes(vertex)) this.editor.select([vertex]);
      this.gesture = { ...held, kind: 'move', constraint: { kind: 'picture' }, move: null, at: this.editor.middle() };
    } else if (event.shiftKey) {
      this.gesture = { ...held, kind: 'band', toX: x, toY: y };
    } else {
      this.gesture = { ...held, kind: 'outside' };
      return;
    }
    event.stopPropagation();
    event.preventDefault();
    this.picture.setPointerCapture(event.pointerId);
    this.picture.focus({ preventScroll: true });
    this.editor.draw();
  }

  private track(event: PointerEvent) {
    if (!this.editor.isShown) return;
    const { x, y } = this.placeOf(event);
    const { gesture } = this;
    if (!gesture) {
      if (event.buttons === 0) this.hover(event, x, y);
      return;
    }
    if (event.pointerId !== gesture.pointer || gesture.kind === 'outside') return;
    event.stopPropagation();
    if (gesture.kind === 'band') {
      [gesture.toX, gesture.toY] = [x, y];
      this.editor.draw();
      return;
    }
    if (!this.editor.projection || (!gesture.move && Math.hypot(x - gesture.x, y - gesture.y) < SLACK)) return;
    if (!gesture.move) this.editor.settle();
    gesture.move ??= this.editor.model.move(this.editor.frame, this.editor.player.transport.frames);
    const [dx, dy, dz] = draggedBy(this.editor.projection, gesture.at, gesture.constraint, gesture, { x, y });
    const { diagonal } = this.editor.model;
    gesture.move([dx * diagonal, dy * diagonal, dz * diagonal]);
  }

  private release(event: PointerEvent, isCancelled: boolean) {
    const { gesture } = this;
    if (gesture?.pointer !== event.pointerId) return;
    this.gesture = null;
    const { x, y } = this.placeOf(event);
    if (gesture.kind === 'outside') {
      const isClick = !isCancelled && Math.hypot(x - gesture.x, y - gesture.y) < SLACK;
      if (isClick && this.editor.isShown) this.editor.select([]);
      return;
    }
    event.stopPropagation();
    if (gesture.kind === 'band' && !isCancelled) {
      this.editor.select([
        ...this.editor.model.selection,
        ...verticesWithin(this.editor.places, rectangleOf({ ...gesture, toX: x, toY: y })),
      ]);
    }
    if (gesture.kind === 'move' && gesture.move) {
      if (isCancelled) this.editor.model.undo();
      this.editor.sayMoved();
    }
    this.editor.draw();
  }

  private hover(event: PointerEvent, x: number, y: number) {
    const isInPicture = event.composedPath()[0] === this.picture;
    const pointed = isInPicture && this.editor.gizmo ? constraintAt(this.editor.gizmo, x, y) : null;
    const hovered = isInPicture ? vertexAt(this.editor.places, x, y, MOUSE_REACH) : -1;
    this.picture.style.cursor = pointed ? 'move' : hovered >= 0 ? 'pointer' : '';
    if (hovered === this.hovered && JSON.stringify(pointed) === JSON.stringify(this.pointed)) return;
    [this.hovered, this.pointed] = [hovered, pointed];
    this.editor.draw();
  }

  /** Takes back what a pointer that is still down has done. */
  cancel() {
    if (this.gesture?.kind === 'move' && this.gesture.move) this.editor.model.undo();
    this.gesture = null;
    this.editor.draw();
  }

  /** Forgets what is pointed at. */
  rest() {
    this.gesture = this.pointed = null;
    this.hovered = -1;
    this.picture.style.cursor = '';
  }

  private get picture(): HTMLCanvasElement {
    return this.editor.player.stage.canvas;
  }

  private get isOnVertex(): boolean {
    return this.editor.isShown && (this.hovered >= 0 || this.pointed !== null);
  }

  private placeOf(event: PointerEvent): { x: number; y: number } {
    const box = this.picture.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }
}

function rectangleOf(gesture: Held & { toX: number; toY: number }): Rectangle {
  return { fromX: gesture.x, fromY: gesture.y, toX: gesture.toX, toY: gesture.toY };
}
