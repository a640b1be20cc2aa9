import { OUTER_RING, type Constraint, type Gizmo, type Ring } from './gizmo';
import type { PlacedVertex, Rectangle } from './picking';

export interface OverlayColors {
  readonly vertex: string;
  readonly chosen: string;
  readonly outline: string;
  readonly axes: readonly [string, string, string];
}

export interface OverlayState {
  readonly vertices: readonly (PlacedVertex | null)[];
  readonly selection: ReadonlySet<number>;
  /** How much each vertex follows the chosen ones; null where none is chosen. */
  readonly weights: Float64Array | null;
  readonly hovered: number;
  readonly gizmo: Gizmo | null;
  readonly constraint: Constraint | null;
  readonly band: Rectangle | null;
  /** How far the drag goes, in words. */
  readonly label: string | null;
}

const [SMALLEST_DOT, LARGEST_DOT] = [1.9, 4.5];
const ALL_AROUND = 2 * Math.PI;

/** Draws vertices and gizmo on a canvas of its own, in CSS pixels. */
export function drawOverlay(canvas: HTMLCanvasElement, state: OverlayState, colors: OverlayColors): void {
  const { clientWidth: width, clientHeight: height } = canvas;
  const ratio = Math.min(2, devicePixelRatio);
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext('2d');
  if (!context) return;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  drawVertices(context, state, colors);
  if (state.gizmo) drawGizmo(context, state.gizmo, state.constraint, colors);
  if (state.gizmo && state.label !== null) drawLabel(context, state.gizmo, state.label, colors);
  if (state.band) drawBand(context, state.band, colors);
}

function drawVertices(context: CanvasRenderingContext2D, state: OverlayState, colors: OverlayColors): void {
  const { vertices, selection, weights, hovered } = state;
  const size = dotSize(vertices);
  const order = vertices.map((_, v) => v).sort((a, b) => (vertices[b]?.depth ?? 0) - (vertices[a]?.depth ?? 0));
  for (const v of order) {
    const place = vertices[v];
    if (!place) continue;
    const isChosen = selection.has(v);
    const weight = weights?.[v] ?? 0;
    const radius = (isChosen ? Math.max(5, 1.4 * size) : size * (1 + 0.35 * weight)) + (v === hovered ? 2 : 0);
    context.globalAlpha = place.isBehind && !isChosen && v !== hovered ? 0.32 : 1;
    dot(context, place.x, place.y, radius + 0.4 * Math.min(3.5, size), colors.outline);
    dot(context, place.x, place.y, radius, isChosen ? colors.chosen : colors.vertex);
    if (!isChosen && weight > 0.02) {
      context.globalAlpha *= 0.25 + 0.75 * weight;
      dot(context, place.x, place.y, radius, colors.chosen);
    }
  }
  context.globalAlpha = 1;
}

/** Radius of a dot: smaller where vertices are close to each other in the picture. */
function dotSize(vertices: readonly (PlacedVertex | null)[]): number {
  const seen = vertices.filter((place) => place !== null);
  if (seen.length === 0) return SMALLEST_DOT;
  const extent = (values: number[]) => Math.max(...values) - Math.min(...values);
  const area = extent(seen.map(({ x }) => x)) * extent(seen.map(({ y }) => y));
  return Math.min(LARGEST_DOT, Math.max(SMALLEST_DOT, 0.2 * Math.sqrt(area / seen.length)));
}

