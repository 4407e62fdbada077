/** What the page itself measures: input to picture, pictures and bits per second. */

/** Window of the rates, milliseconds. */
const RATE_WINDOW_MILLIS = 2000;
/** Latencies the shown median is taken over. */
const LATENCY_SAMPLES = 15;
/** Inputs without a picture that are remembered; older ones are forgotten. */
const MAX_PENDING_INPUTS = 512;

export interface Readings {
  /** Median time from sending an input to showing it, milliseconds; null before the first. */
  latencyMillis: number | null;
  framesPerSecond: number;
  megabitsPerSecond: number;
}

export class Meters {
  private pending: { seq: number; at: number }[] = [];
  private latencies: number[] = [];
  private arrivals: { at: number; bytes: number }[] = [];

  /** Input `seq` was sent at `now` (milliseconds). */
  inputSent(seq: number, now: number): void {
    this.pending.push({ seq, at: now });
    if (this.pending.length > MAX_PENDING_INPUTS) this.pending.shift();
  }

  /** A picture with all inputs up to `seq` is on screen. The newest one it shows is measured. */
  frameShown(seq: number, now: number): void {
    const newest = this.pending.findLast((input) => input.seq <= seq);
    if (!newest) return;
    this.pending = this.pending.filter((input) => input.seq > seq);
    this.latencies = [...this.latencies, now - newest.at].slice(-LATENCY_SAMPLES);
  }

  /** A message of `bytes` arrived, shown or not. */
  frameArrived(bytes: number, now: number): void {
    this.arrivals.push({ at: now, bytes });
  }

  /** Forgets inputs that will never be answered: the connection is gone. */
  disconnected(): void {
    this.pending = [];
    this.arrivals = [];
  }

  read(now: number): Readings {
    this.arrivals = this.arrivals.filter((arrival) => now - arrival.at <= RATE_WINDOW_MILLIS);
    const seconds = RATE_WINDOW_MILLIS / 1000;
    const bytes = this.arrivals.reduce((sum, arrival) => sum + arrival.bytes, 0);
    return {
      latencyMillis: median(this.latencies),
      framesPerSecond: this.arrivals.length / seconds,
      megabitsPerSecond: (bytes * 8) / 1e6 / seconds,
    };
  }
}

function median(values: number[]): number | null {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.floor(sorted.length / 2)] ?? null;
}
