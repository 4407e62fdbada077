/** Several points at once, and the window two fingers hold. */

import { clamp } from "../scene/vec";
import { MIN_WINDOW, type Range } from "./valueAxis";

/** The selection with one more point, or without it. */
export const withToggled = (selection: readonly number[], index: number): number[] =>
  (selection.includes(index) ? selection.filter((other) => other !== index) : [...selection, index].sort((a, b) => a - b));

/**
 * The window in which two places (in `s`) lie at two shares of its width: what two fingers hold
 * stays under them. Never leaves 0..1.
 */
export function zoomAndPan(window: Range, held: Range, shares: Range): Range {
  const apart = shares[1] - shares[0];
  if (Math.abs(apart) < 1e-3 || (held[1] - held[0]) / apart <= 0) return window;
  const width = clamp((held[1] - held[0]) / apart, MIN_WINDOW, 1);
  const start = clamp(held[0] - shares[0] * width, 0, 1 - width);
  return [start, start + width];
}
