import { expect, test, vi } from 'vitest';
import { LatencyMeter } from './measures';

test('the delay of a frame that is never sent is not waited for', () => {
  vi.useFakeTimers();
  try {
    const meter = new LatencyMeter();
    meter.reset(20);
    const asked = performance.now();
    meter.looked(asked, asked + 10, 19);
    vi.advanceTimersByTime(12_000);
    meter.arrived(20);
    expect(meter.seconds).toBeLessThan(0.02);
  } finally {
    vi.useRealTimers();
  }
});

test('the delay is measured from the look that found a frame solved, and not across a broken connection', () => {
  vi.useFakeTimers();
  try {
    const meter = new LatencyMeter();
    meter.reset(20);
    const asked = performance.now();
    meter.looked(asked, asked, 20);
    vi.advanceTimersByTime(300);
    meter.arrived(20);
    expect(meter.seconds).toBeCloseTo(0.3, 5);
    meter.looked(performance.now(), performance.now(), 21);
    vi.advanceTimersByTime(60_000);
    meter.reset(30);
    meter.arrived(30);
    expect(meter.seconds).toBeNull();
  } finally {
    vi.useRealTimers();
  }
});
