import type { ModelPart } from '../capture';

/** Which parts of a capture are shown: those that somebody has not hidden, in the frames in which the capture has them. */
export class PartChoice {
  private readonly hidden = new Set<number>();
  /** What was given out last. */
  private shown: readonly boolean[] | null = null;

  /** @param changed called when somebody has hidden or shown parts */
  constructor(
    readonly parts: readonly ModelPart[],
    private readonly changed: () => void,
  ) {}

  isOn(part: number): boolean {
    return !this.hidden.has(part);
  }

  get allOn(): boolean {
    return this.hidden.size === 0;
  }

  /** Hides a part, or shows it again. */
  toggle(part: number) {
    if (!this.hidden.delete(part)) this.hidden.add(part);
    this.changed();
  }

  /** Shows one part alone; all again where the others are hidden already. */
  showOnly(part: number) {
    const wasAlone = this.parts.every((_, other) => other === part || !this.isOn(other));
    this.hidden.clear();
    if (!wasAlone) this.parts.forEach((_, other) => other !== part && this.hidden.add(other));
    this.changed();
  }

  showAll() {
    this.hidden.clear();
    this.changed();
  }

  /** Whether the capture has a part in a frame. */
  isThere(part: number, frame: number): boolean {
    const { shown } = this.parts[part];
    return shown === null || shown.some(([start, end]) => start <= frame && frame < end);
  }

  /** The parts that are shown in a frame, where these are others than they were when this was asked last. */
  news(frame: number): readonly boolean[] | null {
    const next = this.parts.map((_, part) => this.isOn(part) && this.isThere(part, frame));
    if (this.shown && next.every((isShown, part) => isShown === this.shown![part])) return null;
    return (this.shown = next);
  }
}
