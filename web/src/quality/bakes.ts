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

/** Clusters that a finished bake is compressed into. */
export const clusterChoices: readonly { value: string; label: string }[] = [{ value: "0", label: "None" }, ...[32, 64, 128, 256].map((count) => ({ value: words(count), label: `${count} clusters` }))];

/** The choices, and what a scene file says beside them. */
export const clusterChoicesWith = (count: number): { value: string; label: string }[] => {
  const own = { value: words(count), label: `${count} clusters` };
  return clusterChoices.some(({ value }) => value === own.value) ? [...clusterChoices] : [...clusterChoices, own];
};

/** What edits cost where light is baked, in words. */
export const bakeCostInWords = (clusters: number): string =>
  `${clusters > 0
    ? "Edits of matter and of these settings bake all anew, another compression too"
    : "Edits of matter bake anew what they touch, edits of these settings all; compression takes the bake as it is"}. A bake that is kept on disk is not made again. Lights turn and change freely.`;

/** What compression left out of the bake, in words. */
export const compressionInWords = (error: number): string => `Compression leaves out ${Number((100 * error).toPrecision(2))} % of the bake (root mean square); pictures differ less.`;

/** Whether light is baked for the scene: other modes show data, or single places. */
export const hasBake = ({ illumination, rendering }: Pick<SceneFile, "illumination" | "rendering">): boolean => illumination.method === "precomputed_transfer" && rendering.mode === "volume";
