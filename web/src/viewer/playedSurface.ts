import type { Capture } from '../capture';
import { hasMaterials } from '../render/hasMaterials';
import type { Stage } from '../render/stage';
import { sentence } from '../text';
import { PartChoice } from './partChoice';

interface SurfaceListener {
  /** What is drawn has changed. */
  readonly refresh: () => void;
  readonly problem: (problem: string) => void;
}

/** Parts and materials of the capture that is played. */
export class PlayedSurface {
  /** Which parts are shown, of a capture that has several. */
  parts: PartChoice | null = null;
  hasMaterials = false;

  constructor(
    private readonly capture: Capture,
    private readonly stage: Stage,
    private readonly listener: SurfaceListener,
  ) {}

  /** Adds them to a model that can be seen already, and then the pictures. */
  async load(signal: AbortSignal) {
    const { capture, stage, listener } = this;
    try {
      const surface = (await capture.surface?.(signal)) ?? null;
      if (!surface || signal.aborted) return;
      await stage.setSurface(surface);
      this.hasMaterials = hasMaterials(surface);
      if (surface.parts.length > 1) this.parts = new PartChoice(surface.parts, listener.refresh);
      listener.refresh();
      if (!this.hasMaterials) return;
      const refused = await stage.setPictures((await capture.pictures?.(signal)) ?? new Map());
      listener.refresh();
      if (refused.length > 0) listener.problem(unshown(refused));
    } catch (error) {
      if (!signal.aborted) listener.problem(sentence(error));
    }
  }

  /** Has the parts drawn that are shown at a place; whether these are others than before. */
  showPartsOf(position: number): boolean {
    const shown = this.parts?.news(Math.floor(position)) ?? null;
    if (shown) this.stage.showParts(shown);
    return shown !== null;
  }
}

/** What is said of pictures that no browser shows. */
export function unshown(paths: readonly string[]): string {
  const names = paths.map((path) => path.slice(path.lastIndexOf('/') + 1));
  const kinds = [...new Set(names.map((name) => name.slice(name.lastIndexOf('.') + 1).toUpperCase()))].join(', ');
  const what = paths.length === 1 ? `The texture ${names[0]} is` : `${paths.length} textures (${kinds}) are`;
  return `${what} not shown: browsers read PNG, JPEG and WebP.`;
}
