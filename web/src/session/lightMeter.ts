/** How long light that is on its way will take, by how it came so far. */

import type { FrameHeader } from "../generated/proto";

/** Newest pictures that the pace is taken from, by their time: milliseconds. */
const WINDOW_MILLIS = 15_000;
/** Before it nothing is said. */
const MIN_SPAN_MILLIS = 800;
/** Of so many steps the largest does not count. */
const MIN_STEPS = 3;
/** Pictures that are remembered. */
const MAX_SAMPLES = 64;

type Lit = Pick<FrameHeader, "illumination_completeness">;

export class LightMeter {
  private samples: { at: number; share: number }[] = [];

  /** A picture came on screen at `now` (milliseconds). */
  shown({ illumination_completeness: share }: Lit, now: number): void {
    const last = this.samples.at(-1);
    // There is less of it than before: it is other light.
    if (share >= 1 || (last && share < last.share)) this.samples = [];
    if (share >= 1) return;
    this.samples = [...this.samples, { at: now, share }].filter(({ at }) => now - at <= WINDOW_MILLIS).slice(-MAX_SAMPLES);
  }

  /** The connection is gone. */
  forget(): void {
    this.samples = [];
  }

  /** Time until all of the light is there, milliseconds; null where it cannot be told. */
  read(): number | null {
    const [first, last] = [this.samples[0], this.samples.at(-1)];
    if (!first || !last || last.at - first.at < MIN_SPAN_MILLIS) return null;
    let before = first;
    const steps = this.samples.slice(1).map((sample) => {
      const step = { time: sample.at - before.at, share: sample.share - before.share };
      before = sample;
      return step;
    });
    // What was there at once, from a disk or from before, is no pace of what is being made.
    const leap = steps.length >= MIN_STEPS ? steps.reduce((a, b) => (b.share > a.share ? b : a)) : null;
    const counted = steps.filter((step) => step !== leap);
    const [time, share] = [counted.reduce((sum, step) => sum + step.time, 0), counted.reduce((sum, step) => sum + step.share, 0)];
    return share > 0 ? ((1 - last.share) * time) / share : null;
  }
}