function drawGizmo(
  context: CanvasRenderingContext2D,
  { kind: tool, middle, arrows, squares, rings }: Gizmo,
  constraint: Constraint | null,
  colors: OverlayColors,
): void {
  const isHeld = (kind: Constraint['kind'], axis: number | null = null) =>
    constraint?.kind === kind && (axis === null || (constraint as { axis?: number }).axis === axis);
  context.lineJoin = context.lineCap = 'round';
  for (const ring of rings) drawRing(context, ring, isHeld(ring.axis === null ? 'picture' : 'axis', ring.axis), colors);
  for (const { axis, corners, opacity } of squares) {
    if (opacity === 0) continue;
    context.globalAlpha = opacity * (isHeld('plane', axis) ? 0.85 : 0.4);
    context.fillStyle = colors.axes[axis];
    polygon(context, corners);
    context.fill();
    context.globalAlpha = opacity;
    context.strokeStyle = colors.axes[axis];
    context.lineWidth = 1.25;
    context.stroke();
  }
  for (const { axis, from, tip, opacity } of [...arrows].sort((a, b) => b.tip.depth - a.tip.depth)) {
    if (opacity === 0) continue;
    context.globalAlpha = opacity;
    const [dx, dy] = [tip.x - from.x, tip.y - from.y];
    const long = Math.hypot(dx, dy) || 1;
    const [ux, uy] = [dx / long, dy / long];
    const neck = { x: tip.x - 13 * ux, y: tip.y - 13 * uy };
    const wing = isHeld('axis', axis) ? 7.5 : 6;
    for (const [color, extra] of [
      [colors.outline, 2.5],
      [colors.axes[axis], 0],
    ] as const) {
      context.strokeStyle = context.fillStyle = color;
      context.lineWidth = (isHeld('axis', axis) ? 4 : 2.75) + extra;
      context.beginPath();
      context.moveTo(from.x, from.y);
      context.lineTo(neck.x, neck.y);
      context.stroke();
      const [left, right] = [-1, 1].map((side) => ({ x: neck.x + side * wing * uy, y: neck.y - side * wing * ux }));
      const across = (corner: { x: number; y: number }) => ({ x: corner.x + 11 * ux, y: corner.y + 11 * uy });
      // What moves has a point, what scales a block.
      polygon(context, tool === 'scale' ? [left, right, across(right), across(left)] : [tip, left, right]);
      context.lineWidth = extra;
      if (extra > 0) context.stroke();
      context.fill();
    }
  }
  context.globalAlpha = 1;
  if (tool === 'rotate') return;
  ring(context, middle.x, middle.y, 11, colors.outline, 4);
  ring(context, middle.x, middle.y, 11, colors.chosen, isHeld('picture') ? 3 : 2);
}

/** A ring to rotate by; what of it is behind the middle is faint. */
function drawRing(context: CanvasRenderingContext2D, { axis, points }: Ring, isHeld: boolean, colors: OverlayColors) {
  const color = axis === null ? colors.chosen : colors.axes[axis];
  const width = isHeld ? 4 : axis === null ? 1.75 : 2.5;
  for (const [stroke, extra, isBehind] of [
    [color, 0, true],
    [colors.outline, 2.5, false],
    [color, 0, false],
  ] as const) {
    context.globalAlpha = isBehind ? 0.22 : 1;
    context.strokeStyle = stroke;
    context.lineWidth = width + extra;
    context.beginPath();
    points.forEach((from, k) => {
      const to = points[(k + 1) % points.length];
      if (from.isBehind !== isBehind) return;
      context.moveTo(from.x, from.y);
      context.lineTo(to.x, to.y);
    });
    context.stroke();
  }
  context.globalAlpha = 1;
}

function drawLabel(context: CanvasRenderingContext2D, { middle }: Gizmo, label: string, colors: OverlayColors) {
  context.font = `600 14px ${getComputedStyle(context.canvas).fontFamily}`;
  context.textAlign = 'center';
  const [x, y] = [middle.x, middle.y - OUTER_RING - 12];
  context.strokeStyle = colors.outline;
  context.lineWidth = 4;
  context.strokeText(label, x, y);
  context.fillStyle = colors.chosen;
  context.fillText(label, x, y);
}

function drawBand(context: CanvasRenderingContext2D, band: Rectangle, colors: OverlayColors): void {
  const box = [band.fromX, band.fromY, band.toX - band.fromX, band.toY - band.fromY] as const;
  context.fillStyle = context.strokeStyle = colors.chosen;
  context.globalAlpha = 0.14;
  context.fillRect(...box);
  context.globalAlpha = 1;
  context.lineWidth = 1;
  context.setLineDash([4, 3]);
  context.strokeRect(...box);
  context.setLineDash([]);
}

function dot(context: CanvasRenderingContext2D, x: number, y: number, radius: number, color: string): void {
  context.beginPath();
  context.arc(x, y, radius, 0, ALL_AROUND);
  context.fillStyle = color;
  context.fill();
}

function ring(context: CanvasRenderingContext2D, x: number, y: number, radius: number, color: string, width: number) {
  context.beginPath();
  context.arc(x, y, radius, 0, ALL_AROUND);
  context.strokeStyle = color;
  context.lineWidth = width;
  context.stroke();
}

function polygon(context: CanvasRenderingContext2D, corners: readonly { readonly x: number; readonly y: number }[]) {
  context.beginPath();
  corners.forEach(({ x, y }, k) => (k === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
  context.closePath();
}
