import type { Player } from '../viewer/player';
import { resolvedColor } from '../viewer/stageColors';
import { sought } from '../viewer/transport';
import { counts, editedRows } from './cageEdit';
import { EditModel } from './editModel';
import { EditPointer } from './editPointer';
import { gizmoAt, type Gizmo } from './gizmo';
import { meanOf } from './grip';
import { keyCommand, keyMotion, type KeyCommand } from './keys';
import { type Motion, type MotionKind, degrees, timesAs } from './motion';
import { drawOverlay, type OverlayColors } from './overlay';
import { placedVertices, vertexAt, vertexTowards, type PlacedVertex } from './picking';
import type { Vector } from '../coordinates/vector';
import { Projection } from '../render/projection';
import { frameText } from '../viewer/frameNumbers';
import type { ViewerHost } from '../viewer/host';

/** Milliseconds after which another press of an arrow key is a step of its own. */
const PAUSE = 1200;

const DONE: Readonly<Record<MotionKind, string>> = { move: 'moved', rotate: 'rotated', scale: 'scaled' };

/** Picks and moves vertices of a cage in the picture of a player, by pointer and by keys. */
export class CageEditor extends EventTarget {
  readonly model: EditModel;
  /** Whether picking adds to what is chosen, for fingers that have no shift key. */
  addsToSelection = false;
  said = '';
  /** Vertices of the cage and gizmo where they were drawn last. */
  places: readonly (PlacedVertex | null)[] = [];
  projection: Projection | null = null;
  gizmo: Gizmo | null = null;
  private readonly canvas = document.createElement('canvas');
  private readonly stop = new AbortController();
  private readonly pointer: EditPointer;
  private colors: OverlayColors | null = null;
  private lastKey = { step: 0, time: -Infinity };
  private chosenTool: MotionKind = 'move';

  constructor(
    private readonly host: ViewerHost,
    readonly player: Player,
  ) {
    super();
    const { decoder } = player.stage;
    this.model = new EditModel(player.capture.static, decoder.diagonal, player.capture.layers);
    this.model.onChange = () => this.changed();
    this.canvas.setAttribute('aria-hidden', 'true');
    // Pointers go through to the picture below, which the camera is turned on.
    Object.assign(this.canvas.style, {
      position: 'absolute',
      inset: '0',
      width: '100%',
      height: '100%',
      pointerEvents: 'none',
    });
    player.stage.canvas.after(this.canvas);
    this.pointer = new EditPointer(this, host, this.stop.signal);
    player.setFrameEdit(null);
  }

  /** What arrows, rings and keys do to the chosen vertices. */
  get tool(): MotionKind {
    return this.chosenTool;
  }

  set tool(tool: MotionKind) {
    this.chosenTool = tool;
    const words = { move: 'Move', rotate: 'Rotate', scale: 'Scale' } as const;
    this.say(`${words[tool]}.`);
    this.draw();
  }

  get frame(): number {
    return Math.round(this.player.transport.position);
  }

  draw() {
    const { stage } = this.player;
    const { clientWidth, clientHeight } = stage.canvas;
    if (this.stop.signal.aborted || clientWidth === 0) return;
    this.projection = new Projection(stage.clipMatrix, clientWidth, clientHeight);
    this.places = placedVertices(this.projection, stage.cageVertices, this.model.graph.cage.triangles);
    const { selection } = this.model;
    this.gizmo = selection.length > 0 ? gizmoAt(this.projection, this.middle(), this.tool) : null;
    this.colors ??= this.readColors();
    const { hovered, constraint, band, amount } = this.pointer;
    const state = {
      vertices: this.places,
      selection: new Set(selection),
      weights: selection.length > 0 ? this.model.weights : null,
      hovered,
      gizmo: this.gizmo,
      constraint,
      band,
      label: amount && labelOf(amount),
    };
    drawOverlay(this.canvas, state, this.colors);
  }

  /** Takes the colours anew, after the theme has changed. */
  recolor() {
    this.colors = null;
    this.draw();
  }

  /** Does what a key asks for; whether it asked for anything. */
  pressKey(event: KeyboardEvent): boolean {
    const target = event.composedPath()[0] as Element;
    const isInPicture = target === this.player.stage.canvas || target === document.body || target === this.host;
    const command = keyCommand(event, { isInPicture, hasSelection: this.model.selection.length > 0 });
    if (!command) return false;
    event.preventDefault();
    if (this.pointer.isDown && event.key === 'Escape') this.pointer.cancel();
    else this.perform(command);
    return true;
  }

