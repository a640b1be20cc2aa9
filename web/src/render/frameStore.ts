import type { Capture, FrameBlock, Residual } from '../capture';
import type { Offsets } from './decoder';
import type { FromResidualWorker, ToResidualWorker } from './residualWorker';
import { moduleWorker } from '../moduleWorker';
import residualWorkerAddress from './residualWorker.ts?worker&url';

/** What a frame is decoded from. */
export interface FrameData {
  /** `rowsPerFrame × 3`. */
  readonly rows: Float32Array;
  readonly offsets: Offsets;
}

/** Gives the rows of a frame to show in place of its own, both `rowsPerFrame × 3`. */
export type FrameEdit = (frame: number, rows: Float32Array) => Float32Array;

/** Bytes of blocks that are kept. */
const BLOCK_BYTES = 192 * 2 ** 20;
/** Bytes of offsets that are kept. */
const OFFSET_BYTES = 96 * 2 ** 20;

/**
 * Frames of a capture that are in memory or on their way. Blocks are asked for one after another; residual layers are added up in a worker.
 */
export class FrameStore {
  /** Called whenever a frame that was missing has come. */
  onArrival: () => void = () => undefined;
  /** Called with every block that comes. */
  onBlock: (block: FrameBlock) => void = () => undefined;
  /** Changes frames as they are taken out; null leaves them as they are. Edited ones have no offsets, which belong to cages as they were captured. */
  edit: FrameEdit | null = null;
  private readonly blocks = new Map<number, FrameBlock>();
  private readonly offsets = new Map<number, Float32Array>();
  private readonly asked = new Set<number>();
  private readonly loading = new Map<number, Promise<FrameBlock>>();
  private readonly atWorker = new Set<number>();
  private waiting: (() => void)[] = [];
  private readonly stop = new AbortController();
  private worker: Worker | null = null;

  constructor(private readonly capture: Capture) {}

  /** The frame, if all of it is here. */
  peek(frame: number): FrameData | null {
    const block = this.blockOf(frame);
    if (!block) return null;
    const width = 3 * this.capture.static.rowsPerFrame;
    const rows = block.cages.subarray((frame - block.first) * width, (frame - block.first + 1) * width);
    if (this.edit) return { rows: this.edit(frame, rows), offsets: null };
    if (!block.residual) return { rows, offsets: null };
    const offsets = this.offsets.get(frame);
    return offsets ? { rows, offsets } : null;
  }

  /** Sees to it that a frame comes; resolves when it has, to false where the block that should have it has not. */
  async load(frame: number): Promise<boolean> {
    let block = this.blockOf(frame);
    if (!block) {
      block = await this.request(frame);
      this.arrived();
    }
    if (block.residual && !this.offsets.has(frame)) this.requestOffsets(block, block.residual, frame);
    return frame >= block.first && frame < block.first + block.count;
  }

  /** The frame, once all of it is here. */
  async frame(frame: number): Promise<FrameData> {
    if (!(await this.load(frame))) throw new Error(`Frame ${frame} is not where the capture says; load it again.`);
    for (;;) {
      const data = this.peek(frame);
      if (data) return data;
      await new Promise<void>((resolve) => this.waiting.push(resolve));
    }
  }

  /** Loads the first of these frames that is missing, and the offsets of those that are there. */
  prefetch(frames: Iterable<number>) {
    for (const frame of frames) {
      const block = this.blockOf(frame);
      if (block) {
        if (block.residual && !this.offsets.has(frame)) this.requestOffsets(block, block.residual, frame);
      } else {
        // A failure shows when the frame is loaded to be looked at.
        if (this.loading.size === 0) this.load(frame).catch(() => undefined);
        return;
      }
    }
  }

  close() {
    this.stop.abort();
    this.worker?.terminate();
    this.blocks.clear();
    this.offsets.clear();
  }

  private blockOf(frame: number): FrameBlock | null {
    for (const [first, block] of this.blocks) {
      if (frame < first || frame >= first + block.count) continue;
      // Moved to the end, as the one used last.
      this.blocks.delete(first);
      this.blocks.set(first, block);
      return block;
    }
    return null;
  }

  private request(frame: number): Promise<FrameBlock> {
    const running = this.loading.get(frame);
    if (running) return running;
    const loading = this.capture
      .block(frame, this.stop.signal)
      .then((block) => {
        this.keep(block);
        return block;
      })
      .finally(() => this.loading.delete(frame));
    this.loading.set(frame, loading);
    return loading;
  }

  private keep(block: FrameBlock) {
    this.onBlock(block);
    this.blocks.set(block.first, block);
    let bytes = 0;
    for (const held of this.blocks.values()) bytes += bytesOf(held);
    for (const [first, held] of this.blocks) {
      if (bytes <= BLOCK_BYTES || held === block) break;
      bytes -= bytesOf(held);
      this.blocks.delete(first);
      if (this.atWorker.delete(first)) this.send({ kind: 'forget', block: first });
    }
  }

  private requestOffsets(block: FrameBlock, residual: Residual, frame: number) {
    if (this.asked.has(frame) || frame < block.first || frame >= block.first + block.count) return;
    this.asked.add(frame);
    if (!this.atWorker.has(block.first)) {
      this.atWorker.add(block.first);
      this.send({ kind: 'block', block: block.first, points: this.capture.static.rest.length / 3, residual });
    }
    this.send({ kind: 'frame', block: block.first, index: frame - block.first });
  }

  private receive({ block, index, offsets }: FromResidualWorker) {
    const frame = block + index;
    this.asked.delete(frame);
    this.offsets.set(frame, offsets);
    const most = Math.max(8, Math.floor(OFFSET_BYTES / offsets.byteLength));
    for (const oldest of this.offsets.keys()) {
      if (this.offsets.size <= most) break;
      this.offsets.delete(oldest);
    }
    this.arrived();
  }

  private arrived() {
    for (const resolve of this.waiting.splice(0)) resolve();
    this.onArrival();
  }

  private send(message: ToResidualWorker) {
    if (!this.worker) {
      this.worker = moduleWorker(residualWorkerAddress);
      this.worker.onmessage = ({ data }: MessageEvent<FromResidualWorker>) => this.receive(data);
    }
    this.worker.postMessage(message);
  }
}

function bytesOf({ cages, residual }: FrameBlock): number {
  return cages.byteLength + (residual ? residual.shapes.byteLength + residual.correctionVectors.byteLength : 0);
}
