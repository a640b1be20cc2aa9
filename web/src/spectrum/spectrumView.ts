import type { Player } from '../viewer/player';
import { CagePaint } from './cagePaint';
import { computeSpectrum } from './compute';
import { vectorOf, type Spectrum } from './singular';

/** How far a vertex of the cage is moved at the most, in diagonals, and seconds of one swing. */
const [REACH, SWING] = [0.1, 2.4];

/**
 * Paints a right singular vector of Φ on the cage of a player, and moves the cage by it.
 *
 * @fires change when something else is shown
 */
export class SpectrumView extends EventTarget {
  spectrum: Spectrum | null = null;
  /** The part that is computed. */
  progress = 0;
  /** Why there is no spectrum. */
  failure: string | null = null;
  /** Which values are painted: those of vertices, or of faces where normals are unknowns of their own. */
  part: 'vertices' | 'faces' = 'vertices';
  private shown = 0;
  private axis: 0 | 1 | 2 | null = null;
  private vector: Float64Array = new Float64Array(0);
  private readonly paint: CagePaint;
  private readonly stop = new AbortController();
  private readonly stillness = matchMedia('(prefers-reduced-motion: reduce)');

  constructor(readonly player: Player) {
    super();
    this.paint = new CagePaint(player.capture.static.cage.triangles);
    this.paint.mesh.visible = false;
    this.show();
    void this.compute();
  }

  /** Which singular vector is shown, from 0. */
  get index(): number {
    return this.shown;
  }

  set index(index: number) {
    const count = this.spectrum?.values.length ?? 1;
    this.shown = Math.min(count - 1, Math.max(0, Math.round(index)));
    this.update();
  }

  /** The axis along which the cage is moved by the vector; null while it stands. */
  get motion(): 0 | 1 | 2 | null {
    return this.axis;
  }

  set motion(axis: 0 | 1 | 2 | null) {
    this.axis = axis;
    this.update();
  }

  showPart(part: 'vertices' | 'faces') {
    this.part = part;
    this.update();
  }

  /** Shows the colours again after {@link hide}. */
  show() {
    const { stage } = this.player;
    stage.extras.add(this.paint.mesh);
    stage.onCage = (vertices) => this.paint.setVertices(vertices);
    this.update();
  }

  /** Takes colours and movement out of the picture. */
  hide() {
    const { stage } = this.player;
    stage.extras.remove(this.paint.mesh);
    stage.onCage = () => undefined;
    this.player.deform(null);
    this.player.refresh();
  }

  dispose() {
    this.stop.abort();
    this.hide();
    this.paint.dispose();
  }

  private async compute() {
    const { signal } = this.stop;
    try {
      const onProgress = (fraction: number) => {
        this.progress = fraction;
        this.changed();
      };
      this.spectrum = await computeSpectrum(this.player.capture, onProgress, signal);
      this.index = this.shown;
    } catch (error) {
      if (signal.aborted) return;
      this.failure = error instanceof Error ? error.message : String(error);
      this.changed();
    }
  }

  private update() {
    const { spectrum, player, axis, paint } = this;
    if (spectrum) {
      this.vector = vectorOf(spectrum, this.shown);
      const vertices = player.capture.static.cage.positions.length / 3;
      const values = this.part === 'faces' ? this.vector.subarray(vertices) : this.vector.subarray(0, vertices);
      paint.setValues(values, this.part);
      paint.mesh.visible = true;
      paint.setVertices(player.stage.cageVertices);
    }
    player.deform(
      spectrum && axis !== null
        ? { isMoving: !this.stillness.matches, rows: (rows, seconds) => this.moved(rows, axis, seconds) }
        : null,
    );
    player.refresh();
    this.changed();
  }

  /** Rows of a cage moved by the vector along an axis: to one side and back to the other, or to one side where nothing is to move. */
  private moved(rows: Float32Array | Float64Array, axis: 0 | 1 | 2, seconds: number): Float64Array {
    const { vector, player } = this;
    const largest = vector.reduce((most, entry) => Math.max(most, Math.abs(entry)), 0);
    const swing = this.stillness.matches ? 1 : Math.sin((2 * Math.PI * seconds) / SWING);
    const scale = (REACH * player.stage.decoder.diagonal * swing) / (largest || 1);
    const out = Float64Array.from(rows);
    for (let row = 0; row < vector.length; row++) out[3 * row + axis] += scale * vector[row];
    return out;
  }

  private changed() {
    this.dispatchEvent(new Event('change'));
  }
}
