import { holdName } from '../heldName';
import type { Player } from '../viewer/player';
import type { CageEdit } from './cageEdit';
import { hasKeptEdits, identityOf, keepEdits, keptEdits, type KeptEdits, type Keeping } from './keptEdits';

/** Milliseconds after the last change until edits are written. */
const REST = 300;

/** Writes the edits of a capture into the browser as they change, and finds those that were left there. */
export class EditKeeper {
  offer: KeptEdits | null = null;
  /** How the last change was kept; null before the first. */
  keeping: Keeping | null = null;
  private edits: readonly CageEdit[] = [];
  private key: string | null = null;
  private isChanged = false;
  private timer = 0;
  private isClosed = false;
  /** What is done last: looking for edits, then one writing after another. */
  private last: Promise<void>;
  private held: Promise<void> | null = null;
  /** Lets other tabs keep edits of the capture. */
  private readonly ending = new AbortController();
  private readonly flush = () => {
    if (document.hidden) void this.write();
  };

  /** @param onChange called when there is an offer, or when the browser keeps what it did not, or the other way round */
  constructor(
    private readonly player: Player,
    private readonly onChange: () => void,
  ) {
    this.last = this.find();
    // Also before a page is closed, and early enough for the database to write.
    document.addEventListener('visibilitychange', this.flush);
  }

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
    this.isClosed = true;
    document.removeEventListener('visibilitychange', this.flush);
    if (this.keeping === 'elsewhere') this.ending.abort();
    void this.write().finally(() => this.ending.abort());
  }

  private async find() {
    try {
      // Captures are not read for what is not there.
      if (!(await hasKeptEdits())) return;
      this.key = await identityOf(this.player.capture);
      if (this.key !== null && (await this.keptOf(this.key))) await this.hold(this.key);
    } catch {
      // What cannot be found now is looked for again before something is written.
    }
  }

  /** Holds the kept edits of the capture for this tab alone; what other tabs have kept until then is offered. */
  private hold(key: string): Promise<void> {
    return (this.held ??= holdName(`cager-edits ${key}`, this.ending.signal, this.wait).then(async () => {
      this.offer = await this.keptOf(key);
      if (this.offer) this.onChange();
      this.say('kept');
    }));
  }

  private readonly wait = () => {
    if (this.isClosed) this.ending.abort();
    else this.say('elsewhere');
  };

  private keptOf(key: string) {
    return keptEdits(key, this.player.capture.static.cage.positions.length / 3);
  }

  /** Writes after everything that is being written, so that the newest edits are those that stay. */
  private write(): Promise<void> {
    clearTimeout(this.timer);
    return (this.last = this.last.then(() => this.writeNow()));
  }

  private async writeNow() {
    if (!this.isChanged) return;
    let keeping: Keeping = 'refused';
    try {
      this.key ??= await identityOf(this.player.capture);
      if (this.key !== null) {
        await this.hold(this.key);
        this.isChanged = false;
        // What is offered stays until it is answered.
        keeping = await keepEdits(this.key, [...(this.offer?.edits ?? []), ...this.edits]);
      }
    } catch {
      // The source of the capture is gone, and there is nothing to know it by; or the page may hold no names.
    }
    this.say(keeping);
  }

  private say(keeping: Keeping) {
    const isNews = keeping !== (this.keeping ?? 'kept');
    this.keeping = keeping;
    if (isNews && !this.isClosed) this.onChange();
  }
}