  /** Ends editing. The edits stay in the picture; whoever begins again goes on with the same editor. */
  hide() {
    this.pointer.rest();
    this.canvas.hidden = true;
  }

  show() {
    this.canvas.hidden = false;
    this.settle();
    this.draw();
  }

  dispose() {
    this.stop.abort();
    this.canvas.remove();
  }

  get isShown(): boolean {
    return !this.canvas.hidden;
  }

  private perform(command: KeyCommand) {
    const { model } = this;
    switch (command.kind) {
      case 'undo':
        this.say(model.undo() ? 'Undone.' : 'Nothing to undo.');
        break;
      case 'redo':
        this.say(model.redo() ? 'Redone.' : 'Nothing to redo.');
        break;
      case 'clear':
        this.select([]);
        break;
      case 'leave':
        this.dispatchEvent(new Event('leave'));
        break;
      case 'enter':
        this.select([this.nearestToMiddle()]);
        break;
      case 'step':
        this.select([this.stepped(command.by)]);
        break;
      case 'towards': {
        const next = vertexTowards(this.places, model.selection[0], command);
        if (next >= 0) this.select([next]);
        break;
      }
      case 'tool':
        this.tool = command.tool;
        break;
      case 'nudge':
        this.nudge(command);
    }
  }

  private nudge(command: KeyCommand & { kind: 'nudge' }) {
    if (!this.projection) return;
    this.settle();
    const now = performance.now();
    if (now - this.lastKey.time > PAUSE) this.lastKey.step++;
    this.lastKey.time = now;
    const { model, tool, frame } = this;
    const step = `key ${tool} ${this.lastKey.step} ${frame}`;
    const motion: Motion = keyMotion(tool, command, this.projection, this.middle(), model.diagonal);
    model.begin(tool, frame, this.player.transport.frames, step)(motion);
    this.sayChanged(tool);
  }

  select(vertices: readonly number[]) {
    this.model.selection = vertices.filter((v) => v >= 0);
    this.say(this.model.selection.length === 0 ? 'Nothing selected.' : `${this.named()} selected.`);
  }

  /** Tells screen readers what was done to the chosen vertices. */
  sayChanged(how: MotionKind) {
    this.say(`${this.named()} ${DONE[how]} in frame ${frameText(this.player.transport.numbers, this.frame)}.`);
  }

  private say(sentence: string) {
    this.said = sentence;
    this.dispatchEvent(new Event('change'));
  }

  private changed() {
    const { edits, layers } = this.model;
    const { capture } = this.player;
    if (capture.layers && capture.layers !== layers) capture.setLayers?.(layers);
    this.player.setFrameEdit(edits.some(counts) ? (frame, rows) => editedRows(rows, frame, edits) : null);
    this.dispatchEvent(new Event('change'));
    this.draw();
  }

  /** Stands still at a whole frame: vertices are moved in one frame, not between two. */
  settle() {
    const { transport } = this.player;
    const position = Math.round(transport.position);
    if (transport.playing || position !== transport.position)
      this.player.transport = { ...sought(transport, position), playing: false };
  }

  /** The middle of the chosen vertices, in the scene's unit. */
  middle(): Vector {
    return meanOf(this.player.stage.cageVertices, this.model.selection);
  }

  private nearestToMiddle(): number {
    const { clientWidth, clientHeight } = this.player.stage.canvas;
    const inFront = this.places.map((place) => (place?.isBehind === false ? place : null));
    return vertexAt(inFront, clientWidth / 2, clientHeight / 2, Infinity);
  }

  private stepped(by: number): number {
    const { vertices } = this.model.graph;
    return (((this.model.selection[0] + by) % vertices) + vertices) % vertices;
  }

  private named(): string {
    const { selection } = this.model;
    return selection.length === 1 ? `Vertex ${selection[0]}` : `${selection.length} vertices`;
  }

  private readColors(): OverlayColors {
    const style = getComputedStyle(this.host);
    const color = (name: string) => resolvedColor(this.host.renderRoot, style.getPropertyValue(`--cager-${name}`));
    const axes = [color('bad'), color('good'), color('accent')] as const;
    return { vertex: color('cage'), chosen: color('accent'), outline: color('stage'), axes };
  }
}

/** What is written beside the gizmo while it is dragged; nothing of lengths, which the picture shows. */
function labelOf({ kind, amount }: { readonly kind: MotionKind; readonly amount: number }): string | null {
  if (kind === 'move') return null;
  return kind === 'rotate' ? degrees(amount) : timesAs([amount, amount, amount]);
}
