/** The curve under another value range: every point keeps its data value. */

import type { TransferFunctionPoint } from "../generated/proto";
import { clamp, lerp, lerpTriple, rounded, type Triple } from "../scene/vec";
import { extinctionOf, opacityFromExtinction } from "./opacity";
import { positionOf, valueOf, type Range } from "./valueAxis";

type Points = readonly TransferFunctionPoint[];

/** Places closer than this to another are that place, in `s`: the ends of the window are met exactly. */
const PLACE = 1e-7;

const nearly = (s: number): number => Math.round(s / PLACE) / (1 / PLACE) + 0;
const roundTriple = ([x, y, z]: Triple): Triple => [rounded(x), rounded(y), rounded(z)];

/**
 * The points of a curve over the data values `from`, placed over the data values `to`. What
 * reaches beyond `to` is cut at its end, with the matter the curve has there.
 */
export function ontoRange(points: Points, from: Range, to: Range): TransferFunctionPoint[] {
  const moved = points.map((point) => ({ ...point, s: nearly(positionOf(valueOf(point.s, from), to)) }));
  const inside = moved.filter(({ s }) => s >= 0 && s <= 1);
  // The neighbours of each end across it; a point on the end itself needs no cut.
  const below = moved.filter(({ s }) => s < 0).at(-1);
  const above = moved.find(({ s }) => s > 1);
  const low = below && inside[0]?.s !== 0 ? [pointBetween(below, inside[0] ?? above ?? below, 0)] : [];
  const before = inside.at(-1) ?? below;
  const high = above && before?.s !== 1 ? [pointBetween(before ?? above, above, 1)] : [];
  return [...low, ...inside, ...high];
}

/** A point at `s` on the segment between two neighbours; a curve's outer point goes on. */
function pointBetween(a: TransferFunctionPoint, b: TransferFunctionPoint, s: number): TransferFunctionPoint {
  const t = b.s > a.s ? clamp((s - a.s) / (b.s - a.s), 0, 1) : 0;
  const extinction = lerp(extinctionOf(a), extinctionOf(b), t);
  const asOpacity = a.extinction === undefined && b.extinction === undefined;
  return {
    s,
    ...(asOpacity ? { opacity: rounded(opacityFromExtinction(extinction)) } : { extinction: rounded(extinction) }),
    albedo: roundTriple(lerpTriple(a.albedo, b.albedo, t)),
    emission: roundTriple(lerpTriple(a.emission, b.emission, t)),
    // A material holds from its point up to the next.
    ...(a.material === undefined ? {} : { material: a.material }),
  };
}
