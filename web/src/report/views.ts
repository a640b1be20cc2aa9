import { html, LitElement, nothing, type PropertyValues } from 'lit';
import { customElement, property, state } from 'lit/decorators.js';
import { repeat } from 'lit/directives/repeat.js';
import { Color } from 'three';
import { framed, HOME, nearlySame, type CameraState } from '../render/camera';
import { CameraControls } from '../render/cameraControls';
import { resolvedColor, stageColors } from '../viewer/stageColors';
import { controls } from '../style/controls';
import { glyphs } from '../style/glyphs';
import { sentence } from '../text';
import { Quality } from '../viewer/quality';
import { DrawingScene, type Drawing, type DrawingColors } from './geometry/drawing';
import { homeView, pictureShape, keyedCamera } from './geometry/framing';
import { Painter } from './geometry/painter';
import { saveSideBySide } from './savedSheet';
import { viewsStyle } from './viewsStyle';

export interface View {
  readonly title: string;
  readonly note: string;
  /** Colour of a mark before the title. */
  readonly color?: string;
  /** What is drawn at a place of the group's slider, of which there is 0 alone where it has none; between two places too. */
  drawing(place: number): Drawing;
  /** Positions that the camera frames in place of the group's, where these are far from them. */
  readonly framed?: Float32Array;
}

export interface Moments {
  readonly count: number;
  readonly first: number;
  /** Moments per second. */
  readonly rate: number;
  /** Whether there is something to see between two moments. */
  readonly smooth: boolean;
  readonly name: (place: number) => string;
}

/** Views of models and cages beside each other, which turn and play in step. */
@customElement('report-views')
export class Views extends LitElement {
  static override styles = [controls, viewsStyle];

  @property({ attribute: false }) views: readonly View[] = [];
  @property({ attribute: false }) framed: Float32Array = new Float32Array(0);
  @property({ attribute: false }) moments: Moments | null = null;
  /** What the group shows, for people who do not see it. */
  @property() label = '';
  @state() private isLarge = false;
  @state() private isPlaying = false;
  @state() private place = 0;
  @state() private problem = '';
  private readonly shown = new Map<
    HTMLCanvasElement,
    { view: View; controls: CameraControls; scene: DrawingScene | null; at: number }
  >();
  private readonly visible = new Set<Element>();
  private camera: CameraState = HOME;
  private leader: CameraControls | null = null;
  private isSyncing = false;
  private request = 0;
  private drawnAt = 0;
  private readonly quality = new Quality();
  private readonly theme = matchMedia('(prefers-color-scheme: dark)');
  private readonly repaint = () => {
    for (const one of this.shown.values()) one.scene?.setColors(this.colors());
    this.ask();
  };
  private readonly sight = new IntersectionObserver(
    (entries) => {
      for (const { target, isIntersecting } of entries) this.visible[isIntersecting ? 'add' : 'delete'](target);
      this.ask();
    },
    { rootMargin: '200px' },
  );
  private readonly sizes = new ResizeObserver(() => this.ask());

  override render() {
    if (this.problem !== '') return html`<p class="notice" role="alert">${this.problem}</p>`;
    return html`
      <div class="tools row fine">
        ${this.moments && this.moments.count > 1 ? this.slider(this.moments) : nothing}
        <button class="quiet" @click=${() => this.home()}>Reset view</button>
        <button class="quiet" aria-pressed=${String(this.isLarge)} @click=${() => (this.isLarge = !this.isLarge)}>
          Larger
        </button>
        <button class="quiet" @click=${() => this.save()}>Save PNG</button>
      </div>
      <div
        class="views ${this.isLarge ? 'large' : ''}"
        role="group"
        aria-label=${this.label}
        .style=${`--report-view-aspect: ${pictureShape(this.framed)}`}
      >
        ${repeat(
          this.views,
          (view) => view,
          ({ title, note, color }) =>
            html`<figure class="card">
              <canvas
                tabindex="0"
                role="img"
                aria-label="${title}. ${note}. Arrow keys turn it, plus and minus zoom."
                @keydown=${this.turn}
              ></canvas>
              <figcaption class="fine">
                <b>${color === undefined ? nothing : html`<i .style=${`background:${color}`}></i>`}${title}</b
                ><span class="figures">${note}</span>
              </figcaption>
            </figure>`,
        )}
      </div>
    `;
  }

  override connectedCallback() {
    super.connectedCallback();
    this.theme.addEventListener('change', this.repaint);
    this.sizes.observe(this);
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    this.theme.removeEventListener('change', this.repaint);
    this.sizes.disconnect();
    cancelAnimationFrame(this.request);
    this.request = 0;
    this.forget();
  }

  protected override willUpdate(changed: PropertyValues<this>) {
    if (changed.has('moments')) {
      this.place = this.moments?.first ?? 0;
      this.isPlaying = false;
    }
  }

  protected override updated(changed: PropertyValues<this>) {
    if (changed.has('views')) this.follow();
    if (changed.has('views') && !this.leader) this.home(true);
    this.ask();
  }

