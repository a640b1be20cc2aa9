import type { Player } from '../viewer/player';
import type { CageEdit } from './cageEdit';
import { identityOf, keepEdits, keptEdits, type KeptEdits, type Keeping } from './keptEdits';

/** Milliseconds after the last change until edits are written. */
const REST = 300;

/** Writes the edits of a capture into the browser as they change, and finds those that were left there. */
export class EditKeeper {
  /** Edits from before, until somebody takes them up or throws them away. */
  offer: KeptEdits | null = null;
  /** How the last change was kept; null before the first. */
  keeping: Keeping | null = null;
  private edits: readonly CageEdit[] = [];
  private key: string | null = null;
  private isChanged = false;
  private timer = 0;
  private readonly found: Promise<void>;
  private readonly flush = () => {
    if (document.hidden) void this.write();
  };

  /** @param onChange called when there is an offer, or when the browser keeps what it did not, or the other way round */
  constructor(
    private readonly player: Player,
    private readonly onChange: () => void,
  ) {
    this.found = this.find();
    // Also before a page is closed, and early enough for the database to write.
    document.addEventListener('visibilitychange', this.flush);
  }

  /** The edits as they are now. */
  note(edits: readonly CageEdit[]) {
    if (edits === this.edits) return;
    this.edits = edits;
    this.isChanged = true;
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => void this.write(), REST);
  }

  /** The edits that are offered, which from now on are among those that are noted. */
  take(): readonly CageEdit[] {
    const edits = this.offer?.edits ?? [];
    this.offer = null;
    return edits;
  }

  throwAway() {
    this.take();
    this.isChanged = true;
    void this.write();
    this.onChange();
  }

  /** Writes what is still to be written, and ends. */
  close() {
    document.removeEventListener('visibilitychange', this.flush);
    void this.write();
  }

  private async find() {
    this.offer = await keptEdits(this.player.capture);
    if (this.offer) this.onChange();
  }

  private async write() {
    clearTimeout(this.timer);
    await this.found;
    if (!this.isChanged) return;
    this.isChanged = false;
    // What is offered stays until it is answered.
    const edits = [...(this.offer?.edits ?? []), ...this.edits];
    let keeping: Keeping = 'refused';
    try {
      this.key ??= await identityOf(this.player.capture);
      if (this.key !== null) keeping = await keepEdits(this.key, edits);
    } catch {
      // The source of the capture is gone: there is nothing to know it by.
    }
    const isNews = keeping !== (this.keeping ?? 'kept');
    this.keeping = keeping;
    if (isNews) this.onChange();
  }
}
