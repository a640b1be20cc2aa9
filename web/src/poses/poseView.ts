import { ServiceProblem, sentenceOf } from '../service/problem';
import { bodyOf } from '../service/answers';
import { Service } from '../service/service';
import type { Player } from '../viewer/player';
import { polygonWeights, reachable } from './weights';

interface Space {
  readonly id: string;
  readonly poses: readonly number[];
}

/**
 * Deforms a player's model to shapes between some of its frames, which the service finds.
 *
 * @fires change when something else is shown
 */
export class PoseView extends EventTarget {
  poses: readonly number[] = [];
  /** Where between them: of two, from 0 to 1; of more, a place in their polygon. */
  place: readonly [number, number] = [0.5, 0];
  failure: string | null = null;
  private space: Space | null = null;
  private isAsking = false;
  private isOld = false;
  private readonly service = new Service();
  private readonly stop = new AbortController();

  constructor(readonly player: Player) {
    super();
  }

  get weights(): number[] {
    const { poses, place } = this;
    return poses.length === 2 ? [1 - place[0], place[0]] : polygonWeights(place, poses.length);
  }

  /** Takes frames as poses, and goes to the middle of them. */
  choose(poses: readonly number[]) {
    this.poses = poses;
    this.moveTo(poses.length === 2 ? [0.5, 0] : [0, 0]);
  }

  moveTo(place: readonly [number, number]) {
    this.place = this.poses.length > 2 ? reachable(place) : place;
    this.failure = null;
    this.isOld = true;
    if (this.poses.length < 2) this.player.deform(null);
    else void this.ask();
    this.changed();
  }

  /** Shows the frames as they are. */
  hide() {
    this.player.deform(null);
  }

  dispose() {
    this.stop.abort();
    this.hide();
    void this.forget();
  }

  /** Asks for the shape at the place; of places that change meanwhile, for the last one. */
  private async ask() {
    if (this.isAsking) return;
    this.isAsking = true;
    try {
      while (this.isOld && this.poses.length > 1 && !this.stop.signal.aborted) {
        this.isOld = false;
        this.show(await this.shape());
      }
    } catch (error) {
      if (!this.stop.signal.aborted) this.failure = sentenceOf(error);
    }
    this.isAsking = false;
    this.changed();
  }

  private show(rows: Float64Array) {
    if (this.stop.signal.aborted || this.poses.length < 2) return;
    this.player.deform(rows);
  }

  /** The cage at the place. A space that the service has forgotten is made anew. */
  private async shape(): Promise<Float64Array> {
    const { signal } = this.stop;
    for (let isSecond = false; ; isSecond = true) {
      const { id } = await this.made();
      try {
        const path = `shapespaces/${encodeURIComponent(id)}/pose?of=cage&weights=${this.weights.join(',')}`;
        return Float64Array.from(new Float32Array(await bodyOf(await this.service.request(path, { signal }), signal)));
      } catch (error) {
        if (isSecond || !(error instanceof ServiceProblem) || !error.isGone) throw error;
        this.space = null;
      }
    }
  }

  private async made(): Promise<Space> {
    const { poses, service } = this;
    const { signal } = this.stop;
    if (this.space?.poses === poses) return this.space;
    const { capture } = this.player;
    if (3 * capture.static.rowsPerFrame !== capture.static.cage.positions.length)
      throw new Error('Poses cannot be blended in a capture whose cages store normals.');
    await this.forget();
    const body = new FormData();
    const { session } = capture;
    body.append(
      'options',
      JSON.stringify({ frames: poses, ...(session !== undefined && { source_session: session }) }),
    );
    if (session === undefined) {
      const source = await capture.container!(signal);
      const bytes = await source.read(0, source.size, signal);
      body.append('source', new Blob([bytes as Uint8Array<ArrayBuffer>]), 'capture.cager');
    }
    const { id } = await service.json<{ id: string }>('shapespaces', { method: 'POST', body, signal });
    this.space = { id, poses };
    return this.space;
  }

  private async forget() {
    const { space } = this;
    this.space = null;
    // One that is left is forgotten by the service itself.
    if (space)
      await this.service
        .request(`shapespaces/${encodeURIComponent(space.id)}`, { method: 'DELETE' })
        .catch(() => undefined);
  }

  private changed() {
    this.dispatchEvent(new Event('change'));
  }
}
