import { blended, HOME, nearlySame, orbited, panned, zoomed, type CameraState } from './camera';

/** Turns per height of the picture that a drag across it makes. */
const TURN = Math.PI;
/** Seconds after which a movement has come within a third of its end. */
const GLIDE = 0.06;

/**
 * Mouse, touch, pen and wheel on an element as movements of a camera: drag orbits, right or middle drag and two fingers pan, wheel and pinch zoom.
 * Movements glide unless the system asks for reduced motion.
 */
export class CameraControls {
  /** Called when the camera will move, so that pictures are drawn until {@link advance} says that it rests. */
  onMove: () => void = () => undefined;
  onGrab: () => void = () => undefined;
  private shown: CameraState = HOME;
  private wanted: CameraState = HOME;
  private readonly pointers = new Map<number, { x: number; y: number }>();
  private readonly stop = new AbortController();
  private readonly stillness = matchMedia('(prefers-reduced-motion: reduce)');

  /** @param wheelZooms whether the wheel zooms; where it does not, it scrolls the page, and zooms with the control key alone */
  constructor(
    private readonly element: HTMLElement,
    private readonly wheelZooms: () => boolean = () => true,
  ) {
    const options = { signal: this.stop.signal };
    element.addEventListener('pointerdown', (event) => this.grab(event), options);
    element.addEventListener('pointermove', (event) => this.drag(event), options);
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture'] as const) {
      element.addEventListener(end, (event) => this.pointers.delete(event.pointerId), options);
    }
    element.addEventListener('wheel', (event) => this.wheel(event), { ...options, passive: false });
    element.addEventListener('contextmenu', (event) => event.preventDefault(), options);
  }

  get camera(): CameraState {
    return this.shown;
  }

  get destination(): CameraState {
    return this.wanted;
  }

  go(camera: CameraState, atOnce = false) {
    this.wanted = camera;
    if (atOnce || this.stillness.matches) this.shown = camera;
    this.onMove();
  }

  /** Moves on by some seconds; returns whether the camera still moves. */
  advance(seconds: number): boolean {
    if (this.shown === this.wanted) return false;
    const next = blended(this.shown, this.wanted, 1 - Math.exp(-seconds / GLIDE));
    this.shown = nearlySame(next, this.wanted) ? this.wanted : next;
    return true;
  }

  dispose() {
    this.stop.abort();
  }

  private grab(event: PointerEvent) {
    if (this.pointers.size >= 2) return;
    this.element.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    this.onGrab();
  }

  private drag(event: PointerEvent) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    const now = { x: event.clientX, y: event.clientY };
    this.pointers.set(event.pointerId, now);
    const height = Math.max(1, this.element.clientHeight);
    const [right, down] = [(now.x - before.x) / height, (now.y - before.y) / height];
    if (other) {
      const spread = (p: { x: number; y: number }) => Math.max(10, Math.hypot(p.x - other.x, p.y - other.y));
      // Each of the two fingers moves the middle between them by half its own way.
      this.go(panned(zoomed(this.wanted, spread(before) / spread(now)), -right / 2, down / 2));
    } else if (event.buttons & 6 || event.shiftKey) {
      this.go(panned(this.wanted, -right, down));
    } else {
      this.go(orbited(this.wanted, -right * TURN, down * TURN));
    }
  }

  private wheel(event: WheelEvent) {
    if (!event.ctrlKey && !this.wheelZooms()) return;
    event.preventDefault();
    const pixels = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 * event.deltaY : event.deltaY;
    // A pinch on a touchpad arrives as a wheel with the control key and small steps.
    const step = event.ctrlKey ? pixels * 0.01 : pixels * 0.0015;
    this.go(zoomed(this.wanted, Math.exp(Math.min(0.5, Math.max(-0.5, step)))));
  }
}