  private follow() {
    this.forget();
    this.renderRoot.querySelectorAll('canvas').forEach((canvas, k) => {
      const controls = new CameraControls(canvas, () => this.shadowRoot?.activeElement === canvas);
      controls.go(this.camera, true);
      controls.onGrab = () => canvas.focus({ preventScroll: true });
      controls.onMove = () => {
        if (this.isSyncing) return;
        this.leader = controls;
        this.ask();
      };
      this.shown.set(canvas, { view: this.views[k], controls, scene: null, at: NaN });
      this.sight.observe(canvas);
    });
  }

  private forget() {
    for (const { controls, scene } of this.shown.values()) {
      controls.dispose();
      scene?.dispose();
    }
    this.shown.clear();
    this.visible.clear();
    this.sight.disconnect();
    this.leader = null;
  }

  private slider({ count, name }: Moments) {
    return html`<button class="icon" aria-label=${this.isPlaying ? 'Pause' : 'Play'} @click=${() => this.play()}>
        ${glyphs[this.isPlaying ? 'pause' : 'play']}
      </button>
      <input
        type="range"
        min="0"
        max=${count - 1}
        step="1"
        aria-label="Frame"
        aria-valuetext=${name(Math.round(this.place))}
        .value=${String(Math.round(this.place))}
        @input=${(event: Event) => {
          this.isPlaying = false;
          this.place = Number((event.target as HTMLInputElement).value);
        }}
      />
      <output class="figures">${name(Math.round(this.place))}</output>`;
  }

  private play() {
    this.isPlaying = !this.isPlaying;
    this.drawnAt = 0;
    this.ask();
  }

  private home(atOnce = false) {
    const first = this.shown.values().next().value;
    const canvas = this.renderRoot.querySelector('canvas');
    if (!first || !canvas) return;
    const camera = framed(homeView(this.framed), this.framed, this.aspect(canvas));
    first.controls.go(camera, atOnce);
  }

  private aspect(canvas: HTMLCanvasElement): number {
    return canvas.clientWidth / Math.max(1, canvas.clientHeight) || 1;
  }

  private turn(event: KeyboardEvent) {
    const found = this.shown.get(event.currentTarget as HTMLCanvasElement);
    if (!found || event.ctrlKey || event.metaKey || event.altKey) return;
    const next = keyedCamera(found.controls.destination, event.key);
    if (event.key === 'Home') this.home();
    else if (next) found.controls.go(next);
    else return;
    event.preventDefault();
  }

  private ask() {
    if (this.request === 0 && this.isConnected) this.request = requestAnimationFrame((now) => this.draw(now));
  }

  private draw(now: number) {
    this.request = 0;
    const seconds = this.drawnAt === 0 ? 0 : Math.min(0.2, (now - this.drawnAt) / 1000);
    this.drawnAt = now;
    const moves = this.leader?.advance(seconds) ?? false;
    if (this.leader) this.camera = this.leader.camera;
    if (this.isPlaying && this.moments) {
      const { count, rate } = this.moments;
      this.place = (this.place + seconds * rate) % count;
    }
    const busy = moves || this.isPlaying;
    if (busy) this.quality.measure(seconds);
    try {
      this.paint(busy ? this.quality.moving : 1);
    } catch (error) {
      this.problem = sentence(error);
      return;
    }
    if (busy) this.ask();
    else this.drawnAt = 0;
    if (moves) return;
    // The next view that somebody turns begins where all of them are.
    this.isSyncing = true;
    for (const { controls } of this.shown.values()) {
      if (!nearlySame(controls.destination, this.camera)) controls.go(this.camera, true);
    }
    this.isSyncing = false;
  }

  private paint(share: number) {
    const place = this.moments?.smooth === false ? Math.floor(this.place) : this.place;
    for (const [canvas, shown] of this.shown) {
      const [width, height] = [canvas.clientWidth, canvas.clientHeight];
      if (!this.visible.has(canvas) || width === 0 || height === 0) continue;
      const painter = Painter.get();
      if (!shown.scene) {
        shown.scene = new DrawingScene(shown.view.drawing(place));
        shown.scene.setColors(this.colors());
      } else if (shown.at !== place) shown.scene.show(shown.view.drawing(place));
      shown.at = place;
      const own = shown.view.framed;
      const camera = own ? framed(this.camera, own, this.aspect(canvas)) : this.camera;
      painter.paint(canvas, shown.scene, camera, width, height, share * Math.min(2, devicePixelRatio));
    }
  }

  private colors(): DrawingColors {
    const { model, cage, handle } = stageColors(this);
    const [solid, edge] = ['light-dark(#9fb8d6, #86a2c4)', 'light-dark(#6b7078, #14181d)'].map(
      (color) => new Color(resolvedColor(this.renderRoot, color)),
    );
    return { model: new Color(model), cage: new Color(cage), mark: new Color(handle), solid, edge };
  }

  private save() {
    for (const canvas of this.shown.keys()) this.visible.add(canvas);
    this.paint(1);
    const canvases = [...this.shown.keys()];
    if (canvases.length === 0) return;
    saveSideBySide(
      canvases,
      resolvedColor(this.renderRoot, getComputedStyle(this).getPropertyValue('--cager-surface')),
    );
  }
}
