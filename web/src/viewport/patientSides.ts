/** Which side of the patient lies towards each edge of the picture (LPS: x left, y posterior, z superior). */

import type { Camera } from "../generated/proto";
import { scale, type Triple } from "../scene/vec";
import { frameOf } from "./camera";

/** Cosine from which a direction has one letter; a direction between axes has two. */
const ONE_LETTER_COSINE = 0.7;

/** Letters of the positive and the negative direction of each axis. */
const letters = [["L", "R"], ["P", "A"], ["S", "I"]] as const;

/** One or two letters for a direction of unit length in the world; the nearer axis comes first. */
export function letterOf(direction: Triple): string {
  const [first, second] = direction
    .map((cosine, axis) => ({ cosine: Math.abs(cosine), letter: letters[axis]?.[cosine < 0 ? 1 : 0] ?? "" }))
    .sort((a, b) => b.cosine - a.cosine);
  if (!first || !second) return "";
  return first.cosine > ONE_LETTER_COSINE ? first.letter : first.letter + second.letter;
}

export type Edge = "top" | "right" | "bottom" | "left";

/** The letters at the edges of this view. */
export function edgeLetters(camera: Camera): Record<Edge, string> {
  const { right, up } = frameOf(camera);
  return { top: letterOf(up), right: letterOf(right), bottom: letterOf(scale(up, -1)), left: letterOf(scale(right, -1)) };
}
