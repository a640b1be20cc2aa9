import { expect, test } from 'vitest';
import { EventParser } from './sse';

const STREAM = [
  'event: progress\nid: r1.0\ndata: {"solved":0}\n\n',
  ': still here\n\n',
  'event: progress\r\nid: r1.1\r\ndata: {"a":\r\ndata: 1}\r\n\r\n',
  'data\n\nevent: empty\n\n',
  'event: deleted\ndata: {}\n\n',
].join('');

test('events_are_the_same_wherever_the_stream_is_cut', () => {
  const whole = new EventParser().push(STREAM);
  expect(whole).toEqual([
    { type: 'progress', id: 'r1.0', data: '{"solved":0}' },
    { type: 'progress', id: 'r1.1', data: '{"a":\n1}' },
    { type: 'message', id: 'r1.1', data: '' },
    { type: 'deleted', id: 'r1.1', data: '{}' },
  ]);
  for (let cut = 0; cut <= STREAM.length; cut += 1) {
    const parser = new EventParser();
    expect([...parser.push(STREAM.slice(0, cut)), ...parser.push(STREAM.slice(cut))]).toEqual(whole);
  }
});

test('an_event_without_an_end_is_refused', () => {
  const parser = new EventParser();
  const line = 'data: '.padEnd(1 << 19, 'x');
  expect(() => {
    for (let k = 0; k < 4; k += 1) parser.push(line);
  }).toThrow('without an end');
});
