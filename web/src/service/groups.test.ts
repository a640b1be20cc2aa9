import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { LocalCodec } from '../../tests/support/localCodec';
import { ContainerStream, type StoredChunk } from '../container/stream';
import { openContainer } from '../container/open';
import { HEADER_BYTES, parseFields, viewOf } from '../container/section';
import { bytesSource, type Source } from '../container/source';
import {
  allBlocks,
  goldenBytes,
  openBytes,
  type Part,
  putTogether,
  rawPart,
  takeApart,
} from '../../tests/support/containers';
import { GroupFollower } from './closedGroups';
import { endOf, GroupStore } from './groupStore';
import type { Session } from './messages';
import { connect } from './runningContainer';
import type { Service } from './service';

/** A coded container of three groups, which are the same one. */
const container = ofGroups(goldenBytes('coded-mvc'), 3);
const groups = [...new ContainerStream().push(container)];
const [count, frames] = [endOf(groups[0]), endOf(groups[2])];

beforeEach(() => vi.useFakeTimers());
afterEach(() => vi.useRealTimers());

test('groups_are_found_in_pieces_of_any_size_as_they_are_in_the_file', () => {
  expect(groups.map(endOf)).toEqual([count, 2 * count, 3 * count]);
  const stream = new ContainerStream();
  const found: StoredChunk[] = [];
  for (let at = 0; at < container.length; at += 7) found.push(...stream.push(container.subarray(at, at + 7)));
  expect(found).toEqual(groups);
  expect(stream.received).toBe(container.length);
  const bytes = groups.flatMap(({ frames: { header, payload }, residual }) => {
    return [header, payload, residual!.header, residual!.payload].map((part) => part.length);
  });
  expect(stream.bytesPerFrame).toBeCloseTo(bytes.reduce((sum, length) => sum + length) / frames, 9);
});

test('a_damaged_group_is_not_handed_out', () => {
  const damaged = container.slice();
  damaged[groups[1].frames.entry.offset + 60] ^= 1;
  const stream = new ContainerStream();
  expect(() => [...stream.push(damaged)]).toThrow(/damaged/);
});

test('a_completed_container_is_read_from_the_groups_that_are_here', async () => {
  const store = new GroupStore();
  groups.slice(0, 2).forEach((group) => store.put(group));
  const reads: [number, number][] = [];
  const whole = bytesSource(container);
  const counted: Source = {
    size: whole.size,
    read: (offset, length) => {
      reads.push([offset, offset + length]);
      return whole.read(offset, length);
    },
  };
  const source = store.source(counted, frames);
  for (const [offset, end] of [
    [groups[0].residual!.entry.offset, groups[1].residual!.entry.offset],
    [groups[0].frames.entry.offset + 3, groups[1].frames.entry.offset + 50],
  ]) {
    expect(await source.read(offset, end - offset)).toEqual(container.slice(offset, end));
  }
  expect(reads).toEqual([]);
  const capture = await openContainer(source, { codec: new LocalCodec() });
  const expected = await openBytes(container);
  expect(await allBlocks(capture)).toEqual(await allBlocks(expected));
  expect((await allBlocks(capture)).every(({ residual }) => residual !== null)).toBe(true);
  // Groups that were left out of the container are not taken for what lies there instead.
  const { offset } = groups[1].frames.entry;
  await store.source(counted, count).read(offset, 9);
  expect(reads.at(-1)).toEqual([offset, offset + 9]);
  capture.close();
  expected.close();
});

test('the_earliest_groups_are_given_up_for_later_ones', () => {
  const store = new GroupStore(500);
  groups.forEach((group) => store.put(group));
  expect(store.of(0)).toBeNull();
  expect(store.of(frames - 1)).toBe(groups[2]);
  expect(store.of(frames)).toBeNull();
});

test('what_broke_off_is_asked_for_again_when_groups_have_closed', async () => {
  const service = new SlowService();
  const { follower, came } = service.follow();
  await service.send(groups[1].residual!.entry.offset);
  expect(came).toEqual([count]);
  service.breakOff();
  await vi.advanceTimersByTimeAsync(1000);
  follower.looked(sessionOf(count));
  expect(service.requests).toBe(1);
  follower.looked(sessionOf(frames));
  await service.send(container.length);
  expect(service.requests).toBe(2);
  // What came before is not handed out again.
  expect(came).toEqual([count, 2 * count, frames]);
});

