/** A real `cager serve` with a data folder of the test. */

import { type ChildProcess, execFileSync, spawn } from 'node:child_process';
import { once } from 'node:events';
import { mkdtemp, rm, writeFile } from 'node:fs/promises';
import { createHash } from 'node:crypto';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { cager } from './programs';

const START_MS = 20_000;
const TOKENS = 'tokens.toml';

/** Services that run; a test run that fails before it closes them leaves none behind. */
const running = new Set<ChildProcess>();
process.once('exit', () => running.forEach((service) => service.kill('SIGKILL')));

/** A service that can be killed and started again. */
export class TestService {
  /** Address without a path, such as `http://127.0.0.1:43210`. */
  origin = '';
  #process: ChildProcess | null = null;
  #port = 0;

  private constructor(
    private readonly folder: string,
    private readonly args: readonly string[],
  ) {}

  /**
   * @param tokens tokens by tenant; without them the service takes everybody on this machine
   * @param settings as `key=value`
   */
  static async start(
    tokens: Readonly<Record<string, string>> = {},
    settings: readonly string[] = [],
  ): Promise<TestService> {
    const folder = await mkdtemp(join(tmpdir(), 'cager-web-'));
    const file = join(folder, TOKENS);
    await writeTokens(file, tokens);
    const access = Object.keys(tokens).length > 0 ? ['--tokens', file] : [];
    const service = new TestService(folder, [...access, ...settings.flatMap((setting) => ['--set', setting])]);
    await service.run();
    return service;
  }

  /** Starts it again, at the same port; nothing where it runs, as it does unless a test failed after it had killed it. */
  async run(): Promise<void> {
    if (this.#process && running.has(this.#process)) return;
    const args = ['serve', '--listen', `127.0.0.1:${this.#port}`, '--data', join(this.folder, 'data'), ...this.args];
    const started = spawn(cager!, args, { stdio: ['ignore', 'pipe', 'pipe'] });
    this.#process = started;
    running.add(started);
    started.once('exit', () => running.delete(started));
    this.origin = await new Promise<string>((resolve, reject) => {
      let said = '';
      const timer = setTimeout(() => reject(new Error(`cager serve did not start:\n${said}`)), START_MS);
      const listen = (text: Buffer): void => {
        said += text.toString();
        const address = /listening on (127\.0\.0\.1:(\d+))/.exec(said);
        if (!address) return;
        clearTimeout(timer);
        this.#port = Number(address[2]);
        resolve(`http://${address[1]}`);
      };
      started.stdout.on('data', listen);
      started.stderr.on('data', listen);
      started.once('exit', () => reject(new Error(`cager serve ended:\n${said}`)));
    });
  }

  /** Ends it as a crash would. */
  async kill(): Promise<void> {
    const killed = this.#process;
    if (killed?.exitCode !== null || killed.signalCode !== null) return;
    const ended = once(killed, 'exit');
    killed.kill('SIGKILL');
    await ended;
  }

  /** Replaces all tokens; the service notices within a second. */
  async setTokens(tokens: Readonly<Record<string, string>>): Promise<void> {
    await writeTokens(join(this.folder, TOKENS), tokens);
  }

  /** Restarts it with damaged frames of this session, which has some: the session is failed then. */
  async restartWithDamage(id: string): Promise<void> {
    await this.kill();
    const damage =
      'import sqlite3, sys; c = sqlite3.connect(sys.argv[1]); ' +
      'c.execute("UPDATE frames SET spread = 7 WHERE record = (SELECT number FROM records WHERE id = ?)", [sys.argv[2]]); c.commit()';
    execFileSync('python3', ['-c', damage, join(this.folder, 'data', 'catalog.db'), id]);
    await this.run();
  }

  /** Removes the container of this session, which is completed: the service notices when it is asked for, and the session is ready with a problem then. */
  async loseContainer(id: string): Promise<void> {
    await rm(join(this.folder, 'data', 'sessions', id, 'capture.cager'));
  }

  /** Ends it and removes its data. */
  async close(): Promise<void> {
    await this.kill();
    await rm(this.folder, { recursive: true, force: true });
  }
}

/** Writes the file of tokens by tenant, which has their hashes. */
async function writeTokens(file: string, tokens: Readonly<Record<string, string>>): Promise<void> {
  const entries = Object.entries(tokens).map(([tenant, token]) => {
    const digest = createHash('sha256').update(token).digest('hex');
    return `[[token]]\nname = "${tenant}"\ntenant = "${tenant}"\nsha256 = "${digest}"\n`;
  });
  await writeFile(file, entries.join('\n'));
}
