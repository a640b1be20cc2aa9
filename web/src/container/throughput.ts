/** Seconds of transfer before the rate is known, and after which what came before counts half. */
const [MIN_SECONDS, MEMORY_SECONDS] = [0.5, 4];

/** Bytes per second of a connection of late; time in which nothing was to be transferred does not count. */
export class Throughput {
  private bytes = 0;
  private seconds = 0;

  /** Null before it is known, as of what is there at once. */
  get bytesPerSecond(): number | null {
    return this.seconds < MIN_SECONDS ? null : this.bytes / this.seconds;
  }

  /** So many bytes took so many seconds. */
  add(bytes: number, seconds: number): void {
    this.seconds += seconds;
    this.bytes += bytes;
    if (this.seconds < MEMORY_SECONDS) {
      return;
    }
    this.seconds /= 2;
    this.bytes /= 2;
  }
}
