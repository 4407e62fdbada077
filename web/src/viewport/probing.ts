/** What the pointer points at, and distances between two such places. */

import { create } from "zustand";
import { postProbe } from "../api/rest";
import type { ProbeHit } from "../generated/proto";
import { add, length, scale, sub, type Triple } from "../scene/vec";
import { useSession } from "../session/store";
import { session } from "../session/engine";
import { sayError } from "../app/say";
import { currentCamera } from "./actions";
import { recentre } from "./camera";

interface Probing {
  /** The place under the resting pointer. */
  hit: ProbeHit | null;
  measuring: boolean;
  /** World; at most two. */
  ends: readonly Triple[];
}

export const useProbing = create<Probing>(() => ({ hit: null, measuring: false, ends: [] }));

/** Where the pointer is in the viewport, CSS pixels. */
export interface Pixel {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** Counts questions: an answer that a newer question has overtaken is dropped. */
let asked = 0;

async function hitAt({ x, y, width, height }: Pixel): Promise<ProbeHit | null> {
  const { sessionId } = useSession.getState();
  if (!sessionId) return null;
  const whole = { width: Math.max(1, Math.round(width)), height: Math.max(1, Math.round(height)) };
  const answer = await postProbe(sessionId, { camera: currentCamera(), x: Math.min(Math.max(x, 0), whole.width), y: Math.min(Math.max(y, 0), whole.height), ...whole });
  return answer.hit ?? null;
}

/** Shows the value under the pointer. A failure is no message: the next rest of the pointer asks again. */
export function hover(pixel: Pixel): void {
  const question = ++asked;
  hitAt(pixel).then(
    (hit) => question === asked && useProbing.setState({ hit }),
    () => question === asked && useProbing.setState({ hit: null }),
  );
}

export function leave(): void {
  asked++;
  if (useProbing.getState().hit) useProbing.setState({ hit: null });
}

/** Moves the pivot to the place under the pointer, or to the volume's centre where there is none, without turning the view. */
export async function pivotAt(pixel: Pixel): Promise<void> {
  try {
    const hit = await hitAt(pixel);
    session.moveCamera(recentre(currentCamera(), hit?.position ?? [0, 0, 0]));
  } catch (error) {
    sayError(error);
  }
}

/** The same with the middle of the picture, which is the middle of a square one, too. */
export const pivotAtMiddle = (): Promise<void> => pivotAt({ x: 500, y: 500, width: 1000, height: 1000 });

export const toggleMeasuring = (): void => useProbing.setState(({ measuring }) => ({ measuring: !measuring, ends: [] }));

/** Sets the next end of the distance; a third one begins anew. */
export async function measureAt(pixel: Pixel): Promise<void> {
  const hit = await hitAt(pixel).catch(sayError);
  if (hit) useProbing.setState(({ ends }) => ({ ends: withEnd(ends, hit.position) }));
}

export const withEnd = (ends: readonly Triple[], end: Triple): readonly Triple[] => (ends.length === 2 ? [end] : [...ends, end]);

/** Length of the way from one end to the other, in the dataset's unit. */
export const distance = (from: Triple, to: Triple, unitsPerWorld: number): number => length(sub(to, from)) * unitsPerWorld;

export const middle = (a: Triple, b: Triple): Triple => scale(add(a, b), 0.5);
