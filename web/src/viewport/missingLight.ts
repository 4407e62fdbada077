/** What is said of light that is on its way. */

import { hasBake } from "../quality/bakes";
import { isInOwnLight, type SessionState } from "../session/store";
import { lightInWords, lightPercent, showsOldLight } from "../statistics/figures";

export interface MissingLight {
  /** What is going on, in words that stay the same while it does. */
  what: string;
  /** Share of the light that is there, whole percent; null where the light is whole and only its form is not. */
  percent: number | null;
  /** The share in words, with the time that the rest takes where that is known. */
  amount: string | null;
  /** The light on screen is that of before an edit. */
  old: boolean;
  hint: string;
}

const COMES = "The picture is in what there is of its light; it changes until all of it is there";
const BAKES = "What edits of matter touch is baked anew; lights can be turned and changed without that";

type Seen = Pick<SessionState, "frame" | "scene" | "methodSince" | "bakeIsMade" | "lightMillis" | "awaitingPicture" | "link">;

/** What the picture on screen lacks of its light; null where nothing, or where it is not yet the scene's. */
export function missingLight(state: Seen): MissingLight | null {
  const { frame, scene, bakeIsMade, lightMillis, awaitingPicture, link } = state;
  const percent = lightPercent(frame);
  if (percent === null || scene === null || awaitingPicture || link !== "open" || !isInOwnLight(state)) return null;
  const old = showsOldLight(frame);
  const amount = lightInWords(frame, lightMillis);
  if (!hasBake(scene)) return { what: "Light", percent, amount, old, hint: COMES };
  if (old) return { what: "Light of before the edit; baking anew", percent, amount, old, hint: BAKES };
  if (!bakeIsMade) return { what: "Baking light", percent, amount, old, hint: BAKES };
  const compresses = scene.illumination.transfer_clusters > 0;
  return { what: compresses ? "Compressing the bake" : "Storing the bake", percent: null, amount: null, old, hint: BAKES };
}
