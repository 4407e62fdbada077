/** Settings of `precomputed_transfer`, as its panel offers them. */

import type { SceneFile } from "../generated/proto";

/** The server's bounds. */
export const GRID = { from: 4, to: 128 };
export const MAX_PHOTONS = 1 << 24;
export const MAX_EVENTS = 256;
export const MAX_BANDS = 6;

const words = (count: number): string => String(count);

/** Basis lights, with how wide one is, degrees. */
export const lightChoices: readonly { value: string; label: string }[] = [
  { count: 42, degrees: 32 },
  { count: 162, degrees: 16 },
  { count: 642, degrees: 8 },
].map(({ count, degrees }) => ({ value: words(count), label: `${count}, ${degrees}° wide` }));

export const directionChoices: readonly { value: string; label: string }[] = [48, 192, 768, 3072].map((count) => ({ value: words(count), label: words(count) }));

/** Whether light is baked for the scene: other modes show data, or single places. */
export const hasBake = ({ illumination, rendering }: Pick<SceneFile, "illumination" | "rendering">): boolean => illumination.method === "precomputed_transfer" && rendering.mode === "volume";
