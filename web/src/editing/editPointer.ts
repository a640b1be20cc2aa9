import type { CageEditor } from './editor';
import { constraintAt, type Constraint } from './gizmo';
import { motionOf } from './gizmoDrag';
import type { Motion, MotionKind } from './motion';
import { vertexAt, verticesWithin, type Rectangle } from './picking';
import type { Vector } from '../coordinates/vector';

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

type Gesture =
  | (Held & {
      readonly kind: 'drag';
      readonly tool: MotionKind;
      readonly constraint: Constraint;
      readonly at: Vector;
      /** Angle, factor or length; null before anything has moved. */
      amount: number | null;
      act: ((motion: Motion) => void) | null;
    })
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

  get isDown(): boolean {
    return this.gesture !== null;
  }

  get constraint(): Constraint | null {
    return this.gesture?.kind === 'drag' ? this.gesture.constraint : this.pointed;
  }

  /** The angle or the factor of the drag that goes on; null without a drag. */
  get amount(): { readonly kind: MotionKind; readonly amount: number } | null {
    const { gesture } = this;
    return gesture?.kind === 'drag' && gesture.amount !== null ? { kind: gesture.tool, amount: gesture.amount } : null;
  }

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
      const { tool } = this.editor;
      this.gesture = { ...held, kind: 'drag', tool, constraint, at: this.editor.middle(), amount: null, act: null };
    } else if (vertex >= 0) {
      if (!selection.includes(vertex)) this.editor.select([vertex]);
      // A vertex itself is always moved: it is its own pivot.
      const constraint = { kind: 'picture' } as const;
      const at = this.editor.middle();
      this.gesture = { ...held, kind: 'drag', tool: 'move', constraint, at, amount: null, act: null };
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
    const { model, projection, frame, player } = this.editor;
    if (!projection || (!gesture.act && Math.hypot(x - gesture.x, y - gesture.y) < SLACK)) return;
    if (!gesture.act) this.editor.settle();
    const { tool: kind, constraint, at } = gesture;
    gesture.act ??= model.begin(kind, frame, player.transport.frames);
    const drag = { kind, constraint, at, from: gesture, to: { x, y }, diagonal: model.diagonal };
    const { motion, amount } = motionOf(projection, drag, gesture.amount ?? 0, event.shiftKey);
    gesture.amount = amount;
    gesture.act(motion);
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
    if (gesture.kind === 'drag' && gesture.act) {
      if (isCancelled) this.editor.model.undo();
      this.editor.sayChanged(gesture.tool);
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
    if (this.gesture?.kind === 'drag' && this.gesture.act) this.editor.model.undo();
    this.gesture = null;
    this.editor.draw();
  }

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
