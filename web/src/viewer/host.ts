import type { Capture } from '../capture';
import type { Dropped } from '../files/classify';
import type { Player } from './player';

/** What parts of a viewer do with it. */
export interface ViewerHost extends HTMLElement {
  readonly player: Player | null;
  readonly renderRoot: HTMLElement | DocumentFragment;
  readonly updateComplete: Promise<boolean>;
  readonly isShowing: boolean;
  readonly isOpening: boolean;
  /** The present view, as links have it. */
  readonly viewText: string;
  /** The second capture, where the page set one. */
  beside: Capture | null;
  requestUpdate(): void;
  applyColors(): void;
  goTo(view: string): void;
  openFiles(files: readonly Dropped[], beside?: boolean): Promise<void>;
  fail(error: unknown): void;
  report(problem: string): void;
  recover(problem: string): void;
}
