import type { Capture } from '../capture';
import { openContainer } from '../container/open';
import { checkPrelude, PRELUDE_BYTES } from '../container/section';
import { blobSource } from '../container/source';
import { httpSource } from '../service/httpSource';
import { fileNameOf, sentence } from '../text';

export interface OpenerHost {
  readonly isShowing: boolean;
  show(capture: Capture): void;
  fail(error: unknown): void;
  report(problem: string): void;
  requestUpdate(): void;
}

/** Opens the captures of files and addresses; the one that was asked for last is shown. */
export class Opener {
  /** Name of the capture that is being opened; null otherwise. */
  name: string | null = null;
  failure: string | null = null;
  /** The file that is shown, unless the capture came from an address or a session. */
  private file: File | null = null;
  private opened: Capture | null = null;
  private load = new AbortController();

  constructor(private readonly host: OpenerHost) {}

  async openFile(file: File): Promise<void> {
    await this.openFrom(file.name, (signal) => openFile(file, signal), file);
  }

  async openAddress(src: string): Promise<void> {
    const name = fileNameOf(src);
    await this.openFrom(name, async (signal) => openContainer(await httpSource(src, { signal }), { name, signal }));
  }

  /** Opens the file anew that was shown before; whether there was one. */
  reopen(): boolean {
    if (this.file) void this.openFile(this.file);
    return this.file !== null;
  }

  stop() {
    this.load.abort();
    this.name = null;
  }

  /** Closes what was opened here and is no longer shown. */
  close() {
    this.opened?.close();
    this.opened = null;
  }

  forget() {
    this.file = this.name = this.failure = null;
  }

  /** Opens a capture; the present one stays if that fails. */
  private async openFrom(name: string, open: (signal: AbortSignal) => Promise<Capture>, file: File | null = null) {
    this.load.abort();
    this.load = new AbortController();
    const { signal } = this.load;
    this.name = name;
    this.failure = null;
    this.host.requestUpdate();
    try {
      const capture = await open(signal);
      if (signal.aborted) {
        capture.close();
        return;
      }
      this.host.show(capture);
      this.opened = capture;
      this.file = file;
    } catch (error) {
      if (signal.aborted) return;
      this.name = null;
      if (this.host.isShowing) this.host.report(sentence(error));
      else this.host.fail(error);
      this.host.requestUpdate();
    }
  }
}

export function openFile(file: File, signal?: AbortSignal): Promise<Capture> {
  return openContainer(blobSource(file), { name: file.name, ...(signal && { signal }) });
}

/** @throws Error with one sentence for a person where the first bytes of a file say that it is no container */
export async function checkContainer(file: File): Promise<void> {
  const source = blobSource(file);
  checkPrelude(await source.read(0, Math.min(PRELUDE_BYTES, source.size)));
}
