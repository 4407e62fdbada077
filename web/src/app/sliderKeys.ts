/** What a key does to a number by its slider. */

import { clamp } from "../scene/vec";

/**
 * The value after a key took the slider from one position to another, where `led` is the value there.
 * It goes at least one unit, so that rounding does not take the step back; a slider that stays at its
 * end leaves a value beyond that end alone.
 */
export function valueAfterKey(value: number, led: number, [from, to]: readonly [number, number], { unit, min, max }: { unit: number; min: number; max: number }): number {
  if (to === from) return value;
  return clamp(to > from ? Math.max(led, value + unit) : Math.min(led, value - unit), min, max);
}