test('a_connection_that_brings_nothing_is_given_up', async () => {
  const service = new SlowService();
  const { follower, came } = service.follow();
  await service.send(100);
  for (let second = 0; second < 30; second += 3) {
    await vi.advanceTimersByTimeAsync(3000);
    follower.looked(sessionOf(frames));
  }
  await service.send(container.length);
  expect(service.requests).toBe(2);
  expect(came.at(-1)).toBe(frames);
});

test('a_long_container_is_not_received_again_and_again_where_connections_keep_breaking', async () => {
  const step = 10_000;
  const long = ofGroups(goldenBytes('coded-mvc'), 100, step / 2);
  const ends = [...new ContainerStream().push(long)].map(({ frames: { entry, payload } }) => {
    return entry.offset + HEADER_BYTES + payload.length;
  });
  const service = new SlowService(long);
  const { follower, came } = service.follow(4 * step);
  let received = 0;
  // As behind a proxy that ends every connection, while as much again is coded.
  for (const [k, end] of ends.entries()) {
    follower.looked(sessionOf((k + 1) * count, end));
    await vi.advanceTimersByTimeAsync(10);
    if (service.isOpen) {
      await service.send(end);
      received += end;
    }
    service.breakOff();
    await vi.advanceTimersByTimeAsync(20_000);
  }
  expect(service.requests).toBeGreaterThan(8);
  expect(came.length).toBeGreaterThan(60);
  expect(received).toBeLessThan(3.5 * long.length);
});

/** A running session's service, whose container is sent as far as a test says. */
class SlowService {
  requests = 0;
  private sent = 0;
  private stream: ReadableStreamDefaultController<Uint8Array> | null = null;

  constructor(private readonly bytes: Uint8Array = container) {}

  get isOpen(): boolean {
    return this.stream !== null;
  }

  follow(freeBytes?: number): { follower: GroupFollower; came: number[] } {
    const came: number[] = [];
    const service = this as unknown as Service;
    const take = (group: StoredChunk) => void came.push(endOf(group));
    const follower = new GroupFollower(service, 'id', take, connect(service, 'id'), freeBytes);
    return { follower, came };
  }

  request(_path: string, { signal }: RequestInit): Promise<Response> {
    this.requests += 1;
    this.sent = 0;
    const body = new ReadableStream<Uint8Array>({ start: (stream) => void (this.stream = stream) });
    signal?.addEventListener('abort', () => this.breakOff());
    return Promise.resolve(new Response(body));
  }

  /** Sends the container up to its byte `end`. */
  async send(end: number) {
    await vi.advanceTimersByTimeAsync(10);
    for (; this.sent < end; this.sent += 1 << 20) {
      this.stream?.enqueue(this.bytes.subarray(this.sent, Math.min(end, this.sent + (1 << 20))));
    }
    this.sent = end;
    await vi.advanceTimersByTimeAsync(10);
  }

  breakOff() {
    this.stream?.error(new TypeError('network error'));
    this.stream = null;
  }
}

function sessionOf(frames: number, bytes = 1000): Session {
  return { coding: { group_frames: count, frames, bytes } } as unknown as Session;
}

/** The container with so many copies of its one group, each with so many bytes more than it needs. */
function ofGroups(bytes: Uint8Array, copies: number, more = 0): Uint8Array<ArrayBuffer> {
  const parts = takeApart(bytes).map((part) => ({ ...part, fields: parseFields(part.header, 0) }));
  const isOfGroup = ({ fields }: (typeof parts)[0]) => ['resi', 'FRAM'].includes(fields.tag);
  const { count } = parts.find(isOfGroup)!.fields;
  const group = (copy: number): Part[] =>
    parts.filter(isOfGroup).map(({ header, payload }) => {
      const shifted = header.slice();
      viewOf(shifted).setUint32(8, copy * count, true);
      return { header: shifted, payload: new Uint8Array([...payload, ...new Uint8Array(more)]) };
    });
  return putTogether([
    ...parts.slice(0, parts.findIndex(isOfGroup)),
    ...Array.from({ length: copies }, (_, copy) => group(copy)).flat(),
    rawPart('ERRS', new Uint8Array(8 * count * copies), 4),
  ]);
}
