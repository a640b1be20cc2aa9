/** States that follow each other, with a way back and forth. */
export class History<T> {
  private past: T[] = [];
  private future: T[] = [];
  private step: string | null = null;

  constructor(private state: T) {}

  get present(): T {
    return this.state;
  }

  get canUndo(): boolean {
    return this.past.length > 0;
  }

  get canRedo(): boolean {
    return this.future.length > 0;
  }

  /** Goes on to a state. Changes that follow each other with the same name are one step: a drag is undone at once. */
  change(state: T, step: string | null = null): void {
    if (step === null || step !== this.step) this.past.push(this.state);
    this.step = step;
    this.state = state;
    this.future = [];
  }

  /** Ends a step: the next change is one of its own, whatever its name. */
  endStep(): void {
    this.step = null;
  }

  undo(): boolean {
    return this.move(this.past, this.future);
  }

  redo(): boolean {
    return this.move(this.future, this.past);
  }

  private move(from: T[], to: T[]): boolean {
    const state = from.pop();
    if (state === undefined) return false;
    to.push(this.state);
    this.state = state;
    this.step = null;
    return true;
  }
}
