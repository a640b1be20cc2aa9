import type { Capture, UpAxis } from '../capture';
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
  /** Which axis of the second capture points up, where that was chosen. */
  besideUp: UpAxis | null;
  /** The second capture, where the page set one. */
  beside: Capture | null;
  requestUpdate(): void;
  applyColors(): void;
  goTo(view: string): void;
  openFiles(files: readonly Dropped[], beside?: boolean): Promise<void>;
  fail(error: unknown): void;
  /** Says that files are no capture yet, and how they become one. */
  offerUpload(files: readonly Dropped[]): void;
  report(problem: string): void;
  recover(problem: string): void;
}
