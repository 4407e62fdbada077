/** How long light that is on its way will take, by how it came so far. */

import type { FrameHeader } from "../generated/proto";

/** Newest pictures that the pace is taken from, by their time: milliseconds. */
const WINDOW_MILLIS = 15_000;
/** Before it nothing is said. */
const MIN_SPAN_MILLIS = 800;
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
    if (!first || !last || last.at - first.at < MIN_SPAN_MILLIS || last.share <= first.share) return null;
    return ((1 - last.share) * (last.at - first.at)) / (last.share - first.share);
  }
}
